"""Parameter changes while running: checked as a whole, then made as a whole."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import numpy as np

from tp_controller.config.build import Settings
from tp_controller.errors import InvalidValue, shown
from tp_controller.parameters import Parameter, alternatives
from tp_controller.robot import Limits
from tp_controller.stack import Stack

LIMITS = 'robot.limits.'
DAMPING = 'solver.damping'
HIERARCHY = 'hierarchy'


def check_changes(
    settings: Settings, schema: Mapping[str, Parameter], changes: Mapping[str, Any]
) -> Callable[[], None]:
    """Check parameter changes without making them.

    Parameters
    ----------
    settings
        What the controller runs on.
    schema
        Its parameters by dotted key.
    changes
        New values by dotted key.

    Returns
    -------
    callable
        Makes the changes; it cannot fail.

    Raises
    ------
    InvalidValue
        For an unknown parameter, one that cannot change while running, or a value that
        is not accepted. Nothing has changed then.
    """
    checked = {key: _read(key, value, schema) for key, value in changes.items()}
    stack = settings.stack
    steps: list[Callable[[], None]] = [partial(settings.values.update, checked)]
    given = {
        key.removeprefix(LIMITS): value for key, value in checked.items() if key.startswith(LIMITS)
    }
    if given:
        limits = stack.robot.limits.replaced(**given)
        stack.safety_filter.check_limits(limits)
        _check_slides(stack, limits)
        steps.append(partial(setattr, stack.robot, 'limits', limits))
    _check_levels(stack, checked)
    # The damping first: the levels are checked again, with it, when they are set.
    if DAMPING in checked:
        steps.append(partial(setattr, stack.solver, 'damping', checked[DAMPING]))
    for key, value in checked.items():
        if key == HIERARCHY:
            steps.append(partial(setattr, stack, 'hierarchy', value))
        elif key == 'solver.objective.gain':
            steps.append(partial(setattr, stack.solver.objective, 'gain', value))
        elif key.startswith('tasks.'):
            _, name, leaf = key.split('.')
            task = stack.tasks[name]
            if leaf == 'weight':
                steps += [partial(setattr, task, leaf, value), stack.prepare_solver]
                continue
            try:
                getattr(task, f'check_{leaf}')(value)
            except InvalidValue as error:
                raise error.under(f'tasks.{name}') from None
            steps.append(partial(setattr, task, leaf, value))

    def apply() -> None:
        for step in steps:
            step()

    return apply


def _check_slides(stack: Stack, limits: Limits) -> None:
    """Check that no slide gets longer: set-based tasks rely on how far it takes the arm."""
    before = stack.robot.limits
    farthest = np.maximum(-before.position_min, before.position_max)
    if not any(task.set_based for task in stack.tasks.values()):
        return
    for key, ends in (('min', -limits.position_min), ('max', limits.position_max)):
        for i in np.flatnonzero((ends > farthest) & stack.robot.sliding):
            raise InvalidValue(
                f'{LIMITS}position_{key}',
                f'a longer way for {stack.robot.joints[i]}',
                'a range within the present one: set-based tasks rely on it',
            )


def _check_levels(stack: Stack, checked: Mapping[str, Any]) -> None:
    """Check that the levels can be resolved, as they are to be and with the damping to come."""
    if HIERARCHY not in checked and DAMPING not in checked:
        return
    try:
        stack.check_hierarchy(checked.get(HIERARCHY, stack.hierarchy), checked.get(DAMPING))
    except InvalidValue as error:
        if HIERARCHY in checked:
            raise
        got = f'{checked[DAMPING]}, which leaves {error.got}'
        raise InvalidValue(DAMPING, got, error.accepts) from None


def _read(key: str, value: Any, schema: Mapping[str, Parameter]) -> Any:
    if key not in schema or not schema[key].runtime:
        changeable = {name: p for name, p in schema.items() if p.runtime}
        what = 'a change while running' if key in schema else 'an unknown parameter'
        accepts = alternatives(key, changeable, brief=key not in schema)
        raise InvalidValue(key, what, f'changes of {accepts}')
    if value is None:
        raise InvalidValue(key, shown(value), schema[key].accepts)
    return schema[key].read(key, value)
