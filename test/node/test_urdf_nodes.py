"""A robot described by a URDF, through the real nodes."""

import numpy as np
import pytest

from tp_sim.harness import ClosedLoop, GoalRejected, HarnessError

# A shoulder that turns without end, an arm that rises and a boom that slides out.
ARM = """
<robot name="crane">
  <link name="floor"/><link name="tower"/><link name="arm"/><link name="boom"/><link name="hook"/>
  <joint name="turn" type="continuous"><parent link="floor"/><child link="tower"/>
    <origin xyz="0 0 0.5"/><axis xyz="0 0 1"/><limit effort="1" velocity="1.0"/></joint>
  <joint name="rise" type="revolute"><parent link="tower"/><child link="arm"/>
    <axis xyz="0 -1 0"/><limit lower="-0.5" upper="1.4" effort="1" velocity="1.0"/></joint>
  <joint name="slide" type="prismatic"><parent link="arm"/><child link="boom"/>
    <axis xyz="1 0 0"/><limit lower="0.2" upper="1.5" effort="1" velocity="0.5"/></joint>
  <joint name="end" type="fixed"><parent link="boom"/><child link="hook"/>
    <origin xyz="0.3 0 0"/></joint>
</robot>
"""


@pytest.fixture
def crane(tmp_path):
    (tmp_path / 'crane.urdf').write_text(ARM)
    return {
        '/**': {'robot': {'urdf': str(tmp_path / 'crane.urdf')}},
        'tp_sim': {'rate': 60.0, 'initial_positions': [3.0, 0.2, 0.4]},
        'tp_controller': {
            'hierarchy': ['hook_position'],
            'solver': {'damping': 0.01},
            'tasks': {
                'hook_position': {'type': 'position', 'frame': 'hook', 'gain': [2.0]},
                'tower_angle': {'type': 'joint', 'joints': ['turn']},
            },
        },
    }


def test_a_goal_in_space_is_reached_within_the_limits_of_the_description(crane):
    with ClosedLoop(crane) as loop:
        loop.send_goal('hook_position', [0.5, -0.8, 0.9])
        loop.run(10.0)
        record = loop.record
    assert record.current['hook_position'][-1] == pytest.approx([0.5, -0.8, 0.9], abs=1e-4)
    assert np.all(np.abs(record.qd) <= [1.0, 1.0, 0.5])
    assert record.current['hook_position'][0] == pytest.approx(
        [0.7 * np.cos(0.2) * np.cos(3.0), 0.7 * np.cos(0.2) * np.sin(3.0), 0.5 + 0.7 * np.sin(0.2)]
    )


def test_a_continuous_joint_goes_the_short_way_round(crane):
    crane['tp_controller']['hierarchy'] = ['tower_angle']
    with ClosedLoop(crane) as loop:
        loop.send_goal('tower_angle', [-3.0])
        loop.run(8.0)
        turn = loop.record.q[:, 0]
    assert turn[-1] == pytest.approx(2.0 * np.pi - 3.0, abs=1e-3)
    assert np.all(np.diff(turn) >= 0.0)


def test_the_frames_of_a_refused_goal_are_listed_once_each(crane):
    with ClosedLoop(crane) as loop, pytest.raises(GoalRejected) as caught:
        loop.send_goal('hook_position', [0.5, 0.0, 0.9], 'map')
    assert str(caught.value).endswith("accepts '', floor, tower, arm, boom, hook")


def test_a_rate_that_is_left_out_is_found_and_said_before_the_arm_moves(crane):
    crane['tp_controller']['tasks']['lift'] = {'type': 'joint', 'joints': ['rise'], 'gain': [9.0]}
    crane['tp_controller']['hierarchy'] = ['lift']
    with ClosedLoop(crane) as loop:
        loop.send_goal('lift', [3.0])
        loop.run(1.0)
        assert 'rate: 60 Hz, found from the joint states' in loop.state.message
        loop.run(2.0)
        record = loop.record
    assert not record.qd[:10].any()
    assert 1.39 < record.q[-1, 1] <= 1.4
    with pytest.raises(HarnessError, match=r'status 2:\ntp_controller: rate: got no value'):
        ClosedLoop(crane, {'tp_controller': {'robot': {'limits': {'position_max': [1.0]}}}})


def test_a_description_that_cannot_be_used_is_refused_by_both_nodes(crane, tmp_path):
    (tmp_path / 'crane.urdf').write_text(ARM.replace('link="tower"', 'link="twoer"', 1))
    with pytest.raises(HarnessError, match=r"status 2:\ntp_\w+: robot\.urdf: got joint 'turn'"):
        ClosedLoop(crane)
    crane['/**']['robot']['urdf'] = str(tmp_path / 'nothing.urdf')
    with pytest.raises(HarnessError, match=r'status 2:\ntp_\w+: robot\.urdf: got .*/noth'):
        ClosedLoop(crane)
