"""Parameter changes while running, under every scheme."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from random_stacks import examples, numbers, positive_vectors, vectors
from small_arms import planar_block

from tp_controller import InvalidValue, build_settings
from tp_controller.config import check_changes, controller_schema
from tp_controller.parameters import flatten
from tp_controller.solvers import INVERSES, SOLVER_TYPES

TIP = {'type': 'position', 'frame': 'link_4', 'axes': 'xy', 'target': [2.0, 1.0]}
TURN = {'type': 'orientation', 'frame': 'link_4', 'axes': 'z', 'target': [0.5]}
ELBOW = {'type': 'joint', 'joints': ['joint_2'], 'target': [1.0]}
SCHEMES = [(scheme, True) for scheme in SOLVER_TYPES] + [('extended_jacobian', False)]
HIERARCHIES = {
    # All four rows make a square system; an objective needs one of them left.
    True: (['tip'], ['elbow', 'tip'], ['tip + turn'], ['turn', 'elbow']),
    False: (['tip', 'turn', 'elbow'], ['elbow + turn', 'tip'], ['elbow', 'turn', 'tip']),
}


def block(scheme, objective=True, hierarchy=('tip', 'turn'), **solver):
    if objective:
        solver['objective'] = {'type': 'posture', 'positions': [0.1, 0.4, 0.2, 0.3]}
    return flatten(
        {
            'robot': planar_block(1.0, 0.9, 0.8, 0.7),
            'solver': {'type': scheme, **solver},
            'hierarchy': list(hierarchy),
            'tasks': {'tip': TIP, 'turn': TURN, 'elbow': ELBOW},
        }
    )


@st.composite
def running_stacks_and_changes(draw):
    scheme, objective = draw(st.sampled_from(SCHEMES))
    hierarchies = st.sampled_from(HIERARCHIES[objective])
    inverse = draw(st.sampled_from(INVERSES))
    flat = block(scheme, objective, draw(hierarchies), inverse=inverse)
    if draw(st.booleans()):
        flat['solver.joint_weights'] = draw(positive_vectors(4, 0.5, 5))
    possible = {
        'solver.damping': numbers(0.0, 1.0),
        'hierarchy': hierarchies,
        'tasks.tip.weight': numbers(0.1, 9.0),
        'tasks.turn.weight': numbers(0.1, 9.0),
        'tasks.turn.gain': positive_vectors(1, 0.1, 4),
        'robot.limits.velocity': positive_vectors(4, 0.2, 3),
    }
    if objective:
        possible['solver.objective.gain'] = numbers(0.1, 3.0)
    keys = draw(st.lists(st.sampled_from(sorted(possible)), unique=True, min_size=1))
    return flat, {key: draw(possible[key]) for key in keys}, np.array(draw(vectors(4, 2)))


@given(running_stacks_and_changes())
@examples(150)
def test_after_changes_every_scheme_behaves_as_one_built_with_the_new_values(case):
    flat, changes, q = case
    settings = build_settings(flat)
    settings.stack.step(q + 0.3)
    check_changes(settings, controller_schema(flat), changes)()
    fresh = build_settings(flat | changes)
    assert settings.values == fresh.values
    result, expected = settings.stack.step(q), fresh.stack.step(q)
    np.testing.assert_array_equal(result.command, expected.command)
    assert result.scale == expected.scale
    for level, fresh_level in zip(result.levels, expected.levels, strict=True):
        np.testing.assert_array_equal(level.requested, fresh_level.requested)


APART = {'recursive', 'projected_gradient', 'hqp'}  # invert every level by itself


@pytest.mark.parametrize('scheme', sorted(set(SOLVER_TYPES) - APART))
def test_a_damping_that_sets_tasks_apart_which_are_inverted_together_is_refused(scheme):
    flat = block(scheme) | {'tasks.tip.damping': 0.1}
    settings, schema = build_settings(flat), controller_schema(flat)
    with pytest.raises(InvalidValue, match='which leaves turn with another') as caught:
        check_changes(settings, schema, {'solver.damping': 0.5})
    assert caught.value.key == 'solver.damping'
    assert settings.stack.solver.damping == 0.1
    with pytest.raises(InvalidValue, match='inverts them together'):
        build_settings(flat | {'solver.damping': 0.5})


@pytest.mark.parametrize('order', [1, -1])
def test_a_damping_and_the_levels_that_it_suits_may_change_together(order):
    flat = block('augmented', hierarchy=['tip']) | {'tasks.tip.damping': 0.5}
    settings, schema = build_settings(flat), controller_schema(flat)
    with pytest.raises(InvalidValue, match='inverts them together') as caught:
        check_changes(settings, schema, {'hierarchy': ['tip', 'turn']})
    assert caught.value.key == 'hierarchy'
    changes = [('solver.damping', 0.5), ('hierarchy', ['tip', 'turn'])][::order]
    check_changes(settings, schema, dict(changes))()
    apart = [('solver.damping', 0.2), ('hierarchy', ['turn'])][::order]
    check_changes(settings, schema, dict(apart))()
    assert settings.stack.hierarchy == ('turn',)
    assert settings.stack.solver.damping == 0.2


def test_settings_that_an_inverse_does_not_use_set_no_tasks_apart():
    build_settings(block('augmented', inverse='pinv') | {'tasks.tip.damping': 0.5})
    build_settings(block('augmented') | {'tasks.tip.singular_region': 0.5})
    with pytest.raises(InvalidValue, match='singular_region'):
        build_settings(block('augmented', inverse='adaptive') | {'tasks.tip.singular_region': 0.5})


def test_a_hierarchy_of_too_many_rows_for_the_extended_jacobian_is_refused_while_it_runs():
    flat = block('extended_jacobian')
    settings = build_settings(flat)
    before = settings.stack.step(np.full(4, 0.3)).command.copy()
    with pytest.raises(InvalidValue, match='4 rows for 4 joints'):
        check_changes(settings, controller_schema(flat), {'hierarchy': ['tip', 'turn', 'elbow']})
    np.testing.assert_array_equal(settings.stack.step(np.full(4, 0.3)).command, before)
