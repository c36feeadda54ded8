"""What moved a recorded controller beside joint states: goals, feedforwards, parameters, holds."""

from __future__ import annotations

import array
from collections.abc import Iterator
from typing import Any

import numpy as np
from rclpy.parameter import parameter_value_to_python

from tp_controller.config import (
    RESUME,
    TARGETS,
    Settings,
    build_addition,
    check_changes,
    controller_schema,
    remove,
)
from tp_controller.errors import InvalidValue, TaskPriorityError
from tp_controller.recording import Entry, Recording
from tp_controller.ros.state import StateMessage
from tp_controller.ros.task_inputs import FEEDFORWARD, GOAL, TRAJECTORY, TaskInputs
from tp_controller.tasks import Task

EVENTS = '/parameter_events'


class ReplayedInputs:
    """Gives a controller's inputs back, each before the cycle in which it was taken over.

    The counters in ``~/state`` say in which cycle a message was taken over, and its time of
    sending which one it was; parameters were changed between two states by their times.

    Parameters
    ----------
    recording
        The recording.
    settings, state, inputs
        Parts of the controller that are moved.
    """

    def __init__(
        self, recording: Recording, settings: Settings, state: StateMessage, inputs: TaskInputs
    ) -> None:
        self._settings, self._state, self._inputs = settings, state, inputs
        self._node = recording.controller
        topics = [topic for topic in recording.types if topic.startswith(f'{self._node}/')]
        ends = tuple(f'/{what}' for what in (GOAL, FEEDFORWARD, TRAJECTORY))
        topics = [topic for topic in topics if topic.endswith(ends)]
        self._messages: dict[str, list[Entry]] = {topic: [] for topic in topics}
        self._events: list[Entry] = []
        for entry in recording.messages([*topics, EVENTS]):
            if entry.topic != EVENTS:
                self._messages[entry.topic].append(entry)
            elif entry.message.node == self._node:
                self._events.append(entry)
        self.notes: dict[str, None] = {}
        """What could not be given back, and why."""

    def begin(self, recorded: Any) -> None:
        """Take over what came before the first recorded state."""
        stack = self._settings.stack
        for entry in recorded.tasks:
            task = stack.tasks.get(entry.name)
            if task is None:
                continue
            mine = self._state.task(entry.name)
            mine.accepted_goals = entry.accepted_goals
            mine.accepted_feedforwards = entry.accepted_feedforwards
            desired = np.array(entry.desired)
            if recorded.cycles > 1 and desired.size and np.all(np.isfinite(desired)):
                task.target = desired

    def before(self, recorded: Any, sent: int) -> None:
        """Make what was made before the cycle that published a state.

        Parameters
        ----------
        recorded
            The state.
        sent
            Time [ns] when it was published.
        """
        self._follow_tasks(recorded)
        while self._events and self._events[0].sent < sent:
            self._change(self._events.pop(0).message)
        for entry in recorded.tasks:
            task = self._settings.stack.tasks.get(entry.name)
            if task is not None:
                self._take_goal(task, entry, sent)
                self._take_feedforward(task, entry, sent)
        self._follow_hold(bool(recorded.held))

    def _take_goal(self, task: Task, recorded: Any, sent: int) -> None:
        mine = self._state.task(task.name)
        missing = recorded.accepted_goals - mine.accepted_goals
        if missing <= 0:
            return
        # Of several only the last one is left to see.
        mine.accepted_goals += missing - 1
        desired = np.array(recorded.desired)
        for message in self._waiting(task, GOAL, sent):
            try:
                target = self._inputs.target_of(task, message)
            except InvalidValue:
                continue
            if np.array_equal(target, desired):
                self._inputs.take_over(task, GOAL, message)
                return
        for message in self._waiting(task, TRAJECTORY, sent):
            self._inputs.take_over(task, TRAJECTORY, message)
            if mine.accepted_goals == recorded.accepted_goals:
                return
        # By an action, or a topic of another name: the state says what became of it.
        self._inputs.aim(task, desired)

    def _take_feedforward(self, task: Task, recorded: Any, sent: int) -> None:
        mine = self._state.task(task.name)
        missing = recorded.accepted_feedforwards - mine.accepted_feedforwards
        if missing <= 0:
            return
        for message in self._waiting(task, FEEDFORWARD, sent):
            self._inputs.take_over(task, FEEDFORWARD, message)
            break
        else:
            self._note(f'{task.name}: a feedforward that is not in the recording')
        mine.accepted_feedforwards = recorded.accepted_feedforwards

    def _waiting(self, task: Task, what: str, sent: int) -> Iterator[Any]:
        """Messages that were sent before a time [ns], the newest first; each once."""
        entries = self._messages.get(f'{self._node}/{task.name}/{what}', [])
        count = sum(entry.sent < sent for entry in entries)
        found = entries[:count]
        del entries[:count]
        for entry in reversed(found):
            yield entry.message

    def _follow_tasks(self, recorded: Any) -> None:
        """Load tasks that have come, and forget those that have left."""
        stack = self._settings.stack
        names = [entry.name for entry in recorded.tasks]
        for name in names:
            if name not in stack.tasks:
                try:
                    build_addition(self._settings, name, self._new_parameters(name)).load()
                except TaskPriorityError as error:
                    self._note(f'task {name} cannot be added: {error}')
        for name in [name for name in stack.tasks if name not in names]:
            if stack.place_of(name) < 0:
                self._inputs.forget(stack.tasks[name])
                remove(self._settings, name)
        if set(names) != {task.name for task in self._state.msg.tasks}:
            self._state.follow_tasks()

    def _new_parameters(self, name: str) -> dict[str, Any]:
        """Parameters of a task that has come, from the events that follow."""
        prefix = f'tasks.{name}.'
        found: dict[str, Any] = {}
        for entry in self._events:
            for key, value in _values(entry.message.new_parameters):
                if key.startswith(prefix):
                    found.setdefault(key.removeprefix(prefix), value)
        return found

    def _change(self, event: Any) -> None:
        """Make the change of parameters that an event tells of."""
        settings = self._settings
        schema = controller_schema(settings.values)
        changes = {
            key: value
            for key, value in _values([*event.new_parameters, *event.changed_parameters])
            if key in schema and _plain(settings.values[key]) != value
        }
        if not changes:
            return
        try:
            check_changes(settings, schema, changes)()
        except TaskPriorityError as error:
            self._note(f'a change of parameters cannot be made again: {error}')
        self._state.follow_hierarchy()

    def _follow_hold(self, held: bool) -> None:
        stack = self._settings.stack
        if held and not stack.held:
            stack.hold()
            self._inputs.end_motion()
        elif stack.held and not held:
            stack.resume(targets=self._settings.values[RESUME] == TARGETS)

    def _note(self, text: str) -> None:
        self.notes[text] = None


def _values(parameters: Any) -> Iterator[tuple[str, Any]]:
    for parameter in parameters:
        yield parameter.name, _plain(parameter_value_to_python(parameter.value))


def _plain(value: Any) -> Any:
    return list(value) if isinstance(value, tuple | array.array) else value
