"""Services that change the stack of a running controller, and the one that saves it.

What takes long is kept from the cycle: a text is read and tasks built by a thread of its own,
meshes by a process, and what has to be done between two cycles is done in pieces of about a
millisecond, with joint states answered in between. What moves the arm is done in one: the
parameters of a request are set together, as ROS 2 sets parameters atomically.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from typing import Any

from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.node import Node
from rclpy.parameter import Parameter as RosParameter

from tp_controller.config import (
    Request,
    Settings,
    build_addition,
    check_request,
    controller_schema,
    parameter_text,
    present_parameters,
    read_task,
    read_text,
    remove,
    split_request,
    write_text,
)
from tp_controller.config.additions import Addition
from tp_controller.errors import InvalidValue, TaskPriorityError, listed, shown
from tp_controller.parameters import Flat
from tp_controller.ros.apart import Apart
from tp_controller.shape_process import described_apart
from tp_controller.tasks import Task
from tp_interfaces.srv import AddTask, Change, RemoveTask, Save

TRIES = 5
"""How often a task is built anew because limits have changed meanwhile."""


class StackServices:
    """``~/change``, ``~/add_task``, ``~/remove_task`` and ``~/save``, one request after the other.

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
        for service, name, answer in (
            (AddTask, '~/add_task', self._on_add),
            (RemoveTask, '~/remove_task', self._on_remove),
            (Change, '~/change', self._on_change),
            (Save, '~/save', self._on_save),
        ):
            node.create_service(service, name, partial(_answered, answer), callback_group=group)
        self._apart = Apart(node)
        robot = settings.stack.robot
        if isinstance(robot.body_source, partial):
            robot.body_source = partial(robot.body_source, read=described_apart)
        _load_compiled()
        self._apart.begin(_load_solvers)

    async def _on_add(self, request: AddTask.Request) -> None:
        block = await self._apart.run(partial(read_task, request.parameters))
        await self._make(Request({request.name: block}, (), {}, request.level))

    async def _on_remove(self, request: RemoveTask.Request) -> None:
        tasks = self._settings.stack.tasks
        if request.name not in tasks:
            raise InvalidValue('name', shown(request.name), f'one of {listed(tasks)}')
        await self._make(Request({}, (request.name,), {}))

    async def _on_change(self, request: Change.Request) -> None:
        parameters = await self._apart.run(partial(read_text, request.parameters))
        await self._make(split_request(parameters, self._settings.stack.tasks))

    async def _on_save(self, request: Save.Request) -> None:
        found = present_parameters(self._settings)
        write = partial(_write, found, self._node.get_name(), request.path, request.overwrite)
        await self._apart.run(write)

    async def _make(self, request: Request) -> None:
        """Make everything that is asked for, or nothing.

        Raises
        ------
        TaskPriorityError
            If it cannot be done.
        """
        additions = await self._build(request.additions)
        self._check(request, additions)
        try:
            for addition in additions:
                addition.load()
                await self._apart.in_pieces(self._added(addition.task))
            # Anything may have changed meanwhile.
            self._set(self._check(request, additions))
        except TaskPriorityError:
            for addition in additions:
                await self._forget(addition.task.name)
            raise
        # All leave in one: what stood in pauses could list one of them again.
        tasks = self._settings.stack.tasks
        gone = [(tasks[name], remove(self._settings, name)) for name in request.removals]
        for task, keys in gone:
            await self._apart.in_pieces(self._removed(task, keys))

    def _check(self, request: Request, additions: Sequence[Addition]) -> Flat:
        schema = controller_schema(self._settings.values)
        return check_request(self._settings, schema, request, additions)

    async def _build(self, blocks: Mapping[str, Mapping[str, Any]]) -> list[Addition]:
        """Tasks of a request, made for the limits that the robot has now."""
        made = [partial(build_addition, self._settings, name, blocks[name]) for name in blocks]
        for _ in range(TRIES):
            additions = [await self._apart.run(make) for make in made]
            if all(addition.up_to_date for addition in additions):
                return additions
        raise InvalidValue('robot.limits', 'changes all the time', 'a moment without')

    def _set(self, changes: Flat) -> None:
        """Set parameters, which were checked, as anybody would: both stay the same."""
        if not changes:
            return
        values = {
            key: list(value) if isinstance(value, tuple) else value
            for key, value in changes.items()
        }
        # Of an empty list ROS would not know that it is one of texts.
        parameters = [
            RosParameter(key, value=[''] if value == [] else value)
            for key, value in values.items()
        ]
        result = self._node.set_parameters_atomically(parameters)
        if not result.successful:
            raise Refused(result.reason)

    async def _forget(self, name: str) -> None:
        """Remove a task that is not in the hierarchy."""
        stack = self._settings.stack
        task = stack.tasks.get(name)
        if task is not None and stack.place_of(name) < 0:
            keys = remove(self._settings, name)
            await self._apart.in_pieces(self._removed(task, keys))


class Refused(TaskPriorityError):
    """Parameters could not be set after all; the text says why."""


async def _answered(answer: Callable[[Any], Any], request: Any, response: Any) -> Any:
    try:
        await answer(request)
        response.success = True
    except TaskPriorityError as error:
        response.message = str(error)
    return response


def _write(parameters: Flat, node: str, path: str, overwrite: bool) -> None:
    write_text(parameter_text(parameters, node), path, overwrite)


def _load_compiled() -> None:
    """Load what tasks to come may need: it would hold up the cycle later."""
    from tp_controller.robot import bounds
    from tp_controller.tasks import damper

    _ = bounds, damper


def _load_solvers() -> None:
    """Load what a change of `solver.type` may need: it takes some 50 ms."""
    from tp_controller.solvers import hqp_kernel, lexicographic

    _ = hqp_kernel, lexicographic
