"""ROS 2 parameters of a running controller: checked, applied, declared with tasks that come."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

from rcl_interfaces.msg import SetParametersResult
from rclpy.node import Node
from rclpy.parameter import Parameter as RosParameter

from tp_controller.config import ROS_OWN, Settings, check_changes, controller_schema
from tp_controller.errors import InvalidValue
from tp_controller.ros.log import Log
from tp_controller.ros.parameters import describe_parameters
from tp_controller.tasks import Task

AT_ONCE = 5
"""Parameters of a new task that are declared between two cycles."""


class LiveParameters:
    """Keeps the parameters of the node and what the controller runs on equal.

    Parameters
    ----------
    node
        The controller's node.
    settings
        What it runs on.
    changed
        Called after every change.
    """

    def __init__(self, node: Node, settings: Settings, changed: Callable[[], None]) -> None:
        self._node = node
        self._log = Log(node)
        self._settings = settings
        self._changed = changed
        self._schema = controller_schema(settings.values)
        describe_parameters(node, self._schema, settings.values)
        self._declaring = False
        self._pending: Callable[[], tuple[str, ...]] | None = None
        node.add_on_set_parameters_callback(self._check)
        node.add_post_set_parameters_callback(self._apply)

    def declare(self, task: Task) -> Iterator[None]:
        """Declare the parameters of a task that has come, with pauses in between."""
        self._schema = controller_schema(self._settings.values)
        own = [key for key in self._schema if key.startswith(f'tasks.{task.name}.')]
        for i in range(0, len(own), AT_ONCE):
            some = {key: self._schema[key] for key in own[i : i + AT_ONCE]}
            self._declaring = True
            describe_parameters(self._node, some, self._settings.values)
            self._declaring = False
            yield

    def forget(self, keys: Sequence[str]) -> None:
        """Let parameters of a task that has left be."""
        self._schema = controller_schema(self._settings.values)
        for key in keys:
            if self._node.has_parameter(key):
                self._node.undeclare_parameter(key)

    def close(self) -> None:
        """Let changes be."""
        self._node.remove_on_set_parameters_callback(self._check)
        self._node.remove_post_set_parameters_callback(self._apply)

    def _check(self, parameters: Sequence[RosParameter]) -> SetParametersResult:
        if self._declaring:
            return SetParametersResult(successful=True)
        changes = {p.name: p.value for p in parameters if not p.name.startswith(ROS_OWN)}
        try:
            self._pending = check_changes(self._settings, self._schema, changes)
        except InvalidValue as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _apply(self, parameters: Sequence[RosParameter]) -> None:
        if self._pending is not None:
            for line in self._pending():
                self._log.warning(line)
            self._pending = None
            self._changed()
