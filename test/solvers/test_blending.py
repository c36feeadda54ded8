"""Transitions between the answers to two problems."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from random_stacks import examples
from value_cases import HIERARCHIES, PERIOD, every_task, near_edges, spatial

from tp_controller import InvalidValue, Level, Problem, Stack, blend, solve

seeds = st.integers(0, 2**32 - 1)
shares = st.floats(0.0, 1.0)
schemes = st.sampled_from(['recursive', 'hqp'])


def problem(rng, n, above=None, low=-1.0, high=1.0):
    """Random levels, below rows that are given."""
    levels = [] if above is None else [above]
    levels += [Level(rng.normal(size=(k, n)), rng.normal(size=k)) for k in (2, 1)]
    return Problem(levels, low, high)


@given(seeds, shares, schemes)
@examples(100)
def test_joint_bounds_and_inequality_rows_of_both_are_kept(seed, share, scheme):
    rng = np.random.default_rng(seed)
    n = 5
    C, least = rng.normal(size=(2, n)), -rng.uniform(0.0, 0.3, 2)
    low, high = -rng.uniform(0.1, 1.0, n), rng.uniform(0.1, 1.0, n)
    both = [problem(rng, n, Level(C=C, least=least), low, high) for _ in range(2)]
    found = blend(*both, share, scheme)
    qd = found.velocity
    assert np.all((low <= qd) & (qd <= high))
    assert np.all(C @ qd >= least - 1e-6)
    for answer, one in zip((found.first, found.second), both, strict=True):
        np.testing.assert_array_equal(answer.velocity, solve(one, scheme=scheme).velocity)


@given(seeds, schemes)
@examples(50)
def test_the_ends_are_the_two_answers_to_the_last_bit(seed, scheme):
    rng = np.random.default_rng(seed)
    both = [problem(rng, 4) for _ in range(2)]
    for share, one in zip((0.0, 1.0), both, strict=True):
        expected = solve(one, scheme=scheme).velocity
        np.testing.assert_array_equal(blend(*both, share, scheme).velocity, expected)


@given(seeds, shares, shares)
@examples(50)
def test_the_velocity_is_continuous_in_the_share(seed, one, other):
    rng = np.random.default_rng(seed)
    both = [problem(rng, 4) for _ in range(2)]
    found = [blend(*both, share) for share in (one, other)]
    gap = np.abs(found[0].second.velocity - found[0].first.velocity)
    change = np.abs(found[1].velocity - found[0].velocity)
    assert np.all(change <= abs(other - one) * gap + 1e-12)


@given(seeds, shares)
@examples(50)
def test_a_level_that_both_meet_is_met_in_between(seed, share):
    rng = np.random.default_rng(seed)
    above = Level(rng.normal(size=(2, 6)), 0.1 * rng.normal(size=2))
    both = [problem(rng, 6, above, -9.0, 9.0) for _ in range(2)]
    found = blend(*both, share, inverse='pinv')
    for answer in (found.first, found.second):
        np.testing.assert_allclose(answer.levels[0].achieved, above.velocity, atol=1e-9)
    np.testing.assert_allclose(above.J @ found.velocity, above.velocity, atol=1e-9)


@given(seeds, st.sampled_from(HIERARCHIES), st.sampled_from(HIERARCHIES), shares)
@examples(20)
def test_stacks_of_one_robot_blend_inside_the_bounds_of_the_step(seed, one, other, share):
    robot = spatial(acceleration=20.0)
    tasks = every_task(robot)
    stack = Stack(robot, [tasks['tip']], rate=1.0 / PERIOD, tasks=list(tasks.values()))
    q = near_edges(np.random.default_rng(seed))
    both = []
    for hierarchy in (one, other):
        stack.hierarchy = hierarchy
        both.append(stack.problem(q))
    np.testing.assert_array_equal(both[0].low, both[1].low)
    qd = blend(*both, share).velocity
    assert np.all((both[0].low <= qd) & (qd <= both[0].high))


def test_a_transition_between_hierarchies_has_no_step_in_the_velocity():
    robot = spatial()
    tasks = every_task(robot)
    tasks['posture'].target = [0.0] * 6
    stack = Stack(robot, [tasks['tip']], rate=1.0 / PERIOD, tasks=list(tasks.values()))
    q, wishes, ends = np.full(6, 0.4), [], []
    for share in np.linspace(0.0, 1.0, 101):
        both = []
        for hierarchy in (['tip', 'posture'], ['turn', 'posture']):
            stack.hierarchy = hierarchy
            both.append(stack.problem(q))
        found = blend(*both, share)
        wishes.append(found.velocity)
        ends.append([found.first.velocity, found.second.velocity])
        q = q + PERIOD * stack.safety_filter.step(found.velocity, q)
        if share == 0.0:
            step = np.abs(found.second.velocity - found.first.velocity).max()
    assert step > 0.5
    # Joints that leave a limit change what either hierarchy asks for from step to step.
    own = np.abs(np.diff(ends, axis=0)).max(axis=(1, 2))
    assert np.all(np.abs(np.diff(wishes, axis=0)).max(axis=1) < own + 0.03 * step)


@pytest.mark.parametrize('share', [-0.1, 1.1, np.nan])
def test_other_shares_are_refused(share):
    rng = np.random.default_rng(0)
    with pytest.raises(InvalidValue, match=r'share.*from 0 to 1'):
        blend(problem(rng, 3), problem(rng, 3), share)


def test_problems_of_other_joints_are_refused():
    rng = np.random.default_rng(0)
    with pytest.raises(InvalidValue, match='second'):
        blend(problem(rng, 3), problem(rng, 4), 0.5)
    named = [problem(rng, 2)._replace(joints=names) for names in (['a', 'b'], ['a', 'c'])]
    with pytest.raises(InvalidValue, match='second'):
        blend(*named, 0.5)
