"""What a solver notes of an answer, for explanations."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]


class Findings(NamedTuple):
    """How an answer came about, level by level; arrays of its own."""

    metric: Matrix
    """T (n, n) with ``qd = T y``, where the norm of y is made small."""
    rules: Matrix
    """λ and ε of every level (levels, 2), see `Inverse.rule`."""
    shares: Vector
    """What joints at their bounds left to every level (levels,), from 0 to 1."""
    stops: NDArray[np.int64]
    """First level that each joint's bound stopped (n,), -1 if none."""
    held: NDArray[np.bool_]
    """Which joints were stopped at the end of their range (n,)."""
    acting: NDArray[np.bool_]
    """Which inequality rows decided on the answer (K,), the rows of all levels one after the
    other; False for equality rows."""
    scale: float
    """What uniform scaling left of the answer, 1 without it."""
