"""What an arm makes of its commands: delay, lag, noise and commands that it holds."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tp_controller.errors import InvalidValue, shown

Vector = NDArray[np.float64]

KEYS = ('delay', 'lag', 'noise', 'hold')
"""Parameters ``robot.…`` that describe an arm's response."""


class Response(NamedTuple):
    """What an arm makes of its commands; without anything it carries each out exactly."""

    delay: Vector
    """Time (n,) [s] from the state that a command answers to when it acts."""
    lag: Vector
    """Time constants (n,) [s] with which the velocities follow the acting command."""
    noise: Vector
    """Amplitudes (n,) [rad, m]: measured positions are wrong by no more."""
    hold: float
    """Time [s] for which the arm may go on with a command after the next one was due."""

    @classmethod
    def of(
        cls,
        n: int,
        delay: Sequence[float] | None = None,
        lag: Sequence[float] | None = None,
        noise: Sequence[float] | None = None,
        hold: float = 0.0,
    ) -> Response:
        """Response of n joints from one value for all or one per joint; nothing is zero.

        Raises
        ------
        InvalidValue
            For a wrong number of values, or one that is negative or not finite.
        """
        if not 0.0 <= hold < math.inf:
            raise InvalidValue('robot.hold', shown(hold), 'a number of at least 0')
        return cls(
            _spread('delay', delay, n), _spread('lag', lag, n), _spread('noise', noise, n), hold
        )

    @property
    def ideal(self) -> bool:
        """Whether every command is carried out at once, and every position exact."""
        return not (self.delay.any() or self.lag.any() or self.noise.any() or self.hold)

    @property
    def exact(self) -> bool:
        """Whether positions that are measured are those that the next command starts from."""
        return not (self.delay.any() or self.lag.any() or self.noise.any())

    @property
    def late(self) -> float:
        """Longest time [s] for which the arm may not do what was commanded last."""
        return float(np.max(self.delay + self.lag)) + self.hold


def _spread(key: str, values: Sequence[float] | None, n: int) -> Vector:
    found = np.array((0.0,) if values is None else values, dtype=float).reshape(-1)
    if found.size not in (1, n):
        accepts = '1 value' if n == 1 else f'1 value or {n}, one per joint of robot.joints'
        raise InvalidValue(f'robot.{key}', f'{found.size} values {shown(found)}', accepts)
    if not np.all(np.isfinite(found)) or np.any(found < 0.0):
        raise InvalidValue(f'robot.{key}', shown(found), 'finite numbers of at least 0')
    found = np.broadcast_to(found, (n,)).copy()
    found.flags.writeable = False
    return found
