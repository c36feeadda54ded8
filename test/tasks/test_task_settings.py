import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from random_stacks import examples, gains, vectors
from references import quaternion_rotation
from small_arms import planar_robot, wrist

from tp_controller.tasks import JointTask, OrientationTask, PoseTask, PositionTask


def position_task(axes='xy'):
    task = PositionTask('t', planar_robot(0.75, 0.5, 0.5), 'link_3', axes)
    task.robot.update(np.array([0.0, 0.6, 0.3]))
    return task


KINDS = {
    'position': lambda robot: PositionTask('t', robot, 'link_3'),
    'angle': lambda robot: OrientationTask('t', robot, 'link_3', 'z'),
    'rotation': lambda robot: OrientationTask('t', robot, 'link_3', 'xyz'),
    'planar_pose': lambda robot: PoseTask('t', robot, 'link_3', 'xy', 'z'),
    'pose': lambda robot: PoseTask('t', robot, 'link_3', 'x', 'xy'),
    'joint': lambda robot: JointTask('t', robot, ['yaw', 'roll']),
}


@pytest.fixture(params=KINDS)
def task(request):
    robot = wrist()
    robot.update(np.array([0.3, 0.7, -0.4]))
    return KINDS[request.param](robot)


def desired_velocity(task):
    task.update()
    velocity = np.empty(task.k)
    task.desired_velocity(velocity)
    return velocity


def gain_matrix(values, k):
    """K by the words of the contract: one value, one per axis, or k*k row by row."""
    if len(values) == k * k:
        return np.array([[values[k * row + column] for column in range(k)] for row in range(k)])
    return np.diag(values if len(values) == k else values * k)


@pytest.mark.parametrize('k', [1, 2, 3])
@given(data=st.data())
@examples(50)
def test_the_desired_velocity_is_gain_times_error_plus_feedforward(k, data):
    task = position_task('xyz'[:k])
    values = data.draw(gains(k))
    feedforward = data.draw(vectors(k, 5))
    task.target = data.draw(vectors(k, 5))
    task.gain, task.feedforward = values, feedforward
    velocity = desired_velocity(task)
    expected = gain_matrix(values, k) @ task.error + feedforward
    np.testing.assert_allclose(velocity, expected, atol=1e-12)
    np.testing.assert_array_equal(task.gain, gain_matrix(values, k))


def test_a_gain_matrix_is_read_row_by_row():
    task = position_task('xy')
    task.gain = [1.0, 0.5, -0.5, 2.0]
    np.testing.assert_array_equal(task.gain, [[1.0, 0.5], [-0.5, 2.0]])


def test_a_task_starts_with_gain_one_and_no_feedforward():
    task = position_task('xy')
    np.testing.assert_array_equal(task.gain, np.eye(2))
    np.testing.assert_array_equal(task.feedforward, [0.0, 0.0])
    assert task.target is None


@pytest.mark.parametrize('values', [[0.0], [0.0, 0.0], [0.0] * 4, [1.0, 1.0, 1.0, 1.0]])
def test_a_gain_may_leave_directions_alone(values):
    task = position_task('xy')
    task.gain = values
    np.testing.assert_array_equal(task.gain, gain_matrix(values, 2))


@pytest.mark.parametrize(
    ('name', 'values'),
    [('target', [0.1, 0.2]), ('gain', [1.0, 2.0, 2.0, 4.0]), ('feedforward', [0.3, 0.4])],
)
def test_what_a_task_is_given_and_gives_back_are_copies(name, values):
    task = position_task('xy')
    given_array = np.array(values)
    setattr(task, name, given_array)
    kept = getattr(task, name)
    given_array[:] = 9.0
    getattr(task, name)[:] = 8.0
    np.testing.assert_array_equal(getattr(task, name), kept)


def test_the_present_value_is_a_copy(task):
    current = task.current
    before = current.copy()
    current[:] = 9.0
    np.testing.assert_array_equal(task.current, before)


def test_a_held_task_has_no_error(task):
    task.hold()
    task.update()
    np.testing.assert_allclose(task.error, np.zeros(task.k), atol=1e-12)
    np.testing.assert_allclose(task.target, task.current, atol=1e-15)
    assert len(task.target) == task.target_size


def test_a_held_task_keeps_its_target_when_the_robot_moves(task):
    task.hold()
    target = task.target
    task.robot.update(np.array([0.5, 0.9, 0.1]))
    task.update()
    np.testing.assert_array_equal(task.target, target)
    assert np.abs(task.error).max() > 0.05


def test_a_target_set_after_a_hold_is_the_one_that_counts(task):
    goal = task.current
    task.robot.update(np.array([0.5, 0.9, 0.1]))
    task.hold()
    task.target = goal
    task.robot.update(np.array([0.3, 0.7, -0.4]))
    task.update()
    np.testing.assert_allclose(task.error, np.zeros(task.k), atol=1e-9)


def test_the_present_value_is_the_target_that_the_present_pose_stands_for(task):
    if task.type == 'joint':
        assert task.current.tolist() == [task.robot.q[2], task.robot.q[0]]
    else:
        pose = task.frame.position, task.frame.rotation
        np.testing.assert_array_equal(task.current, task.target_from_pose(*pose))


def test_the_present_orientation_is_a_quaternion_in_the_order_x_y_z_w():
    robot = wrist()
    robot.update(np.array([0.3, 0.7, -0.4]))
    task = OrientationTask('t', robot, 'link_3')
    np.testing.assert_allclose(
        quaternion_rotation(task.current), robot.frame('link_3').rotation, atol=1e-12
    )


@pytest.mark.parametrize('size', [1e-300, 1e-160, 0.5, 3.0, 1e160, 1e300])
def test_a_target_quaternion_may_have_any_length(size):
    task = OrientationTask('t', wrist(), 'link_3')
    task.target = size * np.array([0.6, 0.0, 0.0, -0.8])
    np.testing.assert_allclose(task.target, [0.6, 0.0, 0.0, -0.8], atol=1e-15)


def test_the_quaternion_in_the_target_of_a_pose_is_brought_to_unit_length():
    task = PoseTask('t', wrist(), 'link_3')
    task.target = [1.0, 2.0, 3.0, 0.0, 3.0, 0.0, 4.0]
    np.testing.assert_allclose(task.target, [1.0, 2.0, 3.0, 0.0, 0.6, 0.0, 0.8], atol=1e-15)


def test_a_twist_stands_for_the_feedforward_of_the_controlled_axes():
    twist = np.arange(1.0, 7.0)
    task = PoseTask('t', wrist(), 'link_3', 'xz', 'y')
    np.testing.assert_array_equal(task.feedforward_from_twist(twist), [1.0, 3.0, 5.0])


def test_changes_of_named_joints_leave_the_other_values_of_a_joint_task():
    task = JointTask('t', wrist(), ['yaw', 'roll'])
    values = np.array([1.0, 2.0])
    np.testing.assert_array_equal(task.with_joints(values, ['roll'], [5.0]), [1.0, 5.0])
    np.testing.assert_array_equal(values, [1.0, 2.0])
