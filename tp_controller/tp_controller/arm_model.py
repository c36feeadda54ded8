"""A model of the arm: where it is by the commands that it was sent."""

from __future__ import annotations

import math
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tp_controller.arm_state import ArmState
from tp_controller.prepared import Prepared
from tp_controller.robot.response import Response

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]

SETTLED = 1e-4
"""Way [rad, m] that is left of earlier commands when the arm counts as standing still."""
SAME = 1e-6
"""Times [steps] that differ by less than this are the same."""
FALLING = 0.5
"""Time [s] in which the memory of a late cycle fades."""
FADED = 0.01
"""Share of a step below which it has faded."""
LONGEST = 1.0
"""Longest step [s] that bounds are computed for."""
WINDOW = 0.05
"""Time [s] over which the velocity of an arm with noise is measured."""
NOW, HEAD, STEP = 0, 3, 10
"""Places among the arguments of `tp_controller.commands_under_way.expect`."""


class ArmModel:
    """Carries out what was sent, with the delay and the lag of the arm.

    Parameters
    ----------
    response
        What the arm is like.
    period
        Time [s] of one step; infinite if unknown.
    n
        Number of joints.

    Attributes
    ----------
    timed
        Whether the period is known.
    step
        Time [s] of a step that bounds have to be computed for: the period, or more after late
        cycles.
    now
        Time [s] of the last state.
    times, commands, head
        Ring of the commands: when each was sent (m,) [s], what they are (m, n) and which is the
        newest.
    state
        What is known of the joints.
    upper, lower, held_upper, held_lower
        As `tp_controller.commands_under_way.farthest`; not for an ideal arm.
    """

    def __init__(self, response: Response, period: float, n: int) -> None:
        self.response, self.period, self.step = response, period, period
        self.timed = math.isfinite(period)
        self.ideal, self.exact = response.ideal, response.exact
        m = 2
        if self.timed:
            longest = float(np.max(response.delay))
            m = 2 * math.ceil((longest + max(response.hold, WINDOW)) / period) + 4
        self.times, self.commands = np.zeros(m), np.zeros((m, n))
        self.state = ArmState.zero(n)
        self._past_rows = self.state.rows.copy()
        self._past_commands: Matrix | None = None
        """Commands before the last state, if that changed them."""
        held = math.ceil(response.hold / period - SAME) + 1 if response.hold else 0
        self.upper, self.lower = np.zeros((2, n))
        self.held_upper, self.held_lower = np.zeros((2, held, n))
        self._expect: Prepared | None = None
        self.rest()
        self._past = self.now, self.head, self.step

    @property
    def settled(self) -> bool:
        """Whether the arm is where all commands until now take it to."""
        return not self.timed or bool(np.max(np.abs(self.state.z - self.state.p)) <= SETTLED)

    @property
    def command(self) -> Vector:
        """Velocities (n,) that were sent last."""
        return self.commands[self.head]

    def rest(self) -> None:
        """Forget all: the arm stands still."""
        self.now, self.head, self.step = 0.0, self.times.size - 1, self.period
        self.state.rows[:] = 0.0
        self.commands[:] = 0.0
        self.times[:] = -math.inf

    def keep(self) -> None:
        """Let `undo` lead to the present model."""
        self._past_rows[:], self._past_commands = self.state.rows, None
        self._past = self.now, self.head, self.step

    def undo(self) -> None:
        """Go back to the model that was kept."""
        if self._past_commands is not None:
            self.commands[:], self._past_commands = self._past_commands, None
        self.state.rows[:] = self._past_rows
        self.now, self.head, self.step = self._past

    def send(self, command: Vector) -> None:
        """Take note of the velocities (n,) that answer the last state."""
        self.head = (self.head + 1) % self.times.size
        self.times[self.head] = self.now
        self.commands[self.head] = command

    def be_at(self, q: Vector) -> None:
        """Be at positions (n,) that are those of the arm, with nothing under way."""
        state = self.state
        state.p[:] = state.z[:] = state.q[:] = q

    def turn_to(self, q: Vector, velocity: Vector) -> None:
        """Be at positions (n,), as an arm that has moved with constant velocities (n,)."""
        state = self.state
        state.p[:] = state.q[:] = q
        self.turn(np.ones(q.size, dtype=bool), velocity)

    def turn(self, joints: NDArray[np.bool_], velocity: Vector) -> None:
        """Let some joints (n,) have moved with constant velocities (n,) all the time."""
        self._past_commands = self.commands.copy()
        self.commands[:, joints] = velocity[joints]
        for velocities in (self.state.v, self.state.v_high, self.state.v_low):
            velocities[joints] = velocity[joints]

    def pass_time(self, elapsed: float | None) -> float:
        """Time that has passed; bounds are computed for late cycles to come, if any were."""
        if elapsed is None or abs(elapsed - self.period) <= SAME * self.period:
            passed = self.period
        else:
            passed = max(elapsed, 0.0)
        self.now += passed
        if passed == self.step == self.period:
            return passed
        fallen = self.step - (self.step - self.period) * min(1.0, self.period / FALLING)
        if fallen - self.period < FADED * self.period:
            fallen = self.period
        self.step = max(self.period, min(passed, LONGEST), fallen)
        return passed

    def go_on(self, elapsed: float) -> None:
        """Go on by a time [s] in which no state came."""
        self.now += elapsed
        self.advance(elapsed)
        self.refer()

    def advance(self, passed: float) -> None:
        """Carry out what was sent, until now."""
        response = self.response
        if self.ideal:
            self.state.p[:] += passed * self.command
            return
        self._under_way.advance(
            self.now,
            passed,
            self.times,
            self.commands,
            self.head,
            response.delay,
            response.lag,
            response.hold,
            self.period,
            self.state.rows,
        )

    def refer(self) -> None:
        """Find where the arm gets to with what was sent until now, and how far it may get."""
        if self._expect is None:
            self._expect = self._prepared()
        call = self._expect
        call.put(NOW, self.now)
        call.put(HEAD, self.head)
        call.put(STEP, self.step)
        call.run()

    def _prepared(self) -> Prepared:
        response = self.response
        return Prepared(
            self._under_way.expect,
            self.now,
            self.times,
            self.commands,
            self.head,
            response.delay,
            response.lag,
            float(response.hold),
            self.exact,
            self.ideal,
            float(self.period),
            float(self.step),
            self.state.rows,
            self.upper,
            self.lower,
            self.held_upper,
            self.held_lower,
        )

    def expected(self, elapsed: float) -> Vector:
        """Positions (n,) so much time [s] later; the model stays as it is."""
        before, now = self.state.rows.copy(), self.now
        self.now += elapsed
        self.advance(elapsed)
        found = self.state.p.copy()
        self.state.rows[:], self.now = before, now
        return found

    def line(
        self,
        command: Vector,
        acceleration: Vector,
        position_min: Vector,
        position_max: Vector,
        out: Matrix,
    ) -> bool:
        """Line along which the arm brakes, see `tp_controller.braking_line.line`.

        Parameters
        ----------
        command, acceleration, position_min, position_max, out
            As `Arm.line`.
        """
        response = self.response
        return bool(
            self._lines.line(
                self.now,
                self.times,
                self.commands,
                self.head,
                response.delay,
                response.lag,
                response.hold,
                self.period,
                self.step,
                acceleration,
                command,
                self.state.rows,
                position_min,
                position_max,
                *out,
            )
        )

    @cached_property
    def _under_way(self) -> Any:
        """Module that is compiled, or loaded, for arms that move."""
        from tp_controller import commands_under_way

        return commands_under_way

    @cached_property
    def _lines(self) -> Any:
        """Module that is compiled, or loaded, for arms that keep distances."""
        from tp_controller import braking_line

        return braking_line
