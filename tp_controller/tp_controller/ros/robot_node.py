"""Nodes that wait until their robot is described."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import Any

from rcl_interfaces.msg import SetParametersResult
from rclpy.clock import Clock, ClockType
from rclpy.executors import Executor
from rclpy.node import Node
from rclpy.parameter import Parameter as RosParameter
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.timer import Timer
from std_msgs.msg import String

from tp_controller.config import robot_source
from tp_controller.robot import LONGEST_URDF, same_description
from tp_controller.ros.log import Log
from tp_controller.ros.parameters import given_parameters

TOPIC = 'robot_description'
TOPIC_QOS = QoSProfile(
    depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL, reliability=ReliabilityPolicy.RELIABLE
)
"""As robot_state_publisher offers it: who comes late gets the description too."""
HEARTBEAT = 0.1
"""Time [s] between signs of life while the node waits."""
LONGEST_WAIT = 0.1
"""Time [s] after which a signal is seen at the latest."""


class RobotNode(Node, ABC):
    """A node about the robot of its parameters or, if they name none, of a topic.

    A subclass calls `begin` when it can be started.

    Parameters
    ----------
    name
        Default name of the node.
    options
        Passed on to the node.

    Attributes
    ----------
    log
        The node's log.
    started
        Whether the robot is known and `start` was called.
    """

    def __init__(self, name: str, **options: Any) -> None:
        super().__init__(name, automatically_declare_parameters_from_overrides=True, **options)
        self.log = Log(self)
        self.started = False
        self._given = given_parameters(self)
        self._description: str | None = None
        self._differs = False
        self._comparisons = ThreadPoolExecutor(1, 'descriptions')

    @abstractmethod
    def check(self, given: Mapping[str, Any]) -> None:
        """Check parameters as far as that is possible without the robot.

        Raises
        ------
        InvalidValue
            If they cannot be used with any robot.
        """

    @abstractmethod
    def start(self, given: Mapping[str, Any], description: str | None) -> None:
        """Do what the node is for.

        Parameters
        ----------
        given
            Values by dotted key that the node was started with.
        description
            URDF from the topic, None if the parameters name the robot.

        Raises
        ------
        InvalidValue
            If the parameters or the description cannot be used.
        """

    def show_waiting(self, message: str) -> None:
        """Give a sign of life; called while the node waits for its robot."""

    def spin(self, executor: Executor) -> None:
        """Wait for something to do, for a moment, and do it; called again and again."""
        executor.spin_once(timeout_sec=LONGEST_WAIT)

    def work(self) -> None:
        """Do what may not wait; called after every `spin`."""

    def survives(self, error: Exception) -> bool:
        """Whether the node can go on after an exception in one of its callbacks; it says so."""
        return False

    def stop(self) -> str:
        """Leave the robot safe, for the end of the process; return what was done about it."""
        return ''

    def begin(self) -> None:
        """Start, or wait for the description of the robot and start then.

        Raises
        ------
        InvalidValue
            As `check` and `start`. What `start` raises after a wait ends the executor's spin.
        """
        if robot_source(self._given) is not None:
            self._start()
            return
        self.check(self._given)
        subscription = self.create_subscription(String, TOPIC, self._on_description, TOPIC_QOS)
        message = f'waiting for robot_description on {subscription.topic_name}'
        # Checks of changes need the robot, and these would be new values for its start.
        self._refusal = partial(_refuse_changes, message)
        self.add_on_set_parameters_callback(self._refusal)
        self._heartbeat = self.make_timer(HEARTBEAT, partial(self.show_waiting, message))
        self.log.info(f'{message}: the parameters name no robot')

    def make_timer(self, period: float, callback: Callable[[], None]) -> Timer:
        """Make a timer with a period [s] that nobody's clock changes."""
        return self.create_timer(period, callback, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def _on_description(self, msg: String) -> None:
        if self._description is None:
            self._description = msg.data
            self.remove_on_set_parameters_callback(self._refusal)
            self.destroy_timer(self._heartbeat)
            self._start()
        elif not self._differs and msg.data != self._description:
            # To compare takes long, and control goes on meanwhile.
            self._comparisons.submit(self._compare, msg.data)

    def _compare(self, text: str) -> None:
        """Say once if a description is another than the robot's."""
        assert self._description is not None
        same = len(text) <= LONGEST_URDF and same_description(self._description, text)
        if not same and not self._differs:
            self._differs = True
            self.log.warning('another robot_description is ignored: a restart takes it')

    def _start(self) -> None:
        self.start(self._given, self._description)
        self.started = True


def _refuse_changes(reason: str, _: Sequence[RosParameter]) -> SetParametersResult:
    return SetParametersResult(successful=False, reason=reason)
