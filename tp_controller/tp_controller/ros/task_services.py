"""Services that add tasks to a running controller and remove them.

What takes long is kept from the cycle: a text is read and a task built by a thread of its own,
meshes by a process, and what has to be done between two cycles is done in pieces of about a
millisecond, with joint states answered in between.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Generator, Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import Any, TypeVar

from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.node import Node
from rclpy.parameter import Parameter as RosParameter

from tp_controller.config import (
    Settings,
    build_addition,
    check_removal,
    read_task,
    remove,
)
from tp_controller.config.additions import Addition
from tp_controller.errors import InvalidValue, TaskPriorityError
from tp_controller.shape_process import described_apart
from tp_controller.tasks import Task
from tp_interfaces.srv import AddTask, RemoveTask

T = TypeVar('T')

SWITCH_INTERVAL = 0.0001
"""Longest time [s] for which the thread that builds tasks keeps the cycle waiting."""
TRIES = 5
"""How often a task is built anew because limits have changed meanwhile."""


class TaskServices:
    """``~/add_task`` and ``~/remove_task``, one request after the other.

    Parameters
    ----------
    node
        The controller's node.
    settings
        What it runs on.
    added
        Called with a task that has been loaded, before it comes into the hierarchy. What it
        does has pauses, at which joint states may be answered.
    removed
        Called in the same way with a task that has left, and the keys of its parameters.
    """

    def __init__(
        self,
        node: Node,
        settings: Settings,
        added: Callable[[Task], Iterator[None]],
        removed: Callable[[Task, list[str]], Iterator[None]],
    ) -> None:
        self._node = node
        self._settings = settings
        self._added, self._removed = added, removed
        # Requests wait for each other, joint states for none of them.
        group = MutuallyExclusiveCallbackGroup()
        node.create_service(AddTask, '~/add_task', self._on_add, callback_group=group)
        node.create_service(RemoveTask, '~/remove_task', self._on_remove, callback_group=group)
        self._thread = ThreadPoolExecutor(1, 'tasks')
        sys.setswitchinterval(SWITCH_INTERVAL)
        robot = settings.stack.robot
        if isinstance(robot.body_source, partial):
            robot.body_source = partial(robot.body_source, read=described_apart)
        _load_compiled()

    async def _on_add(
        self, request: AddTask.Request, response: AddTask.Response
    ) -> AddTask.Response:
        try:
            addition = await self._build(request.name, request.parameters)
            addition.check(request.level)
        except TaskPriorityError as error:
            response.message = str(error)
            return response
        addition.load()
        await self._in_pieces(self._added(addition.task))
        try:
            # The hierarchy may have changed meanwhile.
            self._arrange(addition.check(request.level))
        except InvalidValue as error:
            response.message = str(error)
            await self._forget(addition.task)
            return response
        response.success = True
        return response

    async def _on_remove(
        self, request: RemoveTask.Request, response: RemoveTask.Response
    ) -> RemoveTask.Response:
        try:
            hierarchy = check_removal(self._settings.stack, request.name)
        except InvalidValue as error:
            response.message = str(error)
            return response
        self._arrange(hierarchy)
        await self._forget(self._settings.stack.tasks[request.name])
        response.success = True
        return response

    async def _forget(self, task: Task) -> None:
        """Remove a task that is not in the hierarchy."""
        await self._in_pieces(self._removed(task, remove(self._settings, task.name)))

    async def _build(self, name: str, text: str) -> Addition:
        """Task of a request, made for the limits that the robot has now.

        Raises
        ------
        TaskPriorityError
            If it cannot be made.
        """
        parameters = await self._apart(partial(read_task, text))
        for _ in range(TRIES):
            addition = await self._apart(partial(build_addition, self._settings, name, parameters))
            if addition.up_to_date:
                return addition
        raise InvalidValue('robot.limits', 'changes all the time', 'a moment without')

    async def _apart(self, work: Callable[[], T]) -> T:
        """Do work in the thread; joint states are answered meanwhile."""
        future = self._thread.submit(work)
        future.add_done_callback(lambda _: _wake(self._node))
        while not future.done():
            await _Pause()
        return future.result()

    async def _in_pieces(self, pieces: Iterator[None]) -> None:
        for _ in pieces:
            await _Pause(self._node)

    def _arrange(self, hierarchy: tuple[str, ...]) -> None:
        """Set the hierarchy, which was checked, by its parameter: both stay the same."""
        if hierarchy != tuple(self._settings.stack.hierarchy):
            # Of an empty list ROS would not know that it is one of texts.
            levels = list(hierarchy) or ['']
            self._node.set_parameters([RosParameter('hierarchy', value=levels)])


class _Pause:
    """A moment in which the executor does what else there is to do.

    Parameters
    ----------
    node
        Node whose executor is not to wait for anything then; None if it may wait.
    """

    def __init__(self, node: Node | None = None) -> None:
        if node is not None:
            _wake(node)

    def __await__(self) -> Generator[Any, None, None]:
        yield


def _wake(node: Node) -> None:
    if node.executor is not None:
        node.executor.wake()


def _load_compiled() -> None:
    """Load what tasks to come may need: it would hold up the cycle later."""
    from tp_controller.robot import bounds
    from tp_controller.tasks import damper

    _ = bounds, damper
