"""The controller as a managed node."""

import numpy as np
import pytest
from lifecycle_msgs.msg import TransitionEvent
from lifecycle_msgs.srv import ChangeState, GetState
from sensor_msgs.msg import JointState

from tp_interfaces.action import Reach
from tp_interfaces.msg import ControllerState
from tp_interfaces.srv import AddTask
from tp_sim.harness import ClosedLoop, GoalRejected

START = [0.0, 0.6, 0.3]
RATE, LIMIT = 100.0, 2.0
SHARED = {'rate': RATE, 'robot': {'limits': {'velocity': [1.0], 'acceleration': [LIMIT]}}}


def change(client, label):
    """Ask for a transition; whether it was made, and the state by then."""
    request = ChangeState.Request()
    request.transition.label = label
    made = client.call(ChangeState, 'tp_controller/change_state', request).success
    state = client.call(GetState, 'tp_controller/get_state', GetState.Request())
    return made, state.current_state.label


def test_a_moving_controller_is_driven_through_all_states(config):
    with ClosedLoop(config / 'a4_position_joint.yaml', {'/**': SHARED}, lockstep=False) as loop:
        client = loop.client
        commands = client.collect(JointState, 'joint_velocity_command')
        events = client.collect(TransitionEvent, 'tp_controller/transition_event')
        joints = client.collect(JointState, 'joint_states')

        def moves():
            return loop.state.status == ControllerState.RUNNING and max(np.abs(speed())) > 0.1

        def speed():
            return np.array(commands[-1].velocity) if commands else np.zeros(3)

        reach = client.start_reach({'ee_position': [1.0, -0.5]})
        client.wait_for(moves, 'motion')
        assert change(client, 'deactivate') == (True, 'inactive')
        ended = reach.wait()
        assert ended.outcome == Reach.Result.INTERRUPTED
        assert 'deactivated' in ended.message
        client.wait_for(lambda: loop.state.status == ControllerState.INACTIVE, 'the state')
        assert loop.state.message.startswith('inactive: no command is sent')
        assert not loop.state.held
        client.wait_for(
            lambda: [list(msg.velocity) for msg in commands[-10:]] == [[0.0] * 3] * 10, 'ten zeros'
        )
        # No command skipped: braking is inside the limit of acceleration.
        steps = np.abs(np.diff([msg.velocity for msg in commands], axis=0)).max(axis=1)
        assert np.sort(steps[-30:])[-1] <= 1.5 * LIMIT / RATE
        before = len(commands)
        client.spin_for(0.3)
        assert len(commands) == before
        refused = client.start_reach({'ee_position': [1.0, -0.5]}).wait()
        assert refused.outcome == Reach.Result.REFUSED
        assert 'one while the node is not active' in refused.message
        with pytest.raises(GoalRejected, match='not active'):
            loop.send_feedforward('ee_position', [0.1, 0.0])
        assert change(client, 'deactivate') == (False, 'inactive')
        assert loop.controller.running

        # Where the arm is: the controller's state has where it was when it last answered one.
        before, place = len(commands), list(joints[-1].position)
        assert change(client, 'activate') == (True, 'active')
        client.wait_for(lambda: loop.state.status == ControllerState.RUNNING, 'control')
        client.spin_for(0.2)
        assert not np.any([msg.velocity for msg in commands[before:]])
        assert loop.state.position == pytest.approx(place, abs=1e-6)
        loop.send_goal('ee_position', [1.0, -0.5])
        client.wait_for(moves, 'motion')

        added = '{type: joint, joints: [joint_2]}'
        request = AddTask.Request(name='added', level=1, parameters=added)
        assert client.call(AddTask, 'tp_controller/add_task', request).success
        for _ in range(2):
            change(client, 'deactivate')
            change(client, 'cleanup')
            # The present stack is what comes again.
            assert change(client, 'configure') == (True, 'inactive')
            assert change(client, 'activate') == (True, 'active')
        client.wait_for(lambda: loop.state.status == ControllerState.RUNNING, 'control')
        assert client.task('added').level == 1

        change(client, 'deactivate')
        assert change(client, 'cleanup') == (True, 'unconfigured')
        client.wait_for(lambda: loop.state.status == ControllerState.WAITING, 'the state')
        assert loop.state.message.startswith('unconfigured')
        loop.set_parameters({'hierarchy': ['no_such_task']})
        assert change(client, 'configure') == (False, 'unconfigured')
        # What is read-only while the node is configured may be changed now.
        loop.set_parameters({'hierarchy': ['ee_position'], 'tasks.ee_position.frame': 'link_2'})
        assert change(client, 'configure') == (True, 'inactive')
        with pytest.raises(GoalRejected):
            loop.set_parameters({'tasks.ee_position.frame': 'link_3'})
        assert change(client, 'activate') == (True, 'active')
        client.wait_for(lambda: loop.state.status == ControllerState.RUNNING, 'control')
        assert [task.name for task in loop.state.tasks if task.level >= 0] == ['ee_position']
        place = list(client.task('ee_position').current)
        assert client.start_reach({'ee_position': place}).wait().outcome == Reach.Result.REACHED

        assert change(client, 'shutdown') == (True, 'finalized')
        assert events[-1].goal_state.label == 'finalized'
        assert not any(commands[-1].velocity)
        output = loop.controller.output
        assert loop.controller.stop() == 0
        loop.controller = None
        assert 'Traceback' not in output
        assert "hierarchy: got 'no_such_task'" in output


def test_without_autostart_it_waits_and_leaves_the_arm_to_others(lone_controller):
    changes = {'tp_controller': {'autostart': False}, '/**': {'command': {}}}
    changes['/**'] = SHARED | {'command': {'type': 'joint_state_position'}}
    controller = lone_controller(changes, wait=False)
    client = controller.client
    positions = client.collect(JointState, 'joint_position_command')
    client.wait_for(lambda: client.state is not None, 'the controller')
    assert controller.state.message.startswith('unconfigured')
    assert change(client, 'activate') == (False, 'unconfigured')
    assert change(client, 'configure') == (True, 'inactive')
    client.wait_for(lambda: controller.state.status == ControllerState.INACTIVE, 'the state')
    for place in (START, [0.4, 0.5, 0.6]):
        assert change(client, 'activate') == (True, 'active')
        before = len(positions)
        while len(positions) == before:
            # A busy machine may hold a state up until it is too old.
            ignored = controller.state.ignored_states
            controller.give(place)
            client.wait_for(
                lambda before=before, ignored=ignored: (
                    len(positions) > before or controller.state.ignored_states > ignored
                ),
                'a command',
            )
        # A new beginning each time, exactly where the arm is.
        assert list(positions[before].position) == place
        assert change(client, 'deactivate') == (True, 'inactive')
        before = len(positions)
        controller.give(START)
        client.spin_for(0.2)
        assert len(positions) == before
    assert controller.process.stop() == 0
    assert len(positions) == before
    assert 'ended by' not in controller.process.output
