"""Whether measured positions can be believed, and whether the arm does what it should."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tp_controller.arm_chart import FARTHEST, ArmChart
from tp_controller.arm_model import SAME, WINDOW, ArmModel
from tp_controller.errors import shown
from tp_controller.prepared import Prepared

Vector = NDArray[np.float64]

MEMORY = 0.1
"""Least time [s] over which parting from the model is added up."""
PARTED = 2.5e-3
"""Distance [rad, m] by which a joint may always part from the model."""
RESPONSE = 0.03
"""Delay and lag [s] that need not be declared for a joint to count as following."""
BACK = 0.5
"""An arm follows again when it is parted by less than this share of what is allowed."""
SLOWER = 0.5
"""A joint that moves by less than this share of its command is taken as it moves."""
DOUBTFUL = 0.2
"""A time between states that differs from the period by more than this share may be wrong."""
PAUSE, PAUSE_LEAST = 5.0, 0.03
"""After so many periods without a command, so much time [s] at least, and delay and lag, a driver
may have stopped the arm."""
SOON = 0.5
"""A command that was sent later than this share of a period after its state may not have acted
when the next state was measured,"""
OVERTAKEN, OVERTAKEN_TIME = 3, 0.1
"""nor may so many of those before, or those of so much time [s]; this counts for as many commands
that follow."""
STANDS = 1e-4
"""Velocity [rad/s, m/s] below which a joint stands still."""
JUMP = 3.0
"""So many times as far as its velocity limit lets it a joint does not get."""
JUMP_LEAST = 0.05
"""Distance [rad, m] that is never a jump."""
NOW, HEAD, STEP, LIMIT, BEFORE, MORE = 1, 2, 3, 4, 5, 6
"""Places among the arguments of `tp_controller.following.follow` and ``begin``; the last is the
time that has passed, or whether measured velocities count."""


class Judgement:
    """Brings a model of the arm to measured positions, and judges both.

    Parameters
    ----------
    joints
        Names of the joints (n,).
    model
        The model.
    chart
        Its positions as configurations.

    Attributes
    ----------
    limit
        Velocity limits (n,) [rad/s, m/s] that tell a jump.
    following
        Whether the arm does what it is commanded to.
    doubted
        Whether there is a measured position that is not believed yet.
    notice
        What was wrong with the last state, by joint and amount; empty if nothing was.
    """

    def __init__(self, joints: Sequence[str], model: ArmModel, chart: ArmChart) -> None:
        n = len(joints)
        self._joints, self._model, self._chart = tuple(joints), model, chart
        self._measured = np.zeros((model.times.size, chart.space.nq))
        """Configurations (m, nq) that the commands of the ring answer; not for an ideal arm."""
        self.limit = np.full(n, math.inf)
        self._late, self._unsure = 0.0, 0
        many = math.ceil(OVERTAKEN_TIME / model.period) if model.timed else OVERTAKEN
        self._overtaken = min(max(OVERTAKEN, many), model.times.size - 2)
        self._found, self._asked, self._q, self._qd = np.zeros(2), *np.zeros((3, n))
        self._follow: Prepared | None = None
        self._begin: Prepared | None = None
        response = model.response
        slow = 0.5 * float(np.max(response.delay + response.lag))
        self._allowed = max(2.0 * model.period, RESPONSE) + slow + 2.0 * response.hold
        response_time = float(np.max(response.delay + 3.0 * response.lag))
        self._pause = max(PAUSE * model.period, PAUSE_LEAST) + response_time
        self._memory = max(MEMORY, 2.0 * self._allowed)
        self._tolerances = np.array(
            [JUMP, JUMP_LEAST, FARTHEST, self._memory, PARTED, self._allowed, SLOWER]
        )
        self.rest()
        self._past = self._began, self.doubted, self.following, self._stood

    @property
    def late(self) -> float:
        """How long [s] after its state the last command was sent; set for every command."""
        return self._late

    @late.setter
    def late(self, seconds: float) -> None:
        self._late = seconds
        if seconds > SOON * self._model.period:
            self._unsure = self._overtaken
        elif self._unsure:
            self._unsure -= 1

    @property
    def tolerance(self) -> Vector:
        """By how much the arm may part before it counts as not following (n,) [rad, m]."""
        allowed = PARTED + 2.0 * self._model.response.noise
        return allowed + self._allowed * self._model.state.fastest

    def rest(self) -> None:
        """Forget what was found."""
        self._began, self.doubted, self.following = 0.0, False, True
        self._stood = np.zeros(len(self._joints))
        self.notice = ''

    def keep(self) -> None:
        """Let `undo` lead to what is known now."""
        self._past = self._began, self.doubted, self.following, self._stood

    def undo(self) -> None:
        """Go back to what was known when it was kept."""
        self._began, self.doubted, self.following, self._stood = self._past

    def send(self) -> None:
        """Take note of a command that was sent to the arm where it was measured last."""
        self._measured[self._model.head] = self._chart.configuration(self._model.state.q)

    def begin(self, q: Vector, before: Vector, qd: Vector | None) -> bool:
        """Begin at measured positions (n,); false if no joint can have them.

        Parameters
        ----------
        q, before, qd
            As `Arm.take`. Velocities that are finite are taken over to ``before``.
        """
        if self._begin is None:
            self._begin = self._prepared_begin()
        self._q[:] = q
        if qd is not None:
            self._qd[:] = qd
        if not self._run(self._begin, before, qd is not None):
            self._refuse(q)
            return False
        if not self._model.ideal:
            self._measured[:] = self._chart.configuration(q)
        return True

    def follow(self, q: Vector, passed: float, before: Vector, qd: Vector | None) -> bool:
        """Go on to positions (n,), if the arm can have come to them.

        Where the time since the last state is no period it may be known badly, and with it what
        the positions say of the velocity. A joint that says itself that it moves is not taken as
        blocked then; nor is one that still carries out a command before the last, if one of these
        came late. One that says that it has stopped in a pause goes on from there.

        Parameters
        ----------
        q, before, qd
            As `Arm.take`.
        passed
            Time [s] since the last state.
        """
        self._asked[:] = before
        if self._follow is None:
            self._follow = self._prepared_follow()
        self._q[:] = q
        model = self._model
        late = self._unsure > 0
        there = model.state.q.copy() if late else model.state.q
        if not self._run(self._follow, before, passed):
            return False
        if late and passed > 0.0:
            # A driver may give the command for the velocity: positions tell.
            moves = self._may_be_late((q - there) / passed, passed)
            before[moves] = self._asked[moves]
        if qd is not None:
            doubtful = abs(passed - model.period) > DOUBTFUL * model.period
            if doubtful and not np.array_equal(before, self._asked):
                moves = _carries_out(qd, self._asked)
                before[moves] = self._asked[moves]
            if passed - self.late > self._pause:
                self._see_stops(before, qd)
        self.doubted = False
        self._judge(q, before)
        return True

    def _may_be_late(self, moved: Vector, passed: float) -> NDArray[np.bool_]:
        """Which joints (n,), moved by so much a second, may carry out an earlier command.

        Not one that has stood for longer, though it was commanded to move: until it moves.
        """
        stands = np.abs(moved) < STANDS
        asked = np.abs(self._asked) > STANDS
        # A new array: `undo` goes back to the one before.
        self._stood = np.where(stands, self._stood + passed * asked, 0.0)
        stuck = self._stood > OVERTAKEN_TIME + OVERTAKEN * self._model.period
        return _carries_out(moved, self._slowest()) & ~stuck

    def _slowest(self) -> Vector:
        """Of the commands before the last the slowest (n,); zero where they are opposite."""
        model = self._model
        recent = model.commands[model.head - np.arange(1, self._overtaken + 1)]
        low, high = recent.min(axis=0), recent.max(axis=0)
        return np.where(low > 0.0, low, np.minimum(high, 0.0))

    def _see_stops(self, before: Vector, qd: Vector) -> None:
        """Let joints that stand, or nearly so, after a pause go on from what they say of it."""
        stopped = ~_carries_out(qd, before)
        if not (stopped.any() and np.isfinite(qd).all()):
            return
        before[stopped] = _nearer_zero(before, qd)[stopped]
        # What was under way is not any more.
        self._model.turn(stopped, before)
        self._model.refer()

    def _run(self, call: Prepared, before: Vector, more: float) -> bool:
        model = self._model
        call.put(NOW, model.now)
        call.put(HEAD, model.head)
        call.put(STEP, model.step)
        call.replace(LIMIT, self.limit)
        call.replace(BEFORE, before)
        call.put(MORE, more)
        return bool(call.run())

    def _prepared_begin(self) -> Prepared:
        rows = self._model.state.rows
        return self._prepared(self._kernel.begin, (False, self._qd), (), (FARTHEST, rows))

    def _prepared_follow(self) -> Prepared:
        noise, rows = self._model.response.noise, self._model.state.rows
        results = (self._tolerances, rows, self._found)
        return self._prepared(self._kernel.follow, (self._model.now,), (noise,), results)

    def _prepared(
        self,
        function: Any,
        given: tuple[Any, ...],
        noise: tuple[Vector, ...],
        results: tuple[Any, ...],
    ) -> Prepared:
        """Call with what both functions take, and what one of them takes in between."""
        model, response = self._model, self._model.response
        return Prepared(
            function,
            self._q,
            model.now,
            model.head,
            float(model.step),
            self.limit,
            np.zeros(len(self._joints)),
            *given,
            model.times,
            model.commands,
            response.delay,
            response.lag,
            *noise,
            float(response.hold),
            model.ideal,
            model.exact,
            float(model.period),
            *results,
            model.upper,
            model.lower,
            model.held_upper,
            model.held_lower,
        )

    @cached_property
    def _kernel(self) -> Any:
        """Module that is compiled, or loaded, for arms that move."""
        from tp_controller import following

        return following

    def accept(self, q: Vector, before: Vector, qd: Vector | None) -> bool:
        """Take the first positions after a time without states; false if no joint can have them.

        Parameters
        ----------
        q, before, qd
            As `Arm.take`.
        """
        if np.max(np.abs(q)) > FARTHEST:
            self._refuse(q)
            return False
        model, state, noise = self._model, self._model.state, self._model.response.noise
        np.clip(state.p, q - noise, q + noise, out=state.p)
        state.q[:] = q
        self._measured[:] = self._chart.configuration(q)
        state.parted[:] = 0.0
        if qd is not None and np.isfinite(qd).all():
            before[:] = _nearer_zero(before, qd)
        self._began = model.now
        return True

    def believe(self, q: Vector, passed: float, before: Vector, qd: Vector | None) -> bool:
        """Take positions that the arm cannot have come to, if they are the second of their kind.

        Parameters
        ----------
        q, passed, before, qd
            As `follow`, which did not take them.
        """
        model, state = self._model, self._model.state
        joint = int(self._found[0])
        self.notice = (
            f'{self._joints[joint]} jumped by {float(q[joint] - state.p[joint]):.4g}, '
            f'more than it can move in {passed:.3g} s'
        )
        if qd is not None and np.isfinite(qd).all():
            before[:] = _nearer_zero(before, qd)
        span = max(passed, model.period)
        near = JUMP * self.limit * span + JUMP_LEAST
        near += 2.0 * model.response.noise
        if np.max(np.abs(q)) > FARTHEST:
            self.doubted = False
            return False
        if not (self.doubted and np.all(np.abs(q - state.candidate) <= near)):
            state.candidate[:] = q
            self.doubted = True
            return False
        before[:] = _nearer_zero(before, (q - state.candidate) / span)
        self.doubted, self._began = False, model.now
        model.turn_to(q, before)
        self._measured[:] = self._chart.configuration(q)
        state.parted[:] = 0.0
        self._asked[:] = before
        self._correct(q, passed, before)
        # What it does was found already; from the new position it has not moved.
        before[:] = self._asked
        return True

    def _correct(self, q: Vector, passed: float, before: Vector) -> None:
        """Bring the model to within the noise of the measured position."""
        model = self._model
        self._kernel.correct(
            q,
            passed,
            model.command,
            model.response.noise,
            self._memory,
            PARTED,
            self._allowed,
            model.ideal,
            model.period,
            SLOWER,
            before,
            model.state.rows,
            self._found,
        )
        self._judge(q, before)

    def _judge(self, q: Vector, before: Vector) -> None:
        """See whether the arm follows, by how far it has parted from the model."""
        joint, share = self._found.tolist()
        if share > 1.0:
            self.following = False
        elif share < BACK:
            self.following = True
        if self.following:
            return
        model, joint = self._model, int(joint)
        parted = float(model.state.parted[joint])
        short = parted * float(model.command[joint]) <= 0.0
        self.notice = (
            f'{self._joints[joint]} does not follow: in the last {self._memory:.2g} s it came '
            f'{abs(parted):.3g} {"less" if short else "farther"} than commanded'
        )
        if not model.ideal:
            model.state.p[:] = q
            before[:] = _nearer_zero(before, self._velocity(q))

    def _velocity(self, q: Vector) -> Vector:
        """Velocity (n,) of the arm as it was measured of late."""
        model, chart = self._model, self._chart
        age = model.now - model.times
        usable = np.isfinite(age) & (age > 0.0) & (age < model.now - self._began + model.period)
        old = np.flatnonzero(usable & (age >= WINDOW * (1.0 - SAME)))
        if not old.size:
            old = np.flatnonzero(usable)
            if not old.size:
                return np.zeros(len(self._joints))
            i = int(old[np.argmax(age[old])])
        else:
            i = int(old[np.argmin(age[old])])
        way = chart.space.difference(self._measured[i], chart.configuration(q))
        return way / float(age[i])

    def _refuse(self, q: Vector) -> None:
        self.notice = f'no joint can be at the position {shown(q)}'


def _carries_out(qd: Vector, command: Vector) -> NDArray[np.bool_]:
    """Whether each joint moves at half of its command (n,) at least."""
    moves: NDArray[np.bool_] = qd * np.sign(command) >= SLOWER * np.abs(command)
    return moves


def _nearer_zero(one: Vector, other: Vector) -> Vector:
    """Of two velocities per joint the slower one, zero where they are opposite."""
    size = np.minimum(np.abs(one), np.abs(other))
    return np.where(one * other > 0.0, np.copysign(size, one), 0.0)
