"""What ros2_control's forward_command_controller and joint_state_broadcaster expect, and give.

Both are small: this stand-in has their topics, qualities of service, order of joints, extra
joints and the NaN that a command is before the first one comes.
"""

import math

import numpy as np
import pytest
from rclpy.clock import Clock, ClockType
from rclpy.qos import qos_profile_system_default
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

from tp_interfaces.msg import ControllerState

RATE, SPEED, ACCELERATION = 100.0, 1.0, 2.0
JOINTS = ['joint_1', 'joint_2', 'joint_3']
START = {'joint_1': 0.0, 'joint_2': 0.6, 'joint_3': 0.3, 'gripper': 0.04}


class Ros2Control:
    """A controller manager with mock hardware, and the two controllers in it."""

    def __init__(self, node, command_interface):
        self._interface = command_interface
        self._commands = np.full(3, math.nan)
        self.state, self.velocity = dict(START), dict.fromkeys(START, 0.0)
        self.received, self.applied, self._node = [], [], node
        node.create_subscription(
            Float64MultiArray,
            f'/{command_interface}_controller/commands',
            self._on_command,
            qos_profile_system_default,
        )
        self._publisher = node.create_publisher(
            JointState, 'joint_states', qos_profile_system_default
        )
        node.create_timer(1.0 / RATE, self._update, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def _on_command(self, msg):
        assert len(msg.data) == len(JOINTS)
        self.received.append(list(msg.data))
        self._commands[:] = msg.data

    def _update(self):
        if not np.isnan(self._commands).any():
            self.applied.append(self._commands.copy())
            for name, value in zip(JOINTS, self._commands.tolist(), strict=True):
                before = self.state[name]
                if self._interface == 'velocity':
                    self.state[name] += value / RATE
                else:
                    self.state[name] = value
                self.velocity[name] = (self.state[name] - before) * RATE
        # The broadcaster has its own order, and all joints that there are.
        names = ['joint_3', 'gripper', 'joint_1', 'joint_2']
        msg = JointState(name=names)
        msg.header.stamp = self._node.get_clock().now().to_msg()
        msg.position = [self.state[name] for name in names]
        msg.velocity = [self.velocity[name] for name in names]
        msg.velocity[1] = math.nan
        msg.effort = [math.nan] * len(names)
        self._publisher.publish(msg)


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
