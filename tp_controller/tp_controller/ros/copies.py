"""Whether one joint state comes again and again while the arm is moved by it."""

from __future__ import annotations

from collections.abc import Callable

from tp_controller.ros.state_watch import Arrival, StateWatch

SHARE = 0.9
"""Share of the largest age for which copies may move the arm: then braking has to begin."""


class Copies:
    """Sees copies of the joint state that was answered last, stamp and all.

    Copies count if one comes soon after the other: a simulation that waits for its answer may
    show a state again after a while. They count where the stamp is of a clock.

    Parameters
    ----------
    watch
        Who judges joint states.
    limit
        Age [s] at which a state may not move anything: ``timeouts.joint_state``.

    Attributes
    ----------
    stood
        Whether copies have come for too long: only a new state is answered then.
    """

    def __init__(self, watch: StateWatch, limit: float) -> None:
        self._watch, self._limit = watch, limit
        self._soon = 0.5 * limit
        self._last: Arrival | None = None
        self._first: Arrival | None = None
        self.stood = False

    def know_period(self, period: float) -> None:
        """Take over the time [s] between joint states."""
        # Longer than between the states of a driver, shorter than a simulation waits.
        self._soon = min(max(0.5 * self._limit, 1.3 * period), 0.95 * self._limit)

    def answered(self, arrival: Arrival, again: bool) -> None:
        """Take note that a state, or a copy of the one before, was answered by a command."""
        self._last = arrival
        if not again:
            self._first, self.stood = None, False

    def braked(self) -> None:
        """Take note that braking came in place of an answer, for which somebody may wait."""
        self._last = None

    def too_long(self, arrival: Arrival, moves: Callable[[], bool], running: bool) -> bool:
        """Whether a state is a copy, and copies have come for too long.

        Parameters
        ----------
        arrival
            The newest state.
        moves
            Tells whether the last command moves an arm.
        running
            Whether states are being answered; if not, no copy is.
        """
        watch = self._watch
        if not (watch.is_resend(arrival) and watch.of_wall_clock(arrival)):
            return False
        if self.stood:
            return True
        before, self._last = self._last, arrival
        if before is None or watch.between(before, arrival) > self._soon:
            self._first = None
        elif self._first is None and moves():
            self._first = before
        if self._first is None:
            return False
        self.stood = not (running and watch.between(self._first, arrival) <= SHARE * self._limit)
        return self.stood
