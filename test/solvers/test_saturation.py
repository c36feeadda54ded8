"""Saturation that keeps priorities: joints are held, levels are scaled from the lowest up."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from plain_levels import random_levels, resolve
from random_stacks import (
    arms,
    examples,
    numbers,
    parameters,
    planar_arms,
    positive_vectors,
    states,
)
from references import away_from_rank_changes, recursion
from small_arms import planar_block

from tp_controller import InvalidValue, build_settings, read_parameter_file, solve
from tp_controller.solvers import Inverse, RecursiveSolver

seeds = st.integers(0, 10_000)
shapes = st.lists(st.integers(1, 3), min_size=1, max_size=4)


def holding(n, damping=0.0, **settings):
    return RecursiveSolver(n, Inverse('dls', damping), saturation='null_space', **settings)


def shares(solver):
    return solver.shares


@given(seeds, shapes, numbers(0.05, 3), st.sampled_from([0.0, 0.1]))
@examples(150)
def test_no_joint_ever_exceeds_its_limit(seed, rows, limit, damping):
    levels = random_levels(seed, 6, rows)
    limits = limit * np.random.default_rng(seed).uniform(0.2, 1.0, 6)
    qd = resolve(holding(6, damping), levels, limits)
    assert np.all(np.abs(qd) <= limits)


@given(seeds, shapes, st.sampled_from([0.0, 0.1]))
@examples(80)
def test_within_the_limits_nothing_changes(seed, rows, damping):
    levels = random_levels(seed, 6, rows)
    plain = resolve(RecursiveSolver(6, Inverse('dls', damping)), levels)
    solver = holding(6, damping)
    np.testing.assert_allclose(resolve(solver, levels, 1e9), plain, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(resolve(solver, levels), plain, rtol=1e-9, atol=1e-12)
    np.testing.assert_array_equal(shares(solver), 1.0)


@given(seeds, st.lists(st.integers(1, 2), min_size=2, max_size=4), numbers(0.05, 2))
@examples(150)
def test_a_lower_level_never_costs_a_higher_one_anything(seed, rows, limit):
    levels = random_levels(seed, 6, rows)
    everything = resolve(holding(6), levels, limit)
    for kept in range(1, len(levels)):
        alone = resolve(holding(6), levels[:kept], limit)
        for J, _ in levels[:kept]:
            np.testing.assert_allclose(J @ everything, J @ alone, atol=1e-9)


@pytest.mark.parametrize('scheme', ['recursive', 'hqp'])
def test_rounding_does_not_decide_what_lower_levels_get(config, scheme):
    """Levels above leave joints at their limits, to the last bits."""
    values = read_parameter_file(config / 'panda.yaml', 'tp_controller')
    stack = build_settings(values).stack
    limits = stack.robot.limits
    rng = np.random.default_rng(3)
    for _ in range(40):
        q = rng.uniform(limits.position_min, limits.position_max)
        levels = [
            (level.J, 3.0 * rng.normal(size=len(level.J))) for level in stack.problem(q).levels
        ]
        found = []
        for noise in (0.0, 1e-13, 1e-13, 1e-13):
            noisy = [
                (J * (1.0 + noise * rng.normal(size=J.shape)), v * (1.0 + noise * rng.normal()))
                for J, v in levels
            ]
            bounds = -limits.velocity, limits.velocity
            found.append(solve(noisy, *bounds, scheme, inverse='adaptive').velocity)
        np.testing.assert_allclose(found[1:], [found[0]] * 3, atol=1e-6)


@given(seeds, st.integers(1, 3), numbers(0.05, 2))
@examples(150)
def test_what_a_level_gets_is_its_share_of_what_it_asks_for(seed, rows, limit):
    """Exactly along it, at least as much as scaling the shortest answer would give."""
    ((J, v),) = levels = random_levels(seed, 6, [rows])
    solver = holding(6)
    qd = resolve(solver, levels, limit)
    (share,) = shares(solver)
    np.testing.assert_allclose(J @ qd, share * v, atol=1e-9)
    uniform = min(1.0, limit / np.abs(np.linalg.pinv(J) @ v).max())
    assert share >= uniform - 1e-12


@given(seeds, st.integers(2, 3), numbers(0.05, 1))
@examples(100)
def test_one_row_gets_all_that_the_joints_can_give(seed, n, limit):
    """The most that J qd can be inside the box is Σ |J| limit: then a bang-bang velocity."""
    ((J, v),) = levels = random_levels(seed, n, [1])
    solver = holding(n)
    qd = resolve(solver, levels, limit)
    most = limit * float(np.abs(J).sum())
    assert abs(float(J[0] @ qd)) == pytest.approx(min(most, abs(v[0])), rel=1e-9)
    assert shares(solver)[0] == pytest.approx(min(1.0, most / abs(v[0])), rel=1e-9)


def test_another_joint_makes_up_for_one_that_is_at_its_limit():
    levels = [(np.array([[1.0, 1.0]]), np.array([2.5]))]
    limits = np.array([1.0, 2.0])
    np.testing.assert_allclose(resolve(holding(2), levels, limits), [1.0, 1.5])
    uniform = resolve(RecursiveSolver(2, Inverse('pinv'), saturation='uniform'), levels, limits)
    np.testing.assert_allclose(uniform, [1.0, 1.0])


def test_the_lowest_level_is_the_first_to_be_scaled():
    levels = [
        (np.array([[1.0, 1.0, 0.0]]), np.array([1.0])),
        (np.array([[0.0, 0.0, 1.0]]), np.array([4.0])),
    ]
    solver = holding(3)
    qd = resolve(solver, levels, 1.0)
    np.testing.assert_allclose(qd, [0.5, 0.5, 1.0])
    np.testing.assert_allclose(shares(solver), [1.0, 0.25])


@given(seeds, st.lists(st.integers(1, 2), min_size=1, max_size=3), numbers(0.05, 2))
@examples(60)
def test_joint_weights_do_not_break_the_limits_or_the_priorities(seed, rows, limit):
    root = np.random.default_rng(seed).normal(size=(5, 5))
    W = root @ root.T + np.eye(5)
    weights = (0.5 * (W + W.T)).ravel()
    levels = random_levels(seed, 5, rows)
    qd = resolve(holding(5, joint_weights=weights), levels, limit)
    assert np.all(np.abs(qd) <= limit)
    alone = resolve(holding(5, joint_weights=weights), levels[:1], limit)
    np.testing.assert_allclose(levels[0][0] @ qd, levels[0][0] @ alone, atol=1e-8)


@st.composite
def limited_stacks(draw):
    robots = arms(min_joints=2, max_joints=7) | planar_arms(min_joints=2)
    block = draw(parameters(robots=robots, dampings=st.just(0.0) | numbers(0.05, 1)))
    n = len(block['robot']['joints'])
    block['robot'] = block['robot'] | {'limits': {'velocity': draw(positive_vectors(n, 0.05, 2))}}
    block['solver'] = block['solver'] | {'saturation': 'null_space'}
    return block, draw(states(n))


@given(limited_stacks())
@examples(100)
def test_on_random_robots_limits_hold_and_lower_levels_cost_nothing(case):
    block, q = case
    stack = build_settings(block).stack
    result = stack.step(q)
    assert np.all(np.abs(result.command) <= stack.robot.limits.velocity)
    assert 0.0 <= result.scale <= 1.0
    everything = [level.achieved.copy() for level in result.levels]
    Js = [np.vstack([stack.tasks[name].J for name in level.tasks]) for level in result.levels]
    _, found = recursion([(J, np.zeros(len(J))) for J in Js], 0.0)
    assume(away_from_rank_changes(found, 1e-13, 1e-6))
    alone = build_settings(block | {'hierarchy': block['hierarchy'][:1]}).stack.step(q)
    size = max(1.0, float(np.abs(Js[0]).max()))
    np.testing.assert_allclose(everything[0], alone.levels[0].achieved, atol=1e-8 * size)


@pytest.mark.parametrize('scheme', ['augmented', 'weighted', 'projected_gradient'])
def test_every_scheme_may_hold_joints(scheme):
    block = {
        'robot': planar_block(1.0, 1.0, 1.0, 1.0) | {'limits': {'velocity': [0.3]}},
        'solver': {
            'type': scheme,
            'inverse': 'pinv',
            'saturation': 'null_space',
            'objective': {'type': 'posture', 'positions': [0.0] * 4},
        },
        'hierarchy': ['tip'],
        'tasks': {
            'tip': {'type': 'position', 'frame': 'link_4', 'axes': 'xy', 'target': [1.0, 1.0]}
        },
    }
    result = build_settings(block).stack.step(np.array([0.4, 0.5, 0.6, 0.7]))
    assert np.abs(result.command).max() == pytest.approx(0.3)
    (level,) = result.levels
    along = level.achieved @ level.requested / (level.requested @ level.requested)
    np.testing.assert_allclose(level.achieved, along * level.requested, atol=1e-9)
    assert result.scale <= along + 1e-9


def test_a_saturation_that_is_none_is_refused():
    with pytest.raises(InvalidValue, match='one of null_space, uniform') as caught:
        RecursiveSolver(3, saturation='clip')
    assert caught.value.key == 'solver.saturation'
