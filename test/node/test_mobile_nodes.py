"""Robots whose base moves, through the real nodes."""

import numpy as np
import pytest
from sensor_msgs.msg import JointState

from tp_sim.harness import ClosedLoop, HarnessError
from tp_sim.long_runs import run_all

COORDINATES = ['base/x', 'base/y', 'base/yaw', 'joint_1', 'joint_2']
VELOCITIES = ['base/forward', 'base/yaw', 'joint_1', 'joint_2']
CENTER, RADIUS = np.array([1.1, -0.2]), 0.25


def hands(record):
    """Positions (N, 2) of the hand of mobile_planar.yaml at the recorded configurations."""
    x, y, yaw, one, two = record.q.T
    first, second = yaw + one, yaw + one + two
    along = 0.2 * np.array([np.cos(yaw), np.sin(yaw)])
    along += 0.4 * np.array([np.cos(first), np.sin(first)])
    along += 0.35 * np.array([np.cos(second), np.sin(second)])
    return (np.array([x, y]) + along).T


def test_a_differential_drive_brings_its_hand_to_goals_clear_of_a_post(config):
    with ClosedLoop(config / 'mobile_planar.yaml') as loop:
        states = loop.client.collect(JointState, 'joint_states')
        commands = loop.client.collect(JointState, 'joint_velocity_command')
        assert list(loop.state.joint_names) == VELOCITIES
        assert list(loop.state.position_names) == COORDINATES
        for goal, posture in (([2.2, 0.4], [0.6, -0.9]), ([-0.6, -0.8], [-0.6, 0.9])):
            loop.send_goal('hand_position', goal)
            loop.send_goal('posture', posture)
            loop.run(12.0)
            assert hands(loop.record)[-1] == pytest.approx(goal, abs=2e-3)
            assert loop.record.q[-1, 3:] == pytest.approx(posture, abs=1e-2)
        record = loop.record
    assert list(commands[-1].name) == VELOCITIES
    assert list(states[-1].name) == COORDINATES
    distances = np.linalg.norm(hands(record) - CENTER, axis=1) - RADIUS - 0.05
    assert distances.min() > 0.0
    feet = np.linalg.norm(record.q[:, :2] - CENTER, axis=1) - RADIUS - 0.2
    assert feet.min() > 0.0
    assert np.all(np.abs(record.qd) <= np.array([0.6, 1.2, 1.5, 1.5]) * (1.0 + 1e-9))
    # No motion across: the path is tangent to the heading in the middle of every step.
    moves, yaw = np.diff(record.q[:, :2], axis=0), record.q[:, 2]
    middle = 0.5 * (yaw[1:] + yaw[:-1])
    across = moves[:, 1] * np.cos(middle) - moves[:, 0] * np.sin(middle)
    assert np.abs(across).max() < 1e-9


def test_velocities_of_joint_states_are_the_derivatives_of_their_positions(config):
    with ClosedLoop(config / 'mobile_planar.yaml') as loop:
        states = loop.client.collect(JointState, 'joint_states')
        loop.send_goal('hand_position', [0.5, 1.5])
        loop.run(2.0)
    q = np.array([state.position for state in states])
    rates = np.array([state.velocity for state in states])
    same = np.all(np.diff(q, axis=0) == 0.0, axis=1)
    found = (np.diff(q, axis=0) / 0.01)[~same]
    # That of the mean of a step, by half of how much it turns.
    assert np.abs(found - rates[1:][~same]).max() < 0.5 * 0.6 * 1.2 * 0.01 + 1e-9


def test_a_floating_base_holds_its_place_and_goes_to_a_pose(config):
    changes = {
        '/**': {
            'robot': {
                'base': 'floating',
                'limits': {
                    'velocity': [0.5] * 6 + [1.5] * 2,
                    'acceleration': [2.0] * 6 + [6.0] * 2,
                },
            }
        },
        'tp_sim': {'initial_positions': [0.2, 0.1, 0.5, 0.0, 0.0, 0.6, 0.8, 0.6, -0.9]},
        'tp_controller': {
            'hierarchy': ['hand', 'posture'],
            'tasks': {'hand': {'type': 'pose', 'frame': 'link_2', 'gain': [1.5]}},
        },
    }
    target = [0.5, 0.4, 0.9, 0.0, 0.6, 0.0, 0.8]
    with ClosedLoop(config / 'mobile_planar.yaml', changes) as loop:
        loop.run(0.5)
        start = loop.record.q
        loop.send_goal('hand', target)
        loop.run(10.0)
        record = loop.record
    assert np.ptp(start, axis=0) == pytest.approx(np.zeros(9), abs=1e-9)
    assert record.current['hand'][-1][:3] == pytest.approx(target[:3], abs=1e-3)
    quaternion = record.current['hand'][-1][3:]
    assert abs(quaternion @ target[3:]) == pytest.approx(1.0, abs=1e-5)


def test_a_description_from_the_topic_is_put_on_the_base_of_the_parameters():
    arm = """<robot name="stick"><link name="foot"/><link name="end"/>
      <joint name="joint" type="revolute"><parent link="foot"/><child link="end"/>
      <origin xyz="0.5 0 0"/><axis xyz="0 0 1"/>
      <limit lower="-2" upper="2" effort="1" velocity="1"/></joint></robot>"""
    hand = {'type': 'position', 'frame': 'end', 'axes': 'xy', 'gain': [1.5]}
    document = {
        '/**': {
            'rate': 100.0,
            'robot': {
                'base': 'differential',
                'limits': {'velocity': [0.6, 1.2, 1.5], 'acceleration': [1.2, 3.0, 6.0]},
            },
        },
        'tp_sim': {'initial_positions': [0.0, 0.0, 0.5, 0.2]},
        'tp_controller': {'hierarchy': ['hand'], 'tasks': {'hand': hand}},
    }
    with ClosedLoop(document, description=arm) as loop:
        loop.send_goal('hand', [-0.5, 0.8])
        loop.run(10.0)
        x, y, yaw, _ = loop.record.q[-1]
    assert [x + 0.5 * np.cos(yaw), y + 0.5 * np.sin(yaw)] == pytest.approx([-0.5, 0.8], abs=2e-3)


@pytest.mark.parametrize(
    ('changes', 'line'),
    [
        (
            {'tp_controller': {'tasks': {'posture': {'type': 'joint', 'joints': ['base/x']}}}},
            "tasks.posture.joints: got 'base/x' of a differential drive, which cannot move across",
        ),
        (
            {'tp_sim': {'initial_positions': [0.0, 0.0]}},
            'initial_positions: got 2 values; accepts 5, those of base/x, base/y, base/yaw',
        ),
        (
            {'tp_sim': {'plant': {'type': 'rigid_body'}}},
            'plant.type: got rigid_body for a robot with a base that moves; accepts kinematic',
        ),
        ({'/**': {'robot': {'base': 'tracked'}}}, "robot.base: got 'tracked'; accepts one of"),
    ],
)
def test_what_a_base_cannot_have_ends_a_node_with_one_line(config, changes, line):
    with pytest.raises(HarnessError) as caught, ClosedLoop(config / 'mobile_planar.yaml', changes):
        pass
    assert line in str(caught.value)
    assert 'ended with status 2' in str(caught.value)


def test_a_reset_by_names_puts_the_base_somewhere(config):
    with ClosedLoop(config / 'mobile_planar.yaml') as loop:
        loop.reset({'base/x': 0.5, 'base/yaw': 2.0, 'joint_2': 0.3})
        loop.clear_record()
        assert loop.record.q[-1] == pytest.approx([0.5, 0.0, 2.0, 0.6, 0.3], abs=1e-9)


def test_a_long_run_of_a_late_and_noisy_base_breaks_no_limit(config):
    path = config / 'mobile_planar.yaml'
    plants = {
        'ideal': {},
        'late': {'plant.delay': 2, 'plant.lag': [0.03], 'plant.noise': [1e-3]},
        'lossy': {'plant.delay': 1, 'plant.command_loss': 0.3, 'plant.state_loss': 0.3},
    }
    for outcomes in run_all(path, ['recursive'], 2000, 1, plants).values():
        assert not outcomes['recursive'].broken
        assert outcomes['recursive'].reached == outcomes['recursive'].goals
