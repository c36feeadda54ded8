import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from planar_config import changed, dotted_parameters, nested_parameters
from random_stacks import examples, parameters, states

from tp_controller import InvalidValue, build_settings
from tp_controller.config import (
    SHARED,
    controller_schema,
    describe_robot,
    read_parameters,
    robot_source,
)
from tp_controller.parameters import Parameter, flatten
from tp_controller.tasks import COMMON, TASK_TYPES

Q = np.array([0.1, 0.6, 0.3])


def whole(value):
    """The same value with whole numbers in place of decimals, where they are whole."""
    if isinstance(value, dict):
        return {key: whole(entry) for key, entry in value.items()}
    if isinstance(value, list):
        return [whole(entry) for entry in value]
    return int(value) if isinstance(value, float) and value.is_integer() else value


def rounded(value):
    if isinstance(value, dict):
        return {key: rounded(entry) for key, entry in value.items()}
    if isinstance(value, list):
        return [rounded(entry) for entry in value]
    return float(np.ceil(value)) if isinstance(value, float) else value


def command(block, q=Q):
    return build_settings(block).stack.step(q).command.copy()


def test_nested_and_dotted_parameters_are_the_same():
    assert flatten(nested_parameters()) == dotted_parameters()
    np.testing.assert_array_equal(command(nested_parameters()), command(dotted_parameters()))


def test_a_block_may_have_dotted_keys_inside():
    mixed = nested_parameters()
    mixed['tasks'] = {'tip.type': 'position', 'tip.frame': 'link_3', 'tip': {'axes': 'xy'}}
    assert flatten(mixed)['tasks.tip.type'] == 'position'
    assert flatten(mixed)['tasks.tip.axes'] == 'xy'


@given(parameters(), st.data())
@examples(40)
def test_random_parameters_mean_the_same_nested_and_dotted(block, data):
    q = data.draw(states(len(block['robot']['joints'])))
    np.testing.assert_array_equal(command(block, q), command(flatten(block), q))


def test_whole_numbers_are_accepted_wherever_a_number_is_expected():
    block = rounded(nested_parameters())
    block['robot']['dh']['base_pose'] = [1.0, 2.0, 3.0, 0.0, 1.0, 0.0]
    block['robot']['limits'] = {
        'velocity': [1.0, 2.0, 3.0],
        'acceleration': [4.0],
        'position_min': [-3.0],
        'position_max': [3.0],
    }
    block['rate'] = 100.0
    block['tasks']['tip'] |= {'gain': [2.0, 0.0, 0.0, 2.0]}
    numbers = [v for v in flatten(whole(block)).values() if not isinstance(v, str)]
    assert not any(
        isinstance(number, float) for v in numbers for number in (v if type(v) is list else [v])
    )
    np.testing.assert_array_equal(command(whole(block)), command(block))


def test_one_value_may_stand_for_a_list_of_one():
    block = changed({'hierarchy': 'turn', 'tasks.turn.target': 0.3, 'robot.limits.velocity': 1})
    listed = changed(
        {'hierarchy': ['turn'], 'tasks.turn.target': [0.3], 'robot.limits.velocity': [1.0]}
    )
    np.testing.assert_array_equal(command(block), command(listed))


def test_tuples_and_arrays_of_numbers_are_lists():
    block = changed({'tasks.tip.target': (1.0, 0.5), 'tasks.tip.gain': np.array([2.0, 3.0])})
    np.testing.assert_array_equal(command(block), command(dotted_parameters()))


def test_what_is_left_out_has_its_default():
    block = {
        'robot': nested_parameters()['robot'],
        'hierarchy': ['tip'],
        'tasks': {'tip': {'type': 'position', 'frame': 'link_3'}},
    }
    del block['robot']['limits'], block['robot']['base_frame']
    values, stack = build_settings(block)
    assert values['solver.type'] == 'recursive'
    assert values['solver.damping'] == stack.solver.damping == 0.1
    assert values['command.type'] == 'joint_state'
    assert values['timeouts.joint_state'] == 0.1
    assert values['timeouts.feedforward'] == 0.5
    assert values['robot.dh.base_pose'] == (0.0,) * 6
    assert values['tasks.tip.axes'] == 'xyz'
    assert stack.robot.base_frame == 'base'
    assert np.all(np.isinf(stack.robot.limits.velocity))
    task = stack.tasks['tip']
    assert task.target is None
    np.testing.assert_array_equal(task.gain, np.eye(3))
    np.testing.assert_array_equal(task.feedforward, np.zeros(3))


def test_every_value_reaches_the_object_that_it_is_for():
    values, stack = build_settings(
        changed(
            {
                'robot.dh.base_pose': [1.0, 2.0, 3.0, 0.0, 0.0, 0.5],
                'robot.base_frame': 'world',
                'robot.limits.velocity': [1.0, 2.0, 3.0],
                'robot.limits.position_min': [-1.0],
                'robot.limits.position_max': [2.0],
                'robot.limits.acceleration': [4.0],
                'rate': 50.0,
                'solver.damping': 0.25,
                'command.type': 'float64_multi_array',
            }
        )
    )
    robot = stack.robot
    assert robot.joints == ('joint_1', 'joint_2', 'joint_3')
    assert robot.base_frame == 'world'
    assert stack.solver.damping == 0.25
    assert stack.safety_filter.period == 0.02
    assert values['command.type'] == 'float64_multi_array'
    assert stack.hierarchy == ('tip + elbow', 'turn', 'place')
    assert list(stack.tasks) == ['tip', 'turn', 'place', 'elbow', 'spare']
    np.testing.assert_array_equal(robot.limits.velocity, [1.0, 2.0, 3.0])
    np.testing.assert_array_equal(robot.limits.position_min, [-1.0] * 3)
    np.testing.assert_array_equal(robot.limits.position_max, [2.0] * 3)
    np.testing.assert_array_equal(robot.limits.acceleration, [4.0] * 3)
    np.testing.assert_allclose(
        robot.frame('link_3').position,
        [1.0 + 1.75 * np.cos(0.5), 2.0 + 1.75 * np.sin(0.5), 3.0],
    )
    tip, turn, place, elbow, spare = stack.tasks.values()
    assert (tip.type, tip.frame_name, tip.components) == ('position', 'link_3', ('x', 'y'))
    assert (turn.type, turn.frame_name, turn.components) == ('orientation', 'link_2', ('rz',))
    assert (place.type, place.components) == ('pose', ('x', 'y', 'rz'))
    assert (elbow.type, elbow.frame_name, elbow.components) == ('joint', '', ('joint_2',))
    assert spare.components == ('rx', 'ry', 'rz')
    np.testing.assert_array_equal(tip.target, [1.0, 0.5])
    np.testing.assert_array_equal(tip.gain, np.diag([2.0, 3.0]))
    np.testing.assert_array_equal(tip.feedforward, [0.1, 0.2])
    np.testing.assert_allclose(spare.target, [0.0, 0.0, 0.6, 0.8])


def test_building_leaves_the_parameters_alone():
    block = nested_parameters()
    build_settings(block).stack.step(Q)
    assert block == nested_parameters()


@pytest.mark.parametrize('key', controller_schema(dotted_parameters()))
def test_every_parameter_says_what_it_is_and_what_it_accepts(key):
    parameter = controller_schema(dotted_parameters())[key]
    assert isinstance(parameter, Parameter)
    assert parameter.description
    assert parameter.accepts


def test_the_parameters_that_may_change_while_running_are_those_of_the_contract():
    runtime = {
        key for key, value in controller_schema(dotted_parameters()).items() if value.runtime
    }
    limits = {f'robot.limits.{key}' for key in ('velocity', 'acceleration')}
    limits |= {f'robot.limits.position_{key}' for key in ('min', 'max')}
    tasks = {
        f'tasks.{name}.{leaf}'
        for name in nested_parameters()['tasks']
        for leaf in (
            'enabled',
            'gain',
            'feedforward',
            'max_speed',
            'target',
            'weight',
            'time_scaling',
            'around',
        )
    }
    solver = ('type', 'inverse', 'damping', 'singular_region', 'joint_weights', 'saturation')
    solver = {f'solver.{key}' for key in (*solver, 'settle')}
    assert runtime == {'hierarchy', 'resume', 'transition_time'} | solver | limits | tasks


def test_the_schema_holds_the_parameters_of_every_task_type():
    schema = controller_schema(dotted_parameters())
    assert set(SHARED) < set(schema)
    for name, block in nested_parameters()['tasks'].items():
        own = {key.split('.')[2] for key in schema if key.startswith(f'tasks.{name}.')}
        expected = set(COMMON)
        assert own == expected | set(TASK_TYPES[block['type']].parameters)


def test_an_empty_block_is_refused_not_dropped():
    with pytest.raises(InvalidValue, match=r'tasks\.spare: got an empty block'):
        flatten({'hierarchy': ['tip'], 'tasks': {'tip': {'type': 'joint'}, 'spare': {}}})


def test_a_value_given_nested_and_dotted_is_refused():
    with pytest.raises(InvalidValue, match=r'solver\.damping: got two values'):
        flatten({'solver': {'damping': 1.0}, 'solver.damping': 2.0})


def test_a_description_takes_the_place_of_the_dh_parameters():
    values, stack = build_settings(dotted_parameters())
    text = describe_robot(values)
    block = changed({'robot.dh.*': None, 'robot.joints': None})
    for settings in (
        build_settings(block, text),
        build_settings(block | {'robot_description': text}, 'not looked at'),
    ):
        assert settings.values['robot.joints'] == ('joint_1', 'joint_2', 'joint_3')
        assert describe_robot(settings.values, text) == text
        expected = stack.step(Q).command
        np.testing.assert_allclose(settings.stack.step(Q).command, expected, atol=1e-9)


@pytest.mark.parametrize(
    ('changes', 'source'),
    [
        ({}, 'robot.dh.theta'),
        ({'robot.dh.*': None, 'robot.dh.a': [1.0]}, 'robot.dh.a'),
        ({'robot.dh.*': None, 'robot.urdf': 'arm.urdf'}, 'robot.urdf'),
        ({'robot.dh.*': None, 'robot_description': ''}, 'robot_description'),
        ({'robot.dh.*': None}, None),
    ],
)
def test_the_key_that_describes_the_robot_is_found(changes, source):
    assert robot_source(changed(changes)) == source


def test_without_a_robot_everything_else_is_checked():
    block = changed({'robot.dh.*': None, 'robot.rest_positions.wrist': 0.5})
    values = read_parameters(block)
    assert values['robot.rest_positions.wrist'] == 0.5
    assert values['tasks.tip.axes'] == 'xy'
    with pytest.raises(InvalidValue, match=r'robot\.urfd: .*robot\.urdf \(did you mean'):
        read_parameters(block | {'robot.urfd': 'arm.urdf'})
