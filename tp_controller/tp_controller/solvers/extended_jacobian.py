"""The extended Jacobian: as many rows as joints."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from tp_controller.errors import InvalidValue
from tp_controller.solvers.base import RANK_TOLERANCE, Solver
from tp_controller.solvers.problem import Bounds, Curvature, Levels

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]

STEP = 1e-6
"""Step [rad, m] of the central differences."""


class ExtendedJacobianSolver(Solver):
    """A square system: the tasks' rows and exactly n - K auxiliary ones (Baillieul 1985).

    Without an objective the auxiliary rows are tasks like the others. With an objective H
    they are its condition for an optimum among the configurations that the tasks leave:
    ``g(q) = Zᵀ ∇H = 0``, where the columns of ``Z`` (n, n - K) span the null space of the
    tasks' J. They are brought to zero by ``∂g/∂q qd = -κ g`` with the objective's gain κ and ::

        ∂g/∂q = Zᵀ ∂(∇H - Jᵀ μ)/∂q,  μ = (J⁺)ᵀ ∇H held

    What is left out, ``(∂Zᵀ/∂q Z) g``, only turns g: ``‖g‖`` falls by ``exp(-κ t)`` where the
    tasks have full rank. The derivative is taken by central differences; docs/schemes.md has
    the derivation.

    Being square, the system has one answer: a closed path of the tasks is a closed path of
    the joints, away from singularities, where the chosen inverse acts.
    """

    type = 'extended_jacobian'

    def check(self, levels: Levels, damping: float | None = None) -> None:
        """Check that the levels can be resolved; see `Solver.check`."""
        super().check(levels, damping)
        for task in (task for level in levels for task in level if task.set_based):
            raise InvalidValue(
                'hierarchy',
                f'{task.name}, whose rows come and go',
                f'tasks that always act, with solver.type {self.type}',
            )
        rows, n = sum(task.k for level in levels for task in level), self.n
        if self.objective is None and rows != n:
            raise InvalidValue(
                'hierarchy',
                f'{rows} rows for {n} joints',
                f'tasks of {n} rows together with solver.type {self.type}, fewer with a '
                'solver.objective',
            )
        if self.objective is not None and rows >= n:
            raise InvalidValue(
                'hierarchy',
                f'{rows} rows for {n} joints',
                f'tasks of fewer than {n} rows together, so that solver.objective has some',
            )

    def prepare(
        self, levels: Levels, jacobian_at: Callable[[Vector], Matrix] | None = None
    ) -> None:
        """Get ready for levels; see `Solver.prepare`."""
        super().prepare(levels, jacobian_at)
        self._J, self._velocity = np.zeros((self.n, self.n)), np.zeros(self.n)
        self._gradient, self._slope = np.zeros(self.n), np.zeros((self.n, self.n))
        if self.objective is not None and len(self._starts) > 1:
            self._starts[-1] = self.n

    def solve(
        self,
        J: Matrix,
        velocity: Vector,
        bounds: Bounds,
        qd: Vector,
        curvature: Curvature | None = None,
    ) -> float:
        """Write the joint velocity (n,) to ``qd``; see `Solver.solve`."""
        if self.objective is None:
            return self._resolve(J, velocity, bounds, qd, curvature)
        k = self.k
        self._J[:k], self._velocity[:k] = J, velocity
        self.objective.gradient(self._gradient)
        U, s, Vt = np.linalg.svd(J)
        Z = Vt[k:]
        big = s > RANK_TOLERANCE * s[0]
        mu = U[:, big] @ ((Vt[: len(s)][big] @ self._gradient) / s[big])
        self._differentiate(mu)
        np.dot(Z, self._slope, out=self._J[k:])
        self._velocity[k:] = -self.objective.gain * (Z @ self._gradient)
        scale = self._resolve(self._J, self._velocity, bounds, qd, curvature)
        velocity[:] = self._velocity[:k]
        return scale

    def _differentiate(self, mu: Vector) -> None:
        """Fill the slope ∂(∇H - Jᵀ μ)/∂q (n, n) at the present configuration."""
        assert self.objective is not None
        assert self._jacobian_at is not None
        robot = self.objective.robot
        q = robot.q.copy()
        gradient, step = np.zeros((2, self.n))
        for i in range(self.n):
            self._slope[:, i] = 0.0
            for sign in (1.0, -1.0):
                step[i] = sign * STEP
                J = self._jacobian_at(robot.integrate(q, step))
                self.objective.gradient(gradient)
                self._slope[:, i] += sign * (gradient - mu @ J)
            step[i] = 0.0
        self._slope /= 2.0 * STEP
        self._jacobian_at(q)
