"""Changes of a running stack that are asked for as one: parameters, tasks, hierarchy."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import Any, NamedTuple

from tp_controller.config.additions import Addition
from tp_controller.config.build import Settings
from tp_controller.config.changes import HIERARCHY, check_changes, read_changes
from tp_controller.errors import InvalidValue, listed, shown
from tp_controller.parameters import Flat, Parameter, flatten
from tp_controller.stack import Stack


class Request(NamedTuple):
    """What is to change, all of it or nothing."""

    additions: Mapping[str, Mapping[str, Any]]
    """What stands under ``tasks.<name>`` in a parameter file, by name, of tasks that come."""
    removals: Sequence[str]
    """Names of tasks that go."""
    changes: Flat
    """New values of parameters by dotted key."""
    level: int | None = None
    """Level of the one task that comes, see `Addition.check`; None if the changes say it."""


def split_request(parameters: Mapping[str, Any], known: Collection[str]) -> Request:
    """Sort what is asked for in the form of a parameter file.

    Parameters
    ----------
    parameters
        As under ``ros__parameters``, nested or with dotted keys; None in place of a task
        removes it.
    known
        Names of the tasks that there are.

    Raises
    ------
    InvalidValue
        If a task that is to go is not there or changes as well, or there is something else in
        place of a task.
    """
    additions: dict[str, dict[str, Any]] = {}
    removals: list[str] = []
    changes: Flat = {}
    changed: set[str] = set()
    for key, value in flatten(parameters).items():
        first, _, rest = key.partition('.')
        name, dot, leaf = rest.partition('.')
        if first != 'tasks':
            changes[key] = value
        elif not dot:
            if value is not None:
                raise InvalidValue(key, shown(value), 'parameters of a task, or null to remove it')
            if name not in known:
                accepts = f'null for one of {listed(known)}'
                raise InvalidValue(key, 'null for a task that is not there', accepts)
            removals.append(name)
        elif name in known:
            changed.add(name)
            changes[key] = value
        else:
            additions.setdefault(name, {})[leaf] = value
    for name in changed.intersection(removals):
        raise InvalidValue(f'tasks.{name}', 'null and changes', 'one of the two')
    return Request(additions, removals, changes)


def remaining(stack: Stack, names: Collection[str]) -> list[str]:
    """Levels of a hierarchy that remain without some tasks."""
    levels = [
        [name for name in level.split(' + ') if name not in names] for level in stack.hierarchy
    ]
    return [' + '.join(level) for level in levels if level]


def check_request(
    settings: Settings,
    schema: Mapping[str, Parameter],
    request: Request,
    additions: Sequence[Addition],
) -> Flat:
    """Check all that is asked for; nothing has changed yet.

    Parameters
    ----------
    settings
        What the controller runs on.
    schema
        Its parameters by dotted key.
    request
        What is asked for.
    additions
        The tasks that come, made; loaded already or not.

    Returns
    -------
    dict
        All changes of parameters by dotted key, the hierarchy that follows from tasks that go or
        come among them.

    Raises
    ------
    InvalidValue
        For the first thing that cannot be done.
    """
    stack = settings.stack
    for addition in additions:
        addition.check_new()
    tasks = {name: stack.tasks[name] for name in stack.tasks if name not in request.removals}
    tasks |= {addition.task.name: addition.task for addition in additions}
    changes = dict(request.changes)
    if HIERARCHY not in changes:
        hierarchy = tuple(remaining(stack, request.removals))
        if request.level is not None:
            hierarchy = additions[0].check(request.level)
        if hierarchy != stack.hierarchy:
            changes[HIERARCHY] = hierarchy
    check_changes(settings, schema, changes, tasks)
    return read_changes(schema, changes)
