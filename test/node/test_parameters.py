"""Parameters that change while the controller runs, and those that do not."""

import numpy as np
import pytest
from rcl_interfaces.srv import DescribeParameters, GetParameters, ListParameters

from tp_sim.harness import ClosedLoop, GoalRejected


@pytest.fixture(scope='module')
def loop(config):
    with ClosedLoop(config / 'a4_position_joint.yaml') as loop:
        yield loop


@pytest.fixture(autouse=True)
def start(loop):
    loop.reset()
    loop.set_parameters(
        {
            'hierarchy': ['ee_position', 'joint_1_position'],
            'tasks.ee_position.gain': [1.0],
            'tasks.ee_position.target': [1.0, 0.5],
            'tasks.ee_position.feedforward': [0.0, 0.0],
            'solver.damping': 0.1,
            'robot.limits.velocity': [1.0],
            'transition_time': 0.0,
        }
    )
    loop.clear_record()


def value_of(loop, name):
    response = loop.client.call(
        GetParameters, 'tp_controller/get_parameters', GetParameters.Request(names=[name])
    )
    value = response.values[0]
    return list(value.double_array_value) or list(value.string_array_value) or value.double_value


def test_hierarchy_changes_at_run_time(loop):
    loop.set_parameters({'hierarchy': ['joint_1_position + ee_position']})
    loop.step()
    assert [task.level for task in loop.state.tasks] == [0, 0]
    loop.set_parameters({'hierarchy': ['joint_1_position']})
    loop.step()
    assert {task.name: task.level for task in loop.state.tasks} == {
        'ee_position': -1,
        'joint_1_position': 0,
    }


def test_gain_target_and_feedforward_change_at_run_time(loop):
    loop.set_parameters(
        {
            'tasks.ee_position.gain': [1.0, 0.5, 0.0, 2.0],
            'tasks.ee_position.target': [0.8, 0.9],
            'tasks.ee_position.feedforward': [0.01, 0.02],
        }
    )
    loop.step(0)
    record = loop.record
    error = record.error['ee_position'][-1]
    assert record.desired['ee_position'][-1] == pytest.approx([0.8, 0.9])
    expected = np.array([[1.0, 0.5], [0.0, 2.0]]) @ error + [0.01, 0.02]
    assert record.requested['ee_position'][-1] == pytest.approx(expected)


def test_whole_numbers_are_accepted(loop):
    loop.set_parameters({'tasks.ee_position.target': [1, 0], 'solver.damping': 1})
    loop.step(0)
    assert list(loop.client.task('ee_position').desired) == [1.0, 0.0]


def test_velocity_limits_change_at_run_time(loop):
    loop.set_parameters({'robot.limits.velocity': [0.01, 0.02, 0.03]})
    loop.step(0)
    command = np.abs(loop.record.qd[-1])
    assert np.all(command <= [0.01, 0.02, 0.03])
    assert np.any(command == [0.01, 0.02, 0.03])


@pytest.mark.parametrize(
    ('name', 'value', 'reason'),
    [
        ('hierarchy', ['hand'], "hierarchy: got 'hand'; accepts names out of ee_position"),
        ('hierarchy', ['ee_position', 'ee_position'], 'hierarchy: got .* twice'),
        ('tasks.ee_position.gain', [1.0, 2.0, 3.0], 'tasks.ee_position.gain: got 3 values'),
        ('tasks.ee_position.gain', [-1.0], 'tasks.ee_position.gain: got .*at least 0'),
        ('tasks.ee_position.target', [1.0], 'tasks.ee_position.target: got 1 value'),
        ('tasks.ee_position.target', [float('nan'), 0.0], 'target: got .*finite'),
        ('tasks.ee_position.target', 'home', "target: got 'home'; accepts a list of numbers"),
        ('tasks.ee_position.feedforward', [0.0], 'feedforward: got 1 value'),
        ('solver.damping', -0.1, 'solver.damping: got -0.1; accepts a number of at least 0'),
        ('robot.limits.velocity', [1.0, 1.0], 'robot.limits.velocity: got 2 values'),
        ('robot.limits.velocity', [0.0], 'robot.limits.velocity: got .*above 0'),
        ('solver.type', 'hpq', "solver.type: got 'hpq'; accepts one of"),
        ('rate', 10.0, 'read-only'),
        ('tasks.ee_position.frame', 'link_2', 'a change while running'),
        ('tasks.hand.gain', [1.0], 'tasks.hand.gain'),
    ],
)
def test_a_bad_value_is_refused_with_a_reason_and_changes_nothing(loop, name, value, reason):
    loop.step(0)
    before = loop.record.qd[-1].copy()
    with pytest.raises(GoalRejected, match=reason):
        loop.set_parameters({name: value})
    loop.step(0)
    assert np.array_equal(loop.record.qd[-1], before)


def test_of_several_values_all_or_none_are_taken(loop):
    with pytest.raises(GoalRejected, match=r'solver\.damping'):
        loop.set_parameters({'tasks.ee_position.target': [0.0, 1.0], 'solver.damping': -1.0})
    loop.step(0)
    assert list(loop.client.task('ee_position').desired) == [1.0, 0.5]
    assert value_of(loop, 'tasks.ee_position.target') == [1.0, 0.5]


def test_every_parameter_is_listed_and_described(loop):
    listing = loop.client.call(
        ListParameters, 'tp_controller/list_parameters', ListParameters.Request()
    )
    names = [name for name in listing.result.names if name not in ROS_OWN]
    assert {'solver.damping', 'timeouts.joint_state', 'tasks.ee_position.feedforward'} <= set(
        names
    )
    response = loop.client.call(
        DescribeParameters,
        'tp_controller/describe_parameters',
        DescribeParameters.Request(names=names),
    )
    for descriptor in response.descriptors:
        assert descriptor.description, descriptor.name
        assert descriptor.additional_constraints, descriptor.name
    read_only = {d.name: d.read_only for d in response.descriptors}
    assert not read_only['solver.damping']
    assert read_only['rate']
    assert value_of(loop, 'timeouts.feedforward') == 0.5


ROS_OWN = ('use_sim_time', 'start_type_description_service')
