import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from random_stacks import arms, examples, states
from references import dh_poses, rotation_vector
from small_arms import planar_robot, robot_of

from tp_controller.robot import Limits

STEP = 1e-5


@st.composite
def arms_in_a_state(draw):
    block = draw(arms())
    return block, draw(states(len(block['joints'])))


@given(arms_in_a_state())
@examples(100)
def test_link_poses_are_the_product_of_the_dh_matrices(case):
    block, q = case
    robot = robot_of(block)
    robot.update(q)
    for name, expected in zip(robot.frames, dh_poses(block['dh'], q), strict=True):
        np.testing.assert_allclose(robot.frame(name).position, expected[:3, 3], atol=1e-12)
        np.testing.assert_allclose(robot.frame(name).rotation, expected[:3, :3], atol=1e-12)


@given(arms_in_a_state())
@examples(60)
def test_jacobians_are_the_derivatives_of_the_dh_product(case):
    """Linear rows from the origin's motion, angular ones from R(q + h) R(q - h)ᵀ."""
    block, q = case
    robot = robot_of(block)
    robot.update(q)
    for j in range(robot.n):
        h = np.zeros(robot.n)
        h[j] = STEP
        poses = zip(dh_poses(block['dh'], q + h), dh_poses(block['dh'], q - h), strict=True)
        for name, (ahead, behind) in zip(robot.frames, poses, strict=True):
            v = (ahead[:3, 3] - behind[:3, 3]) / (2.0 * STEP)
            w = rotation_vector(ahead[:3, :3] @ behind[:3, :3].T) / (2.0 * STEP)
            column = robot.frame(name).jacobian[:, j]
            np.testing.assert_allclose(column, [*v, *w], atol=1e-6)


def test_a_robot_starts_at_the_zero_configuration():
    robot = planar_robot(1.0, 1.0, 1.0)
    np.testing.assert_array_equal(robot.q, np.zeros(3))
    np.testing.assert_array_equal(robot.frame('link_3').position, [3.0, 0.0, 0.0])


def test_frames_are_the_links_from_the_base_outwards():
    assert planar_robot(1.0, 1.0, 1.0).frames == ('link_1', 'link_2', 'link_3')


def test_a_frame_is_the_same_object_at_every_call():
    robot = planar_robot(1.0, 1.0, 1.0)
    assert robot.frame('link_2') is robot.frame('link_2')


def test_views_of_a_frame_follow_the_robot():
    robot = planar_robot(1.0, 1.0, 1.0)
    frame = robot.frame('link_1')
    q, position, rotation = robot.q, frame.position, frame.rotation
    robot.update(np.array([np.pi / 2, 0.0, 0.0]))
    np.testing.assert_array_equal(q, [np.pi / 2, 0.0, 0.0])
    np.testing.assert_allclose(position, [0.0, 1.0, 0.0], atol=1e-15)
    np.testing.assert_allclose(rotation[:, 0], [0.0, 1.0, 0.0], atol=1e-15)
    np.testing.assert_allclose(frame.jacobian[:3, 0], [-1.0, 0.0, 0.0], atol=1e-15)


def test_the_configuration_is_copied_on_update():
    robot = planar_robot(1.0, 1.0, 1.0)
    q = np.array([0.1, 0.2, 0.3])
    robot.update(q)
    q[:] = 9.0
    np.testing.assert_array_equal(robot.q, [0.1, 0.2, 0.3])


@pytest.mark.parametrize('name', ['position', 'rotation', 'jacobian'])
def test_what_a_frame_hands_out_cannot_be_written(name):
    array = getattr(planar_robot(1.0, 1.0, 1.0).frame('link_2'), name)
    with pytest.raises(ValueError, match='read-only'):
        array[0] = 1.0


def test_the_configuration_handed_out_cannot_be_written():
    with pytest.raises(ValueError, match='read-only'):
        planar_robot(1.0, 1.0, 1.0).q[0] = 1.0


def test_absent_limits_are_infinite_and_one_value_serves_all_joints():
    limits = Limits(3, velocity=[2.0])
    np.testing.assert_array_equal(limits.velocity, [2.0, 2.0, 2.0])
    np.testing.assert_array_equal(limits.acceleration, [np.inf] * 3)
    np.testing.assert_array_equal(limits.position_min, [-np.inf] * 3)
    np.testing.assert_array_equal(limits.position_max, [np.inf] * 3)


@pytest.mark.parametrize('name', Limits.KEYS)
def test_limits_handed_out_cannot_be_written(name):
    with pytest.raises(ValueError, match='read-only'):
        getattr(Limits(2), name)[0] = 1.0


def test_a_robot_without_limits_is_unlimited():
    robot = planar_robot(1.0, 1.0, 1.0)
    assert np.all(np.isinf(robot.limits.velocity))
