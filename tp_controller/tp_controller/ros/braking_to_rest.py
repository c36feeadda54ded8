"""Braking to rest: when it has to begin, as joint states have stopped, and its commands."""

from __future__ import annotations

import math
import time

from tp_controller.position_reference import PositionReference
from tp_controller.ros.commands import CommandPublisher
from tp_controller.ros.robot_node import HEARTBEAT
from tp_controller.stack import Stack
from tp_interfaces.msg import ControllerState

ZEROS = 10
"""Zero commands that follow braking at once; further ones follow with every sign of life."""
CUT = 'braking cut'
"""How a line begins that tells of braking which took too long."""
LONGEST_BRAKING = 1.0
"""Time [s] that a controller which ends gives to braking."""
UNKNOWN_PERIOD = 0.01
"""Time [s] between commands of braking where no rate is known."""
STOPPED = 0.2
"""Time [s] beyond the limit of age without any command after which the arm is not braked: zero."""
AFTER_BRAKING = 0.8
"""Least time [periods] between a command of braking and one that answers a joint state."""


class BrakingToRest:
    """Brakes the arm where no joint state moves it. The parameters are those of `Cycle`.

    Attributes
    ----------
    look_period
        Time [s] between two calls of `look`.
    period
        Time [s] between two calls of `send_next`.
    zeros
        Zero commands since the arm came to rest.
    """

    def __init__(
        self,
        stack: Stack,
        commands: CommandPublisher,
        state: ControllerState,
        limit: float,
        reference: PositionReference | None,
    ) -> None:
        self._stack, self._commands, self._state = stack, commands, state
        self._limit, self._reference = limit, reference
        self.look_period = min(0.25 * limit, HEARTBEAT)
        self.period = UNKNOWN_PERIOD
        self.zeros = 0
        self._spacing = 0.0
        """Least time [s] between a command of braking and one that answers a joint state."""
        self._answered = self._sent = -math.inf
        """Steady times [s] of the joint state answered last and of the last command of braking."""
        self._last_seen = self._looked = time.monotonic()
        self._refused = 0
        self._awake_since = -math.inf
        self._paused = 0.0

    def know_period(self, period: float) -> None:
        """Take over the time [s] between joint states."""
        self.period, self._spacing = period, AFTER_BRAKING * period

    @property
    def newest(self) -> bool:
        """Whether the arm was braked after the last answer."""
        return self._sent > self._answered

    @property
    def ready_at(self) -> float:
        """Steady time until which a joint state that comes in real time has to wait.

        A command of braking has just been sent, and two commands would change the velocity in
        one period.
        """
        return self._sent + self._spacing if self._sent > self._answered else -math.inf

    def elapsed(self, taken: float) -> float:
        """Time [s] from braking after the last answer to a steady time; infinite without it."""
        return max(0.0, taken - self._sent) if self._sent > self._answered else math.inf

    def answered(self, taken: float, again: bool) -> None:
        """Take note of an answer to a joint state, taken at a steady time, new or sent again."""
        if not again or self._sent > self._answered:
            self._answered = taken

    def seen(self) -> None:
        """Take note that the joint state was answered by a motion towards the goals."""
        self._last_seen = time.monotonic()
        self._refused = self._state.ignored_states

    def lost(self) -> None:
        """Take note that nothing has been seen of the arm: braking has to begin."""
        self._last_seen = -math.inf

    def look(self) -> str:
        """Find whether joint states have stopped.

        Returns
        -------
        str
            Why an arm that is moved has to be braked; empty if it need not.
        """
        now = time.monotonic()
        pause, self._looked = now - self._looked, now
        if pause > self.look_period + 0.5 * self._limit:
            # States may wait that came meanwhile: those of the last moment are still good.
            self._awake_since, self._paused = now, pause
        grace = max(2.0 * self.period, 0.02)
        if now <= max(self._last_seen + self._limit, self._awake_since + grace):
            return ''
        if self._awake_since > self._last_seen:
            return f'the process was not scheduled for {self._paused:.3g} s'
        if self._commands.withheld:
            return 'commands are withheld'
        usable = 'usable ' if self._state.ignored_states > self._refused else ''
        return f'no {usable}joint state for {self._limit:g} s'

    def send_next(self) -> None:
        """Send the next command of braking to rest; once at rest, a zero command."""
        now = time.monotonic()
        last = max(self._answered, self._sent)
        passed = now - last if math.isfinite(last) else 0.0
        if self._reference is not None:
            # An arm that takes positions waits where it was told to go.
            passed = self._reference.step
        if self._reference is None and passed > self._limit + STOPPED:
            # Its driver has stopped the arm, or it is high time: braking would move it again.
            self._stack.rest()
            self._commands.send(0.0)
        else:
            self._commands.send(self._stack.brake(passed))
        self._sent = now
        self.zeros = 0 if self._commands.velocity.any() else self.zeros + 1

    def stand(self) -> None:
        """Take note that the arm stands still and nothing has moved it yet."""
        self._stack.rest()
        if self._reference is not None:
            self._reference.stop()
        self.zeros = 0
        self._answered, self._sent = -math.inf, time.monotonic()

    def finish(self) -> str:
        """Brake to rest and give zero commands time to arrive, for the end of the process.

        Returns
        -------
        str
            How the arm came to rest.
        """
        begin = now = time.monotonic()
        self.zeros = steps = 0
        rest = math.inf
        while self.zeros < ZEROS and now - rest < 0.2:
            if now - begin > LONGEST_BRAKING and self.zeros == 0:
                self._stack.rest()
                self._commands.send(0.0)
                self._commands.wait_until_arrived()
                return f'{CUT} after {LONGEST_BRAKING:g} s, {self._commands.rest} sent'
            self.send_next()
            now = time.monotonic()
            steps += self.zeros == 0
            if self.zeros == 1:
                rest = now
            time.sleep(max(0.0, min(self.period, HEARTBEAT)))
        self._commands.wait_until_arrived()
        if not steps:
            return f'{self._commands.rest} sent'
        return f'braked to rest in {rest - begin:.2g} s'
