"""Parameter changes while running: checked as a whole, then made as a whole."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence, Sized
from functools import partial
from typing import Any

import numpy as np

from tp_controller.config.build import Settings
from tp_controller.config.risks import hierarchy_risks, limit_risks
from tp_controller.errors import InvalidValue, shown
from tp_controller.parameters import Parameter, alternatives
from tp_controller.robot import Limits
from tp_controller.stack import Stack
from tp_controller.tasks import Task

LIMITS = 'robot.limits.'
DAMPING = 'solver.damping'
HIERARCHY = 'hierarchy'
MOST = 10_000
"""Values, or letters, of one parameter: more would hold up the cycle."""


def check_changes(
    settings: Settings, schema: Mapping[str, Parameter], changes: Mapping[str, Any]
) -> Callable[[], tuple[str, ...]]:
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
        Makes the changes; it cannot fail. It returns what a user should know of them: what
        makes the arm less safe, all in one text, and what set-based tasks warn of now.

    Raises
    ------
    InvalidValue
        For an unknown parameter, one that cannot change while running, or a value that
        is not accepted. Nothing has changed then.
    """
    checked = {key: _read(key, value, schema) for key, value in changes.items()}
    stack = settings.stack
    steps: list[Callable[[], None]] = [partial(settings.values.update, checked)]
    risks: list[str] = []
    given = {
        key.removeprefix(LIMITS): value for key, value in checked.items() if key.startswith(LIMITS)
    }
    if given:
        limits = stack.robot.limits.replaced(**given)
        limits.check_period(stack.robot.joints, stack.safety_filter.period)
        _check_slides(stack, limits)
        steps.append(_prepare_limits(stack, limits, given))
        risks += limit_risks(stack.robot.joints, stack.robot.limits, limits)
    members = _check_levels(stack, checked)
    if members is not None:
        risks += hierarchy_risks(stack.members, members)
    # The damping first: the levels are checked again, with it, when they are set.
    if DAMPING in checked:
        steps.append(partial(setattr, stack.solver, 'damping', checked[DAMPING]))
    for key, value in checked.items():
        if key == HIERARCHY:
            steps.append(partial(setattr, stack, 'hierarchy', value))
        elif key == 'solver.settle':
            steps.append(partial(setattr, stack, 'settle', value))
        elif key == 'solver.objective.gain':
            steps.append(partial(setattr, stack.solver.objective, 'gain', value))
        elif key.startswith('tasks.'):
            _, name, leaf = key.split('.')
            task = stack.tasks[name]
            if leaf == 'weight':
                steps += [partial(setattr, task, leaf, value), stack.prepare_solver]
                continue
            if leaf == 'time_scaling':
                steps.append(partial(setattr, task, leaf, value))
                continue
            try:
                getattr(task, f'check_{leaf}')(value)
            except InvalidValue as error:
                raise error.under(f'tasks.{name}') from None
            steps.append(partial(setattr, task, leaf, value))

    def apply() -> tuple[str, ...]:
        before = _warnings(stack)
        for step in steps:
            step()
        less_safe = [f'less safe from now on: {"; ".join(risks)}'] if risks else []
        return (*less_safe, *(text for text in _warnings(stack) if text not in before))

    return apply


def _warnings(stack: Stack) -> list[str]:
    return [text for task in stack.tasks.values() for text in task.warnings]


def _prepare_limits(stack: Stack, limits: Limits, given: Mapping[str, Any]) -> Callable[[], None]:
    """Check limits, also by the tasks that follow them; return what makes them hold."""
    try:
        return stack.prepare_limits(limits)
    except InvalidValue as error:
        if not error.key.startswith('tasks.'):
            raise
        # A task that could not be made: what was given is to blame.
        key, value = next(iter(given.items()))
        got = f'{shown(value)}, with which {error.key} has {error.got}'
        raise InvalidValue(f'{LIMITS}{key}', got, f'limits with {error.accepts}') from None


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


def _check_levels(stack: Stack, checked: Mapping[str, Any]) -> Sequence[Sequence[Task]] | None:
    """Check that the levels can be resolved, as they are to be and with the damping to come.

    Returns
    -------
    sequence or None
        Tasks by level; None if nothing changes about the levels.
    """
    if HIERARCHY not in checked and DAMPING not in checked:
        return None
    try:
        levels = checked.get(HIERARCHY, stack.hierarchy)
        return stack.check_hierarchy(levels, checked.get(DAMPING))
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
    if isinstance(value, Sized) and len(value) > MOST:
        raise InvalidValue(key, f'{len(value)} values', f'up to {MOST} of them')
    return schema[key].read(key, value)
