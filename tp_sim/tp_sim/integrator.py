"""Kinematic integration of joint velocities; no ROS is imported here."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from tp_controller.errors import InvalidValue, listed, plural, shown
from tp_controller.robot import Limits, Space

Vector = NDArray[np.float64]


class Integrator:
    """Joints that follow velocity commands at once, as far as their limits let them.

    Parameters
    ----------
    q
        Initial configuration (nq,) [rad, m].
    limits
        Velocity and position limits of the n velocities.
    space
        Configuration space; absent means that every joint has one position.

    Raises
    ------
    InvalidValue
        If the initial positions are not finite numbers inside the position limits.
    """

    servo_lag = 0.0
    stiffness = 1.0

    def __init__(
        self, q: Sequence[float] | Vector, limits: Limits, space: Space | None = None
    ) -> None:
        self.limits = limits
        self.space = space_of(limits, space)
        self._initial = self.check(q)
        self._q = self._initial.copy()
        self._qd = np.zeros(limits.velocity.size)

    @property
    def q(self) -> Vector:
        """Configuration (nq,) [rad, m]; a copy."""
        return self._q.copy()

    @property
    def qd(self) -> Vector:
        """Velocities (n,) [rad/s, m/s] of the last step as carried out; a copy."""
        return self._qd.copy()

    def check(self, q: Sequence[float] | Vector, key: str = 'initial_positions') -> Vector:
        """Copy of a configuration (nq,) that the joints can have; its quaternion of length 1.

        Parameters
        ----------
        q
            The configuration [rad, m].
        key
            What they are, for the message.

        Raises
        ------
        InvalidValue
            If they are not finite or outside the position limits.
        """
        q = np.array(q, dtype=float)
        lower, upper = self.limits.position_min, self.limits.position_max
        space = self.space
        if q.shape != (space.nq,):
            whose = f'those of {listed(space.coordinates)}' if space.blocks else 'one per joint'
            raise InvalidValue(key, plural(q.size, 'value'), f'{space.nq}, {whose}')
        if not np.all(np.isfinite(q)):
            raise InvalidValue(key, shown(q), 'finite numbers')
        positions = space.positions(q)
        if not np.isfinite(space.chart(space.neutral, q)).all():
            raise InvalidValue(key, shown(q), 'a quaternion that is not zero')
        if np.any(positions < lower) or np.any(positions > upper):
            raise InvalidValue(
                key,
                shown(q),
                f'positions from {shown(lower)} to {shown(upper)}',
            )
        return q

    def reset(self, q: Sequence[float] | Vector | None = None) -> None:
        """Stand still at a configuration (nq,), at the initial one when none are given.

        Raises
        ------
        InvalidValue
            As `check`; the joints stay where they are then.
        """
        self._q = self._initial.copy() if q is None else self.check(q, 'reset')
        self._qd[:] = 0.0

    def step(self, qd: Vector, dt: float) -> None:
        """Move for ``dt`` [s] at velocities (n,), every joint held to its limits."""
        before = self.space.positions(self._q)
        speed = np.clip(qd, -self.limits.velocity, self.limits.velocity)
        after = before + dt * speed
        held = np.clip(after, self.limits.position_min, self.limits.position_max)
        # A joint that met no end keeps its exact speed, free of rounding.
        stopped = held != after
        self._qd = np.where(stopped, (held - before) / dt, speed)
        self._q = self.space.point(self._q, held)


def space_of(limits: Limits, space: Space | None) -> Space:
    """Space of joints with these limits: that which is given, or one position per joint."""
    if space is not None:
        return space
    return Space([f'joint_{i + 1}' for i in range(limits.velocity.size)])
