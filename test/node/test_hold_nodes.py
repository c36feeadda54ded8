"""Hold and resume over a real service."""

import numpy as np
import pytest
from sensor_msgs.msg import JointState
from std_srvs.srv import SetBool

from tp_interfaces.msg import ControllerState
from tp_interfaces.srv import AddTask, RemoveTask
from tp_sim.harness import ClosedLoop, GoalRejected
from tp_sim.harness.document import edited

START = [0.0, 0.6, 0.3]
BALL = '{type: obstacle, frame: link_3, axes: xy, center: [5.0, 5.0], radius: 0.2}'
LIMIT = 2.0
RATE = 100.0
PATIENT = {'timeouts': {'joint_state': 60.0}}
"""Joint states do not stop because the test is slow."""
SHARED = {'rate': RATE, 'robot': {'limits': {'velocity': [1.0], 'acceleration': [LIMIT]}}}


def hold(client, data=True):
    response = client.call(SetBool, 'tp_controller/hold', SetBool.Request(data=data))
    assert response.success
    return response.message


@pytest.fixture(scope='module')
def loop(config):
    with ClosedLoop(
        config / 'a4_position_joint.yaml', {'/**': SHARED, 'tp_controller': PATIENT}
    ) as loop:
        yield loop


@pytest.fixture
def moving(loop):
    """A loop whose arm is on its way to a goal."""
    if loop.state.held:
        hold(loop.client, False)
    loop.set_parameters({'resume': 'present'})
    loop.reset()
    loop.clear_record()
    loop.send_goal('ee_position', [1.0, -0.5])
    loop.run(0.5)
    assert np.abs(loop.state.command).max() > 0.2
    return loop


def changes_of(loop):
    """Largest change of the command in one step, as a share of what the limit allows."""
    command = loop.record.qd
    return np.abs(np.diff(command, axis=0)).max() * RATE / LIMIT


def test_a_hold_brakes_inside_the_limit_says_so_and_goes_on_in_place(moving):
    client = moving.client
    assert hold(client) == 'braking to rest'
    assert hold(client) == 'held already'
    moving.step(1)
    assert moving.state.status == ControllerState.HELD
    assert moving.state.held
    assert moving.state.message.startswith('held by ~/hold: braking')
    assert np.any(moving.state.command)
    moving.run(1.0)
    assert not np.any(moving.state.command)
    assert moving.state.status == ControllerState.HELD
    assert moving.state.message.startswith('held by ~/hold: at rest')
    assert list(moving.state.levels) == []
    place = list(moving.state.position)
    moving.run(1.0)
    assert list(moving.state.position) == place
    assert hold(client, False) == 'resumed, resume: present'
    assert hold(client, False) == 'not held: nothing to resume'
    moving.run(1.0)
    assert moving.state.status == ControllerState.RUNNING
    assert not moving.state.held
    assert 'held by ~/hold' not in moving.state.message
    assert moving.state.position == pytest.approx(place, abs=1e-9)
    assert changes_of(moving) <= 1.0 + 1e-9


def test_the_log_has_a_line_at_hold_at_rest_and_at_resume(moving):
    def lines():
        said = moving.controller.output.splitlines()
        return [line.split(': ', 1)[1] for line in said if '~/hold' in line]

    before = len(lines())
    hold(moving.client)
    moving.run(1.0)
    hold(moving.client)
    moving.run(0.5)
    hold(moving.client, False)
    moving.client.wait_for(lambda: len(lines()) - before >= 3, 'the lines')
    assert lines()[before:] == [
        'held by ~/hold: braking to rest',
        'held by ~/hold: at rest',
        'resumed by ~/hold, resume: present',
    ]


def test_a_goal_that_comes_meanwhile_moves_nothing_and_counts_afterwards(moving):
    hold(moving.client)
    moving.run(1.0)
    place = list(moving.state.position)
    moving.send_goal('ee_position', [1.2, 0.4])
    with pytest.raises(GoalRejected, match='map'):
        moving.send_goal('ee_position', [1.2, 0.4], frame='map')
    with pytest.raises(GoalRejected, match=r'tasks.ee_position.gain: got \[-1.0\]'):
        moving.set_parameters({'tasks.ee_position.gain': [-1.0]})
    moving.set_parameters({'tasks.ee_position.gain': [2.0]})
    moving.run(0.5)
    assert list(moving.state.position) == place
    hold(moving.client, False)
    moving.run(8.0)
    assert moving.client.task('ee_position').desired == pytest.approx([1.2, 0.4])
    assert moving.client.task('ee_position').error_norm < 1e-3
    moving.set_parameters({'tasks.ee_position.gain': [1.0]})
    assert changes_of(moving) <= 1.0 + 1e-9


def test_with_the_old_targets_the_arm_goes_on_to_its_goal(moving):
    hold(moving.client)
    moving.run(1.0)
    moving.set_parameters({'resume': 'targets'})
    assert hold(moving.client, False) == 'resumed, resume: targets'
    moving.run(12.0)
    assert moving.client.task('ee_position').desired == pytest.approx([1.0, -0.5])
    assert moving.client.task('ee_position').error_norm < 1e-3
    assert changes_of(moving) <= 1.0 + 1e-9
    with pytest.raises(GoalRejected, match="resume: got 'now'; accepts one of present, targets"):
        moving.set_parameters({'resume': 'now'})


def test_a_hold_survives_a_reset_and_changes_of_the_hierarchy(moving):
    client = moving.client
    hold(client)
    moving.run(1.0)
    moving.reset({'joint_1': 0.5, 'joint_2': 0.6, 'joint_3': 0.3})
    moving.run(0.2)
    request = AddTask.Request(name='ball', parameters=BALL, level=0)
    assert client.call(AddTask, 'tp_controller/add_task', request).success
    moving.run(0.2)
    assert client.task('ball').level == 0
    moving.set_parameters({'hierarchy': ['ee_position']})
    moving.run(0.2)
    request = RemoveTask.Request(name='ball')
    assert client.call(RemoveTask, 'tp_controller/remove_task', request).success
    moving.set_parameters({'hierarchy': ['joint_1_position', 'ee_position']})
    moving.run(0.2)
    assert moving.state.status == ControllerState.HELD
    assert moving.state.position == pytest.approx([0.5, 0.6, 0.3], abs=1e-12)
    hold(client, False)
    moving.run(0.5)
    assert moving.state.position == pytest.approx([0.5, 0.6, 0.3], abs=1e-9)
    moving.set_parameters({'hierarchy': ['ee_position', 'joint_1_position']})


def test_without_a_limit_of_acceleration_the_next_command_is_zero(config):
    with ClosedLoop(config / 'a4_position_joint.yaml', {'tp_controller': PATIENT}) as loop:
        loop.send_goal('ee_position', [1.0, -0.5])
        loop.run(0.5)
        assert np.any(loop.state.command)
        hold(loop.client)
        loop.step(1)
        assert not np.any(loop.state.command)
        hold(loop.client, False)
        loop.send_goal('ee_position', [1.0, -0.5])
        loop.run(0.5)
        assert np.any(loop.state.command)


def test_a_late_arm_is_held_too(config):
    late = {'/**': {'robot': {'delay': [0.03], 'lag': [0.05]}}}
    late['/**'] |= SHARED | {'robot': SHARED['robot'] | late['/**']['robot']}
    late |= {'tp_sim': {'plant': {'delay': 3, 'lag': [0.05]}}, 'tp_controller': PATIENT}
    with ClosedLoop(config / 'a4_position_joint.yaml', late) as loop:
        loop.send_goal('ee_position', [1.0, -0.5])
        loop.run(0.5)
        hold(loop.client)
        loop.run(1.5)
        assert loop.state.message.startswith('held by ~/hold: at rest')
        place = np.array(loop.state.position)
        loop.run(1.0)
        assert loop.state.position == pytest.approx(place, abs=1e-4)
        assert changes_of(loop) <= 1.0 + 1e-9


def test_a_hold_from_before_the_first_state_lasts_through_pauses(lone_controller):
    controller = lone_controller({'tp_controller': {'start': 'target'}})
    client = controller.client
    hold(client)
    client.wait_for(lambda: controller.state.held, 'the hold')
    assert controller.state.status == ControllerState.WAITING
    assert 'held by ~/hold: at rest' in controller.state.message
    assert controller.ask(START) == [0.0, 0.0, 0.0]
    assert controller.state.status == ControllerState.HELD
    client.wait_for(lambda: controller.state.status == ControllerState.STALE, 'stale')
    assert controller.state.message.startswith('held by ~/hold: at rest; ')
    assert controller.ask(START) == [0.0, 0.0, 0.0]
    assert controller.state.status == ControllerState.HELD
    hold(client, False)
    client.send_goal('ee_position', [1.0, -0.5])
    assert np.any(controller.ask(START))
    assert not any(any(command.velocity) for command in controller.commands[:-1])


def test_an_empty_hierarchy_means_rest_at_start_and_later(config):
    changes = {'/**': SHARED, 'tp_controller': PATIENT | {'hierarchy': ['']}}
    with ClosedLoop(config / 'a4_position_joint.yaml', changes) as loop:
        loop.clear_record()
        loop.run(0.5)
        assert loop.state.status == ControllerState.RUNNING
        assert 'no task in the hierarchy: at rest' in loop.state.message
        assert list(loop.state.position) == START
        loop.set_parameters({'hierarchy': ['ee_position']})
        loop.send_goal('ee_position', [1.0, -0.5])
        loop.run(0.6)
        assert 'no task' not in loop.state.message
        assert np.abs(loop.state.command).max() > 0.2
        loop.set_parameters({'hierarchy': ['']})
        loop.step(1)
        assert 'no task in the hierarchy: braking' in loop.state.message
        loop.run(1.0)
        assert 'no task in the hierarchy: at rest' in loop.state.message
        assert not np.any(loop.state.command)
        assert changes_of(loop) <= 1.0 + 1e-9


def test_a_late_arm_rests_outside_its_range_in_real_time_too(config):
    response = {'delay': 2 / RATE, 'lag': 0.02, 'noise': 5e-4}
    plant = {'delay': 2, 'lag': [0.02], 'noise': [5e-4]}
    ranges = {'position_min': [-3.0], 'position_max': [3.0]}
    shared = edited(SHARED, {'command': {'type': 'joint_state'}, 'robot': response})
    changes = {
        '/**': edited(shared, {'robot': {'limits': ranges}}),
        'tp_sim': {'plant': plant},
        'tp_controller': PATIENT,
    }
    with ClosedLoop(config / 'a4_position_joint.yaml', changes, lockstep=False) as loop:
        commands = loop.client.collect(JointState, 'joint_velocity_command')
        hold(loop.client)
        loop.client.wait_for(lambda: 'held by ~/hold: at rest' in loop.state.message, 'rest')
        # The second joint stands beyond this end.
        loop.set_parameters({'robot.limits.position_max': [3.0, START[1] - 1.3, 3.0]})
        count = len(commands)
        loop.client.wait_for(lambda: len(commands) > count + 100, 'commands')
        assert not any(any(command.velocity) for command in commands[count:])
        hold(loop.client, False)
        loop.client.wait_for(lambda: commands[-1].velocity[1] < -0.05, 'the way back')
        hold(loop.client)
        loop.client.wait_for(lambda: not any(commands[-1].velocity), 'rest')
        assert loop.state.position[1] > START[1] - 1.2, 'it stands outside'
