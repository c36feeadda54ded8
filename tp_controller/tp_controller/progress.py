"""Whether errors come within their tolerances, stay away, or how long it still takes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from tp_controller.errors import InvalidValue, shown

Vector = NDArray[np.float64]

STEADY = 0.1
"""Time [s] for which all errors have to be within tolerance."""
AT_REST = 1.0
"""Time [s] at rest without progress after which errors are stuck,"""
PATIENCE = 10.0
"""and without progress, whether the arm moves or not."""
SHARE = 0.01
"""An error makes progress that becomes smaller by this share of itself, or by"""
SHARE_OF_TOLERANCE = 0.1
"""this share of its tolerance, whichever is less."""
WINDOW = 0.2
"""Time [s] over which the rate of an error is taken."""
LONGEST = 600.0
"""Estimates [s] above this one are infinite."""
LEAST = 1e-12
"""Errors [m, rad] below this one count as this one."""
FREE = 0.9
"""Errors that shrink at this share of what the gain asks for are not held up by limits."""


class Verdict(Enum):
    """What has become of the errors."""

    REACHED = 'reached'
    STUCK = 'stuck'
    TIMED_OUT = 'timed out'


class Progress:
    """Watches the errors of some tasks, one call of `see` for each joint state.

    Parameters
    ----------
    tolerances
        Largest error norm (m,) of each task that counts as reached [m, rad].
    time_limit
        Time [s] after which it is given up; infinite for none.

    Raises
    ------
    InvalidValue
        For a tolerance that is not above 0, or a negative time limit.

    Attributes
    ----------
    time
        Time [s] so far.
    errors
        Error norms (m,) of the last call; NaN before the first one.
    """

    def __init__(self, tolerances: Sequence[float], time_limit: float = math.inf) -> None:
        for tolerance in tolerances:
            if not 0.0 < tolerance < math.inf:
                raise InvalidValue('tolerance', shown(tolerance), 'a finite number above 0')
        if not time_limit > 0.0:
            raise InvalidValue('time_limit', shown(time_limit), 'a number above 0')
        self._tolerances = np.array(tolerances)
        self._time_limit = time_limit
        self.time = 0.0
        self.errors = np.full(len(tolerances), np.nan)
        self._best = np.full(len(tolerances), np.inf)
        self._within_since = math.nan
        self._moved = self._improved = 0.0
        self._before: tuple[float, Vector] | None = None
        self._rates, self._decays = np.zeros((2, len(tolerances)))

    @property
    def tolerances(self) -> list[float]:
        """Largest error norm of each task that counts as reached [m, rad]."""
        return [float(tolerance) for tolerance in self._tolerances]

    @property
    def pending(self) -> NDArray[np.bool_]:
        """Which tasks (m,) are not within tolerance."""
        return ~(self.errors <= self._tolerances)

    def see(self, seconds: float, errors: Vector, moving: bool) -> Verdict | None:
        """Take note of the errors at a joint state.

        Parameters
        ----------
        seconds
            Time [s] since the last call.
        errors
            Error norms (m,) [m, rad].
        moving
            Whether the arm is not at rest.

        Returns
        -------
        Verdict or None
            None while it goes on.
        """
        self.time += seconds
        self.errors[:] = errors
        if moving:
            self._moved = self.time
        least = np.minimum(SHARE * self._best, SHARE_OF_TOLERANCE * self._tolerances)
        better = self.pending & ~(errors > self._best - np.minimum(least, self._best))
        if better.any():
            self._best[better] = errors[better]
            self._improved = self.time
        self._follow_rates()
        if not self.pending.any():
            if math.isnan(self._within_since):
                self._within_since = self.time
            if self.time - self._within_since >= STEADY:
                return Verdict.REACHED
        else:
            self._within_since = math.nan
            waited = self.time - self._improved
            if waited >= PATIENCE or min(waited, self.time - self._moved) >= AT_REST:
                return Verdict.STUCK
        return Verdict.TIMED_OUT if self.time >= self._time_limit else None

    def wait(self, seconds: float, errors: Vector) -> Verdict | None:
        """Let time [s] pass in which no progress is asked for; the arguments are as for `see`."""
        self.time += seconds
        self.errors[:] = errors
        self.restart()
        return Verdict.TIMED_OUT if self.time >= self._time_limit else None

    def restart(self) -> None:
        """Judge progress from now on."""
        self._best[:] = np.inf
        self._within_since = math.nan
        self._moved = self._improved = self.time
        self._before = None

    def time_left(self, gains: Vector) -> float:
        """Estimate of the time [s] until all errors are within tolerance.

        While limits hold a task up, its error shrinks as fast as of late; as soon as the gain
        asks for less than that, exponentially.

        Parameters
        ----------
        gains
            Gain (m,) [1/s] of each task.

        Returns
        -------
        float
            Infinite while an error does not shrink.
        """
        longest = 0.0
        found = (self.errors, self._tolerances, self._rates, self._decays, gains)
        for error, tolerance, rate, decay, gain in zip(*found, strict=True):
            if error <= tolerance:
                continue
            if rate * LONGEST <= error:
                return math.inf
            if decay >= FREE * gain:
                left = math.log(error / tolerance) / decay
            else:
                # From this error on the gain asks for less than the limits allow.
                bend = max(rate / gain, tolerance)
                left = (error - bend) / rate + math.log(bend / tolerance) / gain
            longest = max(longest, float(left))
        return longest

    def _follow_rates(self) -> None:
        if self._before is None:
            self._before = (self.time, self.errors.copy())
            return
        passed = self.time - self._before[0]
        if passed >= WINDOW:
            before, after = self._before[1], np.maximum(self.errors, LEAST)
            self._rates = (before - after) / passed
            self._decays = np.log(np.maximum(before, LEAST) / after) / passed
            self._before = (self.time, self.errors.copy())
