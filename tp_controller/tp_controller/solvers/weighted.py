"""One soft level."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from tp_controller.solvers.base import Solver
from tp_controller.solvers.problem import Bounds, Curvature, Levels

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]


class WeightedSolver(Solver):
    """All tasks in one sum of squares: the order of the levels counts for nothing.

    ``qd`` minimises ``Σ wᵢ ‖Jᵢ qd - vᵢ‖²``, with damping plus ``λ² ‖qd‖²``; ``wᵢ`` is the
    ``weight`` of task i.
    """

    type = 'weighted'

    def prepare(
        self, levels: Levels, jacobian_at: Callable[[Vector], Matrix] | None = None
    ) -> None:
        """Get ready for levels; see `Solver.prepare`."""
        super().prepare(levels, jacobian_at)
        tasks = [task for group in self._groups for task in group]
        roots = [np.full(task.k, task.weight) for task in tasks]
        self._roots = np.sqrt(np.concatenate([*roots, np.zeros(0)]))
        self._J, self._velocity = np.zeros((self.k, self.n)), np.zeros(self.k)
        self._known = np.zeros((3, self.k))

    def solve(
        self,
        J: Matrix,
        velocity: Vector,
        bounds: Bounds,
        qd: Vector,
        curvature: Curvature | None = None,
    ) -> float:
        """Write the joint velocity (n,) to ``qd``; see `Solver.solve`."""
        np.multiply(J, self._roots[:, None], out=self._J)
        np.multiply(velocity, self._roots, out=self._velocity)
        if curvature is not None:
            np.multiply(curvature.rows, self._roots, out=self._known)
            curvature = curvature._replace(rows=self._known)
        scale = self._resolve(self._J, self._velocity, bounds, qd, curvature)
        np.divide(self._velocity, self._roots, out=velocity, where=self._roots > 0.0)
        return scale
