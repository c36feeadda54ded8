"""Random configurations, and what tasks have there."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from tp_controller.robot import moved
from tp_controller.robot.draws import random_configuration
from tp_controller.stack import Stack
from tp_controller.tasks import SetBasedTask, Task

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]

COUNT = 40
"""Configurations that are looked at."""
NOTHING = 1e-6
"""Share of the size of a Jacobian up to which a singular value or a row counts as zero."""


class Samples:
    """Random configurations inside the ranges, the same ones every time.

    The stack stays as it is.

    Parameters
    ----------
    stack
        The stack.
    count
        Number m of configurations.
    """

    def __init__(self, stack: Stack, count: int = COUNT) -> None:
        rng = np.random.default_rng(0)
        self.stack = stack
        self.configurations = [random_configuration(stack.robot, rng) for _ in range(count)]

    @cached_property
    def jacobians(self) -> dict[str, Matrix]:
        """Jacobians (m, k, n) of all tasks whose rows are always there, by name."""
        tasks = [task for task in self.stack.tasks.values() if not task.set_based]
        found: dict[str, list[Matrix]] = {task.name: [] for task in tasks}
        for q in self.configurations:
            state = self.stack.robot.state(q)
            for task in tasks:
                found[task.name].append(np.asarray(task.rows(state).J))
        return {name: np.array(matrices) for name, matrices in found.items()}

    @cached_property
    def distances(self) -> dict[str, Matrix]:
        """Distances (m, k) [m, rad] of the set-based tasks of the hierarchy, by name."""
        return distances_at(self.stack, self.configurations)

    @property
    def levels(self) -> list[list[Task]]:
        """Tasks of every level whose rows are always there."""
        return [[task for task in level if not task.set_based] for level in self.stack.members]


def guards(stack: Stack) -> list[SetBasedTask]:
    """Return the set-based tasks of the hierarchy."""
    return [task for level in stack.members for task in level if isinstance(task, SetBasedTask)]


def distances_at(stack: Stack, configurations: Sequence[Vector]) -> dict[str, Matrix]:
    """Distances (m, k) [m, rad] of the set-based tasks of the hierarchy, by name."""
    tasks = guards(stack)
    found = {task.name: np.empty((len(configurations), task.k)) for task in tasks}
    if not tasks or not configurations:
        return found
    with moved(stack.robot, configurations[0]):
        for i, q in enumerate(configurations):
            stack.robot.update(q)
            for task in tasks:
                # However far: a lower bound would do for control only.
                task.probe(found[task.name][i], np.full(task.k, np.inf))
    return found


def rank(J: Matrix, size: float) -> int:
    """Rank of a matrix beside one of a size."""
    if not J.size:
        return 0
    return int(np.count_nonzero(np.linalg.svd(J, compute_uv=False) > NOTHING * size))


def freedom(J: Matrix, n: int) -> Matrix:
    """Orthonormal columns (n, r) of the joint velocities that rows (k, n) leave free."""
    if not J.size:
        return np.eye(n)
    _, s, Vt = np.linalg.svd(J)
    return Vt[int(np.count_nonzero(s > NOTHING * np.linalg.norm(J))) :].T


def span(J: Matrix) -> Matrix:
    """Orthonormal columns (n, r) of what rows (k, n) take."""
    _, s, Vt = np.linalg.svd(J, full_matrices=False)
    return Vt[s > NOTHING * np.linalg.norm(J)].T
