"""Objectives by their definitions, and the extended Jacobian that comes of them."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from random_stacks import arms, examples, numbers, planar_arms, states, vectors
from small_arms import planar_block, robot_of
from urdf_arm import ARM
from urdf_reference import descriptions

from tp_controller import InvalidValue, build_settings
from tp_controller.objectives import (
    JointRangeObjective,
    ManipulabilityObjective,
    PostureObjective,
)
from tp_controller.robot import Limits, urdf_robot

H = 1e-6


def slope(objective, q):
    """∂H/∂q by central differences of its value."""
    found = np.zeros(len(q))
    for i, unit in enumerate(np.eye(len(q))):
        ahead, behind = (value_at(objective, q + sign * H * unit) for sign in (1.0, -1.0))
        found[i] = (ahead - behind) / (2.0 * H)
    objective.robot.update(q)
    return found


def value_at(objective, q):
    objective.robot.update(q)
    return objective.value


def gradient(objective, q):
    objective.robot.update(q)
    out = np.full(len(q), 7.0)
    objective.gradient(out)
    return out


@st.composite
def robots_in_a_state(draw, min_joints=1):
    block = draw(arms(min_joints=min_joints) | planar_arms(min_joints=min_joints))
    return robot_of(block), draw(states(len(block['joints'])))


@given(robots_in_a_state(), st.data())
@examples(60)
def test_the_hessian_is_the_derivative_of_the_jacobian(case, data):
    robot, q = case
    assert_hessian(robot, robot.frames[data.draw(st.integers(0, robot.n - 1))], q)


def assert_hessian(robot, name, q):
    frame = robot.frame(name)
    robot.update(q)
    hessian = frame.hessian.copy()
    for i, unit in enumerate(np.eye(len(q))):
        robot.update(q + H * unit)
        ahead = frame.jacobian.copy()
        robot.update(q - H * unit)
        np.testing.assert_allclose(
            hessian[:, :, i], (ahead - frame.jacobian) / (2.0 * H), atol=1e-7
        )


@given(descriptions(), st.data())
@examples(60)
def test_the_hessian_is_right_on_trees_with_mimic_joints(case, data):
    text, joints = case
    robot = urdf_robot(text, data.draw(st.permutations(joints)))
    assert_hessian(robot, data.draw(st.sampled_from(robot.frames)), data.draw(states(len(joints))))


@given(robots_in_a_state(), st.data())
@examples(60)
def test_the_manipulability_is_the_root_of_the_determinant_and_has_its_slope(case, data):
    robot, q = case
    position = data.draw(st.sampled_from(['x', 'yz', 'xyz']))
    orientation = data.draw(st.sampled_from(['', 'z', 'xy']))
    assume(len(position + orientation) <= robot.n)
    objective = ManipulabilityObjective(robot, robot.frames[-1], position, orientation)
    rows = ['xyz'.index(a) for a in sorted(position)] + [
        3 + 'xyz'.index(a) for a in sorted(orientation)
    ]
    robot.update(q)
    J = robot.frame(robot.frames[-1]).jacobian[rows]
    determinant = max(float(np.linalg.det(J @ J.T)), 0.0)
    assert objective.value == pytest.approx(determinant**0.5, abs=1e-7)
    assume(np.linalg.svd(J, compute_uv=False)[-1] > 1e-3)
    np.testing.assert_allclose(gradient(objective, q), slope(objective, q), atol=1e-6, rtol=1e-6)


def test_the_manipulability_of_a_two_link_arm_is_the_one_of_the_textbook():
    """W = l₁ l₂ |sin q₂| (Yoshikawa 1985)."""
    objective = ManipulabilityObjective(robot_of(planar_block(0.7, 0.4)), 'link_2', 'xy')
    q = np.array([0.3, 0.9])
    assert value_at(objective, q) == pytest.approx(0.28 * np.sin(0.9))
    np.testing.assert_allclose(gradient(objective, q), [0.0, 0.28 * np.cos(0.9)], atol=1e-12)
    # Stretched there is no slope; the arm is led out to one side.
    np.testing.assert_allclose(np.abs(gradient(objective, np.zeros(2))), [0.0, 0.28], atol=1e-12)


@given(robots_in_a_state(), st.data())
@examples(40)
def test_posture_and_joint_range_have_the_slopes_of_their_values(case, data):
    robot, q = case
    robot.limits = Limits(robot.n, position_min=[-4.5], position_max=[5.0])
    for objective in (
        PostureObjective(robot, data.draw(vectors(robot.n, 3))),
        JointRangeObjective(robot),
    ):
        np.testing.assert_allclose(gradient(objective, q), slope(objective, q), atol=1e-7)


def test_joints_without_a_range_do_not_count_and_the_middle_is_best():
    robot = urdf_robot(ARM, ['shoulder', 'elbow'])
    objective = JointRangeObjective(robot)
    assert value_at(objective, np.array([2.0, 0.5])) == 0.0
    np.testing.assert_allclose(
        gradient(objective, np.array([2.0, 2.0])), [0.0, -0.5 / 3.0 / 2.0], atol=1e-12
    )


def test_a_continuous_joint_comes_to_a_posture_by_the_shortest_way():
    objective = PostureObjective(urdf_robot(ARM, ['shoulder', 'elbow']), [3.0, 3.0])
    way = gradient(objective, np.array([-3.0, -3.0]))
    np.testing.assert_allclose(way, [6.0 - 2.0 * np.pi, 6.0])


def test_a_joint_range_needs_a_joint_with_a_range():
    with pytest.raises(InvalidValue, match='position_min'):
        JointRangeObjective(robot_of(planar_block(1.0)))


@pytest.mark.parametrize(
    ('arguments', 'key'),
    [
        (('elbow', 'xy'), 'frame'),
        (('link_2', 'xw'), 'position_axes'),
        (('link_2', 'x', 'zz'), 'orientation_axes'),
        (('link_2', ''), 'position_axes'),
        (('link_2', 'xyz'), 'position_axes'),
    ],
)
def test_a_manipulability_that_cannot_be_is_refused(arguments, key):
    with pytest.raises(InvalidValue) as caught:
        ManipulabilityObjective(robot_of(planar_block(1.0, 1.0)), *arguments)
    assert caught.value.key == key


def test_a_posture_needs_one_position_per_joint():
    with pytest.raises(InvalidValue, match='2 values'):
        PostureObjective(robot_of(planar_block(1.0, 1.0)), [0.0])


def test_a_posture_that_is_not_finite_is_refused():
    with pytest.raises(InvalidValue, match='finite'):
        PostureObjective(robot_of(planar_block(1.0, 1.0)), [0.0, np.nan])


def extended(robot, positions, strength=1.0, **tip):
    """Stack of a planar arm whose tip has a place and whose rest is near a posture."""
    n = len(robot['joints'])
    block = {
        'robot': robot,
        'solver': {
            'type': 'extended_jacobian',
            'inverse': 'pinv',
            'objective': {'type': 'posture', 'positions': list(positions), 'gain': strength},
        },
        'hierarchy': ['tip'],
        'tasks': {'tip': {'type': 'position', 'frame': f'link_{n}', 'axes': 'xy'} | tip},
    }
    return build_settings(block).stack


def projected(stack, q):
    """Gradient of the objective in the null space of the tasks."""
    J = stack.robot.frame(stack.robot.frames[-1]).jacobian[:2]
    out = gradient(stack.solver.objective, q)
    return out - np.linalg.pinv(J) @ (J @ out)


bent = st.tuples(numbers(-3, 3), numbers(0.6, 1.4), numbers(0.6, 1.4), numbers(-1.2, 1.2))


@given(bent, st.integers(3, 4), vectors(2, 1))
@examples(25)
def test_at_an_optimum_the_extended_jacobian_moves_the_tip_and_stays_at_the_optimum(
    start, n, velocity
):
    """The rate of the projected gradient along the command, by central differences, is zero."""
    start = np.array(start[:n])
    stack = extended(planar_block(*[1.0] * n), start, feedforward=velocity)
    command = stack.step(start).command.copy()
    np.testing.assert_allclose(stack.step(start).levels[0].achieved, velocity, atol=1e-9)
    np.testing.assert_allclose(projected(stack, start), np.zeros(n), atol=1e-12)
    rates = []
    for sign in (1.0, -1.0):
        q = start + sign * H * command
        stack.robot.update(q)
        rates.append(projected(stack, q))
    np.testing.assert_allclose((rates[0] - rates[1]) / (2.0 * H), np.zeros(n), atol=1e-6)


@given(vectors(5, 1), vectors(5, 2), vectors(2, 1), numbers(0.2, 5))
@examples(40)
def test_far_from_the_optimum_the_projected_gradient_falls_at_its_gain(
    turn, positions, velocity, strength
):
    """Its norm by ``exp(-κ t)``, whatever the tip does meanwhile: what ∂g/∂q omits turns it."""
    q = np.array([0.3, 0.8, -0.9, 0.7, 1.0]) + 0.2 * np.array(turn)
    stack = extended(planar_block(*[1.0] * 5), positions, strength, feedforward=velocity)
    command = stack.step(q).command.copy()
    assume(np.abs(command).max() < 20.0)
    norms = []
    for shift in (0.0, H, -H):
        stack.robot.update(q + shift * command)
        norms.append(np.linalg.norm(projected(stack, q + shift * command)))
    assume(norms[0] > 1e-2)
    rate = (norms[1] - norms[2]) / (2.0 * H)
    assert rate == pytest.approx(-strength * norms[0], rel=1e-4, abs=1e-6)


@given(bent, st.integers(3, 4), vectors(4, 0.2))
@examples(15)
def test_the_extended_jacobian_comes_to_the_optimum_while_the_tip_stays(start, n, shift):
    start = np.array(start[:n])
    stack = extended(planar_block(*[1.0] * n), start + shift[:n], 2.0)
    q = start.copy()
    for _ in range(500):
        q = q + 0.02 * stack.step(q).command
    stack.step(q)
    assert np.abs(projected(stack, q)).max() < 1e-4
    assert np.abs(stack.tasks['tip'].error).max() < 1e-2


slightly_bent = st.tuples(numbers(-3, 3), numbers(0.6, 1.0), numbers(0.6, 1.0))


@given(slightly_bent, st.floats(0.1, 0.3))
@examples(6)
def test_a_closed_path_of_the_tip_is_a_closed_path_of_the_joints(start, radius):
    """On a circle that leads from the tip towards the base, away from singularities."""
    start = np.array(start)
    stack = extended(planar_block(1.0, 1.0, 1.0), start, 10.0, gain=[10.0])
    stack.robot.update(start)
    tip = stack.robot.frame('link_3').position[:2].copy()
    outward = tip / np.linalg.norm(tip)
    centre, sideward = tip - radius * outward, np.array([-outward[1], outward[0]])
    q, ends, count = start.copy(), [], 600
    step = 2.0 * np.pi / count
    for i in range(3 * count + 1):
        if i % count == 0:
            ends.append(q.copy())
        cosine, sine = np.cos(i * step), np.sin(i * step)
        stack.tasks['tip'].target = centre + radius * (cosine * outward + sine * sideward)
        stack.tasks['tip'].feedforward = radius * (cosine * sideward - sine * outward)
        q = q + step * stack.step(q).command
    assert np.abs(ends[2] - ends[1]).max() < 1e-4
    assert np.abs(ends[3] - ends[1]).max() < 1e-4


def test_an_objective_with_no_row_left_for_it_is_refused():
    with pytest.raises(InvalidValue, match='fewer than 2 rows') as caught:
        extended(planar_block(1.0, 1.0), [0.0, 0.0])
    assert caught.value.key == 'hierarchy'
