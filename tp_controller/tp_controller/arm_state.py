"""What is known of an arm that carries commands out, one value a joint and kind."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]

Z, P, V, V_HIGH, V_LOW, PARTED, FASTEST, Q, CANDIDATE = range(9)
"""Rows of `ArmState.rows`, in the order of its other fields."""


class ArmState(NamedTuple):
    """Views of one array, so that compiled functions get one argument."""

    rows: Matrix
    """All of it (9, n)."""
    z: Vector
    """Reference positions (n,) [rad, m]: where the arm gets to with what was sent until now."""
    p: Vector
    """Positions (n,) of the model."""
    v: Vector
    """Velocities (n,) of the model [rad/s, m/s]."""
    v_high: Vector
    """Upper bound (n,) on the velocities."""
    v_low: Vector
    """Lower bound (n,) on the velocities."""
    parted: Vector
    """By how much the arm has parted from the model of late (n,)."""
    fastest: Vector
    """A falling maximum (n,) of the commanded speed."""
    q: Vector
    """Positions (n,) that were measured last."""
    candidate: Vector
    """Measured positions (n,) that are not believed yet."""

    @classmethod
    def zero(cls, n: int) -> ArmState:
        """Return the state of n joints at zero that stand still."""
        rows = np.zeros((len(cls._fields) - 1, n))
        return cls(rows, *rows)
