"""Which joint state is answered, and what it says of the arm."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from tp_controller.errors import InvalidValue
from tp_controller.robot import Robot
from tp_controller.ros.commands import CommandPublisher
from tp_controller.ros.intake import Intake
from tp_controller.ros.joint_states import JointStateReader
from tp_controller.ros.state_watch import Arrival, StateWatch
from tp_controller.ros.warnings import Warnings
from tp_interfaces.msg import ControllerState

AT_REST = 1e-3
"""Velocity [rad/s, m/s] of a joint that counts as at rest."""
SHARE = 0.9
"""Share of the largest age for which copies may move the arm: then braking has to begin."""


class StateChoice:
    """Chooses the newest joint state that can be used, and reads it.

    Copies of the state that was answered last, stamp and all, may not move the arm for long. They
    count if one comes soon after the other: a simulation that waits for its answer may show a
    state again after a while. They count where the stamp is of a clock.

    The parameters are those of `Cycle`, and ``stands``, which is called when one state has come
    again and again for too long while the arm is moved by it.

    Attributes
    ----------
    q
        Coordinates (nq,) [rad, m] that were read last; overwritten by the next ones.
    qd
        Their velocities (n,) [rad/s, m/s]; None if they were not told.
    unanswered
        States that were skipped for newer ones.
    behind
        Whether states were skipped for the last one.
    """

    def __init__(
        self,
        robot: Robot,
        intake: Intake,
        watch: StateWatch,
        commands: CommandPublisher,
        state: ControllerState,
        warnings: Warnings,
        limit: float,
        stands: Callable[[], None],
    ) -> None:
        self._intake, self._watch, self._commands = intake, watch, commands
        self._state, self._warnings, self._limit = state, warnings, limit
        self._stands = stands
        self._soon = 0.5 * limit
        self._last: Arrival | None = None
        self._first: Arrival | None = None
        self._stood = False
        """Whether copies have come for too long: only a new state is answered then."""
        self._reader = JointStateReader(robot.coordinates)
        self._space = robot.space
        self.q, self._rates = np.zeros((2, robot.nq))
        self.qd: NDArray[np.float64] | None = None
        self.unanswered = 0
        self.behind = False

    def know_period(self, period: float) -> None:
        """Take over the time [s] between joint states."""
        # Longer than between the states of a driver, shorter than a simulation waits.
        self._soon = min(max(0.5 * self._limit, 1.3 * period), 0.95 * self._limit)

    def answered(self, arrival: Arrival, again: bool) -> None:
        """Take note that a state, or a copy of the one before, was answered by a command."""
        self._last = arrival
        if not again:
            self._first, self._stood = None, False
            self._watch.answered(arrival)

    def braked(self) -> None:
        """Take note that braking came in place of an answer, for which somebody may wait."""
        self._last = None

    @property
    def moves(self) -> bool:
        """Whether the arm itself says that it moves."""
        return self.qd is not None and bool(np.max(np.abs(self.qd)) > AT_REST)

    def take(self, running: bool, again: bool = False) -> Arrival | None:
        """Newest state that waits and can be used, read; those before it are skipped.

        Parameters
        ----------
        running
            Whether joint states are being answered.
        again
            Whether there is a state already, which is not answered yet.
        """
        arrivals = self._intake.take()
        if not arrivals:
            if not again:
                self._note_others(running)
            return None
        if note := self._watch.note():
            self._warnings.warn('clock', note)
        for older in range(len(arrivals) - 1, -1, -1):
            arrival = arrivals[older]
            problem = ''
            if arrival.age > self._limit:
                problem = f'{arrival.age:.3g} s old when it came'
            elif self._too_long(arrival, running):
                problem = (
                    'the same one, stamp and all, comes again and again while the arm is moved '
                    'by it'
                )
            if problem:
                self._state.ignored_states += older + 1
                self._warnings.warn('old states', f'joint state ignored: {problem}')
                return None
            try:
                self._read(arrival)
            except InvalidValue as error:
                self._ignore(error)
                continue
            skipped = sum(self._watch.differ(other, arrival) for other in arrivals[:older])
            self.unanswered += skipped
            self.behind = skipped > 0
            return arrival
        return None

    def _note_others(self, running: bool) -> None:
        """Tell of joint states of other devices while none of the robot comes."""
        msg, self._intake.others.newest = self._intake.others.newest, None
        if msg is None or running:
            return
        try:
            self._reader.read(msg, self.q)
        except InvalidValue as error:
            self._ignore(error)

    def _ignore(self, problem: InvalidValue) -> None:
        self._state.ignored_states += 1
        self._warnings.warn('joint states', f'joint state ignored: {problem}')

    def _too_long(self, arrival: Arrival, running: bool) -> bool:
        """Whether a state is a copy, and copies have moved the arm for too long."""
        watch = self._watch
        if not (watch.is_resend(arrival) and watch.of_wall_clock(arrival)):
            return False
        if self._stood:
            return True
        before, self._last = self._last, arrival
        if before is None or watch.between(before, arrival) > self._soon:
            self._first = None
        elif self._first is None and self._moves_an_arm():
            self._first = before
        if self._first is None:
            return False
        between = watch.between(self._first, arrival)
        self._stood = not (running and between <= SHARE * self._limit)
        if self._stood:
            self._stands()
        return self._stood

    def _moves_an_arm(self) -> bool:
        """Whether the last command is a motion, and somebody listens to it."""
        return bool(self._commands.velocity.any()) and self._commands.heard

    def _read(self, arrival: Arrival) -> None:
        """Read what the arm does at present; all that is measured enters here."""
        self._reader.read(arrival.msg, self.q)
        found = self._reader.read_velocity(arrival.msg, self._rates)
        self.qd = self._space.velocity(self.q, self._rates) if found else None
