"""What ros2_control's forward_command_controller and joint_state_broadcaster expect, and give."""

import numpy as np
import pytest
from ros2_control_stand_in import JOINTS, RATE, START, Ros2Control

from tp_interfaces.msg import ControllerState

SPEED, ACCELERATION = 1.0, 2.0


@pytest.mark.parametrize('interface', ['velocity', 'position'])
def test_an_arm_behind_ros2_control_is_moved_and_left_at_rest(lone_controller, interface):
    limits = {'velocity': [SPEED], 'acceleration': [ACCELERATION]}
    kind = 'float64_multi_array' + ('_position' if interface == 'position' else '')
    changes = {
        '/**': {'rate': RATE, 'robot': {'limits': limits}, 'command': {'type': kind}},
        'tp_controller': {'start': 'hold'},
    }
    topic = f'joint_{interface}_command:=/{interface}_controller/commands'
    controller = lone_controller(changes, ['-r', topic], wait=False)
    client = controller.client
    arm = Ros2Control(client.node, interface)
    client.wait_for(lambda: len(arm.applied) > 20, 'commands')
    first = arm.applied[0].tolist()
    assert first == ([0.0] * 3 if interface == 'velocity' else [START[name] for name in JOINTS])
    client.send_goal('ee_position', [1.0, 0.5])
    client.wait_for(lambda: client.task('ee_position').error_norm < 0.01, 'the goal')
    client.send_goal('ee_position', [1.3, 0.2])
    client.wait_for(lambda: client.task('ee_position').error_norm < 0.3, 'motion')
    controller.process.signal(2)
    client.wait_for(lambda: not controller.process.running, 'the end')
    assert controller.process.wait() == 0
    count = len(arm.applied)
    client.wait_for(lambda: len(arm.applied) > count + 10, 'rest')
    assert arm.state['gripper'] == START['gripper']
    assert max(np.abs(list(arm.velocity.values()))) == 0.0
    last = np.array(arm.applied[-10:])
    assert np.ptp(last, axis=0).max() == 0.0
    if interface == 'velocity':
        # Readers are best effort and keep one: of positions that were lost nothing is said.
        assert np.abs(arm.received).max() <= SPEED
    assert client.state.status == ControllerState.RUNNING


@pytest.mark.parametrize(
    ('interface', 'kind', 'joints', 'told'),
    [
        ('position', '_position', ['joint_2', 'joint_3', 'joint_1'], 'has the joints joint_2, '),
        ('position', '', JOINTS, 'has the interface_name position, command.type gives velocity'),
    ],
    ids=['joints in another order', 'velocities for positions'],
)
def test_a_reader_that_takes_them_for_something_else_gets_no_command(
    lone_controller, interface, kind, joints, told
):
    changes = {
        '/**': {'rate': RATE, 'command': {'type': f'float64_multi_array{kind}'}},
        'tp_controller': {'start': 'target'},
    }
    topic = f'joint_{kind[1:] or "velocity"}_command:=/{interface}_controller/commands'
    controller = lone_controller(changes, ['-r', topic], wait=False)
    client = controller.client
    arm = Ros2Control(client.node, interface, joints)
    client.wait_for(lambda: client.state is not None and told in client.state.message, told)
    assert client.state.status == ControllerState.WAITING
    client.spin_for(0.3)
    controller.process.signal(2)
    assert controller.process.wait() == 0
    client.spin_for(0.1)
    assert not arm.received
    assert arm.state == START


def test_a_reader_that_does_not_tell_its_order_moves_an_arm_once(lone_controller):
    changes = {
        '/**': {'rate': RATE, 'command': {'type': 'float64_multi_array_position'}},
        'tp_controller': {'timeouts': {'joint_state': 60.0}, 'start': 'hold'},
    }
    topic = 'joint_position_command:=/position_controller/commands'
    client = lone_controller(changes, ['-r', topic], wait=False).client
    arm = Ros2Control(client.node, 'position', ['joint_2', 'joint_3', 'joint_1'], answers=False)
    told = 'joints are where others were sent: the reader has them in another order'
    client.wait_for(lambda: client.state is not None and told in client.state.message, told)
    count = len(arm.received)
    client.wait_for(lambda: len(arm.received) > count + 20, 'commands')
    assert np.ptp(arm.received[count:], axis=0).max() == 0.0
    assert [arm.state[name] for name in JOINTS] == pytest.approx([0.3, 0.0, 0.6], abs=0.02)
