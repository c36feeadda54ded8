"""Levels that never get what they ask for, and guards that others may push aside."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from tp_controller.checks.findings import Finding, note, warning
from tp_controller.checks.samples import NOTHING, Samples, freedom, guards, rank, span
from tp_controller.errors import listed, plural
from tp_controller.tasks import Task

Matrix = NDArray[np.float64]

REST = ('posture', 'manipulability')
"""Kinds of tasks that are meant to get what is left."""
AXES = {'position': ('axes',), 'orientation': ('axes',)}
"""Keys that choose the rows of a task; of others the key is the task's."""


def dead_rows(samples: Samples) -> Iterator[Finding]:
    """Rows that no joint moves at any configuration."""
    for task in _ordinary(samples):
        if task.type not in REST and (names := _dead(samples, task)):
            yield warning(
                _axes_key(task),
                f'no joint moves {listed(names)} of it at {_random(samples)}',
                _without(task, names) or 'no such task',
            )


def rank_of_levels(samples: Samples) -> Iterator[Finding]:
    """Levels whose rows can never all be had: alone, or with what the levels above leave."""
    n, one_by_one = samples.stack.robot.n, samples.stack.solver.one_by_one
    above: list[Task] = []
    for tasks in samples.levels:
        names = ' + '.join(task.name for task in tasks)
        J = _stacked(samples, tasks)
        # What no joint moves is reported by `dead_rows`.
        rows = sum(task.k - len(_dead(samples, task)) for task in tasks)
        alone = max((rank(J_i, float(np.linalg.norm(J_i))) for J_i in J), default=0)
        left = alone
        if above and one_by_one:
            free = [freedom(J_i, n) for J_i in _stacked(samples, above)]
            left = max(
                rank(J_i @ N, float(np.linalg.norm(J_i))) for J_i, N in zip(J, free, strict=True)
            )
        # What one task above has is reported by `same_axes`.
        told = sum(_told(samples, above, task) for task in tasks) if one_by_one else 0
        rest = bool(tasks) and all(task.type in REST for task in tasks)
        upper = listed(task.name for task in above)
        if rest and not left and alone:
            # It still acts where levels above lose directions.
            yield note(
                'hierarchy',
                f'{names} has nothing left at {_random(samples)}: all freedom is taken by '
                f'{upper}, but in singularities',
            )
        elif not left and alone > told:
            yield warning(
                'hierarchy',
                f'{names} gets nothing at {_random(samples)}: all its freedom is taken by {upper}',
                f'fewer rows above, or no {names}',
            )
        elif not rest and alone < rows:
            yield warning(
                'hierarchy',
                f'{names} has {rows} rows, of which {alone} are independent at best at '
                f'{_random(samples)}: it never gets all',
                f'{plural(alone, "row")} (axes or joints) there',
            )
        elif not rest and left < alone - told:
            yield warning(
                'hierarchy',
                f'{names} has {left} of {plural(alone, "direction")} at best at '
                f'{_random(samples)}, the rest is taken by {upper}: it never gets all',
                f'fewer rows above or in {names}',
            )
        above += tasks


def same_axes(samples: Samples) -> Iterator[Finding]:
    """Tasks that control what one above them, or beside them, controls already."""
    if not samples.stack.solver.one_by_one:
        return
    for upper, lower in combinations(_ordinary(samples), 2):
        if lower.type in REST or upper.type in REST:
            continue
        names = _taken(samples, upper, lower)
        if not names:
            continue
        beside = samples.stack.level_of(upper.name) == samples.stack.level_of(lower.name)
        what = 'all of it' if len(names) == lower.k else listed(names)
        where = (
            'beside it: both get a part' if beside else 'above it: it never gets anything there'
        )
        others = [name for name in lower.components if name not in names]
        yield warning(
            _axes_key(lower),
            f'{what} is controlled by {upper.name} {where}',
            f'{listed(others)} alone, or one of the two in the hierarchy'
            if others
            else 'one of the two in the hierarchy',
        )


def guard_order(samples: Samples) -> Iterator[Finding]:
    """Set-based tasks that ordinary ones above or beside them may push aside."""
    stack = samples.stack
    for guard in guards(stack):
        level = stack.level_of(guard.name)
        moves = (guard.reach > 0.0).any(axis=0)
        pushing = [
            task.name
            for task in _ordinary(samples)
            if stack.level_of(task.name) <= level and (_moves(samples, task) & moves).any()
        ]
        if pushing:
            yield warning(
                'hierarchy',
                f'{guard.name} is below or beside {listed(pushing)}, which may push the arm '
                'through its boundary',
                f'{guard.name} above them',
            )


def idle_guards(samples: Samples) -> Iterator[Finding]:
    """Set-based tasks that are loaded but keep nothing."""
    for name, task in samples.stack.tasks.items():
        if task.set_based and samples.stack.level_of(name) < 0:
            yield note('hierarchy', f'{name} is not in it: what it would keep is not kept')


def _ordinary(samples: Samples) -> list[Task]:
    return [task for tasks in samples.levels for task in tasks]


def _stacked(samples: Samples, tasks: Sequence[Task]) -> Matrix:
    """Rows (m, k, n) of some tasks."""
    m, n = len(samples.configurations), samples.stack.robot.n
    parts = [samples.jacobians[task.name] for task in tasks]
    return np.concatenate([np.zeros((m, 0, n)), *parts], axis=1)


def _moves(samples: Samples, task: Task) -> NDArray[np.bool_]:
    """Which joints (n,) the rows of a task have at any configuration."""
    return np.asarray((np.abs(samples.jacobians[task.name]) > NOTHING).any(axis=(0, 1)))


def _dead(samples: Samples, task: Task) -> list[str]:
    """Components that no joint moves at any configuration."""
    J = samples.jacobians[task.name]
    size = NOTHING * max(1.0, float(np.abs(J).max(initial=0.0)))
    still = np.asarray((np.abs(J) <= size).all(axis=(0, 2)))
    return [task.components[i] for i in np.flatnonzero(still)]


def _taken(samples: Samples, upper: Task, lower: Task) -> list[str]:
    """Components of a task whose rows are combinations of another's at every configuration."""
    taken: NDArray[np.bool_] = np.ones(lower.k, dtype=bool)
    moved: NDArray[np.bool_] = np.zeros(lower.k, dtype=bool)
    pairs = zip(samples.jacobians[upper.name], samples.jacobians[lower.name], strict=True)
    for above, below in pairs:
        Q = span(above)
        if Q.shape[1] == samples.stack.robot.n:
            # It has all there is, not these rows in particular.
            return []
        sizes = np.linalg.norm(below, axis=1)
        left = np.linalg.norm(below - below @ Q @ Q.T, axis=1)
        np.logical_and(taken, left <= NOTHING * np.maximum(sizes, NOTHING), out=taken)
        np.logical_or(moved, sizes > NOTHING, out=moved)
    return [lower.components[i] for i in np.flatnonzero(taken & moved)]


def _told(samples: Samples, above: Sequence[Task], task: Task) -> int:
    """How many rows of a task one above has, as `same_axes` tells."""
    if task.type in REST:
        return 0
    uppers = [upper for upper in above if upper.type not in REST]
    return len({name for upper in uppers for name in _taken(samples, upper, task)})


def _axes_key(task: Task) -> str:
    return '.'.join(('tasks', task.name, *AXES.get(task.type, ())))


def _without(task: Task, names: Sequence[str]) -> str:
    """The other components, as the key of `_axes_key` takes them; empty if there are none."""
    others = [name for name in task.components if name not in names]
    # Rows of a rotation are rx, ry and rz.
    return ''.join(name[-1] for name in others) if task.type in AXES else _listed(others)


def _listed(names: Sequence[str]) -> str:
    """Names with commas, empty if there are none."""
    return listed(names) if names else ''


def _random(samples: Samples) -> str:
    return f'{len(samples.configurations)} random configurations'
