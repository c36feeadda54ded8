"""Recursive task priority."""

from __future__ import annotations

from tp_controller.solvers.base import Solver
from tp_controller.solvers.problem import Levels


class RecursiveSolver(Solver):
    """The recursion of Siciliano and Slotine (1991), damped.

    From ``P = I`` and ``qd = 0``, for every level::

        J_bar = J P
        qd += J_barᵀ (J_bar J_barᵀ + λ² I)⁻¹ (velocity - J qd)
        P -= J_bar⁺ J_bar

    with the inverse that is chosen in the second line. The pseudo-inverse in the projector
    is undamped and counts the rank, so that a level's damping is not passed on to the levels
    above it. ``P = N Nᵀ`` is kept as the orthonormal basis ``N`` of the remaining freedom: a
    lower level then moves inside it to the last bit, however badly conditioned its own
    Jacobian is, and the matrices shrink from level to level.
    """

    type = 'recursive'
    settles = True
    one_by_one = True
    compiled = True

    def arrange(self, levels: Levels) -> Levels:
        """Groups of tasks that are inverted together: every level by itself."""
        return levels
