"""What is warned of that shows over many cycles: lateness, a wrong rate, oscillation."""

from __future__ import annotations

import math
import time

import numpy as np
from numpy.typing import NDArray

from tp_controller.oscillation import OscillationWatch
from tp_controller.ros.joint_states import RateCheck
from tp_controller.ros.state_watch import Arrival, StateWatch
from tp_controller.ros.warnings import Warnings
from tp_controller.stack import Stack
from tp_interfaces.msg import ControllerState

TOLERATED = 0.02
"""Age [s] that a command may have at any rate before it is warned of; two periods if longer."""
OFTEN = 10
"""So many late cycles in a hundred are warned of, however late they are."""
SECOND = 0.5
"""The largest age is that of one to two times so long [s]."""
OSCILLATION_PERIOD = 0.5
"""Time [s] after which an oscillation that goes on is told again."""


class CycleWarnings:
    """Looks at every command that was sent, and warns. The parameters are those of `Cycle`.

    Attributes
    ----------
    limit
        Age [s] from which on a command is late; infinite if the rate is unknown.
    """

    def __init__(
        self, stack: Stack, watch: StateWatch, state: ControllerState, warnings: Warnings
    ) -> None:
        self._watch, self._state, self._warnings = watch, state, warnings
        self._oscillation = OscillationWatch(stack)
        self._oscillation_told = -math.inf
        self._largest = self._before = 0.0
        self._turn = -math.inf
        self._recent = self._late = 0
        self._busy = self._begin = self._begin_busy = 0.0
        self.know_rate(None)

    def know_rate(self, rate: float | None) -> None:
        """Take over the rate [Hz] of the joint states; None if unknown."""
        self._period = 1.0 / rate if rate else math.inf
        self.limit = max(2.0 * self._period, TOLERATED)
        self._rate_check = RateCheck(rate) if rate else None

    def restart(self) -> None:
        """Look for oscillation anew, as the arm was braked."""
        self._oscillation.restart()

    def restart_all(self, stopped: bool = False) -> None:
        """Count joint states anew, too; if they have stopped, no wrong rate is warned of."""
        self._oscillation.restart()
        if self._rate_check:
            self._rate_check.restart()
            if stopped:
                self._warnings.clear('rate')

    def begin(self) -> None:
        """Take note that a cycle begins."""
        self._begin, self._begin_busy = time.monotonic(), time.thread_time()

    def see(
        self,
        arrival: Arrival,
        elapsed: float,
        again: bool,
        running: bool,
        q: NDArray[np.float64],
        command: NDArray[np.float64],
    ) -> None:
        """Look at a command that was just sent.

        Parameters
        ----------
        arrival
            The joint state that it answers.
        elapsed
            Time [s] since the state that was answered before; infinite if there was none.
        again
            Whether it is that state.
        running
            Whether states were answered before: the first steps after a rest move little, and
            load what is used for the first time.
        q, command
            The coordinates (nq,) [rad, m] of the state, and the command (n,) [rad/s, m/s].
        """
        state, watch = self._state, self._watch
        late = self._see_age(arrival, running and not again)
        if late:
            self._warnings.warn('late', late)
        elif running and self.limit < elapsed < math.inf and state.command_age <= self._period:
            self._warnings.warn(
                'sender',
                f'joint states came {1e3 * elapsed:.3g} ms apart, period is '
                f'{1e3 * self._period:.3g} ms: their sender is late',
            )
        if again:
            return
        if self._rate_check:
            problem = self._rate_check.see(watch.received, watch.time(arrival))
            if problem:
                self._warnings.warn('rate', problem, lasting=True)
            elif problem is not None:
                self._warnings.clear('rate')
        if self._oscillation.see(q, command, elapsed):
            now = time.monotonic()
            if now - self._oscillation_told >= OSCILLATION_PERIOD:
                self._oscillation_told = now
                self._warnings.warn('oscillation', str(self._oscillation.found))
        elif self._oscillation_told > -math.inf:
            self._oscillation_told = -math.inf
            self._warnings.clear('oscillation')

    def _see_age(self, arrival: Arrival, counts: bool) -> str:
        """Note the age of a command that was just sent; return what to warn of, if it is late."""
        now, busy = time.monotonic(), time.thread_time()
        other, self._busy = self._begin_busy - self._busy, busy
        age = arrival.age + now - arrival.taken
        if now >= self._turn:
            self._before, self._largest = self._largest, 0.0
            self._turn = now + SECOND
        self._largest = max(self._largest, age)
        late = counts and age > self._period
        state = self._state
        state.overruns += late
        state.command_age, state.largest_command_age = age, max(self._largest, self._before)
        self._late += late
        self._recent += 1
        often = self._late >= OFTEN
        if self._recent >= 100 or often:
            self._recent = self._late = 0
        if not late or not (often or age > self.limit):
            return ''
        cause = _cause(age, now - self._begin, busy - self._begin_busy, other)
        return (
            f'command {1e3 * age:.3g} ms after its joint state, period is '
            f'{1e3 * self._period:.3g} ms: {cause}'
        )


def _cause(age: float, duration: float, work: float, other: float) -> str:
    """What took the largest part of the time since the joint state was sent.

    Parameters
    ----------
    age
        That time [s].
    duration, work
        Time [s] of the cycle, and what of it was spent in this thread.
    other
        Time [s] spent in this thread between the last cycle and this one.
    """
    other = min(other, max(0.0, age - duration))
    unscheduled = max(0.0, age - work - other)
    if unscheduled >= max(work, other):
        return f'the process was not scheduled, or its input held up, for {_ms(unscheduled)}'
    if work >= other:
        return f'the controller is slow, its cycle takes {_ms(work)}'
    return f'other work of the controller took {_ms(other)}'


def _ms(seconds: float) -> str:
    return f'{1e3 * seconds:.3g} ms'
