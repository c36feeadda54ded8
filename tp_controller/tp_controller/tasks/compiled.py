"""Tasks on frames and joints, resolved by one compiled call."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from tp_controller.prepared import Prepared
from tp_controller.robot import Frame, Robot
from tp_controller.tasks import base
from tp_controller.tasks.parts import BASE, COLUMNS, REFERENCES, Part

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]


class CompiledRows:
    """Rows of several tasks in arrays of their own, filled by one call.

    Parameters
    ----------
    robot
        The robot.
    tasks
        The tasks with their first rows; those without parts are left out.
    J, errors, feedforward, velocity
        Where the rows of all tasks are: (K, n), and (K,) each. The feedforward is that part of
        the desired velocity that is no gain term.
    """

    def __init__(
        self,
        robot: Robot,
        tasks: Iterable[tuple[base.Task, int]],
        J: Matrix,
        errors: Vector,
        feedforward: Vector,
        velocity: Vector,
    ) -> None:
        from tp_controller.tasks import rows, second_derivatives

        self._tasks = [(task, first) for task, first in tasks if task.parts]
        parts = [(part, task, first) for task, first in self._tasks for part in task.parts]
        width = max([9, robot.n, *(len(part.places) for part, _, _ in parts)])
        self._revisions = [-1] * len(self._tasks)
        # What was taken over last, by identity: most often only a target is new.
        self._loaded: list[tuple[object, ...]] = [(None, None, None)] * len(self._tasks)
        self._added = np.zeros(errors.size)
        self._plan = np.full((len(parts), COLUMNS), -1, dtype=np.int64)
        self._places = np.zeros((len(parts), width), dtype=np.int64)
        self._wraps = np.zeros((len(parts), width), dtype=np.bool_)
        self._values = np.zeros((len(parts), width))
        frames: dict[int, int] = {}

        def slot(frame: Frame | None) -> int:
            if frame is None or frame is robot.base:
                return BASE
            return frames.setdefault(frame.index, len(frames))

        self._first_part: list[int] = []
        i = 0
        for task, first in self._tasks:
            self._first_part.append(i)
            row = first
            for part in task.parts:
                self._plan[i] = (
                    part.kind,
                    row,
                    len(part.places),
                    slot(part.frame),
                    slot(part.reference),
                    REFERENCES if part.axes is None else slot(part.axes),
                    part.axis,
                    part.carried,
                )
                self._places[i, : len(part.places)] = part.places
                self._wraps[i, list(part.wraps)] = True
                row += len(part.places)
                i += 1
        sizes = [task.k for task, _ in self._tasks]
        self._spans = np.array(
            [(first, task.k) for task, first in self._tasks], dtype=np.int64
        ).reshape(-1, 2)
        self._gains = np.zeros((len(sizes), max([1, *sizes]), max([1, *sizes])))
        groups = [
            (first + rows.start, rows.stop - rows.start)
            for task, first in self._tasks
            for rows in task.speed_groups
        ]
        self._first_group = np.cumsum([0, *(len(task.speed_groups) for task, _ in self._tasks)])
        self._speeds = np.full(len(groups), math.inf)
        m, n = robot.twists.shape[0], robot.n
        self._frames = np.array(list(frames), dtype=np.int64)
        self._moves = np.zeros((len(frames), m), dtype=np.bool_)
        by_index = {robot.frame(name).index: robot.frame(name) for name in robot.frames}
        for index, place in frames.items():
            self._moves[place, by_index[index].chain()] = True
        S = np.zeros((0, 0)) if robot.coupling is None else robot.coupling.S
        S = np.ascontiguousarray(S, dtype=float)
        self._fill = Prepared(
            rows.fill,
            robot.q,
            robot.twists,
            robot.poses,
            S,
            self._frames,
            self._moves,
            np.zeros((len(frames), 6, n)),
            self._plan,
            self._places,
            self._wraps,
            self._values,
            self._spans,
            self._gains,
            self._added,
            np.array(groups, dtype=np.int64).reshape(-1, 2),
            self._speeds,
            np.zeros((8, 6, max(n, 3))),
            J,
            errors,
            feedforward,
            velocity,
        )
        chains = [_chain(part) for part, _, _ in parts]
        counts = np.array([len(chain) for chain in chains], dtype=np.int64)
        ordered = np.zeros((len(parts), m), dtype=np.int64)
        for line, chain in zip(ordered, chains, strict=True):
            line[: len(chain)] = chain
        self._fill_hessians = Prepared(
            second_derivatives.fill,
            robot.twists,
            robot.poses,
            S,
            robot.frame(robot.frames[0]).joint_of,
            self._frames,
            self._moves,
            self._plan,
            self._places,
            ordered,
            counts,
            np.zeros((2, 6, max(m, n))),
            np.zeros((7, m, m)),
            np.zeros((4, 3, 3)),
            J,
            errors,
            np.zeros((0, n, n)),
        )

    def fill(self) -> None:
        """Fill the rows of all tasks at the robot's present configuration."""
        for i, (task, first) in enumerate(self._tasks):
            if self._revisions[i] != task.revision:
                self._load(i, task, first)
        self._fill.run()

    def fill_hessians(self, out: NDArray[np.float64]) -> None:
        """Fill the second derivatives (K, n, n) of all tasks, after `fill`, see `hessian`.

        Rows of other tasks and of joints stay as they are.
        """
        self._fill_hessians.replace(-1, out)
        self._fill_hessians.run()

    def _load(self, i: int, task: base.Task, first: int) -> None:
        """Take over a task's target, gain, feedforward and largest speeds."""
        self._revisions[i] = task.revision
        _, feedforward, K, max_speed = task.settings
        if K is not self._loaded[i][1]:
            self._gains[i, : task.k, : task.k] = K
        if feedforward is not self._loaded[i][0]:
            self._added[first : first + task.k] = feedforward
        if max_speed is not self._loaded[i][2]:
            groups = slice(self._first_group[i], self._first_group[i + 1])
            self._speeds[groups] = max_speed if max_speed.size else math.inf
        self._loaded[i] = feedforward, K, max_speed
        for part, values in enumerate(task.part_values(), self._first_part[i]):
            self._values[part, : values.size] = values


def _chain(part: Part) -> NDArray[np.int64]:
    """Velocities (p,) of the model that move a part's frame as seen from its reference."""
    if part.frame is None:
        return np.zeros(0, dtype=np.int64)
    return part.frame.chain(part.reference)
