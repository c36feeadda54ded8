"""Which joint state is answered, and what it says of the arm."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from tp_controller.errors import InvalidValue
from tp_controller.robot import Robot
from tp_controller.ros.commands import CommandPublisher
from tp_controller.ros.copies import Copies
from tp_controller.ros.intake import Intake
from tp_controller.ros.joint_states import JointStateReader
from tp_controller.ros.state_watch import Arrival, StateWatch
from tp_controller.ros.warnings import Warnings
from tp_interfaces.msg import ControllerState

AT_REST = 1e-3
"""Velocity [rad/s, m/s] of a joint that counts as at rest."""


class StateChoice:
    """Chooses the newest joint state that can be used, and reads it.

    Parameters
    ----------
    robot
        Whose joints are read.
    intake, watch
        Where joint states come from, and who judges them.
    commands
        Where answers go.
    state, warnings
        States that are not used are counted and told there.
    limit
        Age [s] at which a joint state may not move anything.
    stands
        Called when one state has come again and again for too long while the arm is moved by it.

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
        self._stands, self._copies = stands, Copies(watch, limit)
        self._reader = JointStateReader(robot.coordinates)
        self._space = robot.space
        self.q, self._rates = np.zeros((2, robot.nq))
        self.qd: NDArray[np.float64] | None = None
        self.unanswered = 0
        self.behind = False

    def know_period(self, period: float) -> None:
        """Take over the time [s] between joint states."""
        self._copies.know_period(period)

    def answered(self, arrival: Arrival, again: bool) -> None:
        """Take note that a state, or a copy of the one before, was answered by a command."""
        self._copies.answered(arrival, again)
        if not again:
            self._watch.answered(arrival)

    def braked(self) -> None:
        """Take note that braking came in place of an answer."""
        self._copies.braked()

    @property
    def moves(self) -> bool:
        """Whether the arm itself says that it moves."""
        return self.qd is not None and bool(np.max(np.abs(self.qd)) > AT_REST)

    def take(self, running: bool) -> Arrival | None:
        """Newest state that waits and can be used, read; those before it are skipped.

        Parameters
        ----------
        running
            Whether joint states are being answered.
        """
        arrivals = self._intake.take()
        if not arrivals:
            return None
        if note := self._watch.note():
            self._warnings.warn('clock', note)
        for older in range(len(arrivals) - 1, -1, -1):
            arrival = arrivals[older]
            problem = ''
            if arrival.age > self._limit:
                problem = f'{arrival.age:.3g} s old when it came'
            elif self._stood(arrival, running):
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
                self._state.ignored_states += 1
                self._warnings.warn('joint states', f'joint state ignored: {error}')
                continue
            skipped = sum(self._watch.differ(other, arrival) for other in arrivals[:older])
            self.unanswered += skipped
            self.behind = skipped > 0
            return arrival
        return None

    def _stood(self, arrival: Arrival, running: bool) -> bool:
        """Whether copies of one state have come for too long while the arm is moved by it."""
        stood = self._copies.stood
        if not self._copies.too_long(arrival, self._moves_an_arm, running):
            return False
        if not stood:
            self._stands()
        return True

    def _moves_an_arm(self) -> bool:
        """Whether the last command is a motion, and somebody listens to it."""
        return bool(self._commands.velocity.any()) and self._commands.heard

    def _read(self, arrival: Arrival) -> None:
        """Read what the arm does at present; all that is measured enters here."""
        self._reader.read(arrival.msg, self.q)
        found = self._reader.read_velocity(arrival.msg, self._rates)
        self.qd = self._space.velocity(self.q, self._rates) if found else None
