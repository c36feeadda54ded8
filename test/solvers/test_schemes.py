"""Every scheme by its defining equations, on plain numbers and on random stacks."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from plain_levels import random_levels, resolve
from random_stacks import arms, examples, numbers, parameters, planar_arms, states
from references import away_from_rank_changes, clear_pinv, recursion
from small_arms import planar_block, planar_robot

from tp_controller import InvalidValue, build_settings
from tp_controller.objectives import PostureObjective
from tp_controller.solvers import (
    AugmentedSolver,
    ExtendedJacobianSolver,
    Inverse,
    ProjectedGradientSolver,
    RecursiveSolver,
    WeightedSolver,
)

shapes = st.lists(st.integers(1, 4), min_size=1, max_size=4)
seeds = st.integers(0, 10_000)
dampings = st.just(0.0) | numbers(0.05, 1)


def stacked(levels):
    return np.vstack([J for J, _ in levels]), np.concatenate([v for _, v in levels])


def damped(damping):
    return Inverse('dls', damping)


@given(seeds, st.integers(2, 9), shapes, dampings)
@examples(100)
def test_augmented_leaves_the_smallest_stacked_residual(seed, n, rows, damping):
    """``‖J qd - v‖² + λ² ‖qd‖²`` has no slope at the answer, which is the shortest one."""
    levels = random_levels(seed, n, rows)
    J, v = stacked(levels)
    qd = resolve(AugmentedSolver(n, damped(damping)), levels)
    np.testing.assert_allclose(J.T @ (J @ qd - v) + damping**2 * qd, np.zeros(n), atol=1e-9)
    expected = np.linalg.lstsq(
        np.vstack([J, damping * np.eye(n)]), np.append(v, np.zeros(n)), rcond=None
    )[0]
    np.testing.assert_allclose(qd, expected, atol=1e-8)


@given(seeds, shapes, st.randoms(use_true_random=False))
@examples(50)
def test_the_order_of_levels_does_not_matter_to_augmented(seed, rows, random):
    levels = random_levels(seed, 7, rows)
    shuffled = random.sample(levels, len(levels))
    qd = resolve(AugmentedSolver(7, damped(0.1)), levels)
    np.testing.assert_allclose(resolve(AugmentedSolver(7, damped(0.1)), shuffled), qd, atol=1e-10)


@given(seeds, st.integers(2, 9), shapes, dampings, st.lists(numbers(0.1, 9), min_size=4))
@examples(100)
def test_weighted_leaves_the_smallest_weighted_sum_of_squares(seed, n, rows, damping, weights):
    levels = random_levels(seed, n, rows)
    weights = weights[: len(levels)]
    qd = resolve(WeightedSolver(n, damped(damping)), levels, weight=weights)
    slope = damping**2 * qd
    for (J, v), weight in zip(levels, weights, strict=True):
        slope = slope + weight * J.T @ (J @ qd - v)
    np.testing.assert_allclose(slope, np.zeros(n), atol=1e-8)


def test_a_great_weight_comes_close_to_a_strict_priority():
    levels = random_levels(11, 4, [3, 3])
    strict = resolve(RecursiveSolver(4, damped(0.0)), levels)
    gaps = [
        np.linalg.norm(
            resolve(WeightedSolver(4, damped(0.0)), levels, weight=[weight, 1.0]) - strict
        )
        for weight in (1.0, 1e2, 1e4, 1e6)
    ]
    assert gaps == sorted(gaps, reverse=True)
    assert gaps[0] > 0.1
    assert gaps[-1] < 1e-4


@given(seeds, st.lists(st.integers(1, 3), min_size=1, max_size=3))
@examples(60)
def test_a_square_extended_jacobian_has_one_answer_that_meets_every_task(seed, rows):
    n = sum(rows)
    levels = random_levels(seed, n, rows)
    J, v = stacked(levels)
    assume(np.linalg.cond(J) < 1e4)
    qd = resolve(ExtendedJacobianSolver(n, Inverse('pinv')), levels)
    np.testing.assert_allclose(J @ qd, v, atol=1e-8)
    recursive = resolve(RecursiveSolver(n, Inverse('pinv')), levels)
    np.testing.assert_allclose(qd, recursive, atol=1e-7)


@pytest.mark.parametrize('rows', [[2], [2, 2, 1], [6]])
def test_an_extended_jacobian_that_is_not_square_is_refused(rows):
    with pytest.raises(InvalidValue, match='tasks of 4 rows together') as caught:
        resolve(ExtendedJacobianSolver(4), random_levels(0, 4, rows))
    assert caught.value.key == 'hierarchy'
    assert f'{sum(rows)} rows for 4 joints' in str(caught.value)


def weighted_inverse(J, W, damping):
    """``W⁻¹ Jᵀ (J W⁻¹ Jᵀ + λ² I)⁻¹``."""
    WJ = np.linalg.solve(W, J.T)
    return WJ @ np.linalg.inv(J @ WJ + damping**2 * np.eye(len(J)))


def random_weights(seed, n):
    root = np.random.default_rng(seed).normal(size=(n, n))
    W = root @ root.T + 0.2 * np.eye(n)
    return 0.5 * (W + W.T)


@given(seeds, st.integers(1, 3), dampings)
@examples(60)
def test_joint_weights_give_the_answer_of_the_smallest_weighted_norm(seed, rows, damping):
    levels, W = random_levels(seed, 5, [rows]), random_weights(seed, 5)
    J, v = levels[0]
    assume(np.linalg.cond(J) < 1e3)
    solver = RecursiveSolver(5, damped(damping), W.ravel())
    expected = weighted_inverse(J, W, damping) @ v
    np.testing.assert_allclose(resolve(solver, levels), expected, atol=1e-8)


@given(seeds, st.lists(st.integers(1, 3), min_size=2, max_size=4), dampings)
@examples(60)
def test_joint_weights_are_the_plain_recursion_in_other_coordinates(seed, rows, damping):
    """With W = L Lᵀ and y = Lᵀ qd the weighted norm of qd is the plain one of y."""
    levels, W = random_levels(seed, 6, rows), random_weights(seed, 6)
    T = np.linalg.inv(np.linalg.cholesky(W)).T
    y, shares = recursion([(J @ T, v) for J, v in levels], damping)
    assume(away_from_rank_changes(shares))
    solver = RecursiveSolver(6, damped(damping), W.ravel())
    np.testing.assert_allclose(resolve(solver, levels), T @ y, atol=1e-7)


def test_a_heavy_joint_moves_less():
    levels = [(np.array([[1.0, 1.0]]), np.array([1.0]))]
    qd = resolve(RecursiveSolver(2, Inverse('pinv'), [4.0, 1.0]), levels)
    np.testing.assert_allclose(qd, [0.2, 0.8], atol=1e-12)


@pytest.mark.parametrize(
    'weights', [[0.0], [1.0, -1.0, 1.0], [1.0, 2.0], [1, 2, 0, 0, 1, 0, 0, 0, 1], [np.inf]]
)
def test_joint_weights_that_are_no_metric_are_refused(weights):
    with pytest.raises(InvalidValue) as caught:
        RecursiveSolver(3, joint_weights=weights)
    assert caught.value.key == 'solver.joint_weights'


def filtered(J, v, rule):
    """Answer whose every direction is scaled by a rule of its singular value."""
    U, s, Vt = np.linalg.svd(J, full_matrices=False)
    return Vt.T @ (np.array([rule(x) for x in s]) * (U.T @ v))


@given(seeds, st.integers(1, 5), numbers(0.05, 1), numbers(0.1, 3))
@examples(80)
def test_adaptive_damping_sets_in_below_the_region_by_its_formula(seed, rows, damping, region):
    J, v = random_levels(seed, 5, [rows])[0]

    def rule(s):
        square = damping**2 * (1.0 - (s / region) ** 2) if s < region else 0.0
        return s / (s * s + square)

    solver = RecursiveSolver(5, Inverse('adaptive', damping, region))
    np.testing.assert_allclose(resolve(solver, [(J, v)]), filtered(J, v, rule), atol=1e-8)


@given(seeds, st.integers(1, 5))
@examples(40)
def test_away_from_singularities_adaptive_damping_is_the_pseudo_inverse(seed, rows):
    J, v = random_levels(seed, 5, [rows])[0]
    smallest = np.linalg.svd(J, compute_uv=False)[-1]
    solver = RecursiveSolver(5, Inverse('adaptive', 0.5, 0.99 * float(smallest)))
    np.testing.assert_allclose(resolve(solver, [(J, v)]), np.linalg.pinv(J) @ v, atol=1e-9)


def test_the_command_is_continuous_and_bounded_while_a_direction_is_lost():
    """Through s = 0 no step is larger than the grid's; the pseudo-inverse would exceed 1e5."""
    solver = RecursiveSolver(2, Inverse('adaptive', 0.1, 0.3))
    shares = np.linspace(-0.5, 0.5, 20_001)
    commands = np.array(
        [resolve(solver, [(np.diag([1.0, s]), np.array([1.0, 1.0]))]) for s in shares]
    )
    assert np.abs(np.diff(commands, axis=0)).max() < 0.006
    assert np.abs(commands).max() < 1.0 / (2.0 * 0.1) * 1.2
    np.testing.assert_allclose(commands[:, 0], 1.0, atol=1e-12)


@given(seeds, st.lists(st.integers(1, 3), min_size=2, max_size=3), dampings)
@examples(50)
def test_a_level_may_have_an_inverse_of_its_own(seed, rows, damping):
    """Its own damping acts on it alone, and on the levels below through what it leaves."""
    levels = random_levels(seed, 6, rows)
    own = [Inverse('dls', damping)] + [Inverse()] * (len(levels) - 1)
    qd = resolve(RecursiveSolver(6, Inverse('pinv')), levels, inverse=own)
    J, v = levels[0]
    expected = J.T @ np.linalg.solve(J @ J.T + damping**2 * np.eye(len(J)), v)
    P = np.eye(6) - np.linalg.pinv(J) @ J
    for J, v in levels[1:]:
        inverse = clear_pinv(J @ P, 1e-6 * np.linalg.norm(J))
        expected = expected + inverse @ (v - J @ expected)
        P = P - inverse @ J @ P
    np.testing.assert_allclose(qd, expected, atol=1e-7)


def test_what_a_task_leaves_open_comes_from_the_solver():
    levels = random_levels(3, 4, [2, 2])
    expected = resolve(RecursiveSolver(4, Inverse('dls', 0.3)), levels)
    solver = RecursiveSolver(4, Inverse('pinv', 0.3))
    qd = resolve(solver, levels, inverse=[Inverse('dls'), Inverse('dls')])
    np.testing.assert_array_equal(qd, expected)


def test_tasks_that_are_inverted_together_must_agree_on_the_inverse():
    levels = random_levels(3, 4, [2, 2])
    inverses = [Inverse(), Inverse(damping=0.5)]
    resolve(RecursiveSolver(4), levels, inverse=inverses)
    resolve(AugmentedSolver(4, damped(0.5)), levels, inverse=inverses)
    with pytest.raises(InvalidValue, match='inverts them together') as caught:
        resolve(AugmentedSolver(4), levels, inverse=inverses)
    assert caught.value.key == 'hierarchy'
    assert 'level_1' in str(caught.value)


OBJECTIVES = st.sampled_from(['posture', 'joint_range', 'manipulability'])


@st.composite
def stacks_with_an_objective(draw):
    """A stack whose levels leave freedom, an objective, and a state."""
    robot = draw(arms(min_joints=4, max_joints=7) | planar_arms(min_joints=4))
    n = len(robot['joints'])
    block = draw(parameters(robots=st.just(robot), max_levels=1, dampings=st.just(0.0)))
    kind = draw(OBJECTIVES)
    objective = {'type': kind, 'gain': draw(numbers(0.1, 2))}
    if kind == 'posture':
        objective['positions'] = draw(states(n)).tolist()
    if kind == 'joint_range':
        robot['limits'] = {'position_min': [-5.0], 'position_max': [6.0]}
        # So fast that nothing reaches an end in one step.
        block['rate'] = 1e6
    if kind == 'manipulability':
        objective |= {'frame': f'link_{n}', 'position_axes': 'xy'}
    block['solver'] |= {'type': 'projected_gradient', 'objective': objective}
    return block, draw(states(n))


@given(stacks_with_an_objective())
@examples(80)
def test_projected_gradient_adds_the_gradient_in_what_the_tasks_leave(case):
    block, q = case
    stack = build_settings(block).stack
    plain = build_settings(block | {'solver': {'damping': 0.0}}).stack
    stack.settle = plain.settle = False
    command, expected = stack.step(q).command, plain.step(q).command.copy()
    J = np.vstack([plain.tasks[name].J for name in plain.hierarchy[0].split(' + ')])
    # Rows of nothing but rounding are rows of zeros.
    J = J * (np.linalg.norm(J, axis=1, keepdims=True) > 1e-13)
    assume(
        away_from_rank_changes(np.linalg.svd(J, compute_uv=False) / max(np.linalg.norm(J), 1e-300))
    )
    gradient = np.zeros(len(q))
    stack.solver.objective.gradient(gradient)
    P = np.eye(len(q)) - np.linalg.pinv(J, rcond=1e-8) @ J
    expected += stack.solver.objective.gain * P @ gradient
    size = max(1.0, float(np.abs(expected).max()))
    np.testing.assert_allclose(command, expected, atol=1e-8 * size)


@given(seeds, st.lists(st.integers(1, 2), min_size=1, max_size=2), dampings, numbers(0.1, 3))
@examples(60)
def test_projected_gradient_with_joint_weights_projects_in_their_metric(seed, rows, damping, gain):
    """What the levels leave free, and nothing else, is nearest to the gradient in the metric."""
    levels, W = random_levels(seed, 6, rows), random_weights(seed, 6)
    J, _ = stacked(levels)
    assume(np.linalg.cond(J) < 1e3)
    objective = PostureObjective(planar_robot(*[1.0] * 6), np.arange(6) / 3)
    objective.gain = gain
    gradient = np.zeros(6)
    objective.climb(gradient)
    inverse = damped(damping)
    plain = resolve(RecursiveSolver(6, inverse, W.ravel()), levels)
    qd = resolve(ProjectedGradientSolver(6, inverse, W.ravel(), objective), levels)
    np.testing.assert_allclose(J @ qd, J @ plain, atol=1e-8)
    Z = np.linalg.svd(J)[2][len(J) :].T
    np.testing.assert_allclose(Z.T @ W @ (qd - gradient), np.zeros(6 - len(J)), atol=1e-7)


def test_projected_gradient_needs_an_objective():
    block = {
        'robot': planar_block(1.0, 1.0, 1.0),
        'solver': {'type': 'projected_gradient'},
        'hierarchy': ['tip'],
        'tasks': {'tip': {'type': 'position', 'frame': 'link_3', 'axes': 'xy'}},
    }
    with pytest.raises(InvalidValue) as caught:
        build_settings(block)
    assert caught.value.key == 'solver.objective.type'
    assert 'posture, joint_range, manipulability' in str(caught.value)
