"""Least distance of set-based tasks along many configurations."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from tp_controller.robot import Robot
from tp_controller.tasks import SetBasedTask

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]

BLOCK = 256
"""Configurations whose lower bounds are computed together."""


class Distances:
    """Distances of a task, computed only where they can be less than those seen before.

    Between two configurations the distance of row i changes by at most ``reach_i |q - q'|``
    (`SetBasedTask.reach`, per coordinate). A configuration is skipped if no distance can be below
    the least one by that bound.

    Parameters
    ----------
    task
        The task.
    """

    def __init__(self, task: SetBasedTask) -> None:
        self._task = task
        self._reach = task.robot.space.coordinate_reach(task.reach)
        self._distance, self._q = np.full(task.k, -math.inf), task.robot.neutral

    def first_below(self, bound: float, path: Matrix) -> int:
        """Index of the first configuration of a path (m, n) where a distance may be below a bound.

        It is m if there is none.
        """
        with np.errstate(invalid='ignore'):
            lower = self._distance - np.abs(path - self._q) @ self._reach.T
        may_be = ~np.all(lower >= bound, axis=1)
        return int(np.argmax(may_be)) if may_be.any() else len(path)

    def look(self, q: Vector) -> float:
        """Least distance [m, rad] at ``q`` (nq,), where the robot was placed."""
        self._task.probe(self._distance)
        self._q[:] = q
        return float(self._distance.min())


def least_distance(robot: Robot, tasks: Iterable[SetBasedTask], path: Matrix) -> float:
    """Least distance of some tasks at all configurations of a path.

    Parameters
    ----------
    robot
        The robot of the tasks. It is at the last configuration of the path afterwards.
    tasks
        Set-based tasks.
    path
        Configurations (m, nq) [rad, m].

    Returns
    -------
    float
        The distance [m, rad]; infinite if there is no task.
    """
    least = math.inf
    for task in tasks:
        distances = Distances(task)
        i = 0
        while i < len(path):
            robot.place(path[i])
            least = min(least, distances.look(path[i]))
            i += 1
            while i < len(path):
                block = path[i : i + BLOCK]
                skipped = distances.first_below(least, block)
                i += skipped
                if skipped < len(block):
                    break
    robot.update(path[-1])
    return least
