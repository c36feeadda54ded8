"""Recursive task priority by damped least squares in successive null spaces."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from tp_controller.solvers.base import Equations, Solver

Vector = NDArray[np.float64]

RANK_TOLERANCE = 1e-8
"""Singular values below this share of ‖J‖ (Frobenius) do not count towards the rank."""


class RecursiveSolver(Solver):
    """The recursion of Siciliano and Slotine (1991), damped.

    From ``P = I`` and ``qd = 0``, for every level::

        J_bar = J P
        qd += J_barᵀ (J_bar J_barᵀ + λ² I)⁻¹ (velocity - J qd)
        P -= J_bar⁺ J_bar

    The pseudo-inverse in the projector is undamped and counts the rank, so that a level's
    damping is not passed on to the levels above it. ``P = N Nᵀ`` is kept as the
    orthonormal basis ``N`` of the remaining freedom: a lower level then moves inside it to
    the last bit, however badly conditioned its own Jacobian is, and the matrices shrink
    from level to level.
    """

    type = 'recursive'

    def solve(self, levels: Sequence[Equations], qd: Vector) -> None:
        """Write the joint velocity (n,) that answers the levels, highest first, to ``qd``."""
        qd[:] = 0.0
        square = self.damping * self.damping
        N = None
        for J, velocity in levels:
            size = math.sqrt(np.vdot(J, J))
            if not size < math.inf:
                raise np.linalg.LinAlgError('a Jacobian beyond the range of floats')
            J_bar = J if N is None else J @ N
            U, s, Vt = np.linalg.svd(J_bar)
            rank = int(np.count_nonzero(s > RANK_TOLERANCE * size))
            # Directions outside the rank stay out: damping near 0 would amplify rounding.
            s = s[:rank]
            residual = velocity - J @ qd if N is not None else velocity
            step = (s / (s * s + square) * (residual @ U[:, :rank])) @ Vt[:rank]
            qd += step if N is None else N @ step
            if rank == Vt.shape[0]:
                return
            N = Vt[rank:].T if N is None else N @ Vt[rank:].T
