"""Stand-in for ros2_control's forward_command_controller and joint_state_broadcaster.

Both are small: it has their topics, qualities of service, parameters, order of joints, extra
joints and the NaN that a command is before the first one comes. As behind the real ones, a command
moves the arm after the next joint state, by the time that has really passed.
"""

import math
import time

import numpy as np
from rcl_interfaces.msg import ParameterValue
from rcl_interfaces.srv import GetParameters
from rclpy.clock import Clock, ClockType
from rclpy.qos import qos_profile_system_default
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

RATE = 100.0
JOINTS = ['joint_1', 'joint_2', 'joint_3']
START = {'joint_1': 0.0, 'joint_2': 0.6, 'joint_3': 0.3, 'gripper': 0.04}


class Ros2Control:
    """A controller manager with mock hardware, and the two controllers in it.

    Without an answer it stands in for another reader, which has no such parameters.
    """

    def __init__(self, node, command_interface, joints=JOINTS, answers=True):
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
        if answers:
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
