"""The topic of commands of an arm that is measured: nobody else publishes, its readers agree."""

from __future__ import annotations

import time

import rclpy
from rclpy.node import Node

from tp_controller.config.schema import POSITION_TYPES
from tp_controller.measuring import Refused
from tp_controller.position_reference import PositionReference
from tp_controller.robot import Robot
from tp_controller.ros.commands import CommandPublisher, command_topic, is_stamped
from tp_controller.ros.neighbours import publishers
from tp_controller.ros.receivers import PERIOD as RECEIVER_PERIOD
from tp_controller.ros.receivers import Receivers

DISCOVERY = 1.0
"""Time [s] in which other publishers are found."""
LOOK_PERIOD = 0.5
"""Time [s] between two looks for them."""


class CommandTopic:
    """Looks for other publishers, and asks readers of commands without names what they take.

    Parameters
    ----------
    node
        Its node; nobody else publishes commands on it.
    robot
        The arm.
    command_type
        The parameter ``command.type``.
    """

    def __init__(self, node: Node, robot: Robot, command_type: str) -> None:
        self._node, self._robot, self._command_type = node, robot, command_type
        self._name = node.resolve_topic_name(command_topic(command_type))
        self._commands: CommandPublisher | None = None
        self._receivers: Receivers | None = None
        self._looked = self._asked = 0.0

    def refuse_others(self) -> None:
        """Refuse to begin if somebody else publishes commands."""
        end = time.monotonic() + DISCOVERY
        while time.monotonic() < end:
            rclpy.spin_once(self._node, timeout_sec=0.05)
        if names := self._others():
            raise Refused(
                f'{self._name} has a publisher, {names}: end it first, only one may move the arm'
            )

    def open(self, reference: PositionReference | None) -> CommandPublisher:
        """Make the publisher of commands, and `ask` their readers."""
        robot, command_type = self._robot, self._command_type
        self._commands = CommandPublisher(self._node, robot, command_type, reference)
        self.ask()
        return self._commands

    def ask(self) -> None:
        """Wait until the readers of commands without names have told what they take.

        Raises
        ------
        Refused
            If it is not what is sent.
        """
        if is_stamped(self._command_type):
            return
        assert self._commands is not None
        interface = 'position' if self._command_type in POSITION_TYPES else 'velocity'
        if self._receivers is not None:
            self._receivers.close()
        joints = self._robot.joints
        self._receivers = Receivers(self._node, self._commands, joints, interface, _ignore)
        while self._commands.withheld and not self._receivers.problem:
            end = time.monotonic() + RECEIVER_PERIOD
            while time.monotonic() < end:
                rclpy.spin_once(self._node, timeout_sec=RECEIVER_PERIOD)
            self._receivers.look()
        if self._receivers.problem:
            raise Refused(self._receivers.problem)

    def look(self) -> str:
        """Look around while the arm moves; return why it may not, empty if it may."""
        assert self._commands is not None
        now = time.monotonic()
        if self._receivers is not None and now - self._asked > RECEIVER_PERIOD:
            self._asked = now
            self._receivers.look()
            if self._commands.withheld:
                gone = f'{self._commands.topic}, which nobody reads any more'
                return self._receivers.problem or gone
        if now - self._looked > LOOK_PERIOD:
            self._looked = now
            if names := self._others():
                return f'{names} publishes commands, too'
        return ''

    def _others(self) -> str:
        """Names of other publishers of commands."""
        names = publishers(self._node, self._name)
        own = f'{self._node.get_namespace().rstrip("/")}/{self._node.get_name()}'
        if self._commands is not None and own in names:
            names.remove(own)
        return ', '.join(names)


def _ignore(_: str) -> None:
    """Stand in for what is told."""
