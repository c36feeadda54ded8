"""What a solver is given: levels of rows, and bounds on the joints."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import ClassVar, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from tp_controller.solvers.inverses import Inverse

Vector = NDArray[np.float64]


AT_BOUND = 1e-9
"""A joint [rad/s, m/s] or a row of unit length this near to its bound is at it."""


class Rows(Protocol):
    """What a solver needs to know of a task."""

    name: str
    k: int
    """Number of its rows."""
    inverse: Inverse
    """How it is inverted, where that differs from the solver's way."""
    weight: float
    """Its share in a weighted sum."""
    set_based: ClassVar[bool]
    """Whether its rows come and go."""
    one_sided: bool
    """Whether its velocities are the least ones allowed, not the ones desired."""


Levels = Sequence[Sequence[Rows]]
"""Tasks by level, highest first."""


class Bounds(NamedTuple):
    """Between what the joints may move in the next step; entries may be infinite."""

    speed: Vector
    """Largest speed of every joint (n,) [rad/s, m/s]."""
    range_lower: Vector
    """Least velocity (n,), at most zero, that leaves time to stop inside the joint's range."""
    range_upper: Vector
    """Largest velocity (n,), at least zero, that leaves time to stop inside the range."""
    soon_lower: Vector
    """Least velocity (n,) that can be had in this very step, all limits together."""
    soon_upper: Vector
    """Largest velocity (n,) that can be had in this very step."""
    ranged: bool = True
    """Whether any joint has a range."""
    change: Vector | None = None
    """By how much velocities may change (n,) from step to step, infinite for joints without such
    a limit; None if no joint has one."""
    before: Vector | None = None
    """Velocities (n,) of the last step, where any joint has such a limit."""
    step: float = math.inf
    """Time [s] of one step."""
    onward: bool = False
    """Whether every joint starts from its last velocity, with such a limit or without."""

    def met(self, qd: Vector) -> NDArray[np.int64]:
        """-1 for joints (n,) whose velocity is at the lower bound of this step, 1 at the upper."""
        upper = (qd >= self.soon_upper - AT_BOUND).astype(np.int64)
        return upper - (qd <= self.soon_lower + AT_BOUND)

    @property
    def start(self) -> Vector | None:
        """Velocities (n,) of the last step, zero for joints without a limit of acceleration.

        In a transition these start from their last velocities, too.
        """
        if self.onward:
            return self.before
        if self.change is None or self.before is None:
            return None
        return np.where(np.isfinite(self.change), self.before, 0.0)

    @classmethod
    def of_speed(cls, speed: Vector) -> Bounds:
        """Bounds of velocity limits (n,) alone."""
        endless = np.full_like(speed, np.inf)
        return cls(speed, -endless, endless, -speed, speed, False)


class Curvature(NamedTuple):
    """What the approach to targets and settling need to know of the rows of all levels (K,).

    See `approach` and `settling`.
    """

    rows: NDArray[np.float64]
    """Of every row (3, K): the error, zero for rows that have none; the part of the desired
    velocity that is no gain term; a bound on the second derivative of the variable by unit joint
    motions."""
    hessians: NDArray[np.float64]
    """Second derivatives (K, n, n) of the variables, as they were filled last."""
    fill: Callable[[], None]
    """Fills in the second derivatives at the present configuration."""

    @classmethod
    def none(cls, n: int) -> Curvature:
        """Nothing known: the published laws alone."""
        return cls(np.zeros((3, 0)), np.zeros((0, n, n)), lambda: None)
