"""Parameters of another node, kept up to date without asking it again."""

from __future__ import annotations

import array
import time
from collections.abc import Sequence
from typing import Any

from rcl_interfaces.msg import ParameterEvent
from rcl_interfaces.srv import GetParameters, ListParameters
from rclpy.node import Node
from rclpy.parameter import parameter_value_to_python

from tp_controller.config import ROS_OWN
from tp_controller.parameters import Flat

LOST = 5.0
"""Time [s] after which an answer is no longer waited for; all is asked for again."""
AT_ONCE = 8
"""Values that are asked for in one call: more would hold up a controller's cycle."""


class RemoteParameters:
    """Asks for all values once, a few at a time, and follows the events of changes.

    Parameters
    ----------
    node
        Asks and listens; somebody has to spin it.
    name
        Full name of the other node.

    Attributes
    ----------
    values
        Values by dotted key as far as they are known.
    complete
        Whether they are all that there are.
    """

    def __init__(self, node: Node, name: str) -> None:
        self._name = name
        self._list = node.create_client(ListParameters, f'{name}/list_parameters')
        self._get = node.create_client(GetParameters, f'{name}/get_parameters')
        self._subscription = node.create_subscription(
            ParameterEvent, '/parameter_events', self._on_event, 100
        )
        self.values: Flat = {}
        self.complete = False
        self._wanted = True
        self._call: Any = None
        self._names: list[str] = []
        self._asked: list[str] = []
        self._begin = 0.0

    def ask_again(self) -> None:
        """Forget the values, which may be those of a process that is over."""
        self.values, self.complete, self._wanted = {}, False, True
        self._call, self._names = None, []

    def work(self) -> None:
        """Go on asking; to be called again and again."""
        if self._call is None:
            if self._wanted and self._list.service_is_ready() and self._get.service_is_ready():
                self._wanted = False
                self._begin = time.monotonic()
                self._call = self._list.call_async(ListParameters.Request())
                self._asked = []
            return
        if not self._call.done():
            if time.monotonic() - self._begin > LOST:
                self.ask_again()
            return
        answer, self._call = self._call.result(), None
        if isinstance(answer, ListParameters.Response):
            names = [str(name) for name in answer.result.names]
            self._names = [name for name in names if not name.startswith(ROS_OWN)]
        elif answer is not None:
            self._keep(self._asked, answer.values)
        self._asked, self._names = self._names[:AT_ONCE], self._names[AT_ONCE:]
        if self._asked:
            self._begin = time.monotonic()
            self._call = self._get.call_async(GetParameters.Request(names=self._asked))
        else:
            self.complete = not self._wanted

    def _keep(self, names: Sequence[str], values: Sequence[Any]) -> None:
        for name, value in zip(names, values, strict=False):
            found = parameter_value_to_python(value)
            if found is not None:
                self.values[name] = list(found) if isinstance(found, array.array) else found

    def _on_event(self, event: ParameterEvent) -> None:
        if event.node != self._name:
            return
        for parameter in (*event.new_parameters, *event.changed_parameters):
            if not parameter.name.startswith(ROS_OWN):
                self._keep([parameter.name], [parameter.value])
        for parameter in event.deleted_parameters:
            self.values.pop(parameter.name, None)
