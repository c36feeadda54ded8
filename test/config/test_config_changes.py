import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from planar_config import dotted_parameters
from random_stacks import (
    examples,
    gains,
    nonzero_vectors,
    numbers,
    parameters,
    positive_vectors,
    states,
    vectors,
)

from tp_controller import InvalidValue, build_settings
from tp_controller.config import check_changes, controller_schema
from tp_controller.parameters import flatten

Q = np.array([0.1, 0.6, 0.3])

GOOD = {
    'hierarchy': ['place', 'turn + tip'],
    'solver.damping': 0.5,
    'robot.limits.velocity': [0.2, 0.3, 0.4],
    'solver.inverse': 'adaptive',
    'transition_time': 0.0,
    'tasks.place.enabled': False,
    'tasks.tip.gain': [5.0],
    'tasks.tip.target': [0.2, -0.3],
    'tasks.tip.feedforward': [0.3, 0.4],
}

BAD = [
    ({'hierarchy': ['', 'tip']}, 'hierarchy', "''"),
    ({'hierarchy': ['nose']}, 'hierarchy', "'nose'"),
    ({'hierarchy': ['tip', 'tip']}, 'hierarchy', "'tip' twice"),
    ({'hierarchy': None}, 'hierarchy', 'a list of texts'),
    ({'hierarchy': [1]}, 'hierarchy', 'a list of texts'),
    ({'solver.damping': -1.0}, 'solver.damping', 'at least 0'),
    ({'solver.damping': '0.1'}, 'solver.damping', 'a number'),
    ({'solver.damping': float('nan')}, 'solver.damping', 'finite'),
    ({'solver.damping': None}, 'solver.damping', 'a number'),
    ({'robot.limits.velocity': [0.0]}, 'robot.limits.velocity', 'above 0'),
    ({'robot.limits.velocity': [1.0] * 2}, 'robot.limits.velocity', '1 value or 3'),
    ({'robot.limits.position_min': [float('inf')]}, 'robot.limits.position_min', 'finite'),
    (
        {'robot.limits.position_min': [2.0], 'robot.limits.position_max': [1.0]},
        'robot.limits.position_min',
        'below position_max',
    ),
    ({'tasks.tip.gain': [1.0] * 3}, 'tasks.tip.gain', '1, 2 or 4 values'),
    ({'tasks.tip.gain': [-1.0]}, 'tasks.tip.gain', 'at least 0'),
    ({'tasks.tip.gain': [True]}, 'tasks.tip.gain', 'a list of numbers'),
    ({'tasks.tip.target': [1.0]}, 'tasks.tip.target', '2 values (position per axis [m])'),
    ({'tasks.tip.target': [1.0, float('nan')]}, 'tasks.tip.target', 'finite'),
    ({'tasks.tip.target': []}, 'tasks.tip.target', '2 values'),
    ({'tasks.spare.target': [0.0] * 4}, 'tasks.spare.target', 'not zero'),
    ({'tasks.tip.feedforward': [1.0]}, 'tasks.tip.feedforward', '2 values (x, y)'),
    ({'tasks.tip.frame': 'link_1'}, 'tasks.tip.frame', 'a change while running'),
    ({'tasks.tip.type': 'pose'}, 'tasks.tip.type', 'a change while running'),
    ({'robot.joints': ['a', 'b', 'c']}, 'robot.joints', 'a change while running'),
    ({'robot.dh.a': [1.0] * 3}, 'robot.dh.a', 'a change while running'),
    ({'solver.type': 'hpq'}, 'solver.type', 'one of'),
    ({'solver.type': 'projected_gradient'}, 'solver.objective.type', 'no value'),
    ({'solver.saturation': 'soft'}, 'solver.saturation', 'one of'),
    ({'solver.joint_weights': [1.0, 2.0]}, 'solver.joint_weights', '1, 3 or 9 values'),
    ({'transition_time': -1.0}, 'transition_time', 'at least 0'),
    ({'tasks.tip.enabled': 1}, 'tasks.tip.enabled', 'true or false'),
    ({'timeouts.joint_state': 1.0}, 'timeouts.joint_state', 'a change while running'),
    ({'solver.dampling': 0.1}, 'solver.dampling', 'an unknown parameter'),
    ({'tasks.nose.gain': [1.0]}, 'tasks.nose.gain', 'an unknown parameter'),
]


def settings_and_schema(more=()):
    flat = dotted_parameters() | dict(more)
    return build_settings(flat), controller_schema(flat)


def command(settings):
    return settings.stack.step(Q).command.copy()


def test_changes_are_made_only_when_they_are_applied():
    settings, schema = settings_and_schema()
    before, values = command(settings), dict(settings.values)
    apply = check_changes(settings, schema, GOOD)
    np.testing.assert_array_equal(command(settings), before)
    assert settings.values == values
    apply()
    assert np.abs(command(settings) - before).max() > 0.01
    assert settings.values['solver.damping'] == 0.5
    assert settings.values['hierarchy'] == ('place', 'turn + tip')


@pytest.mark.parametrize(('changes', 'key', 'fragment'), BAD, ids=lambda x: str(x)[:40])
@pytest.mark.parametrize('order', ['good_first', 'bad_first'])
def test_one_bad_change_refuses_them_all_and_nothing_changes(changes, key, fragment, order):
    settings, schema = settings_and_schema()
    before, values = command(settings), dict(settings.values)
    good = {name: value for name, value in GOOD.items() if name not in changes}
    together = good | changes if order == 'good_first' else changes | good
    with pytest.raises(InvalidValue) as caught:
        check_changes(settings, schema, together)
    assert caught.value.key == key
    assert fragment in str(caught.value)
    np.testing.assert_array_equal(command(settings), before)
    assert settings.values == values


def test_the_refusal_of_a_fixed_parameter_lists_those_that_may_change():
    settings, schema = settings_and_schema()
    with pytest.raises(InvalidValue) as caught:
        check_changes(settings, schema, {'robot.joints': ['a']})
    assert 'hierarchy' in caught.value.accepts
    assert 'solver.damping' in caught.value.accepts
    assert 'tasks.tip.gain' in caught.value.accepts
    assert 'robot.dh' not in caught.value.accepts


def test_both_ends_of_a_range_may_change_together_and_one_alone_is_checked_with_the_other():
    settings, schema = settings_and_schema({'rate': 60.0})
    ends = {'robot.limits.position_min': [5], 'robot.limits.position_max': [6]}
    check_changes(settings, schema, ends)()
    np.testing.assert_array_equal(settings.stack.robot.limits.position_min, [5.0] * 3)
    with pytest.raises(InvalidValue, match='below position_max'):
        check_changes(settings, schema, {'robot.limits.position_max': [5]})
    check_changes(settings, schema, {'robot.limits.position_max': [7]})()
    np.testing.assert_array_equal(settings.stack.robot.limits.position_min, [5.0] * 3)
    np.testing.assert_array_equal(settings.stack.robot.limits.position_max, [7.0] * 3)


def test_no_change_at_all_is_accepted():
    settings, schema = settings_and_schema()
    before = command(settings)
    check_changes(settings, schema, {})()
    np.testing.assert_array_equal(command(settings), before)


@st.composite
def stacks_and_changes(draw):
    """Parameters, a state, and changes of some of the parameters that may change."""
    block = draw(parameters())
    n = len(block['robot']['joints'])
    changes = {}
    if draw(st.booleans()):
        changes['solver.damping'] = draw(numbers(0.01, 1))
    if draw(st.booleans()):
        changes['robot.limits.velocity'] = draw(positive_vectors(n, 0.1, 2))
    if draw(st.booleans()):
        changes['solver.type'] = draw(st.sampled_from(['recursive', 'hqp', 'augmented']))
    if draw(st.booleans()):
        changes['solver.saturation'] = draw(st.sampled_from(['null_space', 'uniform']))
    for name in block['tasks']:
        if draw(st.sampled_from([False, False, True])):
            changes[f'tasks.{name}.enabled'] = False
    if draw(st.booleans()):
        names = draw(st.permutations(list(block['tasks'])))
        changes['hierarchy'] = list(names[: draw(st.integers(1, len(names)))])
    for name, task in block['tasks'].items():
        k = len(task['feedforward'])
        if draw(st.booleans()):
            changes[f'tasks.{name}.gain'] = draw(gains(k))
            changes[f'tasks.{name}.feedforward'] = draw(vectors(k, 2))
        if draw(st.booleans()):
            changes[f'tasks.{name}.target'] = draw(nonzero_vectors(len(task['target'])))
    return block, changes, draw(states(n))


@given(stacks_and_changes())
@examples(100)
def test_after_changes_the_stack_behaves_as_one_built_with_the_new_values(case):
    block, changes, q = case
    flat = flatten(block)
    settings = build_settings(flat)
    settings.stack.step(q + 0.5)
    check_changes(settings, controller_schema(flat), changes)()
    fresh = build_settings(flat | changes)
    assert settings.values == fresh.values
    result, expected = settings.stack.step(q), fresh.stack.step(q)
    assert settings.stack.hierarchy == fresh.stack.hierarchy
    np.testing.assert_array_equal(result.command, expected.command)
    assert result.scale == expected.scale
    for level, fresh_level in zip(result.levels, expected.levels, strict=True):
        np.testing.assert_array_equal(level.requested, fresh_level.requested)
        np.testing.assert_array_equal(level.achieved, fresh_level.achieved)
