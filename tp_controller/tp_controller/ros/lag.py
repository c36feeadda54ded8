"""How old a message is by a clock that is not ours, which may be wrong, drift or be set."""

from __future__ import annotations

import math

WINDOW = 10.0
"""Time [s] over which the least lag of a clock is sought: longer than clocks drift apart."""
SHIFT = 1.0
"""States that are old for so long [s], and all by the same time, come from a clock set back."""
AGREE = 0.005
"""Stamps run like the steady clock if their least lag changes by less [s] in `SHIFT`."""


class Lag:
    """Age of what carries the time of another clock, from the least lag seen.

    Parameters
    ----------
    limit
        Lags [s] that differ by less come from one clock; more is old, or a clock that was set.
    expected
        Lag [s] if both clocks agree, which the first one is compared with; infinite if unknown.

    Attributes
    ----------
    steady
        Whether the other clock runs like the steady one.
    set_back
        By how much [s] the other clock was found set back at the last call, else 0. If it was
        behind from the start, by how much.
    """

    def __init__(self, limit: float, expected: float = math.inf) -> None:
        self._limit, self._expected = limit, expected
        self._least = self._before = math.inf
        self._window_end = -math.inf
        self.steady = False
        self.set_back = 0.0
        self._second = _Run()
        self._second_least = math.nan
        self._matches = 0
        self._last = -math.inf
        self._old = _Run()

    def age(self, sent: float, now: float, stands: bool = False) -> float:
        """Age [s] of what was sent at a time of the other clock and came at a steady time.

        A time that ``stands``, being that of the call before, does not tell how its clock runs.
        """
        lag = now - sent
        if not stands:
            self._compare(lag, now)
        self.set_back = 0.0
        if now >= self._window_end:
            self._before, self._least = self._least, math.inf
            self._window_end = now + WINDOW
        least = min(self._before, self._least)
        if least == math.inf and lag > self._expected + self._limit:
            # What comes first may have waited long.
            least = self._expected
        age = lag - min(least, lag)
        if age <= self._limit:
            self._old = _Run()
        else:
            age = self._judge_old(lag, now, age)
        if age <= self._limit:
            self._least = min(self._least, lag)
        return age

    def _judge_old(self, lag: float, now: float, age: float) -> float:
        """Age [s], zero if the clock was set back: all lags are alike for a while."""
        long = self._old.add(lag, now) >= SHIFT
        if self._old.spread >= self._limit:
            self._old = _Run()
            self._old.add(lag, now)
        elif long:
            self.set_back, age = age, 0.0
            self._before = math.inf
            self._least = self._old.least
            self._old = _Run()
        return age

    def _compare(self, lag: float, now: float) -> None:
        """Find whether the clocks run alike: two seconds in a row with the same least lag."""
        if now - self._last > self._limit:
            self._second = _Run()
        self._last = now
        if self._second.add(lag, now) < SHIFT:
            return
        matches = abs(self._second.least - self._second_least) < AGREE
        self._matches = self._matches + 1 if matches else 0
        self.steady = self._matches >= 2
        self._second_least = self._second.least
        self._second = _Run()


class _Run:
    """Lags in a row."""

    def __init__(self) -> None:
        self._begin = math.nan
        self.least, self._most = math.inf, -math.inf

    @property
    def spread(self) -> float:
        """Largest less least lag [s]."""
        return self._most - self.least

    def add(self, lag: float, now: float) -> float:
        """Add a lag; return how long [s] the run is."""
        if self.least == math.inf:
            self._begin = now
        self.least, self._most = min(self.least, lag), max(self._most, lag)
        return now - self._begin
