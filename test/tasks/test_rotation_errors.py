import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from random_stacks import examples, nonzero_vectors, numbers, vectors
from references import about, heading, quaternion_rotation, rotation, rotation_vector
from rotation_errors import heading_row, rotation_error
from small_arms import planar_robot, wrist

from tp_controller.rotations import (
    heading as library_heading,
)
from tp_controller.rotations import (
    quaternion_from_rotation,
    rotation_from_quaternion,
    wrap,
)
from tp_controller.tasks import OrientationTask


@st.composite
def turns(draw, low=0.0, high=math.pi):
    """A rotation vector with an angle between two bounds."""
    axis = np.array(draw(nonzero_vectors(3)))
    return axis / np.linalg.norm(axis) * draw(st.floats(low, high))


def planar_error(target, q):
    robot = planar_robot(1.0)
    task = OrientationTask('t', robot, 'link_1', 'z')
    task.target = [target]
    robot.update(np.array([q]))
    task.update()
    return task.error[0]


@pytest.mark.parametrize(
    ('target', 'q', 'error'),
    [
        (3.0, -3.0, 6.0 - math.tau),
        (-3.0, 3.0, math.tau - 6.0),
        (0.5 + 3 * math.tau, 0.0, 0.5),
        (0.0, 0.5 - 2 * math.tau, -0.5),
        (math.pi - 0.01, -math.pi + 0.01, -0.02),
        (1.0, 0.25, 0.75),
    ],
)
def test_an_angle_error_takes_the_shortest_way(target, q, error):
    assert planar_error(target, q) == pytest.approx(error, abs=1e-12)


@given(numbers(-20, 20), numbers(-20, 20))
@examples(100)
def test_an_angle_error_is_at_most_half_a_turn_and_whole_turns_away(target, q):
    error = planar_error(target, q)
    turned = (target - q - error) / math.tau
    assert abs(error) <= math.pi
    assert abs(turned - round(turned)) < 1e-12


@given(st.floats(-1e3, 1e3))
@examples(200)
def test_a_wrapped_angle_points_the_same_way(angle):
    assert abs(wrap(angle)) <= math.pi
    assert math.cos(wrap(angle)) == pytest.approx(math.cos(angle), abs=1e-12)
    assert math.sin(wrap(angle)) == pytest.approx(math.sin(angle), abs=1e-12)


@given(turns(), turns())
@examples(200)
def test_a_rotation_error_is_the_logarithm_of_the_way_left(vector, start):
    R = rotation(start)
    error = rotation_error(rotation(vector) @ R, R)
    np.testing.assert_allclose(rotation(error), rotation(vector), atol=1e-9)
    assert np.linalg.norm(error) <= math.pi + 1e-9


@given(turns(high=math.pi - 1e-3), turns())
@examples(200)
def test_a_rotation_error_is_the_rotation_vector_itself(vector, start):
    R = rotation(start)
    np.testing.assert_allclose(rotation_error(rotation(vector) @ R, R), vector, atol=1e-9)


@given(turns(low=math.pi - 1e-3), turns())
@examples(200)
def test_a_rotation_error_near_half_a_turn_agrees_with_the_independent_logarithm(vector, start):
    """Up to the sign of a half turn, which is as short one way as the other."""
    R = rotation(start)
    R_des = rotation(vector) @ R
    error, expected = rotation_error(R_des, R), rotation_vector(R_des @ R.T)
    distance = min(np.abs(error - expected).max(), np.abs(error + expected).max())
    assert distance < 1e-6
    if np.linalg.norm(vector) < math.pi - 1e-6:
        np.testing.assert_allclose(error, vector, atol=1e-6)


@pytest.mark.parametrize('axis', 'xyz')
def test_half_a_turn_about_an_axis_has_an_error_of_pi_about_it(axis):
    error = rotation_error(about(axis, math.pi), np.eye(3))
    unit = np.array([letter == axis for letter in 'xyz'], dtype=float)
    np.testing.assert_allclose(np.abs(error), math.pi * unit, atol=1e-7)


@pytest.mark.parametrize('angle', [0.0, 1e-12, 1e-9, 1e-6, 1e-3])
def test_small_rotation_errors_keep_their_size(angle):
    error = rotation_error(about('y', angle), np.eye(3))
    np.testing.assert_allclose(error, [0.0, angle, 0.0], atol=1e-15, rtol=1e-9)


@given(nonzero_vectors(4))
@examples(100)
def test_a_quaternion_of_any_length_and_sign_is_the_same_rotation(quaternion):
    R = rotation_from_quaternion(np.array(quaternion))
    np.testing.assert_allclose(R, quaternion_rotation(quaternion), atol=1e-14)
    np.testing.assert_allclose(rotation_from_quaternion(-np.array(quaternion)), R, atol=1e-14)


@given(turns())
@examples(100)
def test_a_rotation_survives_the_way_through_its_quaternion(vector):
    quaternion = quaternion_from_rotation(rotation(vector))
    assert quaternion[3] >= 0.0
    assert np.linalg.norm(quaternion) == pytest.approx(1.0, abs=1e-12)
    np.testing.assert_allclose(quaternion_rotation(quaternion), rotation(vector), atol=1e-12)


@given(nonzero_vectors(4), vectors(3, 3), st.sampled_from(['xy', 'xz', 'yz', 'xyz']))
@examples(100)
def test_the_sign_of_a_target_quaternion_does_not_matter(quaternion, q, axes):
    robot = wrist()
    robot.update(np.array(q))
    errors = []
    for sign in (1.0, -1.0):
        task = OrientationTask('t', robot, 'link_3', axes)
        task.target = sign * np.array(quaternion)
        task.update()
        errors.append(task.error)
    np.testing.assert_array_equal(errors[0], errors[1])


@given(nonzero_vectors(4), vectors(3, 3))
@examples(100)
def test_an_orientation_error_about_three_axes_is_the_logarithm(quaternion, q):
    robot = wrist()
    robot.update(np.array(q))
    task = OrientationTask('t', robot, 'link_3', 'xyz')
    task.target = quaternion
    task.update()
    R = about('z', q[0]) @ about('y', q[1]) @ about('z', q[2])
    expected = rotation_vector(quaternion_rotation(quaternion) @ R.T)
    if np.linalg.norm(expected) < math.pi - 1e-6:
        np.testing.assert_allclose(task.error, expected, atol=1e-7)


@pytest.mark.parametrize('axis', 'xyz')
@given(angle=numbers(-3.14, 3.14))
@examples(30)
def test_the_heading_of_a_turn_about_one_axis_is_its_angle(axis, angle):
    assert library_heading(about(axis, angle), 'xyz'.index(axis)) == pytest.approx(angle)


@given(turns(), st.sampled_from('xyz'))
@examples(60)
def test_the_heading_is_the_angle_of_the_image_in_the_plane(vector, axis):
    R = rotation(vector)
    assert library_heading(R, 'xyz'.index(axis)) == pytest.approx(heading(R, axis), abs=1e-12)


@pytest.mark.parametrize('axis', range(3))
def test_the_heading_rate_is_the_spin_where_the_heading_has_no_derivative(axis):
    letter = 'xyz'[(axis + 2) % 3]
    row = heading_row(about(letter, math.pi / 2), axis)
    assert np.all(np.isfinite(row))
    np.testing.assert_array_equal(row, np.eye(3)[axis])


@given(turns(), turns(math.pi - 1e-3, math.pi))
@examples(40)
def test_a_goal_half_a_turn_away_is_approached_the_short_way_without_a_jump(start, way):
    """Turned along its error, a frame goes straight to the goal: the axis never flips."""
    R = rotation(start)
    R_des = rotation(way) @ R
    first = rotation_error(R_des, R)
    dt, turned = 0.02, 0.0
    for i in range(400):
        error = rotation_error(R_des, R)
        np.testing.assert_allclose(error, first * (1.0 - dt) ** i, atol=1e-6)
        R = rotation(dt * error) @ R
        turned += dt * float(np.linalg.norm(error))
    assert turned <= math.pi


@given(numbers(-3, 3), st.sampled_from([-1.0, 1.0]))
@examples(40)
def test_an_angle_error_does_not_jump_where_angle_and_target_pass_half_a_turn(lead, sign):
    """The robot turns through several turns with its target ahead of it all the way."""
    errors = [planar_error(sign * q + lead, sign * q) for q in np.linspace(-7.0, 7.0, 200)]
    np.testing.assert_allclose(errors, math.remainder(lead, math.tau), atol=1e-9)
