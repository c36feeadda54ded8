"""Late cycles: how many, how old their commands were, and what held them up."""

from __future__ import annotations

import math
import time

TOLERATED = 0.02
"""Age [s] that a command may have at any rate before it is warned of; two periods if longer."""
OFTEN = 10
"""So many late cycles in a hundred are warned of, however late they are."""
SECOND = 0.5
"""The largest age is that of one to two times so long [s]."""


class Lateness:
    """Counts cycles whose command was sent later than one period after their joint state.

    Parameters
    ----------
    period
        Time [s] between joint states; infinite if unknown: nothing is late then.

    Attributes
    ----------
    overruns
        Late cycles so far.
    age
        Age [s] of the last command when it was sent.
    limit
        Age [s] that is warned of.
    """

    def __init__(self, period: float) -> None:
        self.period = period
        self.limit = max(2.0 * period, TOLERATED) if math.isfinite(period) else math.inf
        self.overruns = 0
        self.age = 0.0
        self._largest = self._before = 0.0
        self._turn = -math.inf
        self._recent = self._late = 0
        self._busy = self._begin = self._begin_busy = 0.0

    @property
    def largest(self) -> float:
        """Largest age [s] of the last half to whole second."""
        return max(self._largest, self._before)

    @property
    def on_time(self) -> bool:
        """Whether the last command was not late."""
        return self.age <= self.period

    def begin(self) -> None:
        """Take note that a cycle begins."""
        self._begin, self._begin_busy = time.monotonic(), time.thread_time()

    def end(self, age: float, taken: float, counts: bool = True) -> str:
        """Take note that the command was sent.

        Parameters
        ----------
        age
            Age [s] of the joint state when it was taken.
        taken
            When that was, steady [s].
        counts
            Whether it can be late; the first one after a rest cannot.

        Returns
        -------
        str
            What to warn of; empty if nothing.
        """
        now, busy = time.monotonic(), time.thread_time()
        other, self._busy = self._begin_busy - self._busy, busy
        self.age = age + now - taken
        if now >= self._turn:
            self._before, self._largest = self._largest, 0.0
            self._turn = now + SECOND
        self._largest = max(self._largest, self.age)
        late = counts and self.age > self.period
        self.overruns += late
        self._late += late
        self._recent += 1
        often = self._late >= OFTEN
        if self._recent >= 100 or often:
            self._recent = self._late = 0
        if not late or not (often or self.age > self.limit):
            return ''
        cause = self._cause(now - self._begin, busy - self._begin_busy, other)
        return (
            f'command {1e3 * self.age:.3g} ms after its joint state, period is '
            f'{1e3 * self.period:.3g} ms: {cause}'
        )

    def _cause(self, duration: float, work: float, other: float) -> str:
        """What took the largest part of the time since the joint state was sent.

        Parameters
        ----------
        duration, work
            Time [s] of the cycle, and what of it was spent in this thread.
        other
            Time [s] spent in this thread between the last cycle and this one.
        """
        other = min(other, max(0.0, self.age - duration))
        unscheduled = max(0.0, self.age - work - other)
        if unscheduled >= max(work, other):
            return f'the process was not scheduled, or its input held up, for {_ms(unscheduled)}'
        if work >= other:
            return f'the controller is slow, its cycle takes {_ms(work)}'
        return f'other work of the controller took {_ms(other)}'


def _ms(seconds: float) -> str:
    return f'{1e3 * seconds:.3g} ms'
