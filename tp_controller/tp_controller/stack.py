"""The stack of tasks: one step from a configuration to a joint velocity."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple, NoReturn

import numpy as np
from numpy.typing import NDArray

from tp_controller.errors import InvalidValue, UnusableState, listed, shown
from tp_controller.robot import Robot
from tp_controller.solvers import Equations, Solver
from tp_controller.tasks import Task

Vector = NDArray[np.float64]


class LevelResult(NamedTuple):
    """What one level asked for and got in the last step."""

    tasks: tuple[str, ...]
    """Names of the level's tasks, in the order of their rows."""
    requested: Vector
    """Desired task velocity (k,); a read-only view that the next step overwrites."""
    achieved: Vector
    """Task velocity of the command (k,); a read-only view that the next step overwrites."""


class Step(NamedTuple):
    """Result of one step."""

    command: Vector
    """Joint velocity (n,) [rad/s, m/s]; a read-only view that the next step overwrites."""
    scale: float
    """Factor that brought the command into the velocity limits, 1 if none was reached."""
    levels: tuple[LevelResult, ...]
    """One result per level, highest first."""


class Stack:
    """Tasks in levels of priority, a solver and the robot's velocity limits.

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

    Raises
    ------
    InvalidValue
        If the hierarchy is empty, names an unknown task or names one twice.
    """

    def __init__(
        self, robot: Robot, tasks: Iterable[Task], hierarchy: Sequence[str], solver: Solver
    ) -> None:
        self.robot = robot
        self.solver = solver
        self.tasks = {task.name: task for task in tasks}
        self._unaimed = list(self.tasks.values())
        self._held: list[Task] = []
        self._qd: Vector = np.zeros(robot.n)
        self._command = _read_only(self._qd)
        self._levels: tuple[_Level, ...] = ()
        self.hierarchy = hierarchy

    @property
    def hierarchy(self) -> Sequence[str]:
        """Task names by level, highest first, ``a + b`` for two on one level."""
        return tuple(' + '.join(level.result.tasks) for level in self._levels)

    @hierarchy.setter
    def hierarchy(self, hierarchy: Sequence[str]) -> None:
        names_by_level = self.check_hierarchy(hierarchy)
        self._levels = tuple(
            _Level([self.tasks[name] for name in names], self.robot.n) for names in names_by_level
        )
        self._equations = [level.equations for level in self._levels]
        self._results = tuple(level.result for level in self._levels)

    def check_hierarchy(self, hierarchy: Sequence[str]) -> list[list[str]]:
        """Task names of every level.

        Raises
        ------
        InvalidValue
            If there is no level, a name is unknown or a task stands twice.
        """
        levels = [[name.strip() for name in level.split('+')] for level in hierarchy]
        accepts = f'names out of {listed(self.tasks)}, joined by + on one level'
        if not levels:
            raise InvalidValue('hierarchy', 'no level', accepts)
        seen: set[str] = set()
        for name in (name for names in levels for name in names):
            if name not in self.tasks:
                raise InvalidValue('hierarchy', shown(name), accepts)
            if name in seen:
                raise InvalidValue('hierarchy', f'{shown(name)} twice', 'every task once')
            seen.add(name)
        return levels

    def level_of(self, name: str) -> int:
        """Level of a task, 0 is the highest; -1 outside the hierarchy."""
        for i, level in enumerate(self._levels):
            if name in level.result.tasks:
                return i
        return -1

    def velocities_of(self, name: str) -> tuple[Vector, Vector]:
        """Views of the requested and achieved velocity (k,) of a task in the hierarchy.

        They are the ones that steps write to until the hierarchy changes.
        """
        level = self._levels[self.level_of(name)]
        rows = level.rows[name]
        return level.result.requested[rows], level.result.achieved[rows]

    def step(self, q: Vector) -> Step:
        """Compute the command at configuration ``q`` (n,) [rad, m].

        A task without a target takes its value at this configuration as the target.

        Raises
        ------
        UnusableState
            If no finite command follows from the configuration.
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
                for level in self._levels:
                    level.update()
                self.solver.solve(self._equations, self._qd)
        except np.linalg.LinAlgError:
            self._refuse(q)
        if not np.isfinite(self._qd).all():
            self._refuse(q)
        if self._unaimed:
            self._unaimed, self._held = [], []
        scale = self.robot.limits.scale_velocity(self._qd)
        for level in self._levels:
            np.dot(level.equations.J, self._qd, out=level.achieved)
        return Step(self._command, scale, self._results)

    def _refuse(self, q: Vector) -> NoReturn:
        self._qd[:] = 0.0
        for task in self._held:
            task.forget_target()
        self._held = []
        raise UnusableState(f'no finite command follows from the position {shown(q)}')


class _Level:
    """Tasks of one priority, stacked in arrays that are made once."""

    def __init__(self, tasks: Sequence[Task], n: int) -> None:
        self.rows: dict[str, slice] = {}
        k = 0
        for task in tasks:
            self.rows[task.name] = slice(k, k + task.k)
            k += task.k
        # A single task's Jacobian is the level's own; only several are copied together.
        self._single = len(tasks) == 1
        J = tasks[0].J if self._single else np.zeros((k, n))
        velocity = np.zeros(k)
        self._parts = [
            (task, J[rows], velocity[rows])
            for task, rows in zip(tasks, self.rows.values(), strict=True)
        ]
        self.equations = Equations(J, velocity)
        self.achieved = np.zeros(k)
        self.result = LevelResult(
            tuple(self.rows), _read_only(velocity), _read_only(self.achieved)
        )

    def update(self) -> None:
        """Fill the level's equations at the robot's present configuration."""
        for task, J, velocity in self._parts:
            task.update()
            if not self._single:
                J[:] = task.J
            task.desired_velocity(velocity)


def _read_only(array: Vector) -> Vector:
    view = array.view()
    view.flags.writeable = False
    return view
