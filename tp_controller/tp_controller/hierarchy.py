"""Hierarchies: levels of task names, and the tasks that they name."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Sequence

from tp_controller.errors import InvalidValue, listed, shown
from tp_controller.parameters import check_name
from tp_controller.robot import Robot
from tp_controller.tasks import Task


def named_tasks(robot: Robot, tasks: Iterable[Task], period: float) -> dict[str, Task]:
    """Tasks by name; those without a period [s] take it over.

    Raises
    ------
    InvalidValue
        If two tasks have one name, or a task is another robot's, has another period or a gain
        that this one is too long for.
    """
    named: dict[str, Task] = {}
    for task in tasks:
        check_name(task.name)
        key = f'tasks.{task.name}'
        if named.setdefault(task.name, task) is not task:
            raise InvalidValue(key, 'a second task of that name', 'a new name')
        if task.robot is not robot:
            raise InvalidValue(key, 'a task of another robot', "tasks of the stack's robot")
        if task.period not in (period, math.inf):
            got = f'a period of {task.period:g} s'
            raise InvalidValue(key, got, f"the stack's, {period:g} s, or none")
        if task.period != period:
            task.know_period(period)
            try:
                task.check_gain(task.gain.ravel().tolist())
            except InvalidValue as error:
                raise error.under(key) from None
    return named


def all_set_based(tasks: Iterable[Task]) -> bool:
    """Whether all tasks of a level keep distances."""
    return all(task.set_based for task in tasks)


def split_hierarchy(hierarchy: Sequence[str], known: Collection[str]) -> list[list[str]]:
    """Task names of every level, highest first.

    Parameters
    ----------
    hierarchy
        Task names by level; ``a + b`` puts two on one level. One empty name alone means none:
        ROS parameter files know no empty list of texts.
    known
        Names of all tasks.

    Raises
    ------
    InvalidValue
        If a name is unknown or a task stands twice.
    """
    levels = [[name.strip() for name in level.split('+')] for level in hierarchy]
    accepts = f'names out of {listed(known)}, joined by + on one level'
    if levels == [['']]:
        return []
    seen: set[str] = set()
    for name in (name for names in levels for name in names):
        if name not in known:
            raise InvalidValue('hierarchy', shown(name), accepts)
        if name in seen:
            raise InvalidValue('hierarchy', f'{shown(name)} twice', 'every task once')
        seen.add(name)
    return levels
