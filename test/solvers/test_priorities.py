import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from random_stacks import (
    arms,
    examples,
    numbers,
    parameters,
    planar_arms,
    states,
    stretched_states,
    tasks,
)
from references import clear_pinv, recursion
from small_arms import planar_block

from tp_controller import build_settings

DAMPINGS = st.just(0.0) | numbers(0.01, 1)


@st.composite
def stacks_with_lower_levels(draw, robots, state_of):
    """Parameters, the number of levels that are kept, other lower tasks, and a state."""
    block = draw(parameters(robots=robots, dampings=DAMPINGS, min_levels=2))
    kept = draw(st.integers(1, len(block['hierarchy']) - 1))
    others = {
        name: draw(tasks(block['robot']))
        for level in block['hierarchy'][kept:]
        for name in level.split(' + ')
    }
    return block, kept, others, draw(state_of(len(block['robot']['joints'])))


def step(block, q, **changes):
    """Command, what every level achieves, and its Jacobian."""
    stack = build_settings(block | changes).stack
    result = stack.step(q)
    levels = []
    for level in result.levels:
        J = np.vstack([stack.tasks[name].J for name in level.tasks])
        levels.append((level.achieved.copy(), J))
    return result.command.copy(), levels


def assert_upper_levels_unmoved(case):
    block, kept, others, q = case
    alone = step(block, q, hierarchy=block['hierarchy'][:kept])
    with_lower = step(block, q)
    with_others = step(block, q, tasks=block['tasks'] | others)
    # Where a rank hangs on rounding there is no telling what a lower level may use.
    _, shares = recursion([(J, np.zeros(len(J))) for _, J in with_lower[1]], 0.0)
    assume(not np.any((shares > 1e-13) & (shares < 1e-7)))
    for command, levels in (with_lower, with_others):
        size = max(1.0, float(np.abs(command).max()), float(np.abs(alone[0]).max()))
        for (achieved, _), (expected, J) in zip(levels[:kept], alone[1], strict=True):
            tolerance = 1e-9 * size * max(1.0, float(np.linalg.norm(J)))
            assert np.abs(achieved - expected).max() <= tolerance


@given(stacks_with_lower_levels(arms(), states))
@examples(100)
def test_a_lower_level_never_changes_what_a_higher_level_achieves(case):
    assert_upper_levels_unmoved(case)


@given(stacks_with_lower_levels(planar_arms(min_joints=2), stretched_states))
@examples(100)
def test_a_lower_level_changes_nothing_above_it_on_an_arm_along_a_line(case):
    """Stretched or folded exactly: the position task has lost a direction."""
    assert_upper_levels_unmoved(case)


@given(stacks_with_lower_levels(arms(), lambda n: st.just(np.zeros(n))))
@examples(50)
def test_a_lower_level_changes_nothing_above_it_at_the_zero_configuration(case):
    assert_upper_levels_unmoved(case)


@pytest.mark.parametrize('damping', [0.0, 0.1, 1.0])
def test_on_a_stretched_arm_only_the_damping_of_a_level_shortens_what_it_achieves(damping):
    """Along the arm nothing can move; across it the level gets s² / (s² + λ²) of its wish."""
    block = {
        'robot': planar_block(1.0, 1.0, 1.0),
        'solver': {'damping': damping},
        'hierarchy': ['tip', 'first_joint'],
        'tasks': {
            'tip': {'type': 'position', 'frame': 'link_3', 'axes': 'xy', 'target': [2.0, 1.0]},
            'first_joint': {'type': 'joint', 'joints': ['joint_1'], 'target': [5.0]},
        },
    }
    _, levels = step(block, np.zeros(3))
    square = 3.0**2 + 2.0**2 + 1.0**2
    expected = [0.0, square / (square + damping**2)]
    np.testing.assert_allclose(levels[0][0], expected, atol=1e-12)


@given(stacks_with_lower_levels(arms(), states))
@examples(60)
def test_without_damping_a_level_gets_all_that_its_freedom_allows(case):
    """What is left of its wish lies outside the reach of J P: (J P)ᵀ (wish - got) = 0."""
    block, _, _, q = case
    stack = build_settings(block | {'solver': {'damping': 0.0, 'settle': False}}).stack
    result = stack.step(q)
    P = np.eye(len(q))
    levels = []
    for level in result.levels:
        J = np.vstack([stack.tasks[name].J for name in level.tasks])
        levels.append((J, level.requested - level.achieved))
    _, shares = recursion([(J, wish) for J, wish in levels], 0.0)
    assume(not np.any((shares > 1e-13) & (shares < 1e-3)))
    size = max(1.0, float(np.abs(result.command).max()))
    for J, left in levels:
        J_bar = J @ P
        scale = max(1.0, float(np.linalg.norm(J))) ** 2
        assert np.abs(J_bar.T @ left).max() <= 1e-9 * size * scale
        P -= clear_pinv(J_bar, 1e-8 * np.linalg.norm(J)) @ J_bar
