"""Parameter changes while running: checked as a whole, then made as a whole."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sized
from functools import partial
from typing import Any

import numpy as np

from tp_controller.config.build import Settings, build_solver
from tp_controller.config.risks import hierarchy_risks, limit_risks, speed_risks
from tp_controller.config.schema import RESUME
from tp_controller.errors import InvalidValue, shown
from tp_controller.parameters import Flat, Parameter, alternatives
from tp_controller.robot import Limits
from tp_controller.stack import Stack
from tp_controller.tasks import Task

LIMITS = 'robot.limits.'
DAMPING = 'solver.damping'
REBUILT = tuple(
    f'solver.{key}'
    for key in ('type', 'inverse', 'singular_region', 'joint_weights', 'saturation')
)
"""Parameters that a new solver is made for."""
TRANSITION = 'transition_time'
AT_REST = (TRANSITION, RESUME)
"""Parameters that move nothing."""
HIERARCHY = 'hierarchy'
MOST = 10_000
"""Values, or letters, of one parameter: more would hold up the cycle."""


def read_changes(schema: Mapping[str, Parameter], changes: Mapping[str, Any]) -> Flat:
    """Values of parameters that may change while running, in their plain form.

    Raises
    ------
    InvalidValue
        As `check_changes`, as far as the schema tells.
    """
    return {key: _read(key, value, schema) for key, value in changes.items()}


def check_changes(
    settings: Settings,
    schema: Mapping[str, Parameter],
    changes: Mapping[str, Any],
    tasks: Mapping[str, Task] | None = None,
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
    tasks
        Tasks by name that the hierarchy may have; the present ones when left out. With others
        the changes are only checked.

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
    checked = read_changes(schema, changes)
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
    if TRANSITION in checked:
        steps.append(partial(setattr, stack, TRANSITION, checked[TRANSITION]))
    steps += _rearrangement(settings, checked, tasks, risks)
    for key, value in checked.items():
        if key == 'solver.settle':
            steps.append(partial(setattr, stack, 'settle', value))
        elif key == 'solver.objective.gain':
            steps.append(partial(setattr, stack.solver.objective, 'gain', value))
        elif key.startswith('tasks.'):
            _, name, leaf = key.split('.')
            task = stack.tasks[name]
            if leaf == 'enabled':
                continue
            if leaf == 'weight':
                steps += [partial(setattr, task, leaf, value), stack.prepare_solver]
                continue
            if leaf in ('time_scaling', 'around'):
                steps.append(partial(setattr, task, leaf, value))
                continue
            try:
                after = getattr(task, f'check_{leaf}')(value)
            except InvalidValue as error:
                raise error.under(f'tasks.{name}') from None
            if leaf == 'max_speed':
                risks += speed_risks(task, after)
            steps.append(partial(setattr, task, leaf, value))
    # Targets are ordinary motion.
    if any(key not in AT_REST and not key.endswith('.target') for key in checked):
        steps.append(stack.begin_transition)

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


def _rearrangement(
    settings: Settings,
    checked: Mapping[str, Any],
    tasks: Mapping[str, Task] | None,
    risks: list[str],
) -> Iterator[Callable[[], None]]:
    """Check the levels as they are to be, and the solver that is to resolve them.

    Parameters
    ----------
    settings
        What the controller runs on.
    checked
        New values by dotted key.
    tasks
        Tasks by name that the hierarchy may have; the present ones when left out.
    risks
        Texts about what becomes less safe are added to it.

    Yields
    ------
    callable
        What makes the changes, which cannot fail.
    """
    stack = settings.stack
    enabled = {
        key.split('.')[1]: value
        for key, value in checked.items()
        if key.startswith('tasks.') and key.endswith('.enabled')
    }
    anew = [key for key in REBUILT if key in checked]
    solver = build_solver(stack.robot, settings.values | dict(checked)) if anew else None
    damping = None if anew else checked.get(DAMPING)
    if not (HIERARCHY in checked or DAMPING in checked or enabled or anew):
        return
    hierarchy = checked.get(HIERARCHY, stack.hierarchy)
    try:
        members = stack.check_hierarchy(hierarchy, damping, tasks, enabled, solver)
    except InvalidValue as error:
        blamed = next((key for key in (*anew, DAMPING) if key in checked), None)
        if HIERARCHY in checked or enabled or blamed is None:
            raise
        got = f'{shown(checked[blamed])}, which leaves {error.got}'
        raise InvalidValue(blamed, got, error.accepts) from None
    risks += hierarchy_risks(stack.members, members)
    if damping is not None:
        # First: the levels are checked again, with it, when they are set.
        yield partial(setattr, stack.solver, 'damping', damping)
    if HIERARCHY in checked or enabled or anew:
        yield partial(stack.rearrange, hierarchy, enabled, solver)


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
