"""Why goals have no configuration: what has to be given up before they have one."""

from __future__ import annotations

import time
from collections.abc import Sequence
from itertools import chain, islice

import numpy as np
from numpy.typing import NDArray

from tp_controller.planning.conditions import FOUND, Blocked, Conditions, Descent
from tp_controller.planning.starts import starts
from tp_controller.tasks import JointLimitsTask, SetBasedTask, Task

Vector = NDArray[np.float64]

RANGES = 'ranges'
TRIES = 30
"""Configurations among which the one is told whose joints are least out of their ranges."""


def explain_none(
    conditions: Conditions, misses: Sequence[tuple[float, Vector]], end: float
) -> tuple[str, tuple[str, ...]]:
    """Say how near a search came, and what excludes the goals.

    The goals alone are searched for first: without a configuration they are out of reach. Then
    ranges, distances and tasks of higher levels are added one after the other. What leaves no
    configuration is a reason and is left out again.

    Parameters
    ----------
    conditions
        What was searched for.
    misses
        Ends (nq,) of descents with their error norms, the nearest first.
    end
        Steady time [s] by which an answer is needed.

    Returns
    -------
    str
        One line.
    tuple
        Names of what excludes the goals.
    """
    return _Reasons(conditions, end).explain(misses)


class _Reasons:
    def __init__(self, conditions: Conditions, end: float) -> None:
        self._conditions, self._end = conditions, end
        guards = [task for task in conditions.guards if not isinstance(task, JointLimitsTask)]
        self._parts: list[str | Task] = [RANGES, *guards, *conditions.held]
        # The goals alone, and every part once.
        self._searches = 1 + len(conditions.goals) + len(self._parts)

    def explain(self, misses: Sequence[tuple[float, Vector]]) -> tuple[str, tuple[str, ...]]:
        goals = self._conditions.goals
        q = self._find(goals, ())
        if q is None:
            return self._out_of_reach(), ()
        kept: list[str | Task] = []
        given_up: list[str | Task] = []
        for part in self._parts:
            found = self._find(goals, [*kept, part], q)
            if found is None:
                given_up.append(part)
            else:
                kept.append(part)
                q = found
        near = self._near(misses)
        if not given_up:
            return f'{near}, though each part of it can be had; a longer search may find one', ()
        words, names = [], []
        for part in given_up:
            text, found_names = self._cost(part, q, kept)
            words.append(text)
            names += found_names
        return f'{near}, because of {_words(words)}', tuple(names)

    def _near(self, misses: Sequence[tuple[float, Vector]]) -> str:
        """How near the search came."""
        if not misses:
            return 'the search had no time'
        error, q = misses[0]
        norms = self._conditions.ends.error_norms(q)
        away = [f'{name} by {norm:.3g}' for name, norm in norms.items() if norm > FOUND]
        worst: dict[str, Blocked] = {}
        for row in sorted(self._conditions.ends.blocked(q), key=lambda one: one.missing):
            worst[row.task] = row
        crossed = [f'{row.task} by {row.missing:.3g} ({row.row})' for row in worst.values()]
        return f'the nearest misses {_words([*away, *crossed]) or f"by {error:.3g}"}'

    def _out_of_reach(self) -> str:
        conditions = self._conditions
        alone = [task for task in conditions.goals if self._find([task], ()) is None]
        if not alone and len(conditions.goals) > 1:
            names = _words([task.name for task in conditions.goals])
            return f'the goals of {names} exclude each other'
        nearest = [f'{task.name} by {self._least([task]):.3g}' for task in alone]
        return f'out of reach: the nearest misses {_words(nearest)}'

    def _cost(
        self, part: str | Task, q: Vector, kept: Sequence[str | Task]
    ) -> tuple[str, list[str]]:
        """What a part takes at the configuration that has everything else."""
        conditions = self._conditions
        if isinstance(part, str):
            rows = self._least_outside(q, kept)
            text = ' and '.join(f'the range of {row.row} (by {row.missing:.3g})' for row in rows)
            return text or 'the ranges of joints', [row.row for row in rows]
        conditions.robot.update(q)
        if isinstance(part, SetBasedTask):
            descent = conditions.part((), [part])
            rows = descent.blocked(q)
            worst = max(rows, key=lambda row: row.missing, default=None)
            detail = f' ({worst.row}, by {worst.missing:.3g})' if worst else ''
            return f'{part.name}{detail}', [part.name]
        norm = conditions.part([part], ()).error_norms(q)[part.name]
        return f'{part.name} above it (by {norm:.3g})', [part.name]

    def _least_outside(self, q: Vector, kept: Sequence[str | Task]) -> list[Blocked]:
        """Joints that are out of their ranges where the least is missing, among some tries."""
        conditions = self._conditions
        descent = self._descent(conditions.goals, kept)
        best = descent.outside(conditions.inward(q), conditions)
        for start in islice(starts(conditions, descent, 2), TRIES):
            found, error = descent.run(start)
            if error > FOUND or descent.blocked(found):
                continue
            rows = descent.outside(conditions.inward(found), conditions)
            if _missing(rows) < _missing(best):
                best = rows
        return best

    def _descent(self, goals: Sequence[Task], parts: Sequence[str | Task]) -> Descent:
        tasks = [part for part in parts if isinstance(part, Task) and not part.set_based]
        guards = [part for part in parts if isinstance(part, SetBasedTask)]
        return self._conditions.part([*goals, *tasks], guards, RANGES in parts)

    def _find(
        self, goals: Sequence[Task], parts: Sequence[str | Task], near: Vector | None = None
    ) -> Vector | None:
        """Configuration (nq,) that has goals and keeps some parts, None if none is found."""
        now = time.monotonic()
        end = now + max(self._end - now, 0.05) / max(self._searches, 1)
        self._searches -= 1
        descent = self._descent(goals, parts)
        self._least_error = np.inf
        tried = [] if near is None else [near]
        for start in chain(tried, starts(self._conditions, descent, 1)):
            q, error = descent.run(start)
            self._least_error = min(self._least_error, error)
            if error <= FOUND and not descent.blocked(q):
                return q
            if time.monotonic() >= end:
                return None
        return None

    def _least(self, goals: Sequence[Task]) -> float:
        """Least error norm of goals alone."""
        self._find(goals, ())
        return float(self._least_error)


def _missing(rows: Sequence[Blocked]) -> float:
    return sum(row.missing for row in rows)


def _words(parts: Sequence[str]) -> str:
    """Parts in one line: a, b and c."""
    return ' and '.join([', '.join(parts[:-1]), parts[-1]] if len(parts) > 1 else parts)
