"""The simulator node."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rcl_interfaces.msg import SetParametersResult
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.clock import Clock, ClockType
from rclpy.parameter import Parameter as RosParameter
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, String
from std_srvs.srv import SetBool

from tp_controller.config.schema import COMMAND_TYPES
from tp_controller.errors import InvalidValue, listed, shown
from tp_controller.ros.joint_states import JointStateReader
from tp_controller.ros.parameters import ROS_OWN, describe_parameters
from tp_controller.ros.robot_node import TOPIC, TOPIC_QOS, RobotNode
from tp_interfaces.srv import Reset, Step
from tp_sim.lockstep import Lockstep
from tp_sim.settings import (
    build_simulator_settings,
    check_plant_values,
    plant_settings,
    read_simulator_parameters,
    simulator_schema,
)

QUEUE_DEPTH = 100
LONGEST_GAP = 1.0
"""Time [s] that is caught up at most when the simulator itself was late."""
SILENCE = 10.0
"""Least time [s] between two warnings that the machine is too slow."""
MESSAGE_TYPES = dict(zip(COMMAND_TYPES, (JointState, Float64MultiArray), strict=True))
TOPIC_TYPES = {
    'joint_state': 'sensor_msgs/msg/JointState',
    'float64_multi_array': 'std_msgs/msg/Float64MultiArray',
}


class SimulatorNode(RobotNode):
    """Integrates joint velocity commands and publishes joint states.

    In real time the joints move as much as the steady clock: steps that came late are caught up
    with the command in force, and only the newest state is published. What is more than a second
    late is left out. Both are said in the log.
    """

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
        self._values = values
        self._schema = simulator_schema(values)
        self._plant = settings.plant
        self._dt = 1.0 / values['rate']
        self._command = np.zeros(len(self._joints))
        self._fresh = False
        limits = self._plant.joints.limits
        self._ends = limits.position_min, limits.position_max
        self._at_end = self._find_ends()
        self._commands = JointStateReader(self._joints, 'command', 'velocity')
        self._msg = JointState(name=list(self._joints))
        self._msg.header.frame_id = settings.base_frame

        if description is None:
            # From the topic it is there already, by whoever knows the robot.
            self._description_publisher = self.create_publisher(String, TOPIC, TOPIC_QOS)
            self._description_publisher.publish(String(data=settings.description))
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._publisher = self.create_publisher(JointState, 'joint_states', QUEUE_DEPTH)
        self._truth = self.create_publisher(JointState, '~/true_joint_states', QUEUE_DEPTH)
        # A command in lockstep is an answer, none may be missed; else the newest one counts.
        self._queue_depth = QUEUE_DEPTH if values['lockstep'] else 1
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
                self._plant.state_lost,
                values['paused'],
            )
            self.create_timer(0.1, self._repeat, clock=steady)
        else:
            self._steps = self._late = 0
            self._began = time.monotonic()
            self._warned = -SILENCE
            self.create_timer(self._dt, self._tick, clock=steady)
        self.add_on_set_parameters_callback(self._check_changes)
        self.add_post_set_parameters_callback(self._change)
        self.get_logger().info(
            f'{len(self._joints)} joints at {values["rate"]:g} Hz'
            + (', in lockstep' if values['lockstep'] else '')
        )

    def stop(self) -> None:
        """Nothing moves once the node is gone."""

    def _listen_for(self, command_type: str) -> None:
        """Subscribe to commands of a type."""
        self._stamped = command_type == 'joint_state'
        self._subscription = self.create_subscription(
            MESSAGE_TYPES[command_type],
            'joint_velocity_command',
            self._on_command,
            self._queue_depth,
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

    def _check_changes(self, parameters: Sequence[RosParameter]) -> SetParametersResult:
        try:
            self._changed(parameters)
        except InvalidValue as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _changed(self, parameters: Sequence[RosParameter]) -> dict[str, Any]:
        """All values after a change; nothing changes yet.

        Raises
        ------
        InvalidValue
            If they cannot be used.
        """
        given = {p.name: p.value for p in parameters if p.name in self._schema}
        values = self._values | {
            key: self._schema[key].read(key, value) for key, value in given.items()
        }
        check_plant_values(values)
        self._plant.check(plant_settings(values))
        return values

    def _change(self, parameters: Sequence[RosParameter]) -> None:
        if all(p.name.startswith(ROS_OWN) for p in parameters):
            return
        self._values = self._changed(parameters)
        self._plant.configure(plant_settings(self._values))
        self._plant.blocked = self._values['plant.blocked']

    def _publish(self, nanoseconds: int) -> None:
        stamp = self._msg.header.stamp
        stamp.sec, stamp.nanosec = divmod(nanoseconds, 1_000_000_000)
        if self._truth.get_subscription_count():
            self._msg.position, self._msg.velocity = self._plant.q, self._plant.qd
            self._truth.publish(self._msg)
        if self._values['plant.silent'] or (self._lockstep is None and self._plant.state_lost()):
            return
        self._msg.position, self._msg.velocity = self._plant.measured()
        self._publisher.publish(self._msg)

    def _move(self) -> int:
        """Integrate the newest command for one step; return its length [ns]."""
        self._plant.step(self._command if self._fresh else None, self._dt)
        self._fresh = False
        self._tell_stops()
        return round(1e9 * self._dt)

    def _find_ends(self) -> NDArray[np.bool_]:
        """Whether each joint is at an end of its range (n,)."""
        q = self._plant.q
        return (q <= self._ends[0]) | (q >= self._ends[1])

    def _tell_stops(self) -> None:
        """Say which joints have just been driven into an end of their range."""
        before, self._at_end = self._at_end, self._find_ends()
        driven = self._at_end & ~before
        if driven.any():
            names = [self._joints[i] for i in np.flatnonzero(driven)]
            self.get_logger().warning(
                f'at the end of the range, held by its stop: {listed(names)}',
                throttle_duration_sec=1.0,
            )

    def _tick(self) -> None:
        """Move in real time."""
        now = time.monotonic()
        due = int((now - self._began) / self._dt) - self._steps
        if due * self._dt > LONGEST_GAP:
            left_out = due - int(LONGEST_GAP / self._dt)
            self.get_logger().warning(f'late: {left_out * self._dt:.3g} s are left out')
            self._steps += left_out
            due -= left_out
        for _ in range(due):
            self._move()
        self._steps += due
        self._late += max(0, due - 1)
        if self._late and now - self._warned > SILENCE:
            self.get_logger().warning(
                f'late: {self._late} steps of {1e3 * self._dt:.3g} ms were caught up since the '
                'last such line; the machine is busy, or the rate is too high for it'
            )
            self._late, self._warned = 0, now
        if due > 0:
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
        self._fresh = True
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
        self._fresh = False
        self._at_end = self._find_ends()
        if self._lockstep is not None:
            self._lockstep.jumped()
        response.success = True
        return response

    def _reset(self, names: list[str], positions: np.ndarray) -> None:
        if not names and not positions.size:
            self._plant.reset()
            return
        known = all(name in self._joints for name in names)
        if not known or len(set(names)) != len(names) or len(names) != positions.size:
            raise InvalidValue(
                'reset',
                f'{shown(names)} with {positions.size} positions',
                f'one position for each name, names out of {", ".join(self._joints)}',
            )
        q = self._plant.q
        q[[self._joints.index(name) for name in names]] = positions
        self._plant.reset(q)

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
