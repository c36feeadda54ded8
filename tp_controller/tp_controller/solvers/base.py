"""The interface of every solver."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tp_controller.errors import InvalidValue

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]


class Equations(NamedTuple):
    """What one level asks for: ``J qd = velocity``."""

    J: Matrix
    """Task Jacobian (k, n)."""
    velocity: Vector
    """Desired task velocity (k,)."""


class Solver(ABC):
    """Resolves levels of task velocities into one joint velocity.

    Parameters
    ----------
    n
        Number of joints.
    damping
        λ of the damped least squares, in the units of the Jacobian's singular values.
    """

    type: ClassVar[str]
    """Name of the solver in parameter files."""

    def __init__(self, n: int, damping: float = 0.0) -> None:
        self.n = n
        self.damping = damping

    @property
    def damping(self) -> float:
        """λ of the damped least squares, at least 0."""
        return self._damping

    @damping.setter
    def damping(self, value: float) -> None:
        if not (math.isfinite(value) and value >= 0.0):
            raise InvalidValue('solver.damping', repr(value), 'a finite number of at least 0')
        self._damping = float(value)

    @abstractmethod
    def solve(self, levels: Sequence[Equations], qd: Vector) -> None:
        """Write the joint velocity (n,) that answers the levels, highest first, to ``qd``.

        Raises
        ------
        numpy.linalg.LinAlgError
            If a Jacobian is not finite or leaves the range of floats.
        """
