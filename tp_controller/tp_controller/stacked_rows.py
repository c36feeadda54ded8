"""The rows of all tasks of a hierarchy, and the arrays that they are kept in."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import chain
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from tp_controller.hierarchy import all_set_based
from tp_controller.robot import Robot
from tp_controller.solvers import Curvature
from tp_controller.step_results import Layout, Rows, read_only
from tp_controller.tasks import SetBasedTask, Task

if TYPE_CHECKING:
    from tp_controller.tasks.compiled import CompiledRows

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]


class StackedRows:
    """Tasks in levels, whose rows stand in one Jacobian from now on.

    Parameters
    ----------
    robot
        The robot of the tasks.
    levels
        Tasks by level, highest priority first.
    command
        Joint velocities (n,) that were sent last.

    Attributes
    ----------
    levels
        As given.
    tasks
        All of them, in the order of their rows.
    parts
        Which rows belong to each task, by name.
    own
        Whether any task fills its rows itself.
    bounding
        The tasks that are set-based.
    guarded
        The rows that are to keep distances whatever else is asked for.
    J, requested
        Jacobian (K, n) and desired task velocities (K,), as of the last `fill`.
    curvature
        What else a solver may need to know of the rows.
    answers
        The command (n,), ``requested`` and ``achieved`` in one array, so that results of their
        own are one copy; ``shown`` is a view of it that is read only.
    command, achieved
        Joint velocities (n,) that were sent last, and the task velocities (K,) by these.
    told
        ``parts``, ``J`` and ``requested``.
    layout
        Where `answers` has what each level asked for and got.
    """

    def __init__(self, robot: Robot, levels: Sequence[Sequence[Task]], command: Vector) -> None:
        self._robot, self.levels = robot, levels
        self.tasks = list(chain.from_iterable(levels))
        self.parts: dict[str, slice] = {}
        n, k = robot.n, 0
        for task in self.tasks:
            self.parts[task.name] = slice(k, k + task.k)
            k += task.k
        # Tasks write their rows of the whole system themselves; nothing is copied per cycle.
        self.J: Matrix = np.zeros((k, n))
        self.answers = np.concatenate([command, np.zeros(2 * k)])
        self.command = self.answers[:n]
        self.requested, self.achieved = self.answers[n : n + k], self.answers[n + k :]
        self.shown = read_only(self.answers)
        self.told = Rows(self.parts, self.J, self.requested)
        known = np.zeros((3, k))
        self._errors, self._feedforward = known[:2]
        self._place()
        bends = [np.zeros(task.k) if task.set_based else task.bend for task in self.tasks]
        known[2] = np.concatenate([*bends, np.zeros(0)])
        self.curvature = Curvature(known, np.zeros((k, n, n)), self._fill_hessians)
        self._compiled: CompiledRows | None = None
        self.own = bool(self._own)
        self.bounding = [task for task in self.tasks if isinstance(task, SetBasedTask)]
        self.layout: Layout = []
        for tasks in levels:
            rows = self.of_level(tasks)
            asked = slice(n + rows.start, n + rows.stop)
            got = slice(asked.start + k, asked.stop + k)
            self.layout.append((tuple(task.name for task in tasks), asked, got))
        above = next((i for i, level in enumerate(levels) if not all_set_based(level)), k)
        guarded = [self.of_level(level) for level in levels[:above]]
        self.guarded = slice(0, guarded[-1].stop if guarded else 0)

    def _place(self) -> None:
        """Let tasks keep their rows here."""
        self._own: list[tuple[Task, Vector, Vector]] = []
        self._bent: list[tuple[Task, slice]] = []
        for task in self.tasks:
            rows = self.parts[task.name]
            # Rows that come and go have no error that anything converges to.
            task.place(self.J[rows], np.zeros(task.k) if task.set_based else self._errors[rows])
            if not task.parts:
                self._own.append((task, self.requested[rows], self._feedforward[rows]))
                if not task.set_based:
                    self._bent.append((task, rows))

    def of_level(self, tasks: Sequence[Task]) -> slice:
        """Rows of a level by its tasks."""
        return slice(self.parts[tasks[0].name].start, self.parts[tasks[-1].name].stop)

    @property
    def kept(self) -> Iterator[SetBasedTask]:
        """Tasks whose distances are kept whatever happens: those above all that always act."""
        for tasks in self.levels:
            bounds = [task for task in tasks if isinstance(task, SetBasedTask)]
            if len(bounds) < len(tasks) or not all(task.one_sided for task in bounds):
                return
            yield from bounds

    @property
    def one_sided(self) -> NDArray[np.bool_]:
        """Whether the velocity of each row (K,) is the least one allowed."""
        sides = np.array([task.one_sided for task in self.tasks], dtype=np.bool_)
        return np.repeat(sides, [task.k for task in self.tasks])

    def fill(self) -> None:
        """Fill the rows at the robot's present configuration."""
        if self._compiled is None:
            from tp_controller.tasks.compiled import CompiledRows

            self._compiled = CompiledRows(
                self._robot,
                [(task, self.parts[task.name].start) for task in self.tasks],
                self.J,
                self._errors,
                self._feedforward,
                self.requested,
            )
        self._compiled.fill()
        for task, velocity, feedforward in self._own:
            task.update()
            task.desired_velocity(velocity)
            # Of rows without an error there is nothing to approach.
            if task.set_based:
                feedforward[:] = velocity
            else:
                task.limited_feedforward(feedforward)

    def jacobian_at(self, q: Vector) -> Matrix:
        """Jacobian (K, n) after the robot was moved to ``q`` (nq,)."""
        self._robot.update(q)
        self.fill()
        return self.J

    def achieve(self) -> None:
        """Fill what the command achieves."""
        self.J.dot(self.command, out=self.achieved)

    def _fill_hessians(self) -> None:
        hessians = self.curvature.hessians
        if self._compiled is not None:
            self._compiled.fill_hessians(hessians)
        for task, rows in self._bent:
            task.hessian(hessians[rows])
