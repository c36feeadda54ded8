"""Two axes of an orientation: the error is the tilt, whatever the spin about the third axis."""

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from random_stacks import examples, nonzero_vectors, numbers, vectors
from references import about, quaternion_rotation, rotation
from rotation_errors import tilt_error
from small_arms import wrist

from tp_controller.rotations import quaternion_from_rotation
from tp_controller.tasks import OrientationTask

H = 1e-6
PAIRS = st.sampled_from(['xy', 'xz', 'yz'])
FRAMES = st.sampled_from([None, 'link_3'])


def free_axis(axes):
    (letter,) = set('xyz') - set(axes)
    return letter, np.eye(3)['xyz'.index(letter)]


def task_at(axes, axes_frame, quaternion, q):
    robot = wrist()
    task = OrientationTask('t', robot, 'link_3', axes, axes_frame=axes_frame)
    task.target = quaternion
    robot.update(np.array(q, dtype=float))
    task.update()
    return task


def tilt(task, quaternion, q):
    """Angle between the free axis and where the target has it."""
    _, c = free_axis([name[1] for name in task.components])
    R = about('z', q[0]) @ about('y', q[1]) @ about('z', q[2])
    relative = (
        quaternion_rotation(quaternion).T @ R
        if task.axes is task.frame
        else (R @ quaternion_rotation(quaternion).T)
    )
    return math.atan2(np.linalg.norm(np.cross(c, relative @ c)), c @ relative @ c)


@given(PAIRS, FRAMES, nonzero_vectors(4), vectors(3, 3))
@examples(100)
def test_the_size_of_the_error_is_the_angle_between_free_axis_and_target(axes, frame, target, q):
    task = task_at(axes, frame, target, q)
    assert np.linalg.norm(task.error) == pytest.approx(tilt(task, target, q), abs=1e-9)


@given(PAIRS, FRAMES, nonzero_vectors(4), vectors(3, 3), vectors(3, 1))
@examples(100)
def test_the_size_falls_at_the_rate_of_the_jacobian_along_the_error(axes, frame, target, q, qd):
    task = task_at(axes, frame, target, q)
    size = np.linalg.norm(task.error)
    assume(1e-3 < size < math.pi - 1e-3)
    q, qd = np.array(q), np.array(qd)
    ahead, behind = (tilt(task, target, q + sign * H * qd) for sign in (1.0, -1.0))
    rate = task.error @ task.J @ qd / size
    assert rate == pytest.approx((behind - ahead) / (2.0 * H), abs=1e-6)


@given(st.integers(0, 2), st.booleans(), vectors(3, 3), numbers(-7, 7))
@examples(100)
def test_spin_about_the_free_axis_changes_nothing_but_the_direction(axis, carried, vector, spin):
    Q, turn = rotation(vector), about('xyz'[axis], spin)
    error = tilt_error(Q, axis, carried)
    spun = tilt_error(Q @ turn.T, axis, carried)
    assert error[axis] == spun[axis] == 0.0
    expected = error if carried else turn @ error
    if np.linalg.norm(error) < math.pi - 1e-6:
        np.testing.assert_allclose(spun, expected, atol=1e-8)


@given(st.integers(0, 2), st.booleans(), vectors(3, 3))
@examples(100)
def test_turned_by_its_error_a_frame_has_only_the_spin_left(axis, carried, vector):
    Q, c = rotation(vector), np.eye(3)[axis]
    S = rotation(tilt_error(Q, axis, carried))
    left = S.T @ Q if carried else Q @ S.T
    np.testing.assert_allclose(left @ c, c, atol=1e-9)


@pytest.mark.parametrize('axes_frame', [None, 'link_3'])
@given(spin=numbers(-4, 4), lean=numbers(-3, 3), axes=PAIRS)
@examples(30)
def test_a_tilt_goes_away_from_every_spin(axes_frame, spin, lean, axes):
    """As fast as the gain says, although the spin goes on turning meanwhile."""
    letter, _ = free_axis(axes)
    target = quaternion_from_rotation(about(letter, spin) @ about(axes[0], lean))
    R, size, dt = about('y', 0.3), None, 0.01
    for _ in range(300):
        Q = quaternion_rotation(target) @ R.T
        A = np.eye(3) if axes_frame is None else R
        error = A @ tilt_error(A.T @ Q @ A, 'xyz'.index(letter), axes_frame is not None)
        now = np.linalg.norm(error)
        assert size is None or now == pytest.approx((1.0 - 2.0 * dt) * size, rel=2e-2, abs=1e-9)
        size = now
        free = A['xyz'.index(letter)] if axes_frame is None else A[:, 'xyz'.index(letter)]
        R = rotation(dt * (2.0 * error + 0.5 * free)) @ R
    assert size < 0.01


@pytest.mark.parametrize('axis', range(3))
@pytest.mark.parametrize('carried', [False, True])
def test_half_a_turn_away_the_error_is_half_a_turn_about_a_controlled_axis(axis, carried):
    Q = np.diag([1.0 if i == (axis + 1) % 3 else -1.0 for i in range(3)])
    error = tilt_error(Q, axis, carried)
    np.testing.assert_array_equal(np.abs(error), math.pi * np.eye(3)[(axis + 1) % 3])
