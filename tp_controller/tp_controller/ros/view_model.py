"""The robot and the tasks of a controller that runs elsewhere, built from its parameters."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any

from rclpy.node import Node
from std_msgs.msg import String

from tp_controller.config import build_settings, describe_robot, robot_source
from tp_controller.errors import TaskPriorityError
from tp_controller.parameters import Flat
from tp_controller.ros.robot_node import TOPIC, TOPIC_QOS
from tp_controller.stack import Stack
from tp_controller.view.visuals import Visual, visuals

DH = 'robot.dh.'
ROBOT = 'robot'
"""Beginning of the keys that say what a robot looks like."""


class ViewModel:
    """Builds robot and tasks in a thread of its own, as it may take seconds.

    Parameters
    ----------
    node
        Listens to ``robot_description``, for parameters that name no robot.
    namespace
        Where that is.
    """

    def __init__(self, node: Node, namespace: str) -> None:
        self._thread = ThreadPoolExecutor(1, 'robot')
        self._description: str | None = None
        topic = f'{namespace.rstrip("/")}/{TOPIC}'
        self._subscription = node.create_subscription(
            String, topic, self._on_description, TOPIC_QOS
        )
        self._topic = topic
        self._building: Future[Stack] | None = None
        self._reading: Future[list[Visual]] | None = None
        self._parameters: Flat = {}
        self._looks: object = None

    def build(self, parameters: Mapping[str, Any]) -> str:
        """Begin to build; return what that has to wait for, empty if for nothing."""
        self._parameters = dict(parameters)
        if robot_source(self._parameters) is None and self._description is None:
            return f'robot_description on {self._topic}'
        self._building = self._thread.submit(_build, self._parameters, self._description)
        return ''

    def take_stack(self) -> tuple[Stack, bool] | None:
        """Robot and tasks once they are built, None before; once.

        Returns
        -------
        tuple or None
            The stack, and whether its robot looks as the one before.

        Raises
        ------
        TaskPriorityError
            If they could not be built.
        """
        if self._building is None or not self._building.done():
            return None
        done, self._building = self._building, None
        found = done.result()
        robot = {key: value for key, value in self._parameters.items() if key.startswith(ROBOT)}
        looks, self._looks = self._looks, (robot, self._description)
        same = looks == self._looks
        if not same:
            self._reading = self._thread.submit(_read, self._parameters, self._description)
        return found, same

    def take_visuals(self) -> Iterator[Visual]:
        """What links look like, once that is read; once."""
        if self._reading is not None and self._reading.done():
            found, self._reading = self._reading.result(), None
            yield from found

    def _on_description(self, msg: String) -> None:
        self._description = msg.data


def _build(parameters: Flat, description: str | None) -> Stack:
    return build_settings(parameters, description, find_rate=True).stack


def _read(parameters: Flat, description: str | None) -> list[Visual]:
    """Visuals of the links; none of an arm of DH parameters, or one that cannot be read again."""
    if (robot_source(parameters) or '').startswith(DH):
        return []
    try:
        return visuals(describe_robot(parameters, description))
    except TaskPriorityError:
        return []
