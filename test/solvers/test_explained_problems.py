"""Explanations of solutions, without a stack and beside the one of a stack."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from random_stacks import examples
from test_values import SMALL, stack_of
from value_cases import HIERARCHIES, near_edges

from tp_controller import InvalidValue, Level, Problem, explain, explain_step, solve

PARTS = (
    'shortfall',
    'lost_to_singularity',
    'lost_to_damping',
    'lost_to_saturation',
    'lost_to_guard',
    'smallest_singular_value',
)


@given(
    st.integers(0, 2**32 - 1),
    st.sampled_from(HIERARCHIES),
    st.sampled_from(['recursive', 'hqp']),
)
@examples(60)
def test_a_problem_is_explained_as_the_step_of_its_stack(seed, hierarchy, scheme):
    stack, rng = stack_of(seed, hierarchy, scheme, SMALL, 20.0)
    q = near_edges(rng)
    problem = stack.problem(q)
    solution = solve(problem, **stack.solver.settings)
    command = stack.step(q).command
    of_problem, of_step = explain(problem, solution, command), explain_step(stack)
    for one, other in zip(of_problem, of_step, strict=True):
        assert (one.tasks, one.rows, one.rank) == (other.tasks, other.rows, other.rank)
        assert sorted(one.active_rows) == sorted(other.active_rows)
        assert one.joints_at_bound == other.joints_at_bound
        assert one.lost_to_levels.keys() == other.lost_to_levels.keys()
        for name, amount in one.lost_to_levels.items():
            assert amount == pytest.approx(other.lost_to_levels[name], abs=1e-5)
        for part in PARTS:
            assert getattr(one, part) == pytest.approx(getattr(other, part), abs=1e-5), part


def test_a_joint_at_its_bound_is_named():
    problem = Problem([(np.eye(2), [3.0, 0.5])], -1.0, 1.0, joints=['hip', 'knee'])
    for scheme in ('recursive', 'hqp'):
        solution = solve(problem, scheme=scheme, inverse='pinv')
        (level,) = explain(problem, solution)
        assert level.joints_at_bound == ('hip',), scheme
        assert level.requested.tolist() == [3.0, 0.5]
        assert level.achieved[0] == pytest.approx(1.0)
        lost = sum(level.lost_to_levels.values()) + level.lost_to_saturation
        assert lost == pytest.approx(level.shortfall)
        assert level.tasks == ('level 0',)


def test_an_inequality_row_that_holds_a_level_up_is_named_with_its_level():
    wall = Level(C=[[-1.0, 0.0]], least=[-0.2], tasks=['wall'], row_names=['wall x'])
    problem = Problem([wall, ([[1.0, 0.0]], [1.0]), ([[0.0, 1.0]], [0.3])])
    for scheme in ('recursive', 'hqp'):
        solution = solve(problem, scheme=scheme, inverse='pinv')
        above, blocked, free = explain(problem, solution)
        assert above.active_rows == ('wall x',)
        assert blocked.lost_to_levels == {'wall': pytest.approx(0.8)}
        assert blocked.text == '0.8 to wall'
        assert (free.text, free.active_rows) == ('', ())


def test_a_higher_level_is_named_by_its_index():
    problem = Problem([([1.0, 1.0], [1.0]), ([1.0, 1.0], [3.0])])
    second = explain(problem, solve(problem, inverse='pinv'))[1]
    assert second.lost_to_levels == {'level 0': pytest.approx(2.0)}


def test_directions_that_no_joint_can_move_are_given():
    problem = Problem([([[1.0, 0.0], [0.0, 0.0], [1.0, 0.0]], [1.0, 2.0, 1.0])])
    (level,) = explain(problem, solve(problem, inverse='pinv'))
    # Rows without a joint ask for something, so that they act.
    assert level.lost_to_singularity == pytest.approx(2.0)
    directions = level.singular_directions
    assert directions.shape == (2, 3)
    np.testing.assert_allclose(directions @ directions.T, np.eye(2), atol=1e-12)
    np.testing.assert_allclose(directions @ np.array([1.0, 0.0, 1.0]), 0.0, atol=1e-12)


def test_a_command_other_than_the_answer_is_told_apart():
    problem = Problem([(np.eye(2), [1.0, 0.0])])
    solution = solve(problem, inverse='pinv')
    (level,) = explain(problem, solution, [0.4, 0.0])
    assert level.lost_to_guard == pytest.approx(0.6)
    assert level.text == '0.6 to acceleration limits or braking'
    with pytest.raises(InvalidValue, match='command'):
        explain(problem, solution, [0.0])


def test_the_answer_of_another_problem_is_refused():
    problem, other = Problem([(np.eye(2), [1.0, 0.0])]), Problem([(np.eye(3), np.zeros(3))])
    with pytest.raises(InvalidValue, match='solution'):
        explain(problem, solve(other))


def test_schemes_without_levels_explain_nothing():
    problem = Problem([(np.eye(2), [1.0, 0.0])])
    assert explain(problem, solve(problem, scheme='augmented')) == ()
