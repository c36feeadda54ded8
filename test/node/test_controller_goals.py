"""Goals and feedforward over topics: taken, transformed, or refused with a reason."""

import numpy as np
import pytest
from geometry_msgs.msg import PointStamped, PoseStamped, QuaternionStamped, TwistStamped
from sensor_msgs.msg import JointState
from spare_tasks import SPARE_TASKS

from tp_controller.errors import InvalidValue
from tp_sim.harness import ClosedLoop, GoalRejected
from tp_sim.harness.document import edited

NAN = float('nan')


@pytest.fixture(scope='module')
def loop(config):
    """A3 with an idle task of every other type; a busy machine lets it brake late only."""
    changes = edited(SPARE_TASKS, {'tp_controller': {'timeouts': {'joint_state': 5.0}}})
    with ClosedLoop(config / 'a3_position_orientation.yaml', changes) as loop:
        yield loop


@pytest.fixture(autouse=True)
def start(loop):
    """Begin every test at the initial configuration with the same goals."""
    loop.reset()
    loop.set_parameters({'hierarchy': ['ee_position', 'ee_orientation']})
    loop.send_goal('ee_position', [1.0, 0.5])
    loop.send_goal('ee_orientation', [np.pi / 2.0])
    loop.send_feedforward('ee_position', [0.0, 0.0])
    loop.clear_record()


@pytest.mark.parametrize(
    ('task', 'values', 'hierarchy'),
    [
        ('ee_position', [0.3, 1.1], ['ee_position']),
        ('ee_orientation', [2.0], ['ee_orientation']),
        ('hand_pose', [0.2, 1.2, 2.4], ['hand_pose']),
        ('hand_rotation', [0.0, 0.0, np.sin(1.0), np.cos(1.0)], ['hand_rotation']),
        ('elbow', [1.0, -0.5], ['elbow']),
        ('home', [0.1, 0.4, -0.5], ['home']),
        ('from_elbow', [0.4, 0.7], ['from_elbow']),
    ],
)
def test_a_goal_of_every_task_type_is_reached(loop, task, values, hierarchy):
    loop.set_parameters({'hierarchy': hierarchy})
    loop.send_goal(task, values)
    loop.run(10.0)
    assert loop.record.error_norm[task][-1] < 1e-3
    assert loop.record.current[task][-1] == pytest.approx(values, abs=1e-3)


def test_a_goal_in_a_robot_frame_is_transformed_on_receipt(loop):
    loop.send_goal('ee_position', [0.1, 0.2], frame='link_3')
    # The start has link 3 at 0.9 rad with its end at this point.
    tip = np.array(
        [0.75 + 0.5 * np.cos(0.6) + 0.5 * np.cos(0.9), 0.5 * np.sin(0.6) + 0.5 * np.sin(0.9)]
    )
    turn = np.array([[np.cos(0.9), -np.sin(0.9)], [np.sin(0.9), np.cos(0.9)]])
    assert loop.client.task('ee_position').desired == pytest.approx(tip + turn @ [0.1, 0.2])
    loop.send_goal('ee_orientation', [0.1], frame='link_2')
    assert loop.client.task('ee_orientation').desired == pytest.approx([0.7])


def test_a_gaze_turns_its_axis_to_the_point(loop):
    loop.set_parameters({'hierarchy': ['look']})
    loop.send_goal('look', [1.0, 1.5, 0.0])
    loop.run(10.0)
    assert loop.record.error_norm['look'][-1] < 1e-3
    q = loop.record.q[-1]
    elbow = 0.75 * np.array([np.cos(q[0]), np.sin(q[0])])
    tip = elbow + 0.5 * np.array([np.cos(q[0] + q[1]), np.sin(q[0] + q[1])])
    way = np.array([1.0, 1.5]) - tip
    assert np.arctan2(way[1], way[0]) == pytest.approx(q[0] + q[1], abs=2e-3)


def test_a_task_seen_from_a_link_takes_goals_in_any_frame(loop):
    """Without a frame in that link's; others are transformed into it on receipt."""
    loop.send_goal('from_elbow', [0.2, 0.3])
    assert loop.client.task('from_elbow').desired == pytest.approx([0.2, 0.3])
    loop.send_goal('from_elbow', [0.2, 0.3], frame='link_1')
    assert loop.client.task('from_elbow').desired == pytest.approx([0.2, 0.3])
    # Link 1 ends at (0.75, 0) and is not turned at the start; link 2 is, by 0.6 rad.
    loop.send_goal('from_elbow', [1.0, 0.4], frame='base')
    assert loop.client.task('from_elbow').desired == pytest.approx([0.25, 0.4])
    loop.send_goal('from_elbow', [0.0, 0.0], frame='link_2')
    elbow = [0.5 * np.cos(0.6), 0.5 * np.sin(0.6)]
    assert loop.client.task('from_elbow').desired == pytest.approx(elbow)
    assert loop.client.task('from_elbow').relative_to == 'link_1'


def test_a_task_along_the_axes_of_a_link_takes_whole_points_and_its_own_twists(loop):
    loop.set_parameters({'hierarchy': ['along_hand'], 'solver.damping': 0.0})
    tip = np.array(
        [0.75 + 0.5 * np.cos(0.6) + 0.5 * np.cos(0.9), 0.5 * np.sin(0.6) + 0.5 * np.sin(0.9)]
    )
    hand = np.array([np.cos(0.9), np.sin(0.9)])
    goal = [*(tip + 0.1 * hand + 0.2 * np.array([-hand[1], hand[0]])), 0.0]
    loop.send_goal('along_hand', goal)
    task = loop.client.task('along_hand')
    assert list(task.target_components) == ['x', 'y', 'z']
    assert list(task.components) == ['x']
    assert task.error == pytest.approx([0.1])
    # A twist in the base frame along the hand is one along its x axis.
    loop.send_feedforward('along_hand', [0.1])
    loop.clear_record()
    turned = loop.record.requested['along_hand'][-1] - loop.record.error['along_hand'][-1]
    assert turned == pytest.approx([0.1 * hand[0]])
    loop.set_parameters({'solver.damping': 0.1})


def test_a_task_without_a_target_tells_its_measure_and_takes_no_goal(loop):
    loop.set_parameters({'hierarchy': ['ee_position', 'agility']})
    loop.run(1.0)
    measure = loop.record.current['agility']
    task = loop.client.task('agility')
    assert measure.shape[1] == 1
    assert 0.0 < measure[-1, 0] < 3.0
    assert len(task.desired) == len(task.target_components) == 0
    assert task.error_norm == pytest.approx(np.linalg.norm(task.error))
    with pytest.raises(InvalidValue, match='a goal for a manipulability task'):
        loop.send_goal('agility', [1.0])


def test_a_joint_goal_may_name_some_of_the_joints(loop):
    loop.send_goal('elbow', [0.5, 0.5])
    loop.client.publish_goal('elbow', JointState(name=['joint_3'], position=[-1.0]))
    assert list(loop.client.task('elbow').desired) == [0.5, -1.0]


def _bad_goals():
    nan_point = PointStamped()
    nan_point.point.z = NAN
    infinite = PointStamped()
    infinite.point.x = float('inf')
    elsewhere = PointStamped()
    elsewhere.header.frame_id = 'map'
    zero = QuaternionStamped()
    zero.quaternion.w = 0.0
    zero_pose = PoseStamped()
    zero_pose.pose.orientation.w = 0.0
    nan_pose = PoseStamped()
    nan_pose.pose.orientation.x = NAN
    return [
        ('ee_position', nan_point, 'finite'),
        ('ee_position', infinite, 'finite'),
        ('ee_position', elsewhere, 'base, link_1, link_2, link_3'),
        ('ee_orientation', zero, 'quaternion'),
        ('hand_pose', zero_pose, 'quaternion'),
        ('hand_pose', nan_pose, 'finite'),
        ('elbow', JointState(name=['joint_1'], position=[0.0]), 'joint_2, joint_3'),
        ('elbow', JointState(name=['joint_2'], position=[NAN]), 'finite'),
        ('elbow', JointState(name=['joint_2'], position=[]), 'one value for each name'),
        ('elbow', JointState(name=['joint_2'] * 2, position=[0.0, 1.0]), 'names'),
    ]


@pytest.mark.parametrize(('task', 'goal', 'reason'), _bad_goals())
def test_a_bad_goal_is_refused_counted_and_changes_nothing(loop, task, goal, reason):
    before = loop.client.task(task)
    rejected = loop.state.rejected_goals
    with pytest.raises(GoalRejected, match=reason):
        loop.client.publish_goal(task, goal)
    after = loop.client.task(task)
    assert loop.state.rejected_goals == rejected + 1
    assert after.rejected_goals == before.rejected_goals + 1
    assert after.desired == before.desired


def test_the_harness_refuses_values_that_do_not_fit_before_sending(loop):
    with pytest.raises(InvalidValue, match=r'3 values; accepts 2: x \[m\], y \[m\]'):
        loop.send_goal('ee_position', [1.0, 2.0, 3.0])


def test_feedforward_moves_the_task_and_ends_when_it_is_old(loop):
    loop.set_parameters({'hierarchy': ['ee_position'], 'solver.damping': 0.0})
    loop.reset()
    loop.send_goal('ee_position', loop.record.current['ee_position'][-1])
    loop.send_feedforward('ee_position', [0.1, -0.05])
    loop.clear_record()
    loop.run(1.0)
    requested = loop.record.requested['ee_position'] - loop.record.error['ee_position']
    time = loop.record.time
    during = requested[time < 0.49]
    assert during == pytest.approx(np.tile([0.1, -0.05], (len(during), 1)))
    after = requested[time > 0.52]
    assert after == pytest.approx(np.zeros((len(after), 2)), abs=1e-12)
    loop.set_parameters({'solver.damping': 0.1})


def test_feedforward_in_a_robot_frame_is_rotated(loop):
    loop.send_feedforward('ee_position', [0.1, 0.0], frame='link_3')
    loop.step(0)
    record = loop.record
    feedforward = record.requested['ee_position'][-1] - record.error['ee_position'][-1]
    assert feedforward == pytest.approx([0.1 * np.cos(0.9), 0.1 * np.sin(0.9)])


def test_bad_feedforward_is_refused_and_counted(loop):
    rejected = loop.state.rejected_goals
    twist = TwistStamped()
    twist.twist.linear.x = NAN
    with pytest.raises(GoalRejected, match='finite'):
        loop.client.publish_feedforward('ee_position', twist)
    with pytest.raises(GoalRejected, match='joint_2, joint_3'):
        loop.client.publish_feedforward('elbow', JointState(name=['x'], velocity=[0.0]))
    assert loop.state.rejected_goals == rejected + 2


def test_state_tells_what_every_task_asked_for_and_got(loop):
    loop.step(1)
    state = loop.state
    position, orientation, pose, *_ = state.tasks
    assert [task.name for task in state.tasks][:2] == ['ee_position', 'ee_orientation']
    assert (position.type, position.frame) == ('position', 'link_3')
    assert list(position.components) == ['x', 'y']
    assert (position.level, position.enabled, position.active) == (0, True, True)
    assert (orientation.level, pose.level, pose.enabled) == (1, -1, False)
    error = np.array(position.desired) - np.array(position.current)
    assert list(position.error) == pytest.approx(list(error))
    assert position.error_norm == pytest.approx(np.linalg.norm(error))
    assert list(position.requested_velocity) == pytest.approx(list(error))
    assert state.solve_time > 0.0
    assert 0.0 < state.scale <= 1.0
    assert state.header.frame_id == 'base'


@pytest.mark.parametrize('size', [2e9, 1e300, -1e300])
def test_a_feedforward_or_goal_without_bounds_is_refused_with_its_own_cause(loop, size):
    loop.step(0)
    before = loop.record.qd[-1].copy()
    with pytest.raises(GoalRejected, match=r'feedforward rejected: feedforward: got .*up to 1e'):
        loop.send_feedforward('ee_position', [0.0, size])
    with pytest.raises(GoalRejected, match=r'goal rejected: goal position: got .*up to 1e'):
        loop.send_goal('ee_position', [size, 0.0], frame='link_3')
    loop.send_feedforward('ee_position', [0.0, 0.0])
    loop.step(0)
    np.testing.assert_array_equal(loop.record.qd[-1], before)
