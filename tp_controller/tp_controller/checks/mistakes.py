"""All that a controller would refuse about its parameters, not the first mistake alone."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from tp_controller.config import (
    Settings,
    build_robot,
    build_settings,
    build_task,
    controller_schema,
    robot_source,
    task_names,
    task_schema,
)
from tp_controller.config.schema import OBJECTIVE
from tp_controller.errors import InvalidValue
from tp_controller.hierarchy import split_hierarchy
from tp_controller.parameters import Flat, flatten, read_each
from tp_controller.robot import Robot


class Reading(NamedTuple):
    """What could be made of parameters."""

    errors: Sequence[InvalidValue]
    """Why a controller would refuse them; empty if it would not."""
    robot: Robot | None
    """The robot, if it could be built."""
    settings: Settings | None
    """The controller's settings, if there is no error."""


def read(parameters: Mapping[str, Any], description: str | None = None) -> Reading:
    """Build what a controller would, and collect what it would refuse.

    Mistakes of one task do not hide those of another. What follows from a mistake in the robot or
    the rate is not looked for, and the solver is built once the tasks have no mistakes.

    Parameters
    ----------
    parameters
        The dictionary under ``ros__parameters``, nested or with dotted keys.
    description
        URDF of the robot for parameters that name none.
    """
    errors: list[InvalidValue] = []
    try:
        flat = flatten(parameters)
        robot_source(flat)
    except InvalidValue as error:
        return Reading([error], None, None)
    values = _values(flat, errors)
    names = task_names(flat)
    _check_hierarchy(values, names, errors)
    if any(_concerns_robot(error.key) for error in errors):
        return Reading(errors, None, None)
    try:
        robot = build_robot(values, description)
    except InvalidValue as error:
        return Reading([*errors, error], None, None)
    refused = {_task_of(error.key) for error in errors}
    for name in names:
        if name not in refused:
            try:
                build_task(name, robot, values)
            except InvalidValue as error:
                errors.append(error)
    if errors:
        return Reading(errors, robot, None)
    try:
        settings = build_settings(parameters, description, find_rate=True)
    except InvalidValue as error:
        return Reading([error], robot, None)
    return Reading([], settings.stack.robot, settings)


def _values(flat: Flat, errors: list[InvalidValue]) -> Flat:
    """Read every value that can be; tasks and objectives of no known type are left out."""
    known = dict(flat)
    for name in task_names(flat):
        try:
            task_schema(name, flat)
        except InvalidValue as error:
            errors.append(error)
            known = {key: known[key] for key in known if not key.startswith(f'tasks.{name}.')}
    try:
        schema = controller_schema(known)
    except InvalidValue as error:
        errors.append(error)
        known = {key: known[key] for key in known if not key.startswith(OBJECTIVE)}
        schema = controller_schema(known)
    values, found = read_each(known, schema)
    errors += found
    return values


def _check_hierarchy(values: Flat, names: Sequence[str], errors: list[InvalidValue]) -> None:
    levels = values.get('hierarchy', ())
    found = []
    for level in levels:
        try:
            # One empty name alone stands for no level at all.
            if level.strip() or len(levels) > 1:
                split_hierarchy([level or ' '], names)
        except InvalidValue as error:
            found.append(error)
    if not found and levels:
        try:
            split_hierarchy(levels, names)
        except InvalidValue as error:
            found.append(error)
    errors += found


def _concerns_robot(key: str) -> bool:
    return key.startswith(('robot', 'rate'))


def _task_of(key: str) -> str:
    parts = key.split('.')
    return parts[1] if parts[0] == 'tasks' and len(parts) > 1 else ''
