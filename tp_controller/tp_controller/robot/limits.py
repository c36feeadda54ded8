"""Joint limits."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from tp_controller.errors import NO_VALUE, InvalidValue, listed, shown

Vector = NDArray[np.float64]


class Limits:
    """Limits of n joints; a limit that is not given is infinite.

    Each limit is one value for all joints or one per joint, in joint order.

    Parameters
    ----------
    n
        Number of joints.
    velocity
        Largest speed [rad/s, m/s], above zero.
    position_min, position_max
        Range [rad, m].
    acceleration
        Largest acceleration [rad/s², m/s²], above zero.

    Raises
    ------
    InvalidValue
        For a wrong number of values, a value that is not finite, a speed or acceleration
        that is not above zero, or an empty position range.
    """

    KEYS = ('velocity', 'position_min', 'position_max', 'acceleration')

    def __init__(
        self,
        n: int,
        velocity: Sequence[float] | None = None,
        position_min: Sequence[float] | None = None,
        position_max: Sequence[float] | None = None,
        acceleration: Sequence[float] | None = None,
    ) -> None:
        self.velocity = _positive('velocity', velocity, n)
        self.acceleration = _positive('acceleration', acceleration, n)
        self.position_min = _spread('position_min', position_min, n, -np.inf)
        self.position_max = _spread('position_max', position_max, n, np.inf)
        self._check_ranges()

    def replaced(self, **given: Sequence[float] | None) -> Limits:
        """Copy with the limits that are given in place of these.

        Raises
        ------
        InvalidValue
            As the constructor.
        """
        n = self.velocity.size
        new = Limits(n)
        for key in self.KEYS:
            other = Limits(n, **{key: given.get(key)}) if given.get(key) is not None else self
            setattr(new, key, getattr(other, key))
        new._check_ranges()
        return new

    def check_period(self, joints: Sequence[str], period: float) -> None:
        """Check that the ranges can be kept: that takes steps of a known time.

        Parameters
        ----------
        joints
            Names of the joints (n,).
        period
            Time [s] of one step; infinite if unknown.

        Raises
        ------
        InvalidValue
            For a range without a period.
        """
        if math.isfinite(period):
            return
        ends = np.isfinite(self.position_min) | np.isfinite(self.position_max)
        if ends.any():
            named = listed(joint for joint, kept in zip(joints, ends, strict=True) if kept)
            raise InvalidValue(
                'rate', NO_VALUE, f'joint states per second, to keep the ranges of {named}'
            )

    def _check_ranges(self) -> None:
        if not np.all(self.position_min < self.position_max):
            raise InvalidValue(
                'robot.limits.position_min',
                f'{shown(self.position_min)} with position_max {shown(self.position_max)}',
                'values below position_max for every joint',
            )


def _spread(key: str, values: Sequence[float] | None, n: int, absent: float) -> Vector:
    """Limit per joint (n,) from one value, n values or none; read-only."""
    if values is None:
        limit = np.full(n, absent)
    else:
        limit = np.array(values, dtype=float).reshape(-1)
        if limit.size not in (1, n):
            accepts = '1 value' if n == 1 else f'1 value or {n}, one per joint of robot.joints'
            raise InvalidValue(
                f'robot.limits.{key}', f'{limit.size} values {shown(limit)}', accepts
            )
        if not np.all(np.isfinite(limit)):
            raise InvalidValue(f'robot.limits.{key}', shown(limit), 'finite numbers')
        limit = np.broadcast_to(limit, (n,)).copy()
    limit.flags.writeable = False
    return limit


def _positive(key: str, values: Sequence[float] | None, n: int) -> Vector:
    """As `_spread`, for a limit on a magnitude."""
    limit = _spread(key, values, n, np.inf)
    if not np.all(limit > 0.0):
        raise InvalidValue(f'robot.limits.{key}', shown(limit), 'numbers above 0')
    return limit
