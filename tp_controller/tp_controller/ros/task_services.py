"""Services that add tasks to a running controller and remove them."""

from __future__ import annotations

from collections.abc import Callable

import yaml
from rclpy.node import Node
from rclpy.parameter import Parameter as RosParameter

from tp_controller.config import Settings, check_addition, check_removal, remove
from tp_controller.errors import InvalidValue, shown
from tp_controller.tasks import Task
from tp_interfaces.srv import AddTask, RemoveTask

ACCEPTS = 'YAML of a task, such as {type: obstacle, frame: link_3, ...}'


class TaskServices:
    """``~/add_task`` and ``~/remove_task``.

    Parameters
    ----------
    node
        The controller's node.
    settings
        What it runs on.
    added
        Called with a task that has been loaded, before it comes into the hierarchy.
    removed
        Called with a task that has left, and the keys of its parameters.
    """

    def __init__(
        self,
        node: Node,
        settings: Settings,
        added: Callable[[Task], None],
        removed: Callable[[Task, list[str]], None],
    ) -> None:
        self._node = node
        self._settings = settings
        self._added, self._removed = added, removed
        node.create_service(AddTask, '~/add_task', self._on_add)
        node.create_service(RemoveTask, '~/remove_task', self._on_remove)

    def _on_add(self, request: AddTask.Request, response: AddTask.Response) -> AddTask.Response:
        try:
            parameters = _block(request.parameters)
            addition = check_addition(self._settings, request.name, parameters, request.level)
        except InvalidValue as error:
            response.message = str(error)
            return response
        except RecursionError:
            response.message = f'parameters: got a block without end; accepts {ACCEPTS}'
            return response
        addition.load()
        self._added(addition.task)
        self._arrange(addition.hierarchy)
        response.success = True
        return response

    def _on_remove(
        self, request: RemoveTask.Request, response: RemoveTask.Response
    ) -> RemoveTask.Response:
        try:
            hierarchy = check_removal(self._settings.stack, request.name)
        except InvalidValue as error:
            response.message = str(error)
            return response
        self._arrange(hierarchy)
        task = self._settings.stack.tasks[request.name]
        self._removed(task, remove(self._settings, task.name))
        response.success = True
        return response

    def _arrange(self, hierarchy: tuple[str, ...]) -> None:
        """Set the hierarchy, which was checked, by its parameter: both stay the same."""
        if hierarchy != tuple(self._settings.stack.hierarchy):
            self._node.set_parameters([RosParameter('hierarchy', value=list(hierarchy))])


def _block(text: str) -> dict[str, object]:
    try:
        block = yaml.safe_load(text)
    except (yaml.YAMLError, ValueError) as error:
        problem = ' '.join(str(getattr(error, 'problem', error)).split())
        raise InvalidValue('parameters', f'{shown(text)}: {problem}', ACCEPTS) from None
    if not isinstance(block, dict) or not block:
        raise InvalidValue('parameters', shown(text), ACCEPTS)
    return block
