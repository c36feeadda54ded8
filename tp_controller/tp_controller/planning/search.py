"""Configurations that have goals: a search from many starts, the best ones first."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tp_controller.planning.conditions import FOUND, Conditions
from tp_controller.planning.reasons import explain_none
from tp_controller.planning.starts import starts
from tp_controller.stack import Stack

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]

SECONDS = 2.0
"""Time [s] that a search may take,"""
SEARCHING = 0.6
"""and the share of it after which one that has found nothing looks for the reason."""
STARTS = 48
"""Starts of a search that finds something,"""
MOST = 8
"""which ends sooner with so many solutions."""
DIFFERENT = 0.3
"""Least difference [rad, m] of a joint between two solutions."""
ROOM, CLEARANCE = 0.1, 0.05
"""Room of a range, as a share of its half, and distance [m] below which a solution is worse:"""
WORSE = 1.0
"""at none of it as much as one that takes so much longer [s]."""
SLOW = 1.0
"""Speed [rad/s, m/s] of a joint without a limit, for the comparison of solutions."""


class Solution(NamedTuple):
    """A configuration that has all goals and keeps what has to hold."""

    q: Vector
    """Configuration (nq,) [rad, m]; joints that turn are near the present configuration."""
    seconds: float
    """Time [s] that the slowest joint needs to get there at its full speed."""
    room: float
    """Least distance of a joint from the end of its range, as a share of half the range; 1 if
    there are no ranges."""
    clearance: float
    """Least distance [m] beyond what set-based tasks keep; infinite without such tasks."""
    errors: dict[str, float]
    """Error norm [m, rad] by task."""

    @property
    def cost(self) -> float:
        """What solutions are ordered by [s]: the time, more near ends and obstacles."""
        near = max(0.0, 1.0 - self.room / ROOM)
        return self.seconds + WORSE * (near + max(0.0, 1.0 - self.clearance / CLEARANCE))


class Answer(NamedTuple):
    """What a search has found."""

    solutions: tuple[Solution, ...]
    """The best first; empty if none was found."""
    starts: int
    """Number of starts."""
    seconds: float
    """Time [s] that it took."""
    why: str = ''
    """Without a solution, how near the search came and why not nearer."""
    reasons: tuple[str, ...] = ()
    """Names of what excludes the goals: set-based tasks, joints, tasks of higher levels; none if
    they are out of reach or exclude each other."""

    @property
    def best(self) -> Solution | None:
        """The first solution, None if there is none."""
        return self.solutions[0] if self.solutions else None

    @property
    def text(self) -> str:
        """The answer in one line."""
        count = len(self.solutions)
        if count:
            words = f'{count} solution{"s" * (count > 1)}'
            return f'{words} in {self.seconds:.2g} s from {self.starts} starts'
        return f'none found in {self.seconds:.2g} s of search: {self.why}'


def solve(
    stack: Stack,
    goals: Mapping[str, Sequence[float] | Vector],
    q: Vector,
    seconds: float = SECONDS,
    most: int = MOST,
    count: int = STARTS,
    seed: int = 0,
    stop: Callable[[], bool] | None = None,
) -> Answer:
    """Search for configurations that have goals.

    A solution has no error (1e-6 m, rad) in the goals and in every other equality task of the
    levels down to the lowest of the goals'. It is inside all ranges and keeps the distances of all
    set-based tasks of the hierarchy.

    Joints begin at the present configuration, then at the nearest ones of a stored sample, then at
    random ones, and descend by steps of Levenberg and Marquardt (Sugihara 2011) inside the ranges;
    where a distance is too small, its row joins the errors.

    Parameters
    ----------
    stack
        The stack; it stays as it is.
    goals
        Target (target_size,) by task of the hierarchy, as ``target`` of the task.
    q
        Present configuration (nq,) [rad, m].
    seconds
        Time [s] that it may take. One that finds something takes much less; else it looks for
        the reason in the last part of the time.
    most
        Number of solutions that are enough.
    count
        Number of starts of a search that has found something.
    seed
        Seed of the random starts.
    stop
        Called between two starts; the search ends if it returns True.

    Returns
    -------
    Answer
        All different solutions found, the best first; without one, why.

    Raises
    ------
    InvalidValue
        If a goal or the configuration cannot be used.
    """
    begin = time.monotonic()
    with Conditions(stack, goals, q) as conditions:
        found = _search(conditions, begin + SEARCHING * seconds, most, count, seed, stop)
        answer = found.answer(begin)
        if answer.solutions or (stop is not None and stop()):
            return answer
        why, reasons = explain_none(conditions, found.misses, begin + seconds)
        return answer._replace(why=why, reasons=reasons, seconds=time.monotonic() - begin)


class _Found:
    """Solutions of a search, and the misses of one without any."""

    def __init__(self, conditions: Conditions) -> None:
        self.conditions = conditions
        self.solutions: list[Solution] = []
        self.misses: list[tuple[float, Vector]] = []
        self.starts = 0

    def add(self, q: Vector, error: float) -> None:
        """Take the end of a descent over."""
        self.starts += 1
        descent = self.conditions.ends
        if error > FOUND or descent.blocked(q):
            self.misses.append((error, q))
            self.misses = sorted(self.misses, key=lambda miss: miss[0])[:4]
            return
        near = self.conditions.nearest(q)
        if not self._is_old(near):
            self.solutions.append(rated(self.conditions, near))

    def _is_old(self, q: Vector) -> bool:
        robot = self.conditions.robot
        return any(np.abs(robot.difference(one.q, q)).max() < DIFFERENT for one in self.solutions)

    def answer(self, begin: float) -> Answer:
        """Return the solutions in their order."""
        solutions = sorted(self.solutions, key=lambda one: one.cost)
        return Answer(tuple(solutions), self.starts, time.monotonic() - begin)


def _search(
    conditions: Conditions,
    end: float,
    most: int,
    count: int,
    seed: int,
    stop: Callable[[], bool] | None,
) -> _Found:
    found = _Found(conditions)
    for start in starts(conditions, conditions.ends, seed):
        found.add(*conditions.ends.run(start))
        enough = found.starts >= count or len(found.solutions) >= most
        if found.solutions and enough:
            break
        if time.monotonic() >= end or (stop is not None and stop()):
            break
    return found


def rated(conditions: Conditions, q: Vector) -> Solution:
    """Solution of a configuration (nq,) that has all goals."""
    robot = conditions.robot
    way = np.abs(robot.difference(conditions.q, q))
    speed = np.where(np.isfinite(robot.limits.velocity), robot.limits.velocity, SLOW)
    low, high, x = conditions.low, conditions.high, robot.space.positions(q)
    with np.errstate(invalid='ignore'):
        rooms = np.minimum(x - low, high - x) / (0.5 * (high - low))
    room = float(np.min(np.where(np.isfinite(high - low), rooms, 1.0)))
    errors = conditions.ends.error_norms(q)
    clearance = math.inf
    for task in conditions.ends.guards:
        distance = np.empty(task.k)
        task.probe(distance, task.kept + CLEARANCE)
        clearance = min(clearance, float((distance - task.kept).min()))
    return Solution(q, float((way / speed).max()), room, clearance, errors)
