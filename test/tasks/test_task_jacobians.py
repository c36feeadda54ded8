import math

import numpy as np
from hypothesis import assume, given
from hypothesis import strategies as st
from random_stacks import AXES, arms, examples, states, tasks
from references import dh_poses, heading, rotation_vector
from small_arms import planar_robot, robot_of

from tp_controller.tasks import TASK_TYPES, OrientationTask, PoseTask, PositionTask

STEP = 1e-5


@st.composite
def tasks_in_motion(draw, types, axes=AXES):
    """A task, the block of its arm, and a state and joint velocity of the arm."""
    block = draw(arms())
    task_block = draw(tasks(block, types, axes))
    n = len(block['joints'])
    return task_of(block, task_block), block, draw(states(n)), draw(states(n))


def task_of(robot_block, task_block):
    task = TASK_TYPES[task_block['type']].from_parameters(
        'task', robot_of(robot_block), task_block
    )
    task.target = task_block['target']
    return task


def at(task, q):
    """Error and Jacobian at a configuration."""
    task.robot.update(q)
    task.update()
    return task.error.copy(), task.J.copy()


def rate_of_minus_error(task, q, qd):
    """Rate of the task variable, as the target stands still."""
    return (at(task, q - STEP * qd)[0] - at(task, q + STEP * qd)[0]) / (2.0 * STEP)


def pose_of(block, frame, q):
    return dh_poses(block['dh'], q)[int(frame.removeprefix('link_')) - 1]


@given(tasks_in_motion(['position', 'joint']))
@examples(60)
def test_position_and_joint_velocities_are_the_rates_of_minus_the_error(case):
    task, _, q, qd = case
    _, J = at(task, q)
    np.testing.assert_allclose(J @ qd, rate_of_minus_error(task, q, qd), atol=1e-6)


@given(tasks_in_motion(['position']))
@examples(40)
def test_a_position_error_is_the_way_from_the_frame_to_the_target(case):
    task, block, q, _ = case
    error, _ = at(task, q)
    p = pose_of(block, task.frame_name, q)[:3, 3]
    rows = ['xyz'.index(letter) for letter in task.components]
    np.testing.assert_allclose(error, task.target - p[rows], atol=1e-12)


@given(tasks_in_motion(['joint']))
@examples(30)
def test_a_joint_error_is_not_wrapped(case):
    task, block, q, _ = case
    error, _ = at(task, q)
    current = [q[block['joints'].index(name)] for name in task.components]
    np.testing.assert_array_equal(error, task.target - current)


@given(tasks_in_motion(['orientation'], axes='xyz'))
@examples(80)
def test_the_velocity_about_one_axis_is_the_rate_of_the_heading(case):
    """Also for spatial arms, away from where the heading has no derivative."""
    task, block, q, qd = case
    axis = task.components[0].removeprefix('r')
    R = pose_of(block, task.frame_name, q)[:3, :3]
    image_out_of_plane = R['xyz'.index(axis), ('xyz'.index(axis) + 1) % 3]
    assume(abs(image_out_of_plane) < 0.9)
    error, J = at(task, q)
    turns = (task.target[0] - heading(R, axis) - error[0]) / math.tau
    assert abs(turns - round(turns)) < 1e-9
    assert abs(error[0]) <= math.pi
    jump = rate_of_minus_error(task, q, qd) * 2.0 * STEP
    rate = (jump - math.tau * np.round(jump / math.tau)) / (2.0 * STEP)
    np.testing.assert_allclose(J @ qd, rate, atol=1e-6, rtol=1e-6)


@given(tasks_in_motion(['orientation'], axes=('xy', 'xz', 'yz', 'xyz')))
@examples(60)
def test_the_velocity_about_several_axes_is_the_angular_velocity(case):
    task, block, q, qd = case
    _, J = at(task, q)
    ahead = pose_of(block, task.frame_name, q + STEP * qd)[:3, :3]
    behind = pose_of(block, task.frame_name, q - STEP * qd)[:3, :3]
    w = rotation_vector(ahead @ behind.T) / (2.0 * STEP)
    rows = ['xyz'.index(name.removeprefix('r')) for name in task.components]
    np.testing.assert_allclose(J @ qd, w[rows], atol=1e-6)


@given(tasks_in_motion(['pose']))
@examples(60)
def test_a_pose_has_the_rows_of_its_position_and_then_of_its_orientation(case):
    task, block, q, _ = case
    robot = robot_of(block)
    axes = [name for name in task.components if not name.startswith('r')]
    turns = [name.removeprefix('r') for name in task.components if name.startswith('r')]
    position = PositionTask('p', robot, task.frame_name, ''.join(axes))
    orientation = OrientationTask('o', robot, task.frame_name, ''.join(turns))
    position.target, orientation.target = task.target[: len(axes)], task.target[len(axes) :]
    error, J = at(task, q)
    parts = [at(part, q) for part in (position, orientation)]
    assert len(error) == task.k == len(axes) + len(turns)
    np.testing.assert_array_equal(error, np.concatenate([part[0] for part in parts]))
    np.testing.assert_array_equal(J, np.vstack([part[1] for part in parts]))


def test_a_pose_velocity_is_the_rate_of_its_variable():
    task = PoseTask('t', planar_robot(0.75, 0.5, 0.5), 'link_3', 'xy', 'z')
    task.target = [0.3, -0.2, 1.0]
    q, qd = np.array([0.3, -0.8, 1.4]), np.array([1.0, -2.0, 0.5])
    _, J = at(task, q)
    np.testing.assert_allclose(J @ qd, rate_of_minus_error(task, q, qd), atol=1e-8)


def test_axes_stand_in_the_order_of_the_frame_whatever_their_order_in_the_text():
    assert PositionTask('t', planar_robot(1.0), 'link_1', 'zx').components == ('x', 'z')
    assert OrientationTask('t', planar_robot(1.0), 'link_1', 'yx').components == ('rx', 'ry')


def test_a_joint_task_has_unit_rows_in_the_order_of_its_names():
    block = {'type': 'joint', 'joints': ['joint_3', 'joint_1'], 'target': [1.0, 2.0]}
    task = TASK_TYPES['joint'].from_parameters('t', planar_robot(1.0, 1.0, 1.0), block)
    task.target = block['target']
    error, J = at(task, np.array([0.1, 0.2, 0.3]))
    np.testing.assert_array_equal(J, [[0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
    np.testing.assert_allclose(error, [0.7, 1.9])
