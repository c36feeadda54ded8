"""A task asks for no more than its largest speed, in the direction that it would have."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from random_stacks import examples, gains, positive_vectors, states, vectors
from small_arms import planar_block, wrist

from tp_controller import build_settings
from tp_controller.config import check_changes, controller_schema, read_parameter_file
from tp_controller.errors import InvalidValue
from tp_controller.parameters import flatten
from tp_controller.tasks import GazeTask, JointTask, PoseTask, PositionTask

POSE_ROWS = {'position': slice(0, 2), 'orientation': slice(2, 3)}


def pose_task(**settings):
    return PoseTask('t', wrist(), 'link_3', 'xy', 'z', **settings)


def desired_velocity(task):
    task.update()
    velocity = np.empty(task.k)
    task.desired_velocity(velocity)
    return velocity


def limited(velocity, groups, speeds):
    """The velocity with each of its parts made as short as its largest speed."""
    found = np.array(velocity)
    for rows, speed in zip(groups, speeds, strict=True):
        size = np.linalg.norm(velocity[rows])
        found[rows] *= min(1.0, speed / size) if size else 1.0
    return found


@given(
    q=states(3), values=gains(3), feedforward=vectors(3, 5), speeds=positive_vectors(2, 0.05, 9.0)
)
@examples(60)
def test_a_pose_has_a_largest_speed_for_position_and_rotation(q, values, feedforward, speeds):
    free, task = pose_task(), pose_task(max_speed=speeds)
    for one in (free, task):
        one.robot.update(np.array(q))
        one.target, one.gain, one.feedforward = [0.3, -0.2, 1.0], values, feedforward
    expected = limited(desired_velocity(free), POSE_ROWS.values(), speeds)
    np.testing.assert_allclose(desired_velocity(task), expected, atol=1e-12)
    given_part = np.empty(3)
    task.limited_feedforward(given_part)
    lost = desired_velocity(free) - expected
    np.testing.assert_allclose(task.left_out(), lost, atol=1e-12)
    # Gain term and feedforward are shortened alike.
    share = expected / np.where(desired_velocity(free) == 0.0, 1.0, desired_velocity(free))
    moves = desired_velocity(free) != 0.0
    np.testing.assert_allclose(given_part[moves], (share * feedforward)[moves], atol=1e-9)


@given(
    q=states(3), feedforward=vectors(3, 3), speeds=positive_vectors(3, 0.05, 3.0), data=st.data()
)
@examples(60)
def test_the_stack_asks_for_what_its_tasks_do(q, feedforward, speeds, data):
    block = {
        'robot': planar_block(0.75, 0.5, 0.5),
        'solver': {'settle': False},
        'hierarchy': ['place', 'posture'],
        'tasks': {
            'place': {
                'type': 'pose',
                'frame': 'link_3',
                'position_axes': 'xy',
                'orientation_axes': 'z',
                'gain': data.draw(gains(3)),
                'max_speed': speeds[:2],
                'feedforward': feedforward,
                'target': data.draw(vectors(3, 2)),
            },
            'posture': {
                'type': 'posture',
                'max_speed': speeds,
                'target': data.draw(vectors(3, 2)),
            },
        },
    }
    stack = build_settings(block).stack
    stack.step(np.array(q))
    for name, task in stack.tasks.items():
        velocity = np.empty(task.k)
        task.desired_velocity(velocity)
        np.testing.assert_allclose(stack.velocities_of(name)[0], velocity, atol=1e-12)
        for rows, speed in zip(task.speed_groups, task.max_speed, strict=True):
            assert np.linalg.norm(velocity[rows]) <= speed * (1.0 + 1e-12)


def test_rows_that_compiled_code_does_not_fill_are_limited_alike():
    task = GazeTask('t', wrist(), 'link_3', gain=5.0, max_speed=0.2, target=[1.0, 2.0, -3.0])
    task.robot.update(np.array([0.3, 0.7, -0.4]))
    assert np.linalg.norm(desired_velocity(task)) == pytest.approx(0.2, rel=1e-12)


@pytest.mark.parametrize('saturation', ['uniform', 'null_space'])
def test_the_hand_of_a_panda_is_never_faster_and_gets_there(config, saturation):
    values = read_parameter_file(config / 'panda.yaml', 'tp_controller')
    values['solver.saturation'] = saturation
    values['tasks.hand_position.max_speed'] = [0.25]
    stack = build_settings(values).stack
    q = np.array([0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785])
    stack.step(q)
    task, period = stack.tasks['hand_position'], stack.safety_filter.period
    task.target = task.current + np.array([0.1, 0.4, -0.2])
    places = []
    for _ in range(round(5.0 / period)):
        command = stack.step(q).command
        assert np.linalg.norm(task.J @ command) <= 0.25 * (1.0 + 1e-9)
        places.append(task.current)
        q = q + period * command
    speeds = np.linalg.norm(np.diff(places, axis=0), axis=1) / period
    assert 0.24 < speeds.max() < 0.2505
    assert np.linalg.norm(task.error) < 1e-3


@pytest.mark.parametrize(
    ('task', 'values', 'accepts'),
    [
        (pose_task, [0.1, 0.1, 0.1], '1 or 2 values'),
        (lambda: PositionTask('t', wrist(), 'link_3'), [0.1, 0.1], '1 value'),
        (lambda: JointTask('t', wrist(), ['yaw', 'roll']), [0.1] * 3, '1 or 2 values'),
        (pose_task, [0.1, 0.0], 'numbers above 0'),
        (pose_task, [-1.0], 'numbers above 0'),
        (pose_task, [float('nan')], 'numbers above 0'),
        (pose_task, [], '1 or 2 values'),
    ],
)
def test_other_values_are_refused_and_nothing_changes(task, values, accepts):
    one = task()
    one.max_speed = 0.5
    before = one.max_speed
    with pytest.raises(InvalidValue) as caught:
        one.max_speed = values
    assert caught.value.key == 'max_speed'
    assert caught.value.accepts.startswith(accepts)
    np.testing.assert_array_equal(one.max_speed, before)


def test_a_larger_speed_while_running_is_said_to_be_less_safe():
    block = {
        'robot': planar_block(0.75, 0.5, 0.5),
        'hierarchy': ['posture'],
        'tasks': {'posture': {'type': 'posture', 'max_speed': [0.5], 'target': [1.0, 0.0, 0.0]}},
    }
    settings, schema = build_settings(block), controller_schema(flatten(block))
    said = check_changes(settings, schema, {'tasks.posture.max_speed': [0.5, 0.4, 0.6]})()
    assert said == (
        'less safe from now on: tasks.posture.max_speed is larger: '
        '[0.5, 0.5, 0.5] to [0.5, 0.4, 0.6]',
    )
    assert check_changes(settings, schema, {'tasks.posture.max_speed': [0.1]})() == ()
    settings.stack.step(np.zeros(3))
    np.testing.assert_array_equal(settings.stack.velocities_of('posture')[0], [0.1, 0.0, 0.0])
