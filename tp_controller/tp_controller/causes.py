"""What a level's velocity was lost to, by kind and name: an explanation taken apart."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from enum import Enum
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tp_controller.explanation import TOLD, Explanation

if TYPE_CHECKING:
    from tp_controller.stack import Stack
    from tp_controller.tasks import Task

Matrix = NDArray[np.float64]

NAMED = 0.1
"""Losses below this share of what a level asked for are not named."""
SINGULAR = 0.2
"""Share of a level's largest singular value below which it can hardly move."""
MOST = 0.5
"""Share of the joint motion that a level above has taken to be named."""
RANGE, LIMITS = 'the range of ', 'the limits of '
"""What `Explanation.lost_to_levels` calls joints at their bounds."""


class Kind(Enum):
    """What a loss is due to; the values are the words for those without a name."""

    JOINT_RANGE = 'the range of a joint'
    JOINT_LIMITS = 'the limits of a joint'
    SET_BASED_TASK = 'a set-based task'
    HIGHER_TASK = 'a higher level'
    SINGULARITY = 'a singularity'
    DAMPING = 'damping'
    VELOCITY_LIMITS = 'velocity limits'
    SAFETY_FILTER = 'acceleration limits or braking'
    ARM = 'the arm'
    GAIN = 'nothing: gain times error and feedforward ask for no velocity'


class Cause(NamedTuple):
    """What a level lost a part of its velocity to."""

    kind: Kind
    name: str
    """A joint, or tasks; empty where the kind says it all."""
    amount: float
    """How much [m/s, rad/s]; NaN if unknown."""

    @property
    def text(self) -> str:
        """In words."""
        if self.kind is Kind.JOINT_RANGE:
            return f'{RANGE}{self.name}'
        if self.kind is Kind.JOINT_LIMITS:
            return f'{LIMITS}{self.name}'
        if self.kind is Kind.SINGULARITY:
            return f'a singularity of {self.name}'
        return self.name or self.kind.value


def causes(explanation: Explanation, set_based: Collection[str]) -> list[Cause]:
    """Causes of what a level lost, the largest first.

    Parameters
    ----------
    explanation
        Why the level got what it got.
    set_based
        Names of all set-based tasks.
    """
    found = [
        _by_name(name, amount, set_based) for name, amount in explanation.lost_to_levels.items()
    ]
    level = ' + '.join(explanation.tasks)
    found += [
        Cause(Kind.SINGULARITY, level, explanation.lost_to_singularity),
        Cause(Kind.DAMPING, '', explanation.lost_to_damping),
        Cause(Kind.VELOCITY_LIMITS, '', explanation.lost_to_saturation),
        Cause(Kind.SAFETY_FILTER, '', explanation.lost_to_guard),
    ]
    asked = float(np.linalg.norm(explanation.requested))
    if asked <= TOLD:
        return [Cause(Kind.GAIN, '', 0.0)]
    told = [cause for cause in found if cause.amount > max(TOLD, NAMED * asked)]
    return sorted(told, key=lambda cause: -cause.amount)


def trace_damping(found: Sequence[Cause], explanation: Explanation, stack: Stack) -> list[Cause]:
    """Name what is behind a loss to damping, which sets in near singularities.

    Where the level alone could hardly move along what it lost it is a singularity of its own. Else
    the level above that has taken most of the joint motion which it needs made it singular.

    Parameters
    ----------
    found
        Causes of a level.
    explanation
        What they were found from.
    stack
        The stack, after the step that is explained or one that is nearly the same.
    """
    damped = [cause for cause in found if cause.kind is Kind.DAMPING]
    if not damped:
        return list(found)
    lost = explanation.requested - explanation.achieved
    above: list[tuple[tuple[Task, ...], Matrix]] = []
    for tasks, system in zip(stack.members, stack.systems(), strict=True):
        J = system.J[system.counts]
        if tuple(task.name for task in tasks) != explanation.tasks:
            above.append((tuple(tasks), J))
            continue
        if J.shape[0] != lost.size:
            return list(found)
        wanted = J.T @ (lost / np.linalg.norm(lost))
        size = float(np.linalg.norm(wanted))
        if size <= SINGULAR * np.linalg.norm(J, 2):
            name = ' + '.join(explanation.tasks)
            return _merged([*found, Cause(Kind.SINGULARITY, name, damped[0].amount)], damped[0])
        shares = [float(np.linalg.norm(_rows(upper) @ wanted)) / size for _, upper in above]
        if shares and max(shares) >= MOST:
            name = ' + '.join(task.name for task in above[int(np.argmax(shares))][0])
            bounds = {task.name for task in stack.tasks.values() if task.set_based}
            return _merged([*found, _by_name(name, damped[0].amount, bounds)], damped[0])
    return list(found)


def _rows(J: Matrix) -> Matrix:
    """Orthonormal basis of the rows, without those that are hardly independent."""
    _, s, Vt = np.linalg.svd(J, full_matrices=False)
    return Vt[s > SINGULAR * s.max(initial=0.0)]


def _merged(found: Sequence[Cause], without: Cause) -> list[Cause]:
    """Causes but one, those with one name added up, the largest first."""
    amounts: dict[tuple[Kind, str], float] = {}
    for cause in found:
        if cause is not without:
            key = (cause.kind, cause.name)
            amounts[key] = float(np.hypot(amounts.get(key, 0.0), cause.amount))
    merged = [Cause(kind, name, amount) for (kind, name), amount in amounts.items()]
    return sorted(merged, key=lambda cause: -cause.amount)


def _by_name(name: str, amount: float, set_based: Collection[str]) -> Cause:
    for start, kind in ((RANGE, Kind.JOINT_RANGE), (LIMITS, Kind.JOINT_LIMITS)):
        if name.startswith(start):
            return Cause(kind, name.removeprefix(start), amount)
    tasks = name.split(' + ')
    kind = Kind.SET_BASED_TASK if all(task in set_based for task in tasks) else Kind.HIGHER_TASK
    return Cause(kind, name, amount)
