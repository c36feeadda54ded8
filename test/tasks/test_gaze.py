"""The pointing task."""

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from random_stacks import arms, examples, states, vectors
from references import dh_poses, rotation
from small_arms import planar_robot, robot_of

from tp_controller import InvalidValue
from tp_controller.tasks import GazeTask
from tp_controller.tasks.gaze import AXES

H = 1e-6


def direction_of(axis):
    return (-1.0 if axis.startswith('-') else 1.0) * np.eye(3)['xyz'.index(axis[-1])]


@st.composite
def gazes(draw):
    """A gaze task in a state, the pose of its frame as a function, and a joint velocity."""
    block = draw(arms(min_joints=2, max_joints=7))
    n = len(block['joints'])
    link = draw(st.integers(1, n))
    axis = draw(st.sampled_from(AXES))
    task = GazeTask('gaze', robot_of(block), f'link_{link}', axis)
    task.target = draw(vectors(3, 4))

    def pose(q):
        pose = dh_poses(block['dh'], q)[link - 1]
        return pose[:3, 3], pose[:3, :3]

    return task, pose, axis, draw(states(n)), draw(states(n))


def angle(task, pose, axis, q):
    """Angle between the axis and the direction of the target."""
    p, R = pose(q)
    way = task.target - p
    a = R @ direction_of(axis)
    return math.atan2(float(np.linalg.norm(np.cross(a, way))), float(a @ way))


def update(task, q):
    task.robot.update(q)
    task.update()


@given(gazes())
@examples(80)
def test_turned_by_its_error_the_axis_points_at_the_target(case):
    task, pose, axis, q, _ = case
    p, R = pose(q)
    way = task.target - p
    assume(np.linalg.norm(way) > 1e-2)
    update(task, q)
    vector = np.zeros(3)
    vector[['xyz'.index(name[1]) for name in task.components]] = task.error
    turned = R @ rotation(vector) @ direction_of(axis)
    np.testing.assert_allclose(turned, way / np.linalg.norm(way), atol=1e-7)
    assert np.linalg.norm(task.error) == pytest.approx(angle(task, pose, axis, q), abs=1e-7)


@given(gazes())
@examples(80)
def test_the_rate_of_the_angle_is_that_of_the_jacobian_along_the_error(case):
    task, pose, axis, q, qd = case
    assume(np.linalg.norm(task.target - pose(q)[0]) > 1e-1)
    assume(1e-2 < angle(task, pose, axis, q) < math.pi - 1e-2)
    update(task, q)
    unit = task.error / np.linalg.norm(task.error)
    ahead, behind = (angle(task, pose, axis, q + sign * H * qd) for sign in (1.0, -1.0))
    rate = (behind - ahead) / (2.0 * H)
    assert float(unit @ task.J @ qd) == pytest.approx(rate, abs=1e-4, rel=1e-5)


def test_a_turn_about_the_axis_is_free():
    task = GazeTask('gaze', planar_robot(1.0), 'link_1', 'z')
    task.target = [0.0, 0.0, 5.0]
    update(task, np.zeros(1))
    # The joint turns about z; all that moves the direction is the way of the frame.
    assert np.abs(task.J).max() == pytest.approx(1.0 / math.sqrt(26.0) * 5.0 / math.sqrt(26.0))


@pytest.mark.parametrize('axis', AXES)
def test_a_target_right_behind_is_half_a_turn_away(axis):
    task = GazeTask('gaze', planar_robot(1.0), 'link_1', axis)
    robot = task.robot
    robot.update(np.zeros(1))
    task.target = robot.frame('link_1').position - 2.0 * direction_of(axis)
    task.update()
    np.testing.assert_allclose(task.error, [math.pi, 0.0], atol=1e-9)
    assert np.isfinite(task.J).all()


def test_a_target_in_the_frame_itself_asks_for_nothing():
    task = GazeTask('gaze', planar_robot(1.0), 'link_1')
    task.target = [1.0, 0.0, 0.0]
    update(task, np.zeros(1))
    assert not task.error.any()
    assert not task.J.any()


def test_a_gaze_without_a_target_holds_its_direction():
    task = GazeTask('gaze', planar_robot(1.0), 'link_1', '-x')
    task.robot.update(np.array([0.3]))
    task.hold()
    task.update()
    np.testing.assert_allclose(task.target, np.zeros(3), atol=1e-12)
    np.testing.assert_allclose(task.error, np.zeros(2), atol=1e-9)
    np.testing.assert_allclose(task.current, task.target, atol=1e-12)


@pytest.mark.parametrize('axis', ['w', '', 'xy', '+z'])
def test_an_axis_that_is_none_is_refused(axis):
    with pytest.raises(InvalidValue, match='one of x, y, z, -x, -y, -z') as caught:
        GazeTask('gaze', planar_robot(1.0), 'link_1', axis)
    assert caught.value.key == 'axis'
