"""The controller node."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
from builtin_interfaces.msg import Time
from rcl_interfaces.msg import SetParametersResult
from rclpy.clock import Clock, ClockType
from rclpy.duration import Duration
from rclpy.parameter import Parameter as RosParameter
from rclpy.subscription import Subscription
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from visualization_msgs.msg import MarkerArray

from tp_controller.config import (
    HOLD,
    START,
    build_settings,
    check_changes,
    controller_schema,
    know_rate,
    read_parameters,
)
from tp_controller.errors import InvalidValue, UnusableState
from tp_controller.ros.feedforward import FeedforwardOverrides
from tp_controller.ros.goals import FEEDFORWARD_TYPES, GOAL_TYPES, GoalReader
from tp_controller.ros.joint_states import JointStateReader, RateCheck
from tp_controller.ros.markers import PERIOD as MARKER_PERIOD
from tp_controller.ros.markers import Markers
from tp_controller.ros.parameters import ROS_OWN, describe_parameters
from tp_controller.ros.rate import RateEstimate
from tp_controller.ros.robot_node import HEARTBEAT, RobotNode
from tp_controller.ros.state import StateMessage, field_view
from tp_controller.ros.task_services import TaskServices
from tp_controller.tasks import Task
from tp_interfaces.msg import ControllerState

QUEUE_DEPTH = 100
"""Messages that wait while the process is not scheduled: 0.1 s at 1 kHz."""


DECLARED_AT_ONCE = 5
"""Parameters of a new task between two cycles."""


class ControllerNode(RobotNode):
    """Answers every joint state with a joint velocity command."""

    def __init__(self) -> None:
        # An undeclared name then reaches `_check_parameters`, which knows what is meant.
        super().__init__('tp_controller', allow_undeclared_parameters=True)
        self._state_publisher = self.create_publisher(ControllerState, '~/state', QUEUE_DEPTH)
        self.begin()

    def check(self, given: Mapping[str, Any]) -> None:
        """Check parameters as far as that is possible without the robot."""
        read_parameters(given)

    def show_waiting(self, message: str) -> None:
        """Publish what is waited for."""
        state = ControllerState(status=ControllerState.WAITING, scale=1.0, message=message)
        self._state_publisher.publish(state)

    def start(self, given: Mapping[str, Any], description: str | None) -> None:
        """Build the stack of tasks and listen to joint states and goals."""
        self._settings = build_settings({START: HOLD, **given}, description, find_rate=True)
        values = self._settings.values
        self._schema = controller_schema(values)
        describe_parameters(self, self._schema, values)
        self._stack = self._settings.stack
        robot = self._stack.robot
        for name, task in self._stack.tasks.items():
            if (
                values[START] == HOLD
                and self._stack.level_of(name) >= 0
                and task.feedforward.any()
            ):
                self.get_logger().warning(
                    f'tasks.{name}.feedforward moves the arm from the start, though start is hold'
                )

        self._q = np.zeros(robot.n)
        self._stamp = Time()
        self._joint_states = JointStateReader(robot.joints)
        self._rate_check = RateCheck(values['rate']) if values['rate'] else None
        self._goals = GoalReader(robot)
        self._feedforwards = FeedforwardOverrides(
            values['timeouts.feedforward'], self._configured_feedforward
        )
        self._state = StateMessage(self._stack)
        self._warned: dict[str, tuple[str, float]] = {}
        self._last_seen = 0.0
        self._last_heartbeat = 0.0
        self._rate_estimate = self._find_rate()

        self._make_command_publisher(values['command.type'])
        self._inputs: dict[str, list[Subscription]] = {}
        for task in self._stack.tasks.values():
            list(self._listen(task))
        self.create_subscription(JointState, 'joint_states', self._on_joint_state, QUEUE_DEPTH)
        self._stale_after = values['timeouts.joint_state']
        self.create_timer(
            min(self._stale_after / 4.0, HEARTBEAT),
            self._watch,
            clock=Clock(clock_type=ClockType.STEADY_TIME),
        )
        self._markers = Markers(robot, self._state.msg, self._stack.tasks.values())
        self._marker_publisher = self.create_publisher(MarkerArray, '~/markers', 10)
        self.create_timer(
            MARKER_PERIOD, self._publish_markers, clock=Clock(clock_type=ClockType.STEADY_TIME)
        )
        self._declaring = False
        self._pending_changes: Callable[[], tuple[str, ...]] | None = None
        self.add_on_set_parameters_callback(self._check_parameters)
        self.add_post_set_parameters_callback(self._apply_parameters)
        TaskServices(self, self._settings, self._on_task_added, self._on_task_removed)
        self.get_logger().info(f'waiting for joint states; tasks by level: {self._levels()}')

    def stop(self) -> None:
        """Bring the robot to rest: publish a zero command and give it time to arrive."""
        if not self.started:
            return
        self._publish_zero()
        self._command_publisher.wait_for_all_acked(Duration(seconds=0.2))

    def _levels(self) -> str:
        return ', '.join(self._stack.hierarchy)

    def _listen(self, task: Task) -> Iterator[None]:
        """Take goals and feedforwards of a task, with a pause after each subscription."""
        inputs = self._inputs[task.name] = []
        for types, topic, callback in (
            (GOAL_TYPES, 'goal', self._on_goal),
            (FEEDFORWARD_TYPES, 'feedforward', self._on_feedforward),
        ):
            if task.type in types:
                name, call = f'~/{task.name}/{topic}', partial(callback, task)
                inputs.append(self.create_subscription(types[task.type], name, call, 10))
                yield
        for warning in task.warnings:
            self.get_logger().warning(warning)

    def _on_task_added(self, task: Task) -> Iterator[None]:
        self._schema = controller_schema(self._settings.values)
        self._follow_tasks()
        yield
        own = [key for key in self._schema if key.startswith(f'tasks.{task.name}.')]
        for i in range(0, len(own), DECLARED_AT_ONCE):
            some = {key: self._schema[key] for key in own[i : i + DECLARED_AT_ONCE]}
            self._declaring = True
            describe_parameters(self, some, self._settings.values)
            self._declaring = False
            yield
        yield from self._listen(task)

    def _on_task_removed(self, task: Task, keys: Sequence[str]) -> Iterator[None]:
        self._schema = controller_schema(self._settings.values)
        self._feedforwards.forget(task)
        self._follow_tasks()
        for subscription in self._inputs.pop(task.name):
            self.destroy_subscription(subscription)
        yield
        for key in keys:
            if self.has_parameter(key):
                self.undeclare_parameter(key)

    def _follow_tasks(self) -> None:
        self._state.follow_tasks()
        self._markers.follow_tasks(self._stack.tasks.values())

    # Cycle

    def _on_joint_state(self, msg: JointState) -> None:
        start = time.perf_counter()
        state = self._state.msg
        try:
            self._joint_states.read(msg, self._q)
            if self._feedforwards:
                self._feedforwards.expire(msg.header.stamp)
            # Who sends a state again has not moved since.
            again = self._stamp == msg.header.stamp and any(
                (msg.header.stamp.sec, msg.header.stamp.nanosec)
            )
            if again:
                self._stack.undo()
            self._stamp = msg.header.stamp
            step = self._stack.step(self._q)
            if self._rate_estimate:
                self._wait_for_rate(self._rate_estimate, msg.header.stamp)
            state.solve_time = time.perf_counter() - start
        except InvalidValue as error:
            state.ignored_states += 1
            self._warn('joint states', f'joint state ignored: {error}')
            return
        except UnusableState as error:
            state.ignored_states += 1
            self._warn('commands', f'no command: {error}')
            if error.command is not None:
                self._send(error.command, msg)
            return
        self._send(step.command, msg)
        if not again and self._rate_check and (problem := self._rate_check.see(msg.header.stamp)):
            self._warn('rate', problem)
        self._last_seen = time.monotonic()
        state.cycles += 1
        state.header.stamp = msg.header.stamp
        state.scale = step.scale
        if state.status != ControllerState.RUNNING:
            state.status = ControllerState.RUNNING
            self.get_logger().info('running')
            self._goals.robot_seen = True
        if self._state_publisher.get_subscription_count():
            self._state.refresh(step.command)
            self._state.explain(msg.header.stamp)
            self._state_publisher.publish(state)

    def _find_rate(self) -> RateEstimate | None:
        """Estimate of a rate that the parameters do not tell, if there are ranges to keep."""
        try:
            self._stack.robot.limits.check_period(
                self._stack.robot.joints, self._stack.safety_filter.period
            )
        except InvalidValue as error:
            self._warn('rate', f'{error}: the arm rests until it is found from the joint states')
            return RateEstimate()
        return None

    def _wait_for_rate(self, estimate: RateEstimate, stamp: Time) -> None:
        """Stay at rest for one more joint state, or know the rate from it."""
        self._stack.stay()
        rate = estimate.see(stamp)
        if rate is None:
            return
        know_rate(self._settings, rate)
        self._rate_check, self._rate_estimate = RateCheck(rate), None
        self._warn('rate', f'rate: {rate:.4g} Hz, found from the joint states; ranges are kept')
        for task in self._stack.tasks.values():
            for warning in task.warnings:
                self.get_logger().warning(warning)

    def _send(self, command: np.ndarray, msg: JointState) -> None:
        """Publish a command (n,) that answers a joint state."""
        self._velocity[:] = command
        if self._stamped:
            self._command.header.stamp = msg.header.stamp
        self._command_publisher.publish(self._command)

    def _watch(self) -> None:
        """Bring the robot to rest when joint states stop, and show that the node lives."""
        for task in self._stack.tasks.values():
            for notice in task.take_notices():
                self._warn(f'{task.name} contact', notice)
        now = time.monotonic()
        state = self._state.msg
        if state.status == ControllerState.RUNNING:
            if now - self._last_seen <= self._stale_after:
                return
            self._publish_zero()
            self._state.refresh(self._velocity)
            state.status = ControllerState.STALE
            if self._rate_check:
                self._rate_check.restart()
            self.get_logger().warning(f'no joint state for {self._stale_after:g} s: zero command')
        elif now - self._last_heartbeat < HEARTBEAT:
            return
        self._last_heartbeat = now
        self._state_publisher.publish(state)

    def _publish_markers(self) -> None:
        if self._goals.robot_seen and self._marker_publisher.get_subscription_count():
            self._marker_publisher.publish(self._markers.array(self.get_clock().now().to_msg()))

    def _make_command_publisher(self, command_type: str) -> None:
        n = self._stack.robot.n
        self._stamped = command_type == 'joint_state'
        if self._stamped:
            self._command: Any = JointState(name=list(self._stack.robot.joints))
            self._command.header.frame_id = self._stack.robot.base_frame
            self._velocity = field_view(self._command, 'velocity', n)
        else:
            self._command = Float64MultiArray()
            self._velocity = field_view(self._command, 'data', n)
        self._command_publisher = self.create_publisher(
            type(self._command), 'joint_velocity_command', QUEUE_DEPTH
        )

    def _publish_zero(self) -> None:
        self._velocity[:] = 0.0
        self._stack.rest()
        if self._stamped:
            # It answers no joint state; an old stamp could make a driver drop it.
            self._command.header.stamp = self.get_clock().now().to_msg()
        self._command_publisher.publish(self._command)

    # Input while running

    def _on_goal(self, task: Task, msg: Any) -> None:
        try:
            task.target = self._goals.target(task, msg)
        except InvalidValue as error:
            self._reject(task, 'goal', error)
        else:
            self._state.task(task.name).accepted_goals += 1
            self._state.refresh_target(task.name, self._goals.robot_seen)
        self._state_publisher.publish(self._state.msg)

    def _on_feedforward(self, task: Task, msg: Any) -> None:
        configured = self._configured_feedforward(task)
        try:
            task.feedforward = self._goals.feedforward(task, msg, configured)
        except InvalidValue as error:
            self._reject(task, 'feedforward', error)
        else:
            self._state.task(task.name).accepted_feedforwards += 1
            self._feedforwards.begin(task)
        self._state_publisher.publish(self._state.msg)

    def _configured_feedforward(self, task: Task) -> np.ndarray:
        return np.array(self._settings.values[f'tasks.{task.name}.feedforward'])

    def _reject(self, task: Task, what: str, error: InvalidValue) -> None:
        self._state.msg.rejected_goals += 1
        entry = self._state.task(task.name)
        entry.rejected_goals += 1
        entry.message = f'{what} rejected: {error}'
        self._warn(f'{task.name} {what}', f'{task.name}: {entry.message}')

    def _warn(self, subject: str, message: str) -> None:
        """Log a warning, the same about the same subject at most once a second."""
        self._state.msg.message = message
        now = time.monotonic()
        text, when = self._warned.get(subject, ('', 0.0))
        if text != message or now - when >= 1.0:
            self._warned[subject] = (message, now)
            self.get_logger().warning(message)

    # Parameters

    def _check_parameters(self, parameters: Sequence[RosParameter]) -> SetParametersResult:
        if self._declaring:
            return SetParametersResult(successful=True)
        changes = {p.name: p.value for p in parameters if not p.name.startswith(ROS_OWN)}
        try:
            self._pending_changes = check_changes(self._settings, self._schema, changes)
        except InvalidValue as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _apply_parameters(self, parameters: Sequence[RosParameter]) -> None:
        if self._pending_changes is not None:
            for line in self._pending_changes():
                self.get_logger().warning(line)
            self._pending_changes = None
            self._state.follow_hierarchy()
