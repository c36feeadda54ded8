"""Tasks that come and go while running: checked as a whole, then made as a whole."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

from tp_controller.config.build import Settings, build_task
from tp_controller.config.schema import task_schema
from tp_controller.errors import InvalidValue
from tp_controller.parameters import Flat, flatten, read_all
from tp_controller.robot import Limits
from tp_controller.stack import Stack
from tp_controller.tasks import Task

IDLE = -1
"""Level of a task outside the hierarchy."""


class Addition(NamedTuple):
    """A task that can be added; nothing has changed yet."""

    settings: Settings
    task: Task
    values: Flat
    """Its parameters by dotted key, defaults filled in."""
    limits: Limits
    """Limits of the robot that it was made for."""

    @property
    def up_to_date(self) -> bool:
        """Whether limits and period are still those that the task was made for."""
        stack = self.settings.stack
        return self.limits is stack.robot.limits and self.task.period == stack.safety_filter.period

    def check(self, level: int) -> tuple[str, ...]:
        """Levels with the task among them.

        Parameters
        ----------
        level
            List position in the hierarchy that its own new level gets, 0 for the highest; -1
            to leave it idle.

        Raises
        ------
        InvalidValue
            If there is another such task by now, no such level, or the levels cannot be
            resolved.
        """
        stack, name = self.settings.stack, self.task.name
        self.check_new()
        levels = list(stack.hierarchy)
        if not IDLE <= level <= len(levels):
            accepts = f'-1 (idle) or 0 (highest) to {len(levels)} (lowest)'
            raise InvalidValue('level', str(level), accepts)
        if level != IDLE:
            levels.insert(level, name)
            stack.check_hierarchy(levels, tasks=stack.tasks | {name: self.task})
        return tuple(levels)

    def check_new(self) -> None:
        """Check that there is no other task of that name by now.

        Raises
        ------
        InvalidValue
            If there is.
        """
        if self.settings.stack.tasks.get(self.task.name) is not self.task:
            _check_new(self.settings.stack, self.task.name)

    def load(self) -> None:
        """Load the task, still outside the hierarchy."""
        self.settings.stack.add(self.task)
        self.settings.values.update(self.values)


def build_addition(settings: Settings, name: str, parameters: Mapping[str, Any]) -> Addition:
    """Build a task that is to be added.

    It only reads what the controller runs on, so that another thread may do it.

    Parameters
    ----------
    settings
        What the controller runs on.
    name
        Name of the task.
    parameters
        What stands under ``tasks.<name>`` in a parameter file.

    Raises
    ------
    InvalidValue
        If there is such a task already, or anything about it cannot be used.
    """
    robot = settings.stack.robot
    _check_new(settings.stack, name)
    limits = robot.limits
    key = f'tasks.{name}'
    flat = flatten(parameters, f'{key}.')
    values = read_all(flat, task_schema(name, flat))
    task = build_task(name, robot, settings.values | values)
    values[f'{key}.feedforward'] = tuple(task.feedforward)
    return Addition(settings, task, values, limits)


def _check_new(stack: Stack, name: str) -> None:
    if name in stack.tasks:
        raise InvalidValue(f'tasks.{name}', 'a second task of that name', 'a new name')


def remove(settings: Settings, name: str) -> list[str]:
    """Forget a task that is not in the hierarchy.

    Returns
    -------
    list
        Keys of its parameters.
    """
    settings.stack.remove(name)
    keys = [key for key in settings.values if key.startswith(f'tasks.{name}.')]
    for key in keys:
        del settings.values[key]
    return keys
