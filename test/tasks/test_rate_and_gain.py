"""What the rate decides: whether ranges can be kept, and which gains make sense."""

import numpy as np
import pytest
from planar_config import changed

from tp_controller import InvalidValue
from tp_controller.config import (
    build_addition,
    build_settings,
    check_changes,
    controller_schema,
    know_rate,
)

RATE = 50.0


def settings_of(changes):
    flat = changed(changes)
    return build_settings(flat), controller_schema(flat)


@pytest.mark.parametrize(
    ('gain', 'share'),
    [([100.0], '2'), ([1.0, 200.0], '4'), ([60.0, 60.0, 60.0, 60.0], '2.4')],
)
def test_a_gain_that_makes_the_error_grow_is_refused_at_start_and_while_running(gain, share):
    message = (
        rf'tasks.tip.gain: got .*K·dt = {share} at rate 50; accepts gains below 100; '
        'the largest sensible one is 50'
    )
    with pytest.raises(InvalidValue, match=message):
        settings_of({'rate': RATE, 'tasks.tip.gain': gain})
    settings, schema = settings_of({'rate': RATE})
    with pytest.raises(InvalidValue, match=message):
        check_changes(settings, schema, {'tasks.tip.gain': gain})
    block = {'type': 'position', 'frame': 'link_3', 'axes': 'xy', 'gain': gain}
    with pytest.raises(InvalidValue, match=message.replace('tip', 'more')):
        build_addition(settings, 'more', block)


def test_the_gain_of_a_set_based_task_is_judged_too():
    ranges = {'tasks.r.type': 'joint_limits', 'tasks.r.min': [-1.0]}
    with pytest.raises(InvalidValue, match=r'tasks.r.gain'):
        settings_of({'rate': RATE, 'tasks.r.gain': [2.0 * RATE], **ranges})


@pytest.mark.parametrize(('gain', 'warned'), [(49.0, False), (50.0, True), (99.0, True)])
def test_a_gain_that_overshoots_at_every_step_is_warned_of_in_one_line(gain, warned):
    settings, _ = settings_of({'rate': RATE, 'tasks.elbow.gain': [gain]})
    warnings = settings.stack.tasks['elbow'].warnings
    assert len(warnings) == warned
    if warned:
        assert f'tasks.elbow.gain: {gain:g} at rate 50' in warnings[0]
        assert 'the largest sensible gain is 50' in warnings[0]
        assert '\n' not in warnings[0]


def test_without_a_rate_and_for_a_gradient_nothing_is_said_of_a_gain():
    settings, _ = settings_of({'tasks.tip.gain': [1e6]})
    assert settings.stack.tasks['tip'].warnings == ()
    gradient = {'tasks.w.type': 'manipulability', 'tasks.w.frame': 'link_3'}
    settings, _ = settings_of({'rate': RATE, 'tasks.w.gain': [1e3], **gradient})
    assert settings.stack.tasks['w'].warnings == ()


@pytest.mark.parametrize('key', ['position_min', 'position_max'])
@pytest.mark.parametrize('find_rate', [False, True])
def test_a_range_in_the_parameters_needs_a_rate(key, find_rate):
    flat = changed({f'robot.limits.{key}': [0.0, 0.0, 0.0]})
    message = r'^rate: got no value; .* to keep the ranges of joint_1, joint_2, joint_3$'
    with pytest.raises(InvalidValue, match=message):
        build_settings(flat, find_rate=find_rate)
    settings, schema = settings_of({})
    with pytest.raises(InvalidValue, match=message):
        check_changes(settings, schema, {f'robot.limits.{key}': [0.0]})


def test_a_range_of_a_description_needs_a_rate_that_may_come_later():
    parameters = {
        'hierarchy': ['first'],
        'tasks': {'first': {'type': 'joint', 'joints': ['turn'], 'target': [3.0], 'gain': [9.0]}},
    }
    with pytest.raises(InvalidValue, match=r'^rate: got no value; .* to keep the ranges of turn$'):
        build_settings(parameters, DESCRIPTION)
    settings = build_settings(parameters, DESCRIPTION, find_rate=True)
    know_rate(settings, RATE)
    q = np.zeros(1)
    for _ in range(200):
        q = q + settings.stack.step(q).command / RATE
    assert 0.99 < q[0] <= 1.0
    gain = {'type': 'joint', 'joints': ['turn'], 'gain': [3.0 * RATE]}
    with pytest.raises(InvalidValue, match=r'tasks.more.gain'):
        build_addition(settings, 'more', gain)


def test_an_arm_stays_at_rest_until_it_is_told_to_move():
    settings = build_settings(changed({'rate': RATE, 'robot.limits.acceleration': [0.5]}))
    step = settings.stack.step_in_place(np.array([0.1, 0.2, 0.3]))
    settings.stack.stay()
    assert not step.command.any()
    assert not step.levels[0].achieved.any()
    again = settings.stack.step_in_place(np.array([0.1, 0.2, 0.3]))
    assert np.abs(again.command).max() <= 0.5 / RATE + 1e-12


DESCRIPTION = """
<robot name="arm"><link name="base"/><link name="tip"/>
<joint name="turn" type="revolute"><parent link="base"/><child link="tip"/>
<axis xyz="0 0 1"/><limit lower="-1" upper="1" velocity="2" effort="1"/></joint></robot>
"""
