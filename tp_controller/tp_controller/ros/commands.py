"""Commands as messages: joint velocities or positions."""

from __future__ import annotations

import contextlib
from typing import Any

import numpy as np
from builtin_interfaces.msg import Time
from numpy.typing import NDArray
from rclpy.duration import Duration
from rclpy.event_handler import PublisherEventCallbacks, UnsupportedEventTypeError
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

from tp_controller.config.schema import POSITION_TYPES
from tp_controller.position_reference import PositionReference
from tp_controller.robot import Robot
from tp_controller.ros.serialized import Serialized, field_view

QUEUE_DEPTH = 100
VELOCITY_TOPIC, POSITION_TOPIC = 'joint_velocity_command', 'joint_position_command'


def command_topic(command_type: str) -> str:
    """Name of the topic for a value of ``command.type``."""
    return POSITION_TOPIC if command_type in POSITION_TYPES else VELOCITY_TOPIC


def is_stamped(command_type: str) -> bool:
    """Whether commands of this ``command.type`` are sensor_msgs/JointState."""
    return command_type.startswith('joint_state')


class CommandPublisher:
    """Publishes commands in the form of the parameter ``command.type``.

    Parameters
    ----------
    node
        The controller's node.
    robot
        The robot, for joint names.
    command_type
        One of `COMMAND_TYPES`.
    reference
        Makes positions of velocities, for a type that needs them. Nothing is published before
        it has begun.

    Attributes
    ----------
    velocity
        The command sent last (n,) [rad/s, m/s].
    rest
        What is sent to an arm at rest, in words.
    waiting
        Whether it is not known yet who reads the commands.
    moving
        Whether the arm is known to move: it is then braked though its readers are not known yet.
    notices
        Whether readers that come or go are noticed, even if their number is the same again.
    """

    def __init__(
        self,
        node: Node,
        robot: Robot,
        command_type: str,
        reference: PositionReference | None = None,
    ) -> None:
        self._node = node
        self._reference = reference
        self._stamped = is_stamped(command_type)
        field = 'velocity' if reference is None else 'position'
        if self._stamped:
            msg: Any = JointState(name=list(robot.joints))
            msg.header.frame_id = robot.base_frame
        else:
            msg, field = Float64MultiArray(), 'data'
        self.velocity = np.zeros(robot.n)
        self.rest = 'zero command' if reference is None else 'last position'
        self._blocked = self.waiting = self.moving = False
        self._changes = 0
        self.notices = not self._stamped
        self._publisher = self._publish_on(type(msg), command_topic(command_type))
        self._values = field_view(msg, field, robot.n)
        self._stamp = msg.header.stamp if self._stamped else None
        self._message = Serialized(msg)
        self._bytes = b''

    def _publish_on(self, message: type, topic: str) -> Any:
        if self.notices:
            events = PublisherEventCallbacks(matched=self._on_matched)
            with contextlib.suppress(UnsupportedEventTypeError):
                return self._node.create_publisher(
                    message, topic, QUEUE_DEPTH, event_callbacks=events
                )
            self.notices = False
        return self._node.create_publisher(message, topic, QUEUE_DEPTH)

    def _on_matched(self, _: Any) -> None:
        self._changes += 1

    @property
    def topic(self) -> str:
        """Full name of the topic."""
        return str(self._publisher.topic_name)

    @property
    def withheld(self) -> bool:
        """Whether commands are not sent at present."""
        return self._blocked or (self.waiting and not self.moving)

    @property
    def heard(self) -> bool:
        """Whether anybody listens."""
        return bool(self._publisher.get_subscription_count())

    @property
    def readers(self) -> tuple[int, int]:
        """How often readers were seen to come or go, and how many there are."""
        return self._changes, self._publisher.get_subscription_count()

    def send(self, command: NDArray[np.float64] | float, stamp: Time | None = None) -> None:
        """Publish a command (n,).

        Parameters
        ----------
        command
            Joint velocities [rad/s, m/s].
        stamp
            Of the joint state that it answers; None if it answers none. It has the present
            time then: an old stamp could make a driver drop it.
        """
        self.prepare(command, stamp)
        self.send_prepared()

    def prepare(self, command: NDArray[np.float64] | float, stamp: Time | None = None) -> None:
        """Make the message of a command as in `send`, without publishing it."""
        self.velocity[:] = command
        reference = self._reference
        if reference is None:
            self._values[:] = self.velocity
        elif reference.begun:
            self._values[:] = reference.after(self.velocity)
        else:
            return
        if self._stamp is not None:
            answered = stamp or self._node.get_clock().now().to_msg()
            self._stamp.sec, self._stamp.nanosec = answered.sec, answered.nanosec
        self._bytes = self._message.write()

    def send_prepared(self) -> None:
        """Publish what was prepared; little time passes in between, to be too late in."""
        if self.withheld:
            if self._reference is not None:
                # It begins again where the arm is by then.
                self._reference.stop()
            return
        if self._reference is not None:
            if not self._reference.begun:
                return
            self._reference.advance()
        self._publisher.publish(self._bytes)

    def block(self, blocked: bool, waiting: bool) -> None:
        """Send nothing from now on, after a zero to an arm that moves, or send again.

        Parameters
        ----------
        blocked
            Whether commands would move what they are not meant for.
        waiting
            Whether that is not known yet: velocities then go to an arm that moves, to stop it.
        """
        if blocked and not self._blocked and self._reference is None and self.velocity.any():
            self.send(0.0)
        self._blocked, self.waiting = blocked, waiting

    def wait_until_arrived(self) -> None:
        """Give the last command time to arrive."""
        self._publisher.wait_for_all_acked(Duration(seconds=0.2))
