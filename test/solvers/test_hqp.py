"""The hierarchical QP as a scheme: the recursion inside bounds, with inequalities."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from lexicographic_references import Problem, cascade
from plain_levels import random_levels, resolve
from random_stacks import examples, numbers, parameters, planar_arms, positive_vectors, states
from small_arms import planar_block

from tp_controller import build_settings
from tp_controller.solvers import Bounds, HQPSolver, Inverse, RecursiveSolver

seeds = st.integers(0, 10_000)
shapes = st.lists(st.integers(1, 4), min_size=1, max_size=5)
dampings = st.just(0.0) | numbers(0.05, 1)


def schemes(n, damping=0.0, **settings):
    inverse = Inverse('dls', damping)
    return HQPSolver(n, inverse, **settings), RecursiveSolver(n, inverse, **settings)


@given(seeds, st.integers(1, 9), shapes, dampings)
@examples(200)
def test_where_no_bound_stops_it_the_answer_is_that_of_the_recursion(seed, n, rows, damping):
    levels = random_levels(seed, n, rows)
    hqp, recursive = schemes(n, damping)
    expected = resolve(recursive, levels)
    size = max(1.0, float(np.abs(expected).max()))
    np.testing.assert_array_equal(resolve(hqp, levels, 2.0 * size), expected)
    np.testing.assert_array_equal(hqp.shares, 1.0)
    # The program itself, which nothing is left to here, has the same answer.
    asked = np.concatenate([J @ expected if damping else v for J, v in levels])
    qd, wide = np.zeros(n), np.full(n, 2.0 * size)
    assert hqp.problem.solve(np.vstack([J for J, _ in levels]), asked, -wide, wide, qd)
    np.testing.assert_allclose(qd, expected, rtol=0.0, atol=1e-8 * size)


@given(seeds, st.lists(st.integers(1, 3), min_size=1, max_size=3))
@examples(50)
def test_levels_may_have_dampings_and_joints_weights_of_their_own(seed, rows):
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(5, 5))
    W = root @ root.T + np.eye(5)
    hqp, recursive = schemes(5, 0.1, joint_weights=(0.5 * (W + W.T)).ravel())
    levels = random_levels(seed, 5, rows)
    inverses = [Inverse(*choice) for choice in (('dls', 0.3), ('pinv',), ('adaptive', 0.2, 0.9))]
    inverse = [inverses[i] for i in rng.integers(3, size=len(rows))]
    expected = resolve(recursive, levels, inverse=inverse)
    np.testing.assert_allclose(resolve(hqp, levels, inverse=inverse), expected, atol=1e-8)


@given(seeds, st.lists(st.integers(1, 2), min_size=1, max_size=4), numbers(0.05, 2))
@examples(100)
def test_inside_bounds_and_with_inequalities_it_is_the_lexicographic_optimum(seed, rows, limit):
    rng = np.random.default_rng(seed)
    levels = random_levels(seed, 6, rows)
    sided = (rng.random(len(rows)) < 0.5).tolist()
    hqp, _ = schemes(6)
    qd = resolve(hqp, levels, limit, one_sided=sided)
    problem = Problem(
        np.vstack([J for J, _ in levels]),
        np.concatenate([v for _, v in levels]),
        np.cumsum([0, *rows]),
        np.repeat(sided, rows),
        np.full(6, -limit),
        np.full(6, limit),
    )
    np.testing.assert_allclose(qd, cascade(problem), atol=1e-5)


@given(seeds, st.lists(st.integers(1, 2), min_size=2, max_size=4), numbers(0.05, 2), dampings)
@examples(100)
def test_a_lower_level_never_costs_a_higher_one_anything(seed, rows, limit, damping):
    levels = random_levels(seed, 6, rows)
    everything = resolve(schemes(6, damping)[0], levels, limit)
    assert np.all(np.abs(everything) <= limit)
    for kept in range(1, len(levels)):
        alone = resolve(schemes(6, damping)[0], levels[:kept], limit)
        for J, _ in levels[:kept]:
            np.testing.assert_allclose(J @ everything, J @ alone, atol=1e-8)


def test_an_inequality_acts_where_it_stands_in_the_way_and_only_there():
    wall = (np.array([[-1.0, 0.0]]), np.array([-0.5]))
    task = (np.array([[1.0, 1.0]]), np.array([2.0]))
    sided = {'one_sided': [True, False]}
    hqp, _ = schemes(2)
    np.testing.assert_allclose(resolve(hqp, [wall, task], **sided), [0.5, 1.5], atol=1e-9)
    np.testing.assert_array_equal(hqp.acting, [True, False])
    far = (wall[0], np.array([-1.5]))
    np.testing.assert_allclose(resolve(hqp, [far, task], **sided), [1.0, 1.0], atol=1e-9)
    assert not hqp.acting.any()
    broken = (wall[0], np.array([0.3]))
    np.testing.assert_allclose(resolve(hqp, [broken, task], **sided), [-0.3, 2.3], atol=1e-9)
    np.testing.assert_array_equal(hqp.acting, [True, False])


def test_joints_at_the_ends_of_their_ranges_are_told_and_the_others_make_up_for_them():
    hqp, _ = schemes(2)
    level = (np.array([[1.0, 1.0]]), np.array([1.0]))
    resolve(hqp, [level])
    qd, inf = np.zeros(2), np.full(2, np.inf)
    upper = np.array([0.2, 3.0])
    bounds = Bounds(np.full(2, 3.0), -inf, upper, np.full(2, -3.0), upper)
    assert hqp.solve(*level, bounds, qd) == pytest.approx(1.0)
    np.testing.assert_allclose(qd, [0.2, 0.8], atol=1e-9)
    np.testing.assert_array_equal(hqp.held, [True, False])
    narrow = Bounds.of_speed(np.full(2, 0.25))
    assert hqp.solve(*level, narrow, qd) == pytest.approx(0.5)
    np.testing.assert_array_equal(hqp.held, [False, False])


@st.composite
def limited_stacks(draw):
    block = draw(parameters(robots=planar_arms(min_joints=2), dampings=dampings))
    n = len(block['robot']['joints'])
    block['robot'] = block['robot'] | {'limits': {'velocity': draw(positive_vectors(n, 0.05, 2))}}
    return block, draw(states(n))


@given(limited_stacks())
@examples(60)
def test_a_file_needs_no_other_change(case):
    """Within the limits the command stays; beyond them none is exceeded."""
    block, q = case
    recursive = build_settings(block).stack.step(q)
    stack = build_settings(block | {'solver': block['solver'] | {'type': 'hqp'}}).stack
    result = stack.step(q)
    assert np.all(np.abs(result.command) <= stack.robot.limits.velocity)
    assert 0.0 <= result.scale <= 1.0
    if recursive.scale == 1.0:
        # Where a joint is just at its limit the program is solved: to rounding the same.
        np.testing.assert_allclose(result.command, recursive.command, rtol=1e-12, atol=1e-12)


def test_a_set_based_task_that_is_out_changes_nothing():
    block = {
        'robot': planar_block(1.0, 1.0, 1.0) | {'limits': {'velocity': [1.0]}},
        'rate': 100.0,
        'solver': {'type': 'hqp'},
        'hierarchy': ['ball', 'tip'],
        'tasks': {
            'ball': {
                'type': 'obstacle',
                'frame': 'link_3',
                'center': [-2.0, -2.0],
                'radius': 0.3,
                'axes': 'xy',
            },
            'tip': {'type': 'position', 'frame': 'link_3', 'axes': 'xy', 'target': [1.0, 2.0]},
        },
    }
    q = np.array([0.4, 0.5, 0.6])
    both = build_settings(block).stack.step(q)
    alone = build_settings(block | {'hierarchy': ['tip']}).stack.step(q)
    np.testing.assert_array_equal(both.command, alone.command)
