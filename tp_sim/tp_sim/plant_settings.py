"""What a simulated arm is like: delay, lag, imperfect measurements, losses."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tp_controller.errors import InvalidValue, plural, shown

Vector = NDArray[np.float64]
Values = float | Sequence[float] | Vector
"""One value for all joints or one per joint (n,)."""

LONGEST_DELAY = 1000
"""Delay [steps] that may be asked for."""


class PlantSettings(NamedTuple):
    """What a simulated arm is like; the defaults are the ideal one."""

    delay: int = 0
    """A command acts so many whole steps after the one that it was given in."""
    lag: Values = 0.0
    """Time constant [s] with which the velocity follows the command."""
    noise: Values = 0.0
    """Amplitude of the noise in measured positions [rad, m], a bound; see `Plant.measured`."""
    scale: Values = 1.0
    """Measured positions and velocities are the true ones times this."""
    quantum: Values = 0.0
    """Step [rad, m] that measured positions are rounded to."""
    command_loss: float = 0.0
    """Probability that a command does not arrive."""
    state_loss: float = 0.0
    """Probability that the state after a step does not arrive."""
    seed: int = 0
    """Of the noise and the losses."""

    def check(self) -> None:
        """Check what can be checked without knowing the number of joints.

        Raises
        ------
        InvalidValue
            For a delay or seed that is not a whole number, or a loss outside 0 to 1.
        """
        _check_whole('plant.delay', self.delay, LONGEST_DELAY)
        _check_whole('plant.seed', self.seed)
        for key in ('command_loss', 'state_loss'):
            value = getattr(self, key)
            if not 0.0 <= value <= 1.0:
                raise InvalidValue(f'plant.{key}', shown(value), 'a number from 0 to 1')

    def spread(self, key: str, n: int) -> Vector:
        """Values (n,) of one or as many numbers; a copy.

        Raises
        ------
        InvalidValue
            For another number of them, or one that is not finite or negative.
        """
        given = getattr(self, key)
        values = np.array(given, dtype=float).reshape(-1)
        if values.size not in (1, n):
            accepts = '1 value' if n == 1 else f'1 value or {n}, one per joint'
            raise InvalidValue(f'plant.{key}', plural(values.size, 'value'), accepts)
        if not np.all(np.isfinite(values)) or np.any(values < 0.0):
            raise InvalidValue(f'plant.{key}', shown(given), 'finite numbers of at least 0')
        return np.broadcast_to(values, (n,)).copy()


def _check_whole(key: str, value: float, most: int | None = None) -> None:
    number = not isinstance(value, bool) and math.isfinite(value) and value == int(value)
    if not number or value < 0 or (most is not None and value > most):
        accepts = 'a whole number of at least 0' if most is None else f'a whole number to {most}'
        raise InvalidValue(key, shown(value), accepts)
