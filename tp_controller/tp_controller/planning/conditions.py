"""What a configuration has to keep: goals, levels above them, ranges and distances."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tp_controller.errors import InvalidValue, listed, shown
from tp_controller.robot import moved
from tp_controller.snapshot import unchanged
from tp_controller.stack import Stack
from tp_controller.tasks import JointLimitsTask, SetBasedTask, Task
from tp_controller.tasks.compiled import CompiledRows

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]

STEPS = 80
"""Most steps of one descent,"""
LONGEST = 0.5
"""and the largest change [rad, m] of a joint in one of them."""
STALLED, PROGRESS = 8, 0.97
"""A descent ends that has not made the error smaller, by this factor, in so many steps."""
EXACT = 1e-9
"""Error norm [m, rad] at which a descent ends,"""
FOUND = 1e-6
"""and at which everything that it is for counts as reached."""
CLEAR = (0.03, 1e-4)
"""Distances [m, rad] more than is kept, which descents away from obstacles go for in turn."""


class Blocked(NamedTuple):
    """A row of a set-based task that is nearer than it has to be."""

    task: str
    row: str
    """Name of the row: a link, a pair of links or a joint."""
    missing: float
    """By how much [m, rad]."""


class Conditions:
    """Goals and what has to hold with them, of a stack that stays as it is.

    What has to hold: equality tasks of the levels down to the lowest of the goals' have no error.
    Distances of all set-based tasks are as large as these keep them, and joints are inside their
    ranges. It is a context manager: inside, the tasks have the goals as targets and the stack may
    not be used; afterwards stack and robot are as before.

    Parameters
    ----------
    stack
        The stack.
    goals
        Target (target_size,) by task of the hierarchy.
    q
        Present configuration (nq,) [rad, m]. Tasks without a target take their value there, and
        pairs of links that touch there are no matter, as in the stack's first step.

    Raises
    ------
    InvalidValue
        If there is no goal, one cannot be used or q is no configuration.

    Attributes
    ----------
    goals, held
        Equality tasks that have a goal, and the others that have to hold.
    guards
        Set-based tasks that have to hold.
    """

    def __init__(
        self, stack: Stack, goals: Mapping[str, Sequence[float] | Vector], q: Vector
    ) -> None:
        self.stack, self.robot = stack, stack.robot
        self.q = np.array(q, dtype=float).reshape(-1)
        robot = self.robot
        if self.q.size != robot.nq or not np.isfinite(self.q).all():
            raise InvalidValue('q', shown(q), f'{robot.nq} finite numbers')
        self.targets = check_goals(stack, goals)
        lowest = max(stack.level_of(name) for name in self.targets)
        self._levels = [
            task
            for level in stack.members
            for task in level
            if task.set_based or stack.level_of(task.name) <= lowest
        ]
        self.goals = [task for task in self._levels if task.name in self.targets]
        self.held = [
            task
            for task in self._levels
            if not task.set_based and task.target_size and task.name not in self.targets
        ]
        self.guards = [
            task for level in stack.members for task in level if isinstance(task, SetBasedTask)
        ]
        limits, ranged = robot.limits, robot.space.ranged
        self.low = np.where(ranged, limits.position_min, -math.inf)
        self.high = np.where(ranged, limits.position_max, math.inf)
        self._narrow()
        self._exit = ExitStack()

    def _narrow(self) -> None:
        """Let the ranges of `joint_limits` tasks be ranges too: what they keep is inside."""
        own = self.robot.space.own
        for task in self.guards:
            if isinstance(task, JointLimitsTask):
                low, high = task.ends
                for i, first, last in zip(task.coordinates, low, high, strict=True):
                    for j in np.flatnonzero(own == i):
                        self.low[j] = max(self.low[j], first + task.kept.max())
                        self.high[j] = min(self.high[j], last - task.kept.max())

    def __enter__(self) -> Conditions:
        memory = [part for task in self._levels for part in task.memory]
        self._exit.enter_context(_as_before(self._levels))
        self._exit.enter_context(unchanged(*memory))
        self._exit.enter_context(moved(self.robot, self.q))
        for task in self._levels:
            if task.name in self.targets:
                task.target = self.targets[task.name]
            elif task.target is None and task.target_size:
                task.hold()
            if isinstance(task, SetBasedTask):
                # Rows whose links touch at the start may wait, as in a stack's first step.
                task.measure()
        self.ends = Descent(self, [*self.goals, *self.held], self.guards)
        return self

    def __exit__(self, *error: Any) -> None:
        self._exit.close()

    def part(
        self, tasks: Sequence[Task], guards: Sequence[SetBasedTask], ranges: bool = True
    ) -> Descent:
        """Search for a part of the conditions."""
        return Descent(self, tasks, guards, ranges)

    def inward(self, q: Vector) -> Vector:
        """Configuration (nq,) that differs from q by whole turns, as far inside as possible."""
        space, sliding, found = self.robot.space, self.robot.sliding, np.array(q)
        middle = 0.5 * (self.low + self.high)
        for j in np.flatnonzero(space.ranged & ~sliding & np.isfinite(middle)):
            i = space.own[j]
            found[i] -= math.tau * round((found[i] - middle[j]) / math.tau)
        return found

    def nearest(self, q: Vector) -> Vector:
        """Configuration (nq,) that differs from q by whole turns, nearest to the present one."""
        space = self.robot.space
        found = space.unwrapped(q, space.positions(self.q)).copy()
        present, sliding = space.positions(self.q), self.robot.sliding
        for j in np.flatnonzero(space.ranged & ~sliding):
            i = space.own[j]
            turns = round((present[j] - found[i]) / math.tau)
            for step in range(turns, 0, -1 if turns > 0 else 1):
                if self.low[j] <= found[i] + math.tau * step <= self.high[j]:
                    found[i] += math.tau * step
                    break
        return found


def check_goals(stack: Stack, goals: Mapping[str, Sequence[float] | Vector]) -> dict[str, Vector]:
    """Targets (target_size,) of goals in their normal form.

    Raises
    ------
    InvalidValue
        If there is none, a task is not in the hierarchy or has no target, or a target cannot be
        used.
    """
    able = [
        task.name
        for level in stack.members
        for task in level
        if not task.set_based and task.target_size
    ]
    if not goals:
        raise InvalidValue('goals', 'none', f'one or more of {listed(able)}')
    found = {}
    for name, values in goals.items():
        if name not in able:
            task = stack.tasks.get(name)
            got = shown(name)
            if task is not None:
                listed_there = stack.level_of(name) >= 0
                why = f'of type {task.type}' if listed_there else 'not in the hierarchy'
                got = f'{name}, which is {why}'
            raise InvalidValue('goals', got, f'tasks of {listed(able)}')
        try:
            found[name] = stack.tasks[name].check_target(values)
        except InvalidValue as error:
            raise error.under(name) from None
    return found


@contextmanager
def _as_before(tasks: Sequence[Task]) -> Iterator[None]:
    """Let what was compiled for other targets not be taken for the ones of before."""
    revisions = [task.revision for task in tasks]
    try:
        yield
    finally:
        for task, revision in zip(tasks, revisions, strict=True):
            task.revision = revision + 1


class Descent:
    """Descends from configurations to ones where tasks have no error and distances are kept.

    Parameters
    ----------
    conditions
        What they belong to.
    tasks
        Equality tasks, with targets.
    guards
        Set-based tasks.
    ranges
        Whether joints stay inside their ranges.
    """

    def __init__(
        self,
        conditions: Conditions,
        tasks: Sequence[Task],
        guards: Sequence[SetBasedTask],
        ranges: bool = True,
    ) -> None:
        from tp_controller.planning import descent

        self.robot = robot = conditions.robot
        self.tasks, self._step = list(tasks), descent.step
        self.guards = [task for task in guards if not isinstance(task, JointLimitsTask)]
        fences = [task for task in guards if isinstance(task, JointLimitsTask)]
        # Ranges of coordinates of a base are no ranges of joints.
        self.guards += [task for task in fences if task.bends or robot.space.blocks]
        n = robot.n
        self.low = conditions.low if ranges else np.full(n, -math.inf)
        self.high = conditions.high if ranges else np.full(n, math.inf)
        sizes = [task.k for task in tasks]
        self._first = np.concatenate([[0], np.cumsum(sizes)]).astype(int)
        k, distances = int(self._first[-1]), sum(task.k for task in self.guards)
        self._k = k
        self._J, self._e = np.zeros((k + distances, n)), np.zeros(k + distances)
        for task, first in zip(tasks, self._first, strict=False):
            # Rows of joints never change: nobody fills them.
            self._J[first : first + task.k] = task.J
        self._rows = CompiledRows(
            robot, list(zip(tasks, self._first.tolist(), strict=False)),
            self._J, self._e, np.zeros(k + distances), np.zeros(k + distances),
        )  # fmt: skip
        self._own = [
            (task, slice(int(first), int(first) + task.k))
            for task, first in zip(tasks, self._first[:-1], strict=True)
            if not task.parts
        ]
        self._scratch = (
            np.zeros(n, dtype=np.bool_), np.zeros((n, n)), np.zeros((n, n)), np.zeros(n),
        )  # fmt: skip
        self._way = np.zeros(n)

    def errors(self, q: Vector) -> Vector:
        """Errors (k,) of all tasks at a configuration (nq,), where the robot then is."""
        self.robot.update(q)
        self._rows.fill()
        for task, rows in self._own:
            task.update()
            self._J[rows], self._e[rows] = task.J, task.error
        return self._e[: self._k]

    def error_norms(self, q: Vector) -> dict[str, float]:
        """Error norm [m, rad] by task at a configuration (nq,), where the robot then is."""
        errors = self.errors(q)
        pairs = zip(self.tasks, self._first, strict=False)
        return {
            task.name: float(np.linalg.norm(errors[first : first + task.k]))
            for task, first in pairs
        }

    def run(self, q: Vector, least: float = FOUND) -> tuple[Vector, float]:
        """Descend by damped steps from q (nq,).

        Returns
        -------
        Vector
            Configuration (nq,) where it ended.
        float
            Error norm [m, rad] there; distances count if there was no error without them.
        """
        x = self.robot.space.positions(q)
        q = self.robot.integrate(q, np.clip(x, self.low, self.high) - x)
        q, error = self._descend(q)
        if error > least or not self.guards or not self._near(q):
            return q, error
        begin = q
        for clear in CLEAR:
            q, error = self._descend(begin, clear)
            if error <= least:
                break
        return q, error

    def _descend(self, q: Vector, clear: float = 0.0) -> tuple[Vector, float]:
        """Descend; with distances that are `clear` more than is kept unless that is 0."""
        robot, space, k = self.robot, self.robot.space, self._k
        best, best_q = math.inf, q
        mark, since = math.inf, 0
        for number in range(STEPS):
            self.errors(q)
            rows = k
            if clear:
                rows = self._add_distances(rows, clear)
            J, e = self._J[:rows], self._e[:rows]
            square = self._step(
                J, e, space.positions(q), self.low, self.high, LONGEST, *self._scratch, self._way
            )
            error = math.sqrt(square)
            if error < best:
                best, best_q = error, q
            if best < PROGRESS * mark:
                mark, since = best, number
            if not error > EXACT or number - since >= STALLED:
                break
            q = robot.integrate(q, self._way)
        return best_q, best

    def _add_distances(self, row: int, clear: float) -> int:
        """Add rows of distances that are too small; return the number of all rows."""
        for task in self.guards:
            task.measure()
            kept = task.kept
            for i in np.flatnonzero(task.distance < kept):
                self._J[row], self._e[row] = task.slope[i], kept[i] + clear - task.distance[i]
                row += 1
        return row

    def _near(self, q: Vector) -> bool:
        """Whether a distance is too small; the robot is at q."""
        for task in self.guards:
            distance = np.empty(task.k)
            task.probe(distance, task.kept)
            if (distance < task.kept).any():
                return True
        return False

    def blocked(self, q: Vector) -> list[Blocked]:
        """Rows that are nearer than they have to be at q (nq,), where the robot then is."""
        self.robot.update(q)
        return blocked_rows(self.guards)

    def outside(self, q: Vector, conditions: Conditions) -> list[Blocked]:
        """Joints that are outside of the ranges of the conditions at q (nq,)."""
        x = self.robot.space.positions(q)
        beyond = np.maximum(conditions.low - x, x - conditions.high)
        names = self.robot.joints
        return [Blocked('', names[j], float(beyond[j])) for j in np.flatnonzero(beyond > 1e-9)]


def blocked_rows(guards: Sequence[SetBasedTask]) -> list[Blocked]:
    """Rows that are nearer than they have to be at the robot's present configuration."""
    found = []
    for task in guards:
        distance = np.empty(task.k)
        task.probe(distance, task.kept)
        found += [
            Blocked(task.name, task.components[i], float(task.kept[i] - distance[i]))
            for i in np.flatnonzero(distance < task.kept)
        ]
    return found
