"""The stack of tasks: one step from a configuration to a joint velocity."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from itertools import chain
from typing import NamedTuple, NoReturn

import numpy as np
from numpy.typing import NDArray

from tp_controller.errors import InvalidValue, UnusableState, listed, shown
from tp_controller.guard import Guard
from tp_controller.robot import Robot
from tp_controller.solvers import Solver
from tp_controller.tasks import SetBasedTask, Task

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]


class LevelResult(NamedTuple):
    """What one level asked for and got in the last step."""

    tasks: tuple[str, ...]
    """Names of the level's tasks, in the order of their rows."""
    requested: Vector
    """Desired task velocity (k,); a read-only view that the next step overwrites."""
    achieved: Vector
    """Task velocity of the command (k,); a read-only view that the next step overwrites."""


class System(NamedTuple):
    """One level of the last step, row by row."""

    J: Matrix
    """Jacobian (k, n)."""
    counts: NDArray[np.bool_]
    """Whether each row was resolved (k,); bounds that nothing breaks are not."""
    requested: Vector
    """Desired task velocity (k,)."""
    answered: Vector
    """Task velocity of the solver's answer (k,)."""
    achieved: Vector
    """Task velocity of the command (k,), which the guard may have changed."""


class Step(NamedTuple):
    """Result of one step."""

    command: Vector
    """Joint velocity (n,) [rad/s, m/s]; a read-only view that the next step overwrites."""
    scale: float
    """What the velocity limits cost, see `Solver.solve`; 1 if none was reached."""
    levels: tuple[LevelResult, ...]
    """One result per level, highest first."""


class Stack:
    """Tasks in levels of priority, a solver and the robot's limits.

    Parameters
    ----------
    robot
        The robot that carries the tasks out.
    tasks
        All tasks, those outside the hierarchy included.
    hierarchy
        Task names, highest priority first; ``a + b`` puts two tasks on one level.
    solver
        Resolves the levels.
    period
        Time [s] of one step, which limits of position and acceleration and the last check of
        distances need; infinite if unknown.

    Raises
    ------
    InvalidValue
        If the hierarchy is empty, names an unknown task or names one twice; as `Guard`.
    """

    def __init__(
        self,
        robot: Robot,
        tasks: Iterable[Task],
        hierarchy: Sequence[str],
        solver: Solver,
        period: float = math.inf,
    ) -> None:
        self.robot = robot
        self.solver = solver
        self.tasks = {task.name: task for task in tasks}
        self._unaimed = [task for task in self.tasks.values() if task.target_size]
        self._held: list[Task] = []
        self.guard = Guard(robot, period)
        self._qd, self._wish = np.zeros((2, robot.n))
        self._command = _read_only(self._qd)
        self._members: list[list[Task]] = []
        self.hierarchy = hierarchy

    @property
    def hierarchy(self) -> Sequence[str]:
        """Task names by level, highest first, ``a + b`` for two on one level."""
        return tuple(' + '.join(task.name for task in members) for members in self._members)

    @hierarchy.setter
    def hierarchy(self, hierarchy: Sequence[str]) -> None:
        members = self.check_hierarchy(hierarchy)
        for task in self.tasks.values():
            task.place(np.zeros_like(task.J))
        self._members = members
        self._rows: dict[str, slice] = {}
        k = 0
        for task in chain.from_iterable(members):
            self._rows[task.name] = slice(k, k + task.k)
            k += task.k
        # Tasks write their rows of the whole system themselves; nothing is copied per cycle.
        self._J = np.zeros((k, self.robot.n))
        self._velocity, self._achieved = np.zeros(k), np.zeros(k)
        self._parts = [
            (self.tasks[name], self._velocity[rows]) for name, rows in self._rows.items()
        ]
        for task, _ in self._parts:
            task.place(self._J[self._rows[task.name]])
        self._results = tuple(self._result(tasks) for tasks in members)
        self.prepare_solver()
        self.guard.watch(self._kept())

    def _kept(self) -> Iterator[SetBasedTask]:
        """Tasks whose distances are kept whatever happens: those above all that always act."""
        for members in self._members:
            bounds = [task for task in members if isinstance(task, SetBasedTask)]
            if len(bounds) < len(members) or not all(task.one_sided for task in bounds):
                return
            yield from bounds

    def _result(self, tasks: Sequence[Task]) -> LevelResult:
        rows = self._level_rows(tasks)
        return LevelResult(
            tuple(task.name for task in tasks),
            _read_only(self._velocity[rows]),
            _read_only(self._achieved[rows]),
        )

    def _level_rows(self, tasks: Sequence[Task]) -> slice:
        return slice(self._rows[tasks[0].name].start, self._rows[tasks[-1].name].stop)

    def add(self, task: Task) -> None:
        """Load a task of a new name, outside the hierarchy."""
        self.tasks[task.name] = task
        if task.target_size:
            self._unaimed.append(task)

    def remove(self, name: str) -> None:
        """Forget a task outside the hierarchy."""
        task = self.tasks.pop(name)
        self._unaimed = [other for other in self._unaimed if other is not task]

    def prepare_solver(self) -> None:
        """Tell the solver of the levels, and of their tasks' weights and inverses."""
        self.solver.prepare(self._members, self._jacobian_at)
        for name, rows in self._rows.items():
            task = self.tasks[name]
            if isinstance(task, SetBasedTask):
                task.acting = self.solver.acting[rows]

    def _jacobian_at(self, q: Vector) -> Matrix:
        """Stacked Jacobian (K, n) after the robot was moved to ``q`` (n,)."""
        self.robot.update(q)
        for task, _ in self._parts:
            task.update()
        return self._J

    def check_hierarchy(
        self,
        hierarchy: Sequence[str],
        damping: float | None = None,
        tasks: Mapping[str, Task] | None = None,
    ) -> list[list[Task]]:
        """Tasks of every level.

        Parameters
        ----------
        hierarchy
            Task names by level, highest first.
        damping
            λ that the solver is to have; the present one when left out.
        tasks
            Tasks by name that it may have; the present ones when left out.

        Raises
        ------
        InvalidValue
            If there is no level, a name is unknown, a task stands twice or the solver
            cannot resolve the levels.
        """
        tasks = self.tasks if tasks is None else tasks
        levels = split_hierarchy(hierarchy, tasks)
        members = [[tasks[name] for name in names] for names in levels]
        self.solver.check(members, damping)
        return members

    def systems(self) -> list[System]:
        """What every level was in the last step."""
        counts = np.repeat(
            [not task.one_sided for task, _ in self._parts], [task.k for task, _ in self._parts]
        )
        answered = self._J @ self._wish
        found = []
        for tasks in self._members:
            rows = self._level_rows(tasks)
            found.append(
                System(
                    self._J[rows].copy(),
                    counts[rows] | self.solver.acting[rows],
                    self._velocity[rows].copy(),
                    answered[rows],
                    self._achieved[rows].copy(),
                )
            )
        return found

    def level_of(self, name: str) -> int:
        """Level of a task, 0 is the highest; -1 outside the hierarchy."""
        for i, level in enumerate(self._results):
            if name in level.tasks:
                return i
        return -1

    def velocities_of(self, name: str) -> tuple[Vector, Vector]:
        """Views of the requested and achieved velocity (k,) of a task in the hierarchy.

        They are the ones that steps write to until the hierarchy changes.
        """
        rows = self._rows[name]
        return _read_only(self._velocity[rows]), _read_only(self._achieved[rows])

    def step(self, q: Vector) -> Step:
        """Compute the command at configuration ``q`` (n,) [rad, m].

        A task without a target takes its value at this configuration as the target.

        Raises
        ------
        UnusableState
            If no finite command follows from the configuration. If that itself is finite the
            error has a command: braking.
        """
        if not np.isfinite(q).all():
            self._refuse(q)
        self.robot.update(q)
        for task in self._unaimed:
            if task.target is None:
                task.hold()
                self._held.append(task)
        try:
            # What overflows is not finite and refused below.
            with np.errstate(over='ignore', invalid='ignore'):
                for task, velocity in self._parts:
                    task.update()
                    task.desired_velocity(velocity)
                bounds = self.guard.bounds(self.robot.q)
                scale = self.solver.solve(self._J, self._velocity, bounds, self._wish)
        except np.linalg.LinAlgError:
            self._refuse(q)
        if self._unaimed:
            self._unaimed, self._held = [], []
        self._qd[:] = self._wish
        self.guard.pass_on(self.robot.q, self._qd)
        np.dot(self._J, self._qd, out=self._achieved)
        return Step(self._command, scale, self._results)

    def brake(self) -> Vector:
        """Next command (n,) of braking to rest when no configuration comes; a read-only view."""
        self.guard.brake(self._qd)
        np.dot(self._J, self._qd, out=self._achieved)
        return self._command

    def rest(self) -> None:
        """Go on from standstill: the last command was not carried out."""
        self.guard.rest()

    def undo(self) -> None:
        """Take the last step back: its configuration comes again, no time has passed."""
        self.guard.undo()

    def _refuse(self, q: Vector) -> NoReturn:
        self._qd[:] = self._wish[:] = 0.0
        for task in self._held:
            task.forget_target()
        self._held = []
        message = f'no finite command follows from the position {shown(q)}'
        if not np.isfinite(q).all():
            raise UnusableState(message)
        self.guard.bounds(self.robot.q)
        self.guard.pass_on(self.robot.q, self._qd)
        raise UnusableState(message, self._command)


def split_hierarchy(hierarchy: Sequence[str], known: Collection[str]) -> list[list[str]]:
    """Task names of every level, highest first.

    Parameters
    ----------
    hierarchy
        Task names by level; ``a + b`` puts two on one level.
    known
        Names of all tasks.

    Raises
    ------
    InvalidValue
        If there is no level, a name is unknown or a task stands twice.
    """
    levels = [[name.strip() for name in level.split('+')] for level in hierarchy]
    accepts = f'names out of {listed(known)}, joined by + on one level'
    if not levels:
        raise InvalidValue('hierarchy', 'no level', accepts)
    seen: set[str] = set()
    for name in (name for names in levels for name in names):
        if name not in known:
            raise InvalidValue('hierarchy', shown(name), accepts)
        if name in seen:
            raise InvalidValue('hierarchy', f'{shown(name)} twice', 'every task once')
        seen.add(name)
    return levels


def _read_only(array: Vector) -> Vector:
    view = array.view()
    view.flags.writeable = False
    return view
