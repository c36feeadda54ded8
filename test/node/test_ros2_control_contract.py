"""What ros2_control's forward_command_controller and joint_state_broadcaster expect, and give.

Both are small: this stand-in has their topics, qualities of service, parameters, order of joints,
extra joints and the NaN that a command is before the first one comes. As behind the real ones, a
command moves the arm after the next joint state, by the time that has really passed.
"""

import math
import time

import numpy as np
import pytest
from rcl_interfaces.msg import ParameterValue
from rcl_interfaces.srv import GetParameters
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

    def __init__(self, node, command_interface, joints=JOINTS):
        self._interface, self._joints = command_interface, joints
        self._commands = self._values = np.full(3, math.nan)
        self.state, self.velocity = dict(START), dict.fromkeys(START, 0.0)
        self.received, self.applied, self._node = [], [], node
        self._updated = time.monotonic()
        node.create_subscription(
            Float64MultiArray,
            f'/{command_interface}_controller/commands',
            self._on_command,
            qos_profile_system_default,
        )
        # Of the node that reads the commands.
        node.create_service(GetParameters, f'{node.get_name()}/get_parameters', self._on_get)
        self._publisher = node.create_publisher(
            JointState, 'joint_states', qos_profile_system_default
        )
        node.create_timer(1.0 / RATE, self._update, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def _on_get(self, request, response):
        values = {
            'joints': ParameterValue(type=9, string_array_value=self._joints),
            'interface_name': ParameterValue(type=4, string_value=self._interface),
        }
        response.values = [values.get(name, ParameterValue()) for name in request.names]
        return response

    def _on_command(self, msg):
        assert len(msg.data) == len(JOINTS)
        assert np.isfinite(msg.data).all()
        self.received.append(list(msg.data))
        self._commands = np.array(msg.data)

    def _update(self):
        """Read the hardware, then run the broadcaster and the controller of commands."""
        period = time.monotonic() - self._updated
        self._updated += period
        if not np.isnan(self._values).any():
            self.applied.append(self._values)
            for name, value in zip(self._joints, self._values.tolist(), strict=True):
                before = self.state[name]
                self.state[name] = before + value * period
                if self._interface == 'position':
                    self.state[name] = value
                self.velocity[name] = (self.state[name] - before) / period
        # The broadcaster has its own order, and all joints that there are.
        names = ['joint_3', 'gripper', 'joint_1', 'joint_2']
        msg = JointState(name=names)
        msg.header.stamp = self._node.get_clock().now().to_msg()
        msg.position = [self.state[name] for name in names]
        msg.velocity = [self.velocity[name] for name in names]
        msg.velocity[1] = math.nan
        msg.effort = [math.nan] * len(names)
        self._publisher.publish(msg)
        self._values = self._commands


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
