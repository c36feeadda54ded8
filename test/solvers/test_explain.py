"""What each level lost, and to whom."""

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
    positive_vectors,
    states,
)
from references import away_from_rank_changes, recursion
from small_arms import planar_block

from tp_controller import build_settings
from tp_controller.explanation import explain_step as explain


def stack_of(hierarchy, damping=0.0, velocity=None, saturation='uniform', **targets):
    limits = {'limits': {'velocity': [velocity]}} if velocity else {}
    block = {
        'robot': planar_block(1.0, 1.0, 1.0) | limits,
        'solver': {'damping': damping, 'saturation': saturation},
        'hierarchy': hierarchy,
        'tasks': {
            'tip': {'type': 'position', 'frame': 'link_3', 'axes': 'xy'},
            'angle': {'type': 'orientation', 'frame': 'link_3', 'axes': 'z'},
            'first': {'type': 'joint', 'joints': ['joint_1']},
            'rest': {'type': 'posture'},
        },
    }
    stack = build_settings(block).stack
    stack.step(BENT)
    for name, target in targets.items():
        stack.tasks[name].target = target
    return stack


BENT = np.array([0.4, 0.7, 0.5])


def test_a_level_that_got_everything_lost_nothing():
    stack = stack_of(['tip', 'angle'], tip=[1.0, 1.5], angle=[2.0])
    stack.step(BENT)
    for level in explain(stack):
        assert level.shortfall == pytest.approx(0.0, abs=1e-9)
        assert level.text == ''
        assert level.rank == level.rows


def test_a_joint_that_the_levels_above_leave_no_freedom_names_them():
    stack = stack_of(['tip', 'angle', 'first'], first=[2.0])
    stack.step(BENT)
    first = explain(stack)[-1]
    assert (first.rows, first.rank) == (1, 0)
    assert first.smallest_singular_value == np.inf
    assert set(first.lost_to_levels) == {'tip', 'angle'}
    assert np.linalg.norm(list(first.lost_to_levels.values())) == pytest.approx(1.6)
    assert first.lost_to_singularity == pytest.approx(0.0, abs=1e-9)
    assert 'to tip' in first.text
    assert 'to angle' in first.text


def test_only_the_level_that_stands_in_the_way_is_named():
    stack = stack_of(['angle', 'first', 'rest'], rest=[2.0, 0.7, 0.5])
    stack.step(BENT)
    rest = explain(stack)[-1]
    assert rest.rank == 1
    assert rest.lost_to_levels['first'] > rest.lost_to_levels.get('angle', 0.0)


def test_what_no_joint_can_move_is_lost_to_a_singularity():
    stack = stack_of(['first', 'tip'], tip=[4.0, 0.0])
    stack.step(np.zeros(3))
    tip = explain(stack)[-1]
    assert tip.lost_to_singularity == pytest.approx(1.0)
    assert tip.lost_to_levels == {}
    assert tip.text == '1 to a singularity'


def test_what_damping_holds_back_is_told():
    stack = stack_of(['first'], damping=0.5, first=[1.4])
    stack.step(BENT)
    (first,) = explain(stack)
    assert first.lost_to_damping == pytest.approx(0.25 / 1.25)
    assert first.text == '0.2 to damping'


@pytest.mark.parametrize('saturation', ['uniform', 'null_space'])
def test_what_the_velocity_limits_cost_is_told(saturation):
    stack = stack_of(['first'], velocity=0.4, saturation=saturation, first=[1.4])
    stack.step(BENT)
    (first,) = explain(stack)
    assert first.lost_to_saturation == pytest.approx(0.6)
    assert first.text == '0.6 to velocity limits'


def test_rows_that_are_out_do_not_count():
    block = {
        'robot': planar_block(1.0, 1.0) | {'limits': {'velocity': [1.0]}},
        'hierarchy': ['range'],
        'tasks': {
            'range': {
                'type': 'joint_limits',
                'min': [-1.0],
                'max': [1.0],
                'switching': 'hysteresis',
                'activation': 0.1,
            }
        },
    }
    stack = build_settings(block).stack
    stack.step(np.array([0.95, 0.0]))
    assert explain(stack)[0].rows == 1
    stack.step(np.zeros(2))
    assert explain(stack)[0].rows == explain(stack)[0].rank == 0


def test_a_joint_at_the_end_of_its_range_is_named():
    limits = {'velocity': [5.0], 'position_max': [1.0], 'position_min': [-1.0]}
    block = {
        'robot': planar_block(1.0, 1.0) | {'limits': limits},
        'rate': 100.0,
        'solver': {'damping': 0.0},
        'hierarchy': ['joints'],
        'tasks': {
            'joints': {'type': 'joint', 'joints': ['joint_1', 'joint_2'], 'target': [3.0, 0.5]}
        },
    }
    stack = build_settings(block).stack
    step = stack.step(np.array([1.0, 0.0]))
    np.testing.assert_allclose(step.command, [0.0, 0.5], atol=1e-6)
    (level,) = explain(stack)
    assert level.lost_to_levels == {'the range of joint_1': pytest.approx(2.0)}
    assert level.text == '2 to the range of joint_1'


def test_the_hierarchical_program_tells_who_stopped_whom():
    block = {
        'robot': planar_block(1.0, 1.0) | {'limits': {'velocity': [5.0]}},
        'rate': 100.0,
        'solver': {'type': 'hqp', 'damping': 0.0},
        'hierarchy': ['first', 'second'],
        'tasks': {
            'first': {'type': 'joint', 'joints': ['joint_1'], 'target': [8.0]},
            'second': {'type': 'joint', 'joints': ['joint_1', 'joint_2'], 'target': [2.0, 0.5]},
        },
    }
    stack = build_settings(block).stack
    np.testing.assert_allclose(stack.step(np.zeros(2)).command, [5.0, 0.5], atol=1e-9)
    first, second = explain(stack)
    assert first.lost_to_levels == {'the limits of joint_1': pytest.approx(3.0)}
    assert first.text == '3 to the limits of joint_1'
    assert second.lost_to_levels == {'the limits of joint_1': pytest.approx(3.0)}
    stack.tasks['first'].target = [3.0]
    stack.step(np.zeros(2))
    first, second = explain(stack)
    assert first.text == ''
    assert second.lost_to_levels == {'first': pytest.approx(1.0)}
    assert (first.rank, second.rank) == (1, 1)


@given(st.integers(0, 10_000), st.booleans())
@examples(40)
def test_what_is_lost_under_the_program_adds_up(seed, damped):
    rng = np.random.default_rng(seed)
    ends = {'frame': 'link_4', 'gain': [3.0]}
    block = {
        'robot': planar_block(1.0, 0.8, 0.6, 0.5)
        | {'limits': {'velocity': [rng.uniform(0.3, 1.5)], 'acceleration': [20.0]}},
        'rate': 50.0,
        # Settled levels are those of the recursion, which is explained with its shares.
        'solver': {'type': 'hqp', 'damping': 0.1 if damped else 0.0, 'settle': False},
        'hierarchy': ['ball', 'tip', 'turn'],
        'tasks': {
            'ball': {
                'type': 'obstacle',
                'frame': 'link_4',
                'axes': 'xy',
                'center': rng.uniform(-2.0, 2.0, 2).tolist(),
                'radius': 0.5,
            },
            'tip': {'type': 'position', 'axes': 'xy', **ends},
            'turn': {'type': 'orientation', 'axes': 'z', **ends},
        },
    }
    stack, q = build_settings(block).stack, rng.uniform(-1.5, 1.5, 4)
    stack.tasks['tip'].target = rng.uniform(-2.0, 2.0, 2)
    stack.tasks['turn'].target = rng.uniform(-3.0, 3.0, 1)
    for _ in range(30):
        q = q + 0.02 * stack.step(q).command
    for level, system in zip(explain(stack), stack.systems(), strict=True):
        rows = system.counts
        short = float(np.linalg.norm((system.requested - system.achieved)[rows]))
        unanswered = float(np.linalg.norm((system.requested - system.answered)[rows]))
        assert level.shortfall == pytest.approx(short, abs=1e-6)
        assert level.lost_to_saturation == 0.0
        guarded = float(np.linalg.norm((system.answered - system.achieved)[rows]))
        assert level.lost_to_guard == pytest.approx(guarded, abs=1e-9)
        # Levels that hardly matter are not named, and so may be missing from the sum.
        named = np.linalg.norm(list(level.lost_to_levels.values()))
        parts = [named, level.lost_to_singularity, level.lost_to_damping]
        assert np.linalg.norm(parts) == pytest.approx(unanswered, rel=0.2, abs=1e-5)


def test_a_scheme_without_levels_explains_none():
    block = {
        'robot': planar_block(1.0, 1.0),
        'solver': {'type': 'augmented'},
        'hierarchy': ['rest'],
        'tasks': {'rest': {'type': 'posture'}},
    }
    stack = build_settings(block).stack
    stack.step(np.zeros(2))
    assert explain(stack) == ()


@st.composite
def stepped(draw, saturation):
    """A random stack after a step, limits included, away from changes of rank."""
    robots = arms(min_joints=2, max_joints=7) | planar_arms(min_joints=2)
    block = draw(parameters(robots=robots, dampings=st.just(0.0) | numbers(0.05, 1)))
    n = len(block['robot']['joints'])
    block['robot'] = block['robot'] | {'limits': {'velocity': draw(positive_vectors(n, 0.05, 2))}}
    block['solver'] = block['solver'] | {'saturation': saturation, 'settle': False}
    stack = build_settings(block).stack
    stack.step(draw(states(n)))
    _, shares = recursion([(system.J, np.zeros(len(system.J))) for system in stack.systems()], 0.0)
    assume(away_from_rank_changes(shares, 1e-13, 1e-5))
    return stack


@given(stepped('uniform'))
@examples(80)
def test_the_parts_are_the_recursion_with_one_cause_removed_after_the_other(stack):
    """Against independent recursions: undamped and unlimited, damped, damped and limited."""
    systems = stack.systems()
    levels = [(system.J, system.requested) for system in systems]
    damped, _ = recursion(levels, stack.solver.damping)
    for level, (J, _, requested, _, achieved) in zip(explain(stack), systems, strict=True):
        size = max(1.0, float(np.abs(requested).max()), float(np.abs(J @ damped).max()))
        assert level.shortfall == pytest.approx(
            float(np.linalg.norm(requested - achieved)), abs=1e-9 * size
        )
        assert level.lost_to_saturation == pytest.approx(
            float(np.linalg.norm(J @ damped - achieved)), abs=1e-6 * size
        )
        blocked = np.hypot(
            np.linalg.norm(list(level.lost_to_levels.values())), level.lost_to_singularity
        )
        together = np.hypot(blocked, level.lost_to_damping)
        gap = float(np.linalg.norm(requested - J @ damped))
        # Levels that hardly matter are not named, and so may be missing from the sum.
        assert together == pytest.approx(gap, rel=0.2, abs=1e-5 * size)


@given(stepped('null_space'))
@examples(60)
def test_without_a_loss_to_limits_both_saturations_tell_the_same(stack):
    if stack.solver.shares.min() < 1.0:
        return
    for level, (*_, requested, _, achieved) in zip(explain(stack), stack.systems(), strict=True):
        size = max(1.0, float(np.abs(requested).max()))
        assert level.lost_to_saturation == pytest.approx(0.0, abs=1e-6 * size)
        assert level.shortfall == pytest.approx(
            float(np.linalg.norm(requested - achieved)), abs=1e-9 * size
        )
