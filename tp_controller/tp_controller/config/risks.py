"""What a change while running takes from the arm's safety, in words for the log."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import chain

import numpy as np
from numpy.typing import NDArray

from tp_controller.errors import shown
from tp_controller.robot import Limits
from tp_controller.tasks import Task

Vector = NDArray[np.float64]
Members = Sequence[Sequence[Task]]
"""Tasks by level, highest first."""


def limit_risks(joints: Sequence[str], before: Limits, after: Limits) -> Iterator[str]:
    """Say which limits become wider, one text per limit.

    Parameters
    ----------
    joints
        Names of the joints (n,).
    before, after
        Their limits.
    """
    for key in Limits.KEYS:
        old, new = getattr(before, key), getattr(after, key)
        wider = new < old if key == 'position_min' else new > old
        found = [f'{joints[i]} {old[i]:g} to {new[i]:g}' for i in range(len(joints)) if wider[i]]
        if found:
            yield f'robot.limits.{key} is wider: {", ".join(found)}'


def speed_risks(task: Task, after: Vector) -> Iterator[str]:
    """Say whether a task may ask for more speed, in one text.

    Parameters
    ----------
    task
        The task as it is.
    after
        Its largest speeds to be (groups,).
    """
    before = task.max_speed
    if before is not None and np.any(after > before):
        yield f'tasks.{task.name}.max_speed is larger: {shown(before)} to {shown(after)}'


def hierarchy_risks(before: Members, after: Members) -> Iterator[str]:
    """Say which set-based tasks leave the hierarchy or lose priority, one text per task.

    A task loses priority if another one comes above it that was not there, or an ordinary
    task that was below comes onto its level. Set-based tasks that are new to the hierarchy do
    not count.

    Parameters
    ----------
    before, after
        Tasks by level, highest first.
    """
    known = set(chain.from_iterable(before))
    kept = set(chain.from_iterable(after))
    for level, members in enumerate(before):
        for task in members:
            if not task.set_based:
                continue
            if task not in kept:
                yield f'{task.name} leaves the hierarchy: what it kept is kept no more'
                continue
            place = next(i for i, others in enumerate(after) if task in others)
            above = set(chain.from_iterable(after[:place]))
            above -= set(chain.from_iterable(before[:level]))
            above = {other for other in above if other in known or not other.set_based}
            beside = {other for other in after[place] if not other.set_based}
            beside -= set(chain.from_iterable(before[: level + 1]))
            names = [other.name for other in chain.from_iterable(after) if other in above | beside]
            if names:
                yield f'{task.name} loses priority to {", ".join(names)}'
