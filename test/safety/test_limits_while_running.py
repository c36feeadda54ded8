"""Set-based tasks follow limits that change while running, and keep what they were doing."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from random_stacks import examples, numbers, positive_vectors, states
from small_arms import planar_block

from tp_controller import InvalidValue, build_settings
from tp_controller.config import check_changes, controller_schema
from tp_controller.parameters import flatten
from tp_controller.tasks import SetBasedTask

Q = np.array([0.3, -0.4, 0.2])
LIMITS = {
    'velocity': [1.0],
    'position_min': [-2.0],
    'position_max': [2.0],
    'acceleration': [5.0],
}


def block(switching='smooth', limits=LIMITS, **changes):
    """A planar arm whose set-based tasks leave out all that follows from the limits."""
    shared = {'switching': switching}
    arm = planar_block(0.8, 0.6, 0.4)
    return {
        'robot': arm | {'limits': limits, 'link_radius': [0.02]},
        'rate': 100.0,
        'transition_time': 0.0,
        'hierarchy': ['range', 'ball', 'wall', 'hand'],
        'tasks': {
            'range': {'type': 'joint_limits', **shared},
            'ball': {'type': 'obstacle', 'frame': 'link_3', 'center': [9.0, 0.0, 0.0]}
            | {'radius': 0.3, **shared},
            'wall': {'type': 'obstacle', 'whole_arm': True, 'center': [9.0, 0.0, 0.0]}
            | {'radius': 0.3, **shared},
            'hand': {'type': 'position', 'frame': 'link_3', 'axes': 'xy', 'target': [0.5, 1.2]},
        },
    } | changes


def changed(parameters, changes):
    """Settings after changes while running, and what was said of them."""
    flat = flatten(parameters)
    settings = build_settings(flat)
    said = check_changes(settings, controller_schema(flat), changes)()
    return settings, said


def thresholds(task):
    return task.activation, task.release, task.margin, task._needed, task._time, task._travel


@given(
    positive_vectors(3, 0.1, 5),
    positive_vectors(3, 0.5, 20),
    numbers(0.5, 3),
    states(3),
    st.sampled_from(['smooth', 'hysteresis']),
)
@examples(40)
def test_after_new_limits_tasks_are_as_if_made_with_them(velocity, acceleration, end, q, how):
    new = {
        'velocity': velocity,
        'acceleration': acceleration,
        'position_min': [-end],
        'position_max': [end],
    }
    settings, _ = changed(block(how), {f'robot.limits.{key}': new[key] for key in new})
    fresh = build_settings(block(how, limits=new))
    for name, task in settings.stack.tasks.items():
        if isinstance(task, SetBasedTask):
            assert thresholds(task) == thresholds(fresh.stack.tasks[name])
    result, expected = settings.stack.step(q), fresh.stack.step(q)
    assert result.command.tobytes() == expected.command.tobytes()


def test_a_range_of_its_own_does_not_follow_the_robot():
    tasks = block()['tasks'] | {'range': {'type': 'joint_limits', 'min': [-1.0], 'max': [1.0]}}
    settings, _ = changed(block(tasks=tasks), {'robot.limits.position_max': [1.5]})
    settings.stack.step(Q)
    np.testing.assert_allclose(settings.stack.tasks['range'].distance, 1.0 - np.abs(Q))


def test_limits_that_a_task_cannot_have_are_refused_and_nothing_changes():
    tasks = block()['tasks']
    tasks['ball'] |= {'activation': 0.5}
    settings = build_settings(block(tasks=tasks))
    schema = controller_schema(flatten(block(tasks=tasks)))
    before = {name: thresholds(settings.stack.tasks[name]) for name in ('range', 'ball', 'wall')}
    with pytest.raises(InvalidValue) as caught:
        check_changes(settings, schema, {'robot.limits.velocity': [50.0]})
    assert caught.value.key == 'robot.limits.velocity'
    assert 'tasks.ball.activation' in caught.value.got
    assert {name: thresholds(settings.stack.tasks[name]) for name in before} == before
    assert settings.stack.robot.limits.velocity[0] == 1.0


def test_an_activation_that_has_become_too_small_is_said():
    tasks = block()['tasks']
    tasks['ball'] |= {'activation': 1.5}
    _, said = changed(block(tasks=tasks), {'robot.limits.velocity': [2.0]})
    assert len(said) == 2
    assert said[0] == (
        'less safe from now on: robot.limits.velocity is wider: '
        'joint_1 1 to 2, joint_2 1 to 2, joint_3 1 to 2'
    )
    assert said[1].startswith('tasks.ball.activation: 1.5 is less than it takes to brake')
    _, said = changed(block(tasks=tasks), {'robot.limits.velocity': [0.5]})
    assert said == ()


@pytest.mark.parametrize(
    ('hierarchy', 'said'),
    [
        (['range', 'ball', 'wall', 'hand'], ''),
        (['range + ball', 'wall', 'hand'], ''),
        (['range', 'ball', 'hand'], 'wall leaves the hierarchy'),
        (['range', 'hand', 'ball', 'wall'], 'ball loses priority to hand; wall loses'),
        (['range', 'ball', 'wall + hand'], 'wall loses priority to hand'),
        (['ball', 'range', 'wall', 'hand'], 'range loses priority to ball'),
        (['hand'], 'range leaves the hierarchy'),
    ],
)
def test_what_makes_a_hierarchy_less_safe_is_said_in_one_line(hierarchy, said):
    _, lines = changed(block(), {'hierarchy': hierarchy})
    assert len(lines) == (1 if said else 0)
    if said:
        assert lines[0].startswith(f'less safe from now on: {said}')


def test_an_obstacle_that_is_new_takes_no_safety_from_others():
    settings, _ = changed(block(), {'hierarchy': ['range', 'hand']})
    schema = controller_schema(flatten(block()))
    said = check_changes(settings, schema, {'hierarchy': ['ball', 'range', 'hand']})()
    assert said == ()


@pytest.mark.parametrize('how', ['smooth', 'hysteresis'])
def test_a_change_of_the_hierarchy_leaves_tasks_that_stay_as_they_are(how):
    parameters = block(how)
    parameters['tasks']['range'] |= {'min': [-1.0], 'max': [1.0]}
    parameters['tasks']['hand'] = {'type': 'posture', 'target': [5.0, 5.0, 5.0]}
    parameters['robot']['limits'] = {'velocity': [1.0]}
    stack = build_settings(parameters).stack
    q = np.array([0.0, 0.6, 0.9])
    for _ in range(150):
        q = q + 0.01 * stack.step(q).command
    ranges = stack.tasks['range']
    was, acted = ranges.on.copy(), ranges.acting.copy()
    assert ranges.active
    for hierarchy in (['hand', 'range'], ['wall', 'range', 'hand'], ['range', 'hand']):
        stack.hierarchy = hierarchy
        np.testing.assert_array_equal(ranges.on, was)
        np.testing.assert_array_equal(ranges.acting, acted)
    if how == 'hysteresis':
        # Between activation and release a row stays what it was.
        between = q.copy()
        near = 0.5 * (ranges.activation + ranges.release)
        row = int(np.flatnonzero(was)[0])
        between[row] = np.sign(q[row]) * (1.0 - near)
        stack.step(between)
        assert ranges.on[row]
    stack.hierarchy = ['hand']
    assert not ranges.active


def test_a_limit_of_acceleration_that_is_lifted_leaves_no_old_velocity_behind():
    """Without one a step starts from standstill, whatever the arm did before."""
    speeds = {'velocity': [1.0], 'position_min': [-2.0], 'position_max': [2.0]}
    levels = {'hierarchy': ['hand', 'rest'], 'rate': 100.0, 'transition_time': 0.0}
    levels['tasks'] = {
        'hand': {'type': 'position', 'frame': 'link_3', 'axes': 'xy', 'target': [0.5, 1.2]}
        | {'gain': [20.0]},
        'rest': {'type': 'posture', 'target': [-1.5, 1.5, -1.5], 'gain': [20.0]},
    }
    lifted, fresh = (
        build_settings(levels | {'robot': planar_block(0.8, 0.6, 0.4) | {'limits': limits}}).stack
        for limits in (speeds | {'acceleration': [5.0]}, speeds)
    )
    q = Q.copy()
    for _ in range(20):
        q = q + 0.01 * lifted.step(q).command
    lifted.prepare_limits(fresh.robot.limits)()
    command = lifted.step(q).command
    assert np.abs(command).max() == 1.0
    np.testing.assert_array_equal(command, fresh.step(q).command)
