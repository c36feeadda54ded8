"""The gradient of an objective in the freedom that the tasks leave."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from tp_controller.errors import NO_VALUE, InvalidValue, listed
from tp_controller.objectives import OBJECTIVE_TYPES, Objective
from tp_controller.solvers.base import SATURATIONS
from tp_controller.solvers.inverses import DEFAULT, Inverse
from tp_controller.solvers.problem import Bounds, Curvature, Levels
from tp_controller.solvers.recursive import RecursiveSolver

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]


class ProjectedGradientSolver(RecursiveSolver):
    """The levels as in `RecursiveSolver`, then ``qd += P κ ∇H`` (Liégeois 1977).

    ``P`` projects on what all levels leave free, κ is the objective's gain. With one level
    this is the classical ``qd = J† v + (I - J⁺ J) κ ∇H``. With joint weights W the projection
    is orthogonal in their metric, ``P = N Nᵀ W``: of all answers it is the one nearest to
    ``κ ∇H`` by ``(qd - κ ∇H)ᵀ W (qd - κ ∇H)``.
    """

    type = 'projected_gradient'

    def __init__(
        self,
        n: int,
        inverse: Inverse = DEFAULT,
        joint_weights: Sequence[float] | None = None,
        objective: Objective | None = None,
        saturation: str = SATURATIONS[0],
    ) -> None:
        if objective is None:
            raise InvalidValue(
                'solver.objective.type', NO_VALUE, f'one of {listed(OBJECTIVE_TYPES)}'
            )
        super().__init__(n, inverse, joint_weights, objective, saturation)

    def prepare(
        self, levels: Levels, jacobian_at: Callable[[Vector], Matrix] | None = None
    ) -> None:
        """Get ready for levels; see `Solver.prepare`."""
        super().prepare(levels, jacobian_at)
        # The gradient is a last level, seen in coordinates Lᵀ qd where the metric is plain.
        self._Lt = np.ascontiguousarray(np.linalg.inv(self._basis).T)
        self._J = np.vstack([np.zeros((self.k, self.n)), self._Lt])
        self._velocity, self._gradient = np.zeros(self.k + self.n), np.zeros(self.n)
        self._starts = np.append(self._starts, self.k + self.n)

    def _set_rules(self) -> None:
        super()._set_rules()
        self._rules = np.vstack([self._rules, [0.0, 1.0]])

    def solve(
        self,
        J: Matrix,
        velocity: Vector,
        bounds: Bounds,
        qd: Vector,
        curvature: Curvature | None = None,
    ) -> float:
        """Write the joint velocity (n,) to ``qd``; see `Solver.solve`."""
        self._J[: self.k] = J
        self._velocity[: self.k] = velocity
        assert self.objective is not None
        self.objective.climb(self._gradient)
        np.dot(self._Lt, self._gradient, out=self._velocity[self.k :])
        scale = self._resolve(self._J, self._velocity, bounds, qd, curvature)
        velocity[:] = self._velocity[: self.k]
        return scale
