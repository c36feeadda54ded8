"""Recursive task priority inside the joints' bounds."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tp_controller.solvers.hqp import HQPSolver
from tp_controller.solvers.problem import Bounds

Vector = NDArray[np.float64]


class StrictSolver(HQPSolver):
    """The recursion with ``saturation: null_space``: every limit is part of the resolution.

    The recursion of `RecursiveSolver` keeps the velocity limits: a joint that meets its limit is
    held there, others make up for it, and a level of which only a part can be had is scaled, so
    that its direction is kept (Flacco, De Luca and Khatib 2015). Where its answer breaks another
    bound, of acceleration, of range or of a one-sided row, the levels ask for what it gave them,
    and compete for it inside all bounds as under `HQPSolver`. A lower level never changes what
    a higher one gets.
    """

    type = 'recursive'

    def _speed_limit(self, bounds: Bounds) -> Vector:
        """Speeds (n,) that the recursion keeps by scaling levels."""
        return bounds.speed
