"""Kinematic integration of joint velocities; no ROS is imported here."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from tp_controller.errors import InvalidValue, plural, shown
from tp_controller.robot import Limits

Vector = NDArray[np.float64]


class Integrator:
    """Joints that follow velocity commands at once, as far as their limits let them.

    Parameters
    ----------
    q
        Initial positions (n,) [rad, m].
    limits
        Velocity and position limits of the n joints.

    Raises
    ------
    InvalidValue
        If the initial positions are not finite numbers inside the position limits.
    """

    def __init__(self, q: Sequence[float] | Vector, limits: Limits) -> None:
        self.limits = limits
        self._initial = self.check(q)
        self._q = self._initial.copy()
        self._qd = np.zeros_like(self._q)

    @property
    def q(self) -> Vector:
        """Positions (n,) [rad, m]; a copy."""
        return self._q.copy()

    @property
    def qd(self) -> Vector:
        """Velocities (n,) [rad/s, m/s] of the last step as carried out; a copy."""
        return self._qd.copy()

    def check(self, q: Sequence[float] | Vector, key: str = 'initial_positions') -> Vector:
        """Copy of positions (n,) that the joints can have.

        Parameters
        ----------
        q
            The positions [rad, m].
        key
            What they are, for the message.

        Raises
        ------
        InvalidValue
            If they are not finite or outside the position limits.
        """
        q = np.array(q, dtype=float)
        lower, upper = self.limits.position_min, self.limits.position_max
        if q.shape != lower.shape:
            raise InvalidValue(key, plural(q.size, 'value'), f'{lower.size}, one per joint')
        if not np.all(np.isfinite(q)):
            raise InvalidValue(key, shown(q), 'finite numbers')
        if np.any(q < lower) or np.any(q > upper):
            raise InvalidValue(
                key,
                shown(q),
                f'positions from {shown(lower)} to {shown(upper)}',
            )
        return q

    def reset(self, q: Sequence[float] | Vector | None = None) -> None:
        """Stand still at positions (n,), at the initial ones when none are given.

        Raises
        ------
        InvalidValue
            As `check`; the joints stay where they are then.
        """
        self._q = self._initial.copy() if q is None else self.check(q, 'reset')
        self._qd[:] = 0.0

    def step(self, qd: Vector, dt: float) -> None:
        """Move for ``dt`` [s] at velocities (n,), every joint held to its limits."""
        before = self._q
        speed = np.clip(qd, -self.limits.velocity, self.limits.velocity)
        self._q = np.clip(before + dt * speed, self.limits.position_min, self.limits.position_max)
        # A joint that met no end keeps its exact speed, free of rounding.
        stopped = self._q != before + dt * speed
        self._qd = np.where(stopped, (self._q - before) / dt, speed)
