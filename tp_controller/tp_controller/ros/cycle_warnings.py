"""What is warned of that shows over many cycles: lateness, a wrong rate, oscillation."""

from __future__ import annotations

import math
import time

import numpy as np
from numpy.typing import NDArray

from tp_controller.oscillation import OscillationWatch
from tp_controller.ros.joint_states import RateCheck
from tp_controller.ros.lateness import Lateness
from tp_controller.ros.state_watch import Arrival, StateWatch
from tp_controller.ros.warnings import Warnings
from tp_controller.stack import Stack
from tp_interfaces.msg import ControllerState

OSCILLATION_PERIOD = 0.5
"""Time [s] after which an oscillation that goes on is told again."""


class CycleWarnings:
    """Looks at every command that was sent, and warns.

    Parameters
    ----------
    stack
        Has computed the commands.
    watch
        Judges joint states.
    state
        Counters and times are kept there.
    warnings
        Where is told what was found.

    Attributes
    ----------
    lateness
        How late commands are.
    """

    def __init__(
        self,
        stack: Stack,
        watch: StateWatch,
        state: ControllerState,
        warnings: Warnings,
    ) -> None:
        self._watch, self._state, self._warnings = watch, state, warnings
        self._oscillation = OscillationWatch(stack)
        self._oscillation_told = -math.inf
        self.know_rate(None)

    def know_rate(self, rate: float | None) -> None:
        """Take over the rate [Hz] of the joint states; None if unknown."""
        self.lateness = Lateness(1.0 / rate if rate else math.inf)
        self._rate_check = RateCheck(rate) if rate else None

    def restart(self) -> None:
        """Look for oscillation anew, as the arm was braked."""
        self._oscillation.restart()

    def restart_all(self) -> None:
        """Count joint states anew, too."""
        self._oscillation.restart()
        if self._rate_check:
            self._rate_check.restart()

    def stopped(self) -> None:
        """Take note that joint states have stopped: their rate is not known any more."""
        self.restart_all()
        if self._rate_check:
            self._warnings.clear('rate')

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
        state, lateness, watch = self._state, self.lateness, self._watch
        late = lateness.end(arrival.age, arrival.taken, running and not again)
        if late:
            self._warnings.warn('late', late)
        elif running and lateness.limit < elapsed < math.inf and lateness.on_time:
            self._warnings.warn(
                'sender',
                f'joint states came {1e3 * elapsed:.3g} ms apart, period is '
                f'{1e3 * lateness.period:.3g} ms: their sender is late',
            )
        state.overruns = lateness.overruns
        state.command_age = lateness.age
        state.largest_command_age = lateness.largest
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
