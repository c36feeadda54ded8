"""The simulator node."""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import Any

import numpy as np
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.clock import Clock, ClockType
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, String
from std_srvs.srv import SetBool

from tp_controller.config.schema import COMMAND_TYPES
from tp_controller.errors import InvalidValue, shown
from tp_controller.ros.joint_states import JointStateReader
from tp_controller.ros.parameters import describe_parameters
from tp_controller.ros.robot_node import TOPIC, TOPIC_QOS, RobotNode
from tp_interfaces.srv import Reset, Step
from tp_sim.lockstep import Lockstep
from tp_sim.settings import (
    build_simulator_settings,
    read_simulator_parameters,
    simulator_schema,
)

QUEUE_DEPTH = 100
MESSAGE_TYPES = dict(zip(COMMAND_TYPES, (JointState, Float64MultiArray), strict=True))
TOPIC_TYPES = {
    'joint_state': 'sensor_msgs/msg/JointState',
    'float64_multi_array': 'std_msgs/msg/Float64MultiArray',
}


class SimulatorNode(RobotNode):
    """Integrates joint velocity commands and publishes joint states."""

    def __init__(self) -> None:
        super().__init__('tp_sim')
        self.begin()

    def check(self, given: Mapping[str, Any]) -> None:
        """Check parameters as far as that is possible without the robot."""
        read_simulator_parameters(given)

    def start(self, given: Mapping[str, Any], description: str | None) -> None:
        """Publish the first joint state and listen to commands."""
        settings = build_simulator_settings(given, description)
        values = settings.values
        describe_parameters(self, simulator_schema(values), values)
        self._joints = settings.joints
        self._integrator = settings.integrator
        self._dt = 1.0 / values['rate']
        self._command = np.zeros(len(self._joints))
        self._command_time = -np.inf
        self._command_timeout = values['command_timeout']
        self._commands = JointStateReader(self._joints, 'command', 'velocity')
        self._msg = JointState(name=list(self._joints))
        self._msg.header.frame_id = settings.base_frame

        if description is None:
            # From the topic it is there already, by whoever knows the robot.
            self._description_publisher = self.create_publisher(String, TOPIC, TOPIC_QOS)
            self._description_publisher.publish(String(data=settings.description))
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._publisher = self.create_publisher(JointState, 'joint_states', QUEUE_DEPTH)
        self._listen_for(values['command.type'] or COMMAND_TYPES[0])
        if values['command.type'] is None:
            self.create_timer(0.1, self._follow_command_type, clock=steady)
        self.create_service(Reset, '~/reset', self._on_reset)
        # The other callbacks, another step among them, go on while a run is awaited.
        self.create_service(Step, '~/step', self._on_step, callback_group=ReentrantCallbackGroup())
        self.create_service(SetBool, '~/pause', self._on_pause)
        self._lockstep: Lockstep | None = None
        if values['lockstep']:
            self._lockstep = Lockstep(
                self,
                self._publish,
                self._publisher.get_subscription_count,
                self._move,
                values['paused'],
            )
            self.create_timer(0.1, self._repeat, clock=steady)
        else:
            self.create_timer(self._dt, self._tick, clock=steady)
        self.get_logger().info(
            f'{len(self._joints)} joints at {values["rate"]:g} Hz'
            + (', in lockstep' if values['lockstep'] else '')
        )

    def _listen_for(self, command_type: str) -> None:
        """Subscribe to commands of a type."""
        self._stamped = command_type == 'joint_state'
        self._subscription = self.create_subscription(
            MESSAGE_TYPES[command_type], 'joint_velocity_command', self._on_command, QUEUE_DEPTH
        )

    def _follow_command_type(self) -> None:
        """Change to the type of command that is published, if it is the other one."""
        found = {
            info.topic_type
            for info in self.get_publishers_info_by_topic(self._subscription.topic_name)
        }
        for command_type, name in TOPIC_TYPES.items():
            if found == {name} and (command_type == 'joint_state') != self._stamped:
                self.get_logger().info(f'commands come as {name}')
                self.destroy_subscription(self._subscription)
                self._listen_for(command_type)

    def _publish(self, nanoseconds: int) -> None:
        stamp = self._msg.header.stamp
        stamp.sec, stamp.nanosec = divmod(nanoseconds, 1_000_000_000)
        self._msg.position = self._integrator.q
        self._msg.velocity = self._integrator.qd
        self._publisher.publish(self._msg)

    def _move(self) -> int:
        """Integrate the newest command for one step; return its length [ns]."""
        self._integrator.step(self._command, self._dt)
        return round(1e9 * self._dt)

    def _tick(self) -> None:
        """Move in real time."""
        if time.monotonic() - self._command_time > self._command_timeout:
            self._command[:] = 0.0
        self._move()
        self._publish(self.get_clock().now().nanoseconds)

    def _repeat(self) -> None:
        """Publish an unanswered state again for a controller that came after it.

        An answer without a stamp could not be told from the answer to the first copy, so
        then only the arrival of a subscriber makes the state be repeated.
        """
        assert self._lockstep is not None
        if self._lockstep.repeat(always=self._stamped):
            self.get_logger().warning('no command answers; is a controller running?')

    def _on_command(self, msg: Any) -> None:
        try:
            if self._stamped:
                self._commands.read(msg, self._command)
            else:
                self._read_array(msg)
        except InvalidValue as error:
            self.get_logger().warning(f'command ignored: {error}', throttle_duration_sec=1.0)
            return
        self._command_time = time.monotonic()
        if self._lockstep is not None:
            stamp = msg.header.stamp if self._stamped else None
            self._lockstep.answered(
                None if stamp is None else stamp.sec * 1_000_000_000 + stamp.nanosec
            )

    def _read_array(self, msg: Float64MultiArray) -> None:
        values = np.array(msg.data)
        if values.shape != self._command.shape or not np.isfinite(values).all():
            raise InvalidValue(
                'command data', shown(values), f'{self._command.size} finite numbers'
            )
        self._command[:] = values

    def _on_reset(self, request: Reset.Request, response: Reset.Response) -> Reset.Response:
        try:
            self._reset(list(request.name), np.array(request.position))
        except InvalidValue as error:
            response.message = str(error)
            return response
        self._command[:] = 0.0
        if self._lockstep is not None:
            self._lockstep.jumped()
        response.success = True
        return response

    def _reset(self, names: list[str], positions: np.ndarray) -> None:
        if not names and not positions.size:
            self._integrator.reset()
            return
        known = all(name in self._joints for name in names)
        if not known or len(set(names)) != len(names) or len(names) != positions.size:
            raise InvalidValue(
                'reset',
                f'{shown(names)} with {positions.size} positions',
                f'one position for each name, names out of {", ".join(self._joints)}',
            )
        q = self._integrator.q
        q[[self._joints.index(name) for name in names]] = positions
        self._integrator.reset(q)

    async def _on_step(self, request: Step.Request, response: Step.Response) -> Step.Response:
        if self._lockstep is None:
            response.message = 'lockstep: got false; ~/step needs true'
            return response
        finished = self._lockstep.begin(request.steps)
        if finished is None:
            response.message = 'busy: running, or another ~/step is under way'
            return response
        response.success = bool(await finished)
        response.message = '' if response.success else 'ended by ~/pause'
        response.stamp = self._msg.header.stamp
        return response

    def _on_pause(self, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        if self._lockstep is None:
            response.message = 'lockstep: got false; ~/pause needs true'
            return response
        if request.data:
            self._lockstep.pause()
        else:
            self._lockstep.resume()
        response.success = True
        return response
