"""A model of the arm that carries commands out, and whether the arm does what it should."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cached_property, reduce
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tp_controller.errors import NO_VALUE, InvalidValue, shown
from tp_controller.prepared import Prepared
from tp_controller.robot.response import Response
from tp_controller.robot.space import Space
from tp_controller.winding import widen, wound

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
OVERTAKEN = 3
"""nor may so many of those before."""
JUMP = 3.0
"""So many times as far as its velocity limit lets it a joint does not get."""
JUMP_LEAST = 0.05
"""Distance [rad, m] that is never a jump."""
NOW, PASSED, HEAD, LIMIT, STEP, BEFORE = 1, 2, 5, 6, 14, 16
"""Places among the arguments of `tp_controller.following.follow`."""
FARTHEST = 1e6
"""Position [rad, m] that no joint has."""
WINDOW = 0.05
"""Time [s] over which the velocity of an arm with noise is measured."""


class Arm:
    r"""A model of the arm, kept together with what is measured.

    The model carries out what was sent, with its delay and lag. At every state the position is
    brought to within the noise of the measured one,

    .. math:: p \leftarrow \min(\max(p, q - \nu), q + \nu)

    which without noise is the measured position. As the true position is in that interval too,
    noise alone never makes the model worse, and at rest it soon leaves it alone. The stack is
    evaluated at the reference configuration: where the arm gets to with what was sent until
    now. For an ideal arm that is the measured configuration.

    By how much the model had to be moved is added up over a short time. More than `tolerance`
    means that the arm does not follow its commands; then it has to be braked.

    Parameters
    ----------
    joints
        Names of the joints (n,).
    response
        What the arm is like.
    period
        Time [s] of one step; infinite if unknown: then every state is taken as it is.
    space
        Configuration space; absent means that positions are configurations. The model has
        positions (n,): those of scalar joints, and of poses the ways from the pose that was
        measured last.

    Raises
    ------
    InvalidValue
        If the arm is not ideal and the period is unknown.

    Attributes
    ----------
    step
        Time [s] of a step that bounds have to be computed for: the period, or more after late
        cycles.
    following
        Whether the arm does what it is commanded to.
    notice
        What was wrong with the last state, by joint and amount; empty if nothing was.
    limit
        Velocity limits (n,) [rad/s, m/s] that tell a jump.
    late
        How long [s] after its state the last command was sent.
    upper, lower, held_upper, held_lower
        As `tp_controller.following.farthest`; not for an ideal arm.
    """

    def __init__(
        self,
        joints: Sequence[str],
        response: Response,
        period: float,
        space: Space | None = None,
    ) -> None:
        n = len(joints)
        self._space = Space(joints) if space is None else space
        self._anchor, self._past_anchor = np.array([self._space.neutral] * 2)
        self.response, self.period, self.step = response, period, period
        self._timed = math.isfinite(period)
        self._ideal, self._exact = response.ideal, response.exact
        self._flat, self._turns = not self._space.blocks, any(self._space.wrapping)
        # Where a pose gets to depends on the order of the commands that are under way.
        self._winds = not (self._flat or self._exact)
        self._late_place: Vector | None = None
        if not (self._ideal or self._timed):
            accepts = 'a number above 0, for robot.delay, lag, noise or hold'
            raise InvalidValue('rate', NO_VALUE, accepts)
        self._joints, self._n = tuple(joints), n
        longest = float(np.max(response.delay))
        m = 2
        if self._timed:
            m = 2 * math.ceil((longest + max(response.hold, WINDOW)) / period) + 4
        self._times, self._commands = np.zeros(m), np.zeros((m, n))
        self._measured = np.zeros((m, self._space.nq))
        self._state = np.zeros((9, n))
        self._z, self._p, self._v, self._v_high, self._v_low = self._state[:5]
        self._parted, self._fastest, self._q, self._candidate = self._state[5:]
        self.limit = np.full(n, math.inf)
        self._found, self._asked, self._measure = np.zeros(2), np.zeros(n), np.zeros(n)
        self._moves: Prepared | None = None
        held = math.ceil(response.hold / period - SAME) + 1 if response.hold else 0
        self.upper, self.lower = np.zeros((2, n))
        self.held_upper, self.held_lower = np.zeros((2, held, n))
        self.late = 0.0
        self._under_way: Matrix | None = None
        """Commands before the last state, if that changed them."""
        self._allowed = self._allowed_time()
        slow = float(np.max(response.delay + 3.0 * response.lag))
        self._pause = max(PAUSE * period, PAUSE_LEAST) + slow
        self._memory = max(MEMORY, 2.0 * self._allowed)
        self._tolerances = np.array(
            [JUMP, JUMP_LEAST, FARTHEST, self._memory, PARTED, self._allowed, SLOWER]
        )
        self.rest()
        self._past_state, self._past = self._state.copy(), self._numbers()

    @property
    def reference(self) -> Vector:
        """Reference configuration (nq,) [rad, m]; overwritten by the next state."""
        if self._flat:
            return self._z
        if not self._winds:
            return self._space.point(self._anchor, self._z)
        if self._late_place is None:
            self._late_place = self._wound()
        return self._late_place

    @property
    def z(self) -> Vector:
        """Its positions (n,) [rad, m]; overwritten by the next state."""
        return self._z

    @property
    def p(self) -> Vector:
        """Positions (n,) [rad, m] of the arm by the model; overwritten by the next state."""
        return self._p

    def configuration(self, positions: Vector) -> Vector:
        """Configuration (nq,) with positions (n,) of the model."""
        if self._flat:
            return positions
        if np.array_equal(positions, self._z):
            return self.reference
        return self._space.point(self._anchor, positions)

    @property
    def known(self) -> bool:
        """Whether a state was taken since the last `rest`."""
        return self._known

    @property
    def settled(self) -> bool:
        """Whether the arm is where all commands until now take it to, by the model."""
        return not self._timed or bool(np.max(np.abs(self._z - self._p)) <= SETTLED)

    @property
    def parted(self) -> Vector:
        """By how much the arm has parted from the model of late (n,) [rad, m]; a copy."""
        return self._parted.copy()

    @property
    def tolerance(self) -> Vector:
        """By how much it may part before it counts as not following (n,) [rad, m]."""
        allowed = PARTED + 2.0 * self.response.noise
        return allowed + self._allowed * self._fastest

    def _allowed_time(self) -> float:
        response = self.response
        slow = 0.5 * float(np.max(response.delay + response.lag))
        return max(2.0 * self.period, RESPONSE) + slow + 2.0 * response.hold

    def _numbers(self) -> tuple[Any, ...]:
        return (
            self._now,
            self._began,
            self._head,
            self._known,
            self._doubted,
            self._blind,
            self.following,
            self.step,
        )

    def rest(self) -> None:
        """Take the next state as it is, of an arm that stands still."""
        self._now, self._began, self._head = 0.0, 0.0, self._times.size - 1
        self._known = self._doubted = self._blind = False
        self.following = True
        self.notice = ''
        self.step = self.period
        self._state[:] = 0.0
        self._commands[:] = 0.0
        self._times[:] = -math.inf

    def undo(self) -> None:
        """Go back to before the last state."""
        if self._under_way is not None:
            self._commands[:], self._under_way = self._under_way, None
        self._state[:] = self._past_state
        if not self._flat:
            self._anchor[:] = self._past_anchor
        (
            self._now,
            self._began,
            self._head,
            self._known,
            self._doubted,
            self._blind,
            self.following,
            self.step,
        ) = self._past

    def take(
        self, q: Vector, before: Vector, elapsed: float | None = None, qd: Vector | None = None
    ) -> bool:
        """Go on to a measured state.

        Parameters
        ----------
        q
            Measured configuration (nq,) [rad, m], finite.
        before
            Velocities (n,) that the next command may differ from by what acceleration allows.
            Those of joints that do not move as they were commanded are changed to what they do.
        elapsed
            Time [s] since the state before. When left out it is the period, and a state of an
            ideal arm is taken as it is, without judgement.
        qd
            Measured velocities (n,) [rad/s, m/s], used where positions do not tell; None if
            unknown.

        Returns
        -------
        bool
            False for a state that cannot be believed; the model then goes on without it.
        """
        self.keep()
        self.notice = ''
        if self._turns or not self._flat:
            given, q = q, self._placed(q)
            if not np.isfinite(q).all():
                self.notice = f'no joint can be at the position {shown(given)}'
                if self._known and self._timed:
                    self._advance(self._pass(elapsed))
                    self._refer()
                return False
        if not self._known:
            if self._timed and np.abs(q).max() > FARTHEST:
                self.notice = f'no joint can be at the position {shown(q)}'
                return False
            self._start(q, before, qd)
            return True
        if not self._timed:
            self._z[:] = q
            return True
        passed = self._pass(elapsed)
        if self._ideal and elapsed is None:
            self._p[:] = self._z[:] = self._q[:] = q
            self._blind = False
            return True
        if self._blind:
            self._advance(passed)
            credible = self._accept(q, before, qd)
        elif self._follow(q, passed, before, qd):
            self._doubted, credible = False, True
            self._judge(q, before)
            if self.following or self._ideal:
                return True
        else:
            credible = self._believe(q, passed, before, qd)
            if credible:
                self._asked[:] = before
                self._correct(q, passed, before)
                # What it does was found already; from the new position it has not moved.
                before[:] = self._asked
        self._refer()
        return credible

    def _follow(self, q: Vector, passed: float, before: Vector, qd: Vector | None) -> bool:
        """Go on to a position, if the arm can have come to it.

        Where the time since the last state is no period it may be known badly, and with it what
        the positions say of the velocity. A joint that says itself that it moves is not taken as
        blocked then; nor is one that still carries out a command before the last, if that came
        late. One that says that it has stopped in a pause goes on from there.
        """
        self._asked[:] = before
        late = self.late > SOON * self.period
        there = self._q.copy() if late else self._q
        if self._moves is None:
            self._moves = self._prepared()
        call = self._moves
        self._measure[:] = q
        call.put(NOW, self._now)
        call.put(PASSED, passed)
        call.put(HEAD, self._head)
        call.put(STEP, self.step)
        call.replace(BEFORE, before)
        call.replace(LIMIT, self.limit)
        if not call.run():
            return False
        if late and passed > 0.0:
            # A driver may give the command for the velocity: positions tell.
            moves = _carries_out((q - there) / passed, self._slowest())
            before[moves] = self._asked[moves]
        if qd is None:
            return True
        doubtful = abs(passed - self.period) > DOUBTFUL * self.period
        if doubtful and not np.array_equal(before, self._asked):
            moves = _carries_out(qd, self._asked)
            before[moves] = self._asked[moves]
        if passed - self.late > self._pause:
            self._see_stops(before, qd)
        return True

    def _slowest(self) -> Vector:
        """Of the commands before the last the slowest (n,); zero where they are opposite."""
        recent = [self._commands[self._head - i] for i in range(1, OVERTAKEN + 1)]
        return reduce(_nearer_zero, recent)

    def _see_stops(self, before: Vector, qd: Vector) -> None:
        """Let joints that stand, or nearly so, after a pause go on from what they say of it."""
        stopped = ~_carries_out(qd, before)
        if not (stopped.any() and np.isfinite(qd).all()):
            return
        before[stopped] = _nearer_zero(before, qd)[stopped]
        # What was under way is not any more.
        self._under_way = self._commands.copy()
        self._commands[:, stopped] = before[stopped]
        for velocities in (self._v, self._v_high, self._v_low):
            velocities[stopped] = before[stopped]
        self._refer()

    def _placed(self, q: Vector) -> Vector:
        """Positions (n,) of a measured configuration (nq,); those of poses count from there on.

        Turns are counted as the model does. A place that no joint can have is infinitely far.
        """
        space, self._late_place = self._space, None
        if self._known:
            q = space.unwrapped(q, self._p)
        if self._flat:
            return q
        x = space.chart(q, q)
        for block in space.blocks:
            if np.max(np.abs(q[block.q])) > FARTHEST:
                x[block.v] = math.inf
        if not np.isfinite(x).all():
            return x
        found = space.chart(q, space.point(self._anchor, self._p))
        if np.array_equal(self._q, self._p):
            self._q[:] = found
        else:
            self._q[:] = space.chart(q, space.point(self._anchor, self._q))
        self._p[:] = found
        if self._doubted:
            self._candidate[:] = space.chart(q, space.point(self._anchor, self._candidate))
        self._anchor[:] = q
        return x

    def _prepared(self) -> Prepared:
        """The call of `tp_controller.following.follow`."""
        response = self.response
        return Prepared(
            self._kernel.follow,
            self._measure,
            self._now,
            self._now,
            self._times,
            self._commands,
            self._head,
            self.limit,
            response.delay,
            response.lag,
            response.noise,
            float(response.hold),
            self._ideal,
            self._exact,
            float(self.period),
            float(self.step),
            self._tolerances,
            np.zeros(self._n),
            self._state,
            self._found,
            self.upper,
            self.lower,
            self.held_upper,
            self.held_lower,
        )

    def expected(self, elapsed: float) -> Vector:
        """Positions (n,) that the model has so much time [s] later; it stays as it is.

        Raises
        ------
        InvalidValue
            If the period is unknown.
        """
        if not self._timed:
            raise InvalidValue('rate', NO_VALUE, 'a number above 0')
        before, now = self._state.copy(), self._now
        self._now += elapsed
        self._advance(elapsed)
        found = self._p.copy()
        self._state[:], self._now = before, now
        return found

    def go_on(self, elapsed: float) -> None:
        """Let time [s] pass in which no state came.

        What the arm did meanwhile is not known, so that the next state is taken as it is. It
        is not gone back to before this, see `undo`.
        """
        if not (self._known and self._timed):
            return
        self.notice, self._blind = '', True
        self._now += elapsed
        self._advance(elapsed)
        self._refer()
        self._late_place = None

    def _wound(self) -> Vector:
        """Where the arm (nq,) gets to with what was sent, one command after the other."""
        start = self._space.point(self._anchor, self._p)
        lagging = self._space.integrate(start, self.response.lag * self._v)
        under_way = self._now, self._times, self._commands, self._head, self.response.delay
        return wound(self._space, lagging, *under_way)

    def keep(self) -> None:
        """Let `undo` lead to the present model."""
        self._under_way = None
        self._past_state[:], self._past = self._state, self._numbers()
        if not self._flat:
            self._past_anchor[:] = self._anchor

    def _advance(self, passed: float) -> None:
        """Let the model carry out what was sent, until now."""
        response = self.response
        if self._ideal:
            self._p += passed * self._commands[self._head]
            return
        self._kernel.advance(
            self._now,
            passed,
            self._times,
            self._commands,
            self._head,
            response.delay,
            response.lag,
            response.hold,
            self.period,
            self._state,
        )

    def _accept(self, q: Vector, before: Vector, qd: Vector | None) -> bool:
        """Take the first position after a time without states; false if no joint can have it."""
        if np.max(np.abs(q)) > FARTHEST:
            self.notice = f'no joint can be at the position {shown(q)}'
            return False
        noise = self.response.noise
        np.clip(self._p, q - noise, q + noise, out=self._p)
        self._q[:] = q
        self._measured[:] = self.configuration(q)
        self._parted[:] = 0.0
        if qd is not None and np.isfinite(qd).all():
            before[:] = _nearer_zero(before, qd)
        self._began, self._blind = self._now, False
        return True

    @cached_property
    def _kernel(self) -> Any:
        """Module that is compiled, or loaded, for arms that move."""
        from tp_controller import following

        return following

    def _start(self, q: Vector, before: Vector, qd: Vector | None) -> None:
        self._known = True
        self._p[:] = self._z[:] = self._q[:] = q
        self._measured[:] = self.configuration(q)
        if not self._timed:
            return
        if qd is not None and np.isfinite(qd).all():
            # A joint that says more than it can do does not say the truth.
            speed = np.clip(qd, -self.limit, self.limit)
            before[:] = self._commands[:] = self._v[:] = speed
            self._v_high[:] = self._v_low[:] = speed
        self._refer()

    def _pass(self, elapsed: float | None) -> float:
        """Time that has passed; bounds are computed for late cycles to come, if any were."""
        if elapsed is None or abs(elapsed - self.period) <= SAME * self.period:
            passed = self.period
        else:
            passed = max(elapsed, 0.0)
        if passed == self.step == self.period:
            self._now += passed
            return passed
        fallen = self.step - (self.step - self.period) * min(1.0, self.period / FALLING)
        if fallen - self.period < FADED * self.period:
            fallen = self.period
        self.step = max(self.period, min(passed, LONGEST), fallen)
        self._now += passed
        return passed

    def _believe(self, q: Vector, passed: float, before: Vector, qd: Vector | None) -> bool:
        """Whether a position is the second one of its kind that the arm cannot have come to."""
        joint = int(self._found[0])
        self.notice = (
            f'{self._joints[joint]} jumped by {float(q[joint] - self._p[joint]):.4g}, '
            f'more than it can move in {passed:.3g} s'
        )
        if qd is not None and np.isfinite(qd).all():
            before[:] = _nearer_zero(before, qd)
        near = JUMP * self.limit * max(passed, self.period) + JUMP_LEAST
        near += 2.0 * self.response.noise
        if np.max(np.abs(q)) > FARTHEST:
            self._doubted = False
            return False
        if not (self._doubted and np.all(np.abs(q - self._candidate) <= near)):
            self._candidate[:] = q
            self._doubted = True
            return False
        before[:] = _nearer_zero(before, (q - self._candidate) / max(passed, self.period))
        self._doubted, self._began = False, self._now
        self._p[:] = self._q[:] = q
        self._measured[:] = self.configuration(q)
        self._under_way = self._commands.copy()
        self._commands[:] = self._v[:] = self._v_high[:] = self._v_low[:] = before
        self._parted[:] = 0.0
        return True

    def _correct(self, q: Vector, passed: float, before: Vector) -> None:
        """Bring the model to within the noise of the measured position."""
        response = self.response
        self._kernel.correct(
            q,
            passed,
            self._commands[self._head],
            response.noise,
            self._memory,
            PARTED,
            self._allowed,
            self._ideal,
            self.period,
            SLOWER,
            before,
            self._state,
            self._found,
        )
        self._judge(q, before)

    def _judge(self, q: Vector, before: Vector) -> None:
        """See whether the arm follows, by how far it has parted from the model."""
        found = self._found
        if found[1] > 1.0:
            self.following = False
        elif found[1] < BACK:
            self.following = True
        if self.following:
            return
        joint = int(found[0])
        self.notice = (
            f'{self._joints[joint]} does not follow: in the last {self._memory:.2g} s it came '
            f'{abs(float(self._parted[joint])):.3g} '
            f'{"less" if self._short(joint) else "farther"} than commanded'
        )
        if not self._ideal:
            self._p[:] = q
            before[:] = _nearer_zero(before, self._velocity(q))

    def _short(self, joint: int) -> bool:
        return bool(self._parted[joint] * self._commands[self._head, joint] <= 0.0)

    def _velocity(self, q: Vector) -> Vector:
        """Velocity (n,) of the arm as it was measured of late."""
        age = self._now - self._times
        usable = np.isfinite(age) & (age > 0.0) & (age < self._now - self._began + self.period)
        old = np.flatnonzero(usable & (age >= WINDOW * (1.0 - SAME)))
        if not old.size:
            old = np.flatnonzero(usable)
            if not old.size:
                return np.zeros(self._n)
            i = int(old[np.argmax(age[old])])
        else:
            i = int(old[np.argmin(age[old])])
        way = self._space.difference(self._measured[i], self.configuration(q))
        return way / float(age[i])

    def _refer(self) -> None:
        response = self.response
        self._kernel.expect(
            self._now,
            self._times,
            self._commands,
            self._head,
            response.delay,
            response.lag,
            response.hold,
            self._exact,
            self._ideal,
            self.period,
            self.step,
            self._state,
            self.upper,
            self.lower,
            self.held_upper,
            self.held_lower,
        )

    def line(
        self,
        command: Vector,
        acceleration: Vector,
        position_min: Vector,
        position_max: Vector,
        out: Matrix,
    ) -> bool:
        """Line along which the arm moves until it has braked to rest, if this is sent.

        See `tp_controller.following.line`.

        Parameters
        ----------
        command
            Velocities (n,).
        acceleration, position_min, position_max
            Limits (n,), the first in changes of velocity by `step`.
        out
            Results (4, n): the start, the way from there, the tube around it, and nothing.

        Returns
        -------
        bool
            Whether the arm moves.
        """
        response = self.response
        moves = bool(
            self._kernel.line(
                self._now,
                self._times,
                self._commands,
                self._head,
                response.delay,
                response.lag,
                response.hold,
                self.period,
                self.step,
                acceleration,
                command,
                self._state,
                position_min,
                position_max,
                *out,
            )
        )
        if moves and self._space.blocks:
            widen(self._space, out[1], out[2])
        return moves

    def send(self, command: Vector) -> None:
        """Take note of the velocities (n,) that answer the last state."""
        self._head = (self._head + 1) % self._times.size
        self._times[self._head] = self._now
        self._commands[self._head] = command
        self._measured[self._head] = self.configuration(self._q)


def _carries_out(qd: Vector, command: Vector) -> NDArray[np.bool_]:
    """Whether each joint moves at half of its command (n,) at least."""
    moves: NDArray[np.bool_] = qd * np.sign(command) >= SLOWER * np.abs(command)
    return moves


def _nearer_zero(one: Vector, other: Vector) -> Vector:
    """Of two velocities per joint the slower one, zero where they are opposite."""
    size = np.minimum(np.abs(one), np.abs(other))
    return np.where(one * other > 0.0, np.copysign(size, one), 0.0)
