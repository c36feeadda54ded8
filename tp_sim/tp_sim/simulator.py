"""The simulator node."""

from __future__ import annotations

import threading
import time
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rcl_interfaces.msg import SetParametersResult
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.parameter import Parameter as RosParameter
from rclpy.qos import ReliabilityPolicy
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, String
from std_srvs.srv import SetBool

from tp_controller.config import ROS_OWN
from tp_controller.config.schema import COMMAND_TYPES, POSITION_TYPES
from tp_controller.errors import InvalidValue, listed, shown
from tp_controller.ros.commands import command_topic, is_stamped
from tp_controller.ros.joint_states import JointStateReader
from tp_controller.ros.parameters import describe_parameters
from tp_controller.ros.polled import Polled, take
from tp_controller.ros.robot_node import TOPIC, TOPIC_QOS, RobotNode
from tp_interfaces.srv import Reset, Step
from tp_sim.lockstep import Lockstep
from tp_sim.real_time import RealTime
from tp_sim.settings import (
    build_simulator_settings,
    check_plant_values,
    plant_settings,
    read_simulator_parameters,
    simulator_schema,
)

Vector = NDArray[np.float64]

QUEUE_DEPTH = 100
JOINT_STATE, ARRAY = 'sensor_msgs/msg/JointState', 'std_msgs/msg/Float64MultiArray'
NO_POSITIONS = 'commands of positions for a base that moves'


class SimulatorNode(RobotNode):
    """Moves joints as commands of velocities or positions say, and publishes joint states.

    In real time every step takes the newest command that has come. The joints move with the
    steady clock: steps that came late are caught up, with one command and one published state,
    those of the end. See `RealTime`.
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
        self._space = settings.space
        if values['command.type'] in POSITION_TYPES and self._space.blocks:
            raise InvalidValue('command.type', NO_POSITIONS, 'a type of velocities')
        self._values = values
        self._schema = simulator_schema(values)
        self._plant = settings.plant
        self._dt = 1.0 / values['rate']
        self._command = np.zeros(self._space.nv)
        self._fresh = False
        limits = self._plant.joints.limits
        self._ends = limits.position_min, limits.position_max
        self._at_end = self._find_ends()
        self._msg = JointState(name=list(self._space.coordinates))
        self._msg.header.frame_id = settings.base_frame

        if description is None:
            # From the topic it is there already, by whoever knows the robot.
            self._description_publisher = self.create_publisher(String, TOPIC, TOPIC_QOS)
            self._description_publisher.publish(String(data=settings.description))
        self._publisher = self.create_publisher(JointState, 'joint_states', QUEUE_DEPTH)
        self._truth = self.create_publisher(JointState, '~/true_joint_states', QUEUE_DEPTH)
        # Held by whoever uses the plant, or changes what `RealTime`'s thread does.
        self._lock = threading.Lock()
        self._listen_for(values['command.type'] or COMMAND_TYPES[0])
        self.make_timer(0.1, self._look_at_publishers)
        self.create_service(Reset, '~/reset', self._on_reset)
        # The other callbacks, another step among them, go on while a run is awaited.
        self.create_service(Step, '~/step', self._on_step, callback_group=ReentrantCallbackGroup())
        self.create_service(SetBool, '~/pause', self._on_pause)
        self._lockstep: Lockstep | None = None
        self._real_time: RealTime | None = None
        if values['lockstep']:
            self._lockstep = Lockstep(
                self,
                self._publish,
                self._publisher.get_subscription_count,
                self._move,
                self._plant.state_lost,
                values['paused'],
            )
            self.make_timer(0.1, self._repeat)
        else:
            self._real_time = RealTime(self._dt, self._steps, self.get_logger().warning)
            self.make_timer(0.1, self._real_time.check)
        self.add_on_set_parameters_callback(self._check_changes)
        self.add_post_set_parameters_callback(self._change)
        self.get_logger().info(
            f'{self._space.nv} joints at {values["rate"]:g} Hz'
            + (', in lockstep' if values['lockstep'] else '')
        )

    def stop(self) -> str:
        """Nothing moves once the node is gone; there is nothing to be said about it."""
        if self.started and self._real_time is not None:
            self._real_time.stop()
        return ''

    def _listen_for(self, command_type: str) -> None:
        """Subscribe to commands of a type."""
        self._command_type, self._stamped = command_type, is_stamped(command_type)
        self._positions = command_type in POSITION_TYPES
        self._commands = JointStateReader(
            self._space.velocities, 'command', 'position' if self._positions else 'velocity'
        )
        self._fresh = False
        in_lockstep = self._values['lockstep']
        # A command in lockstep is an answer, none may be missed; else the newest one counts.
        self._subscription = self.create_subscription(
            JointState if self._stamped else Float64MultiArray,
            command_topic(command_type),
            self._on_command,
            QUEUE_DEPTH if in_lockstep else 1,
            callback_group=None if in_lockstep else Polled(),
        )

    def _look_at_publishers(self) -> None:
        """Follow the type of command that is published, and tell commands that are not heard."""
        infos = self.get_publishers_info_by_topic(self._subscription.topic_name)
        if any(info.qos_profile.reliability == ReliabilityPolicy.BEST_EFFORT for info in infos):
            self.get_logger().warning(
                'commands are published as best effort, which is not heard: reliable is', once=True
            )
        if self._values['command.type'] is not None:
            return
        heard = [kind for kind in COMMAND_TYPES if self._is_published(kind)]
        if len(heard) == 1 and heard[0] != self._command_type:
            if heard[0] in POSITION_TYPES and self._space.blocks:
                self.get_logger().warning(f'{NO_POSITIONS}, which are not heard', once=True)
                return
            topic = command_topic(heard[0])
            self.get_logger().info(f'commands come as {heard[0]} on {topic}')
            with self._lock:
                self.destroy_subscription(self._subscription)
                self._listen_for(heard[0])

    def _is_published(self, command_type: str) -> bool:
        """Whether anybody publishes commands of a type."""
        topic = self.resolve_topic_name(command_topic(command_type))
        message = JOINT_STATE if is_stamped(command_type) else ARRAY
        return any(info.topic_type == message for info in self.get_publishers_info_by_topic(topic))

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
        with self._lock:
            self._values = self._changed(parameters)
            self._plant.configure(plant_settings(self._values))
            self._plant.blocked = self._values['plant.blocked']

    def _publish(self, nanoseconds: int) -> None:
        stamp = self._msg.header.stamp
        stamp.sec, stamp.nanosec = divmod(nanoseconds, 1_000_000_000)
        if self._truth.get_subscription_count():
            self._fill(self._plant.q, self._plant.qd)
            self._truth.publish(self._msg)
        if self._values['plant.silent'] or (self._lockstep is None and self._plant.state_lost()):
            return
        self._fill(*self._plant.measured())
        self._publisher.publish(self._msg)

    def _fill(self, q: Vector, qd: Vector) -> None:
        """Put a configuration (nq,) and velocities (n,) in the message.

        Velocities in it are the time derivatives of the positions with the same names.
        """
        self._msg.position = q
        self._msg.velocity = self._space.rates(q) @ qd if self._space.blocks else qd

    def _move(self) -> int:
        """Integrate the newest command for one step; return its length [ns]."""
        move = self._plant.follow if self._positions else self._plant.step
        move(self._command if self._fresh else None, self._dt)
        self._fresh = False
        self._tell_stops()
        return round(1e9 * self._dt)

    def _find_ends(self) -> NDArray[np.bool_]:
        """Whether each joint is at an end of its range (n,)."""
        q = self._space.positions(self._plant.q)
        return (q <= self._ends[0]) | (q >= self._ends[1])

    def _tell_stops(self) -> None:
        """Say which joints have just been driven into an end of their range."""
        before, self._at_end = self._at_end, self._find_ends()
        driven = self._at_end & ~before
        if driven.any():
            names = [self._space.velocities[i] for i in np.flatnonzero(driven)]
            self.get_logger().warning(
                f'at the end of the range, held by its stop: {listed(names)}',
                throttle_duration_sec=1.0,
            )

    def _steps(self, count: int, end: float) -> None:
        """Take steps in real time, up to an end [s] by the steady clock."""
        with self._lock:
            msg = take(self._subscription)
            if msg is not None:
                self._on_command(msg)
            for _ in range(count):
                self._move()
            # The time of the state, not of its publication.
            late = round(1e9 * (time.monotonic() - end))
            # Where a clock is awaited its time is zero, and so is the stamp.
            self._publish(max(0, self.get_clock().now().nanoseconds - late))

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
            with self._lock:
                self._reset(list(request.name), np.array(request.position))
        except InvalidValue as error:
            response.message = str(error)
            return response
        if self._lockstep is not None:
            self._lockstep.jumped()
        response.success = True
        return response

    def _reset(self, names: list[str], positions: np.ndarray) -> None:
        if names or positions.size:
            self._plant.reset(self._with(names, positions))
        else:
            self._plant.reset()
        self._fresh = False
        self._at_end = self._find_ends()

    def _with(self, names: list[str], positions: np.ndarray) -> np.ndarray:
        """Present configuration (nq,) with some coordinates replaced."""
        known = all(name in self._space.coordinates for name in names)
        if not known or len(set(names)) != len(names) or len(names) != positions.size:
            raise InvalidValue(
                'reset',
                f'{shown(names)} with {positions.size} positions',
                f'one position for each name, names out of {", ".join(self._space.coordinates)}',
            )
        q = self._plant.q
        q[[self._space.coordinates.index(name) for name in names]] = positions
        return q

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
