"""The straight way ahead of time: what a stack makes of goals before the arm moves."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tp_controller.errors import UnusableState
from tp_controller.planning.conditions import check_goals
from tp_controller.progress import Progress, Verdict
from tp_controller.stack import Stack
from tp_controller.tasks import Task

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]

LONGEST = 30.0
"""Time [s] that is looked ahead at most."""
MOVING = 1e-3
"""Command [rad/s, m/s] from which on the arm is not at rest."""
TOLERANCE = 0.01
"""Error norm [m, rad] of a goal that is reached, where none is given."""
LATER, LESS = 2.0, 0.05
"""In so much time [s] the errors together have to become smaller by this share, else it is
stuck: an arm that creeps is not waited for."""
HOLDS = 1e-3
"""Error norm [m, rad] of a task above at the start up to which it has to hold on the way,"""
LOST = {'position': 1e-3}
OTHERWISE = 5e-3
"""and from which on it does not, by type [m], and of others [rad]."""
STOP_EVERY = 50
"""Steps between two calls of ``stop``."""


class Ahead(NamedTuple):
    """What becomes of goals on the straight way."""

    reached: bool
    """Whether all come within tolerance, and nothing above is lost on the way."""
    time: float
    """Time [s] of the motion that was looked at."""
    length: float
    """Length [rad, m] of the way in joint space."""
    errors: dict[str, float]
    """Error norm [m, rad] by task at its end."""
    q: Vector
    """Configuration (nq,) at its end."""
    lost: tuple[str, ...] = ()
    """Tasks of levels above all goals that had no error at the start, and have one on the way."""
    disturbed: float = 0.0
    """Largest error of such a task, as a share of that from which on it is lost."""


def look_ahead(
    stack: Stack,
    goals: Mapping[str, Sequence[float] | Vector],
    q: Vector,
    tolerances: Mapping[str, float] | None = None,
    seconds: float = LONGEST,
    stop: Callable[[], bool] = lambda: False,
) -> Ahead:
    """Let a stack move joints that carry out every command exactly, from rest.

    It ends when the goals are reached, when they are stuck as `Progress` judges it, when their
    errors have not become smaller by 5 % in 2 s, or when a task above them is lost. Where tasks
    are slow because of their largest speeds, there is as much more time.

    Parameters
    ----------
    stack
        A stack that moves no arm: it makes steps, and its tasks have the goals as targets
        afterwards.
    goals
        Target (target_size,) by task of the hierarchy.
    q
        Configuration (nq,) [rad, m].
    tolerances
        Error norm [m, rad] by task that counts as reached; 0.01 when left out.
    seconds
        Time [s] of the motion that is looked at, longer as tasks are slower.
    stop
        Called at times; the look ends if it returns True.

    Raises
    ------
    InvalidValue
        If a goal cannot be used.
    """
    targets = check_goals(stack, goals)
    for name, target in targets.items():
        stack.tasks[name].target = target
    tasks = [stack.tasks[name] for name in targets]
    progress = Progress([(tolerances or {}).get(name, TOLERANCE) for name in targets])
    period, robot = stack.safety_filter.period, stack.robot
    stack.rest()
    q = np.array(q, dtype=float)
    length, mark, since, count = 0.0, math.inf, 0.0, 0
    highest = min(stack.level_of(task.name) for task in tasks)
    above = [
        task
        for level in stack.members
        for task in level
        if stack.level_of(task.name) < highest and not task.set_based
    ]
    lost: list[str] = []
    disturbed = 0.0
    verdict = None
    while verdict is None:
        try:
            command = stack.step_in_place(q).command
        except UnusableState as error:
            command = np.zeros(robot.n) if error.command is None else error.command
        errors = np.array([math.sqrt(task.error @ task.error) for task in tasks])
        if not count:
            above = [task for task in above if task.error @ task.error <= HOLDS**2]
        shares = {task.name: math.sqrt(task.error @ task.error) / _lost(task) for task in above}
        lost = [name for name, share in shares.items() if share > 1.0]
        disturbed = max([disturbed, *shares.values()])
        if lost:
            progress.errors[:] = errors
            break
        moving = bool(np.abs(command).max() > MOVING)
        slow = max(task.slowness for task in tasks)
        verdict = progress.see(period if count else 0.0, errors, moving)
        seconds -= period / slow
        size = float(errors.sum())
        if size < (1.0 - LESS) * mark:
            mark, since = size, progress.time
        elif progress.pending.any() and progress.time - since > LATER * slow:
            break
        if seconds < 0.0:
            break
        count += 1
        if count % STOP_EVERY == 0 and stop():
            break
        way = period * command
        length += math.sqrt(way @ way)
        q = robot.integrate(q, way)
    stack.rest()
    found = dict(zip(targets, progress.errors.tolist(), strict=True))
    reached = verdict is Verdict.REACHED
    return Ahead(reached, progress.time, length, found, q, tuple(lost), disturbed)


def _lost(task: Task) -> float:
    return LOST.get(task.type, OTHERWISE)
