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
    ranged
        Which joints (n,) can have a range; all of them when left out. The values of a range are
        those of these joints: a pose has none.

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
        ranged: Sequence[bool] | NDArray[np.bool_] | None = None,
    ) -> None:
        self.ranged = np.ones(n, dtype=bool) if ranged is None else np.array(ranged, dtype=bool)
        whose = 'one per joint of robot.joints'
        if not self.ranged.all():
            whose = 'one per velocity, those of the base first'
        self.velocity = _positive('velocity', velocity, n, whose)
        self.acceleration = _positive('acceleration', acceleration, n, whose)
        self.position_min = _range('position_min', position_min, self.ranged, -np.inf)
        self.position_max = _range('position_max', position_max, self.ranged, np.inf)
        self._check_ranges()

    def replaced(self, **given: Sequence[float] | None) -> Limits:
        """Copy with the limits that are given in place of these.

        Raises
        ------
        InvalidValue
            As the constructor.
        """
        n, ranged = self.velocity.size, self.ranged
        new = Limits(n, ranged=ranged)
        for key in self.KEYS:
            value = given.get(key)
            other = self if value is None else Limits(n, ranged=ranged, **{key: value})
            setattr(new, key, getattr(other, key))
        new._check_ranges()
        return new

    def part(self, first: int) -> Limits:
        """Limits of the joints from one on, such as those of an arm behind its base."""
        part = Limits(self.velocity.size - first, ranged=self.ranged[first:])
        for key in self.KEYS:
            setattr(part, key, getattr(self, key)[first:])
        return part

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


def _spread(
    key: str,
    values: Sequence[float] | None,
    n: int,
    absent: float,
    whose: str = 'one per joint of robot.joints',
) -> Vector:
    """Limit per joint (n,) from one value, n values or none; read-only."""
    if values is None:
        limit = np.full(n, absent)
    else:
        limit = np.array(values, dtype=float).reshape(-1)
        if limit.size not in (1, n):
            accepts = '1 value' if n == 1 else f'1 value or {n}, {whose}'
            raise InvalidValue(
                f'robot.limits.{key}', f'{limit.size} values {shown(limit)}', accepts
            )
        if not np.all(np.isfinite(limit)):
            raise InvalidValue(f'robot.limits.{key}', shown(limit), 'finite numbers')
        limit = np.broadcast_to(limit, (n,)).copy()
    limit.flags.writeable = False
    return limit


def _range(
    key: str, values: Sequence[float] | None, ranged: NDArray[np.bool_], absent: float
) -> Vector:
    """As `_spread`, for the ends of ranges: of joints that have none it is absent."""
    if ranged.all():
        return _spread(key, values, ranged.size, absent)
    limit = np.full(ranged.size, absent)
    limit[ranged] = _spread(key, values, int(np.count_nonzero(ranged)), absent)
    limit.flags.writeable = False
    return limit


def _positive(key: str, values: Sequence[float] | None, n: int, whose: str) -> Vector:
    """As `_spread`, for a limit on a magnitude."""
    limit = _spread(key, values, n, np.inf, whose)
    if not np.all(limit > 0.0):
        raise InvalidValue(f'robot.limits.{key}', shown(limit), 'numbers above 0')
    return limit
