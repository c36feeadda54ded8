"""Ways in joint space to configurations: straight, or around by OMPL."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tp_controller.errors import InvalidValue, plural
from tp_controller.interpolation import VectorPath
from tp_controller.planning.clear import Clear
from tp_controller.planning.conditions import Conditions
from tp_controller.planning.search import SLOW, Solution
from tp_controller.planning.timing import timed
from tp_controller.stack import Stack

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]

SECONDS = 5.0
"""Time [s] that a search for a way may take."""
SHORTENING = 0.3
"""Time [s] for shorter ways, as a share of the time to find one, and at most [s]:"""
LONGEST_SHORTENING = 0.5
STEP = 0.5
"""Farthest step of a tree: what the slowest joint does in this time [s]."""
LOOK = 0.02
"""Time [s] on a way between looks at the speeds of tasks."""
TURN = np.pi
"""How far [rad] beyond start and goals a way may turn a joint without ends."""


SEED = 1


class Way(NamedTuple):
    """A way from the present configuration to one that has the goals."""

    points: Matrix
    """Configurations (m, nq) [rad, m], straight from each to the next."""
    path: VectorPath
    """The same in time, rounded at the corners."""
    solution: Solution
    """Where it ends."""
    planned: bool
    """Whether it was searched for; else it is straight in joint space."""
    seconds: float
    """Time [s] that it took to find."""
    holding: tuple[str, ...] = ()
    """Tasks that hold on the way."""

    @property
    def duration(self) -> float:
        """Time [s] from the first point to the last."""
        return float(self.path.times[-1])

    @property
    def length(self) -> float:
        """Length [rad, m] in joint space."""
        return float(np.linalg.norm(np.diff(self.points, axis=0), axis=1).sum())


def find_way(
    conditions: Conditions,
    solutions: Sequence[Solution],
    seconds: float = SECONDS,
    stop: Callable[[], bool] = lambda: False,
) -> Way | None:
    """Find a way from the present configuration to one of some solutions.

    The way keeps the ranges, the distances of all set-based tasks that the goals' conditions
    have, and the tasks of the levels above that have no error now. Straight ways in joint space
    come first. If none is clear, RRT-Connect (Kuffner and LaValle 2000) of OMPL looks for one
    to any of the solutions, which is then made shorter. No task with a largest speed is moved
    faster than that.

    Parameters
    ----------
    conditions
        The goals and what has to hold, entered.
    solutions
        Where it may end, the best first.
    seconds
        Time [s] that it may take.
    stop
        Called in between; the search ends if it returns True.

    Returns
    -------
    Way or None
        The quickest straight way, or a planned one; None if none was found in time.

    Raises
    ------
    InvalidValue
        If the robot has joints with a pose, which are not planned for.
    """
    begin = time.monotonic()
    check_space(conditions)
    clear = Clear(conditions)
    ways = []
    for one in solutions:
        points = clear.way(conditions.q, one.q)
        points = None if points is None else clear.fine(points)
        if points is not None:
            ways.append(_way(clear, points, one, False, begin))
        if stop() or time.monotonic() - begin > seconds:
            return None
    if ways:
        return min(ways, key=lambda way: way.duration + way.solution.cost - way.solution.seconds)
    if not solutions:
        return None
    planner = _Planner(clear, solutions, stop)
    while (left := seconds - (time.monotonic() - begin)) > 0.0 and not stop():
        planned = planner.plan(left)
        if planned is not None:
            return _way(clear, *planned, True, begin)
    return None


def check_space(conditions: Conditions) -> None:
    """Check that ways can be planned for a robot.

    Raises
    ------
    InvalidValue
        If it has joints with a pose.
    """
    blocks = conditions.robot.space.blocks
    if blocks:
        count = plural(len(blocks), 'joint')
        raise InvalidValue('around', f'{count} with a pose', 'arms whose joints turn or slide')


def _way(clear: Clear, points: Matrix, end: Solution, planned: bool, begin: float) -> Way:
    names = tuple(task.name for task in clear.holding)
    is_clear = (lambda _: True) if names else clear.is_clear
    path = timed(points, clear.robot.limits, is_clear)
    times_too_fast = _times_too_fast(clear.conditions.stack, path)
    if times_too_fast > 1.0:
        path = timed(points, clear.robot.limits, is_clear, times_too_fast)
    return Way(points, path, end, planned, time.monotonic() - begin, names)


def _times_too_fast(stack: Stack, path: VectorPath) -> float:
    """How many times faster than their largest speed tasks are moved by a way; at least 1."""
    tasks = [
        (task, task.max_speed)
        for level in stack.members
        for task in level
        if task.settings[0].size == task.target_size
    ]
    limited = [(task, speeds) for task, speeds in tasks if speeds is not None]
    most = 1.0
    for now in np.arange(0.0, path.times[-1], LOOK) if limited else ():
        q, qd = path.at(float(now))
        stack.robot.update(q)
        for task, speeds in limited:
            task.update()
            velocity = task.J @ qd
            for rows, speed in zip(task.speed_groups, speeds, strict=True):
                most = max(most, float(np.linalg.norm(velocity[rows]) / speed))
    return most


class _Planner:
    """One search of OMPL, in time units: a coordinate is a position over the joint's speed.

    Parameters
    ----------
    clear
        Judges configurations and ways.
    solutions
        Where it may end.
    stop
        Ends the search.
    """

    def __init__(
        self, clear: Clear, solutions: Sequence[Solution], stop: Callable[[], bool]
    ) -> None:
        base, geometric, util = ompl_modules()
        util.noOutputHandler()
        # The same search every time, as far as time allows.
        util.RNG.setSeed(SEED)
        self._base, self._geometric = base, geometric
        self._clear, self._solutions = clear, solutions
        self._begin = clear.conditions.q
        limits = clear.robot.limits
        self._speed = np.where(np.isfinite(limits.velocity), limits.velocity, SLOW)
        n = clear.robot.nq
        ends = np.array([self._begin, *(one.q for one in solutions)])
        low, high = clear.conditions.low, clear.conditions.high
        low = np.where(np.isfinite(low), np.minimum(low, self._begin), ends.min(axis=0) - TURN)
        high = np.where(np.isfinite(high), np.maximum(high, self._begin), ends.max(axis=0) + TURN)
        self._space = base.RealVectorStateSpace(n)
        bounds = base.RealVectorBounds(n)
        for i in range(n):
            bounds.setLow(i, float(low[i] / self._speed[i]))
            bounds.setHigh(i, float(high[i] / self._speed[i]))
        self._space.setBounds(bounds)
        self._stop = stop

    def plan(self, seconds: float) -> tuple[Matrix, Solution] | None:
        """Points (m, nq) of a way and where it ends; None if none is found in time [s]."""
        base, geometric = self._base, self._geometric
        information = base.SpaceInformation(self._space)
        end = time.monotonic() + seconds
        information.setStateValidityChecker(self._is_valid)
        information.setMotionValidator(_validator(base, information, self._is_clear))
        information.setup()
        problem = base.ProblemDefinition(information)
        problem.addStartState(self._state(self._begin))
        goals = base.GoalStates(information)
        for one in self._solutions:
            goals.addState(self._state(one.q))
        problem.setGoal(goals)
        planner = geometric.RRTConnect(information)
        planner.setRange(STEP * np.sqrt(self._space.getDimension()))
        planner.setProblemDefinition(problem)
        planner.setup()
        begin = time.monotonic()
        over = base.PlannerTerminationCondition(lambda: self._stop() or time.monotonic() > end)
        planner.solve(over)
        if not problem.hasExactSolution():
            return None
        took = time.monotonic() - begin
        path = problem.getSolutionPath()
        simplifier = geometric.PathSimplifier(information)
        left = min(max(SHORTENING * took, 0.05), LONGEST_SHORTENING)
        points = self._points(path)
        shorter_until = time.monotonic() + left
        simplifier.reduceVertices(path)
        while time.monotonic() < shorter_until:
            if not simplifier.partialShortcutPath(path):
                break
            simplifier.reduceVertices(path)
        points = self._points(path)
        last = points[-1]
        reached = min(self._solutions, key=lambda one: float(np.abs(one.q - last).max()))
        points[-1] = reached.q
        whole = self._whole(points)
        return None if whole is None else (whole, reached)

    def _state(self, q: Vector) -> Any:
        state = self._space.allocState()
        for i, value in enumerate(q / self._speed):
            state[i] = float(value)
        return state

    def _q(self, state: Any) -> Vector:
        speed = self._speed
        return np.array([state[i] for i in range(speed.size)]) * speed

    def _points(self, path: Any) -> Matrix:
        return np.array([self._q(path.getState(i)) for i in range(path.getStateCount())])

    def _is_valid(self, state: Any) -> bool:
        q = self._clear.project(self._q(state))
        return q is not None and self._clear.is_clear(q)

    def _is_clear(self, first: Any, last: Any) -> bool:
        return self._clear.way(self._q(first), self._q(last)) is not None

    def _whole(self, points: Matrix) -> Matrix | None:
        """Points of the way itself, where tasks hold on it: those of all projections."""
        if not self._clear.holding:
            return points
        pieces = [points[:1]]
        for first, last in pairwise(points):
            piece = self._clear.way(first, last)
            if piece is None:
                return None
            pieces.append(piece[1:])
        return self._clear.fine(np.vstack(pieces))


def ompl_modules() -> tuple[Any, Any, Any]:
    """Modules base, geometric and util of OMPL.

    Raises
    ------
    InvalidValue
        If it is not installed.
    """
    try:
        from ompl import base, geometric, util
    except ImportError as error:
        raise InvalidValue('ompl', f'{error}', 'the Python package ompl, 2 or later') from None
    return base, geometric, util


def _validator(base: Any, information: Any, is_clear: Callable[[Any, Any], bool]) -> Any:
    class Validator(base.MotionValidator):
        """Looks at a way as `Clear` does."""

        def checkMotion(self, first: Any, last: Any, *_: Any) -> bool:  # noqa: N802 - OMPL's
            """Whether the way from one state to another is clear."""
            return is_clear(first, last)

    return Validator(information)
