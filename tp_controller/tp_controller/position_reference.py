"""Joint positions for arms that take nothing else: the commands, integrated."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tp_controller.arm_chart import FARTHEST
from tp_controller.arm_judgement import BACK, JUMP, JUMP_LEAST, PARTED, RESPONSE
from tp_controller.errors import InvalidValue, UnusableState, shown
from tp_controller.stack import Stack
from tp_controller.step_results import Step

Vector = NDArray[np.float64]

TIME_CONSTANTS = 4.0
"""After so many time constants of its lag an arm has done what it was told."""
STILL = 0.5
"""Time [s] for which an arm has to stand still to count as at rest."""
STOOD = 0.05
"""Time [s] without any motion after which an arm does not carry out what it is sent."""
SOON = 0.05
"""Share of a new interval between joint states in their mean."""
EXCHANGED = 3.0
"""So many times the tolerance joints are apart at least that count as exchanged."""
OTHER_ORDER = 'joints are where others were sent: the reader has them in another order'
ON_TIME = 0.95
"""Joint states that come in less than this share of a period are too fast to go by."""


class PositionReference:
    r"""The reference configuration as joint positions that are sent.

    It begins at the measured position. From then on it is the sum of the commands,

    .. math:: r \leftarrow r + T u

    whatever is measured, so that it keeps the ranges, speeds and accelerations that the
    commands keep: the stack is evaluated where an arm would be that follows it exactly, with
    the delay and the lag that the parameters describe. What is measured tells whether the arm
    follows: every joint has to be where the reference was within the time that the arm may need,
    within a tolerance. If it is not, the reference has to come to rest. It stops at once if the
    arm has not moved at all: so an arm whose drives come on later is not far from it.

    The reference begins anew, at the measured position and at rest, where going on would make
    the arm jump: if the arm is not where the reference is and

    - joint states had stopped, and it is at rest,
    - the measured position has jumped by what no joint can move, twice in a row, or
    - the reference and the arm have been at rest for a while.

    Of these the first one only counts while joints are where others were sent: their reader has
    them in another order, and the arm would swing for ever.

    Positions of joints that turn without end run on; measured ones are moved by whole turns.

    Parameters
    ----------
    stack
        Gives the commands.
    tolerance
        Largest deviation [rad, m] of the arm from the reference, one value or one per joint.

    Raises
    ------
    InvalidValue
        If the robot has a base that moves, or for a wrong number of tolerances.

    Attributes
    ----------
    notice
        How the arm deviates from the reference; empty if it follows.
    step
        Time [s] by which the next command takes the reference on: the period, less if joint
        states come faster.
    """

    def __init__(self, stack: Stack, tolerance: ArrayLike) -> None:
        robot = stack.robot
        if robot.space.blocks:
            raise InvalidValue(
                'command.type', 'positions for a base that moves', 'a type of velocities'
            )
        allowed = np.array(tolerance, dtype=float).reshape(-1)
        if allowed.size not in (1, robot.n):
            raise InvalidValue(
                'command.tolerance', shown(tolerance), f'1 value or {robot.n}, one per joint'
            )
        self._stack, self._space = stack, robot.space
        self._tolerance = np.broadcast_to(allowed, (robot.n,))
        self._r, self._past, self._next, self._seen, self._place = np.zeros((5, robot.n))
        self._still, self._stood, self._jumped, self._paused = 0.0, 0.0, False, False
        self._fresh, self._was_fresh = True, True
        """Whether nothing was sent since the reference began."""
        self.begun = False
        self.notice = ''
        self.know_period()

    def know_period(self) -> None:
        """Take over the period of the stack; to be called when that has changed."""
        arm = self._stack.arm
        response, self._period = arm.response, arm.period
        timed = math.isfinite(arm.period)
        self.step = self._mean = arm.period if timed else 0.0
        window = float(np.max(response.delay + TIME_CONSTANTS * response.lag)) + response.hold
        window += max(2.0 * self.step, RESPONSE)
        steps = math.ceil(window / arm.period) + 2 if timed else 2
        self._way = np.tile(self._r, (steps, 1))
        """Where the reference was of late (m, n); older entries follow newer ones in a ring."""
        self._head = 0
        self._allowed = self._tolerance + response.noise

    @property
    def positions(self) -> Vector:
        """Positions (n,) [rad, m] that were sent last; a copy."""
        return self._r.copy()

    def stop(self) -> None:
        """Forget where the reference is; the next state begins it."""
        self.begun, self.notice = False, ''

    def pause(self) -> None:
        """Take note that joint states have stopped."""
        self._paused = True

    def answer(self, q: Vector, elapsed: float | None) -> Step:
        """Compute the command that answers a measured state.

        It is zero for the state that the reference begins at, and braking while there is a
        `notice`.

        Parameters
        ----------
        q
            Measured positions (n,) [rad, m], finite.
        elapsed
            Time [s] since the state before; None if unknown.

        Returns
        -------
        Step
            As `Stack.step_in_place`; `after` makes positions of its command.

        Raises
        ------
        UnusableState
            As `Stack.step_in_place`, or if no joint can be at such a position.
        """
        if np.max(np.abs(q)) > FARTHEST:
            raise UnusableState(f'no joint can be at the position {shown(q)}')
        if self.begun:
            q = self._space.unwrapped(q, self._r)
            self._pace(elapsed)
            self._judge(q, self.step if elapsed is None else elapsed)
        else:
            self._begin(q)
        self._paused = False
        if self.notice:
            if self._stood >= STOOD:
                self._stack.rest()
            command = self.brake()
            return Step(command, command.size, 1.0, [])
        step = self._stack.step_in_place(self._model(), self.step)
        if self._fresh:
            self._stack.stay()
        return step

    def brake(self) -> Vector:
        """Compute a command (n,) of braking that answers a state, whatever that is."""
        return self._stack.brake(self.step, self._model())

    def _model(self) -> Vector:
        """Positions (n,) where an arm is after `step` that follows the reference exactly."""
        arm = self._stack.arm
        return arm.expected(self.step) if arm.known and not arm.response.ideal else self._r

    def _begin(self, q: Vector) -> None:
        """Begin at a measured position, at rest."""
        self._stack.rest()
        self._r[:] = self._past[:] = self._way[:] = self._seen[:] = self._place[:] = q
        self._still, self._stood, self._jumped, self._paused = 0.0, 0.0, False, False
        self.begun = self._fresh = True
        self.notice = ''

    def _pace(self, elapsed: float | None) -> None:
        """Let the reference be no faster than the joint states say that time passes."""
        if elapsed is None or not self._period < math.inf:
            return
        self._mean += SOON * (min(max(elapsed, 0.0), self._period) - self._mean)
        self.step = self._period if self._mean >= ON_TIME * self._period else self._mean

    def _judge(self, q: Vector, passed: float) -> None:
        """See whether the arm follows, or the reference has to begin anew."""
        stands = np.all(np.abs(q - self._place) <= PARTED + 2.0 * self._stack.arm.response.noise)
        self._stood = self._stood + passed if stands else 0.0
        if not stands:
            self._place[:] = q
        over = np.maximum(self._way.min(axis=0) - q, q - self._way.max(axis=0))
        share = over / self._allowed
        i = int(np.argmax(share))
        if share[i] <= (BACK if self.notice else 1.0):
            self.notice, self._jumped, self._still = '', False, 0.0
            self._seen[:] = q
            return
        self.notice = (
            f'{self._stack.robot.joints[i]} is {float(over[i]):.3g} farther from the reference '
            f'than its delay and lag explain, command.tolerance is {float(self._tolerance[i]):g}'
        )
        rests, moved = self._at_rest, np.abs(q - self._seen)
        still = bool(np.all(moved <= PARTED + 2.0 * self._stack.arm.response.noise))
        reach = self._stack.robot.limits.velocity * max(passed, self.step)
        near = bool(np.all(moved <= JUMP * reach + JUMP_LEAST + 2.0 * self._allowed))
        if not still:
            self._seen[:] = q
        self._still = self._still + passed if still and rests else 0.0
        jumped, self._jumped = self._jumped and near, not near
        if share[i] > EXCHANGED and self._exchanged(q):
            self.notice = f'{self.notice}; {OTHER_ORDER}'
            # Where the arm is would be sent to other joints again, and so on for ever.
            jumped, self._still = False, 0.0
        if jumped or (rests and (self._paused or self._still >= STILL)):
            self._begin(q)

    def _exchanged(self, q: Vector) -> bool:
        """Whether the joints are where others were sent of late."""
        apart = np.abs(np.sort(self._way, axis=1) - np.sort(q)).max(axis=1)
        return bool(apart.min() <= np.min(self._allowed))

    @property
    def _at_rest(self) -> bool:
        return bool(np.array_equal(self._r, self._past))

    def after(self, command: Vector) -> Vector:
        """Positions (n,) that velocities (n,) lead to; overwritten by the next call."""
        np.multiply(command, self.step, out=self._next)
        self._next += self._r
        return self._next

    def advance(self) -> None:
        """Take note that what `after` gave last was sent."""
        self._was_fresh, self._fresh = self._fresh, False
        self._past[:] = self._r
        self._r[:] = self._next
        self._head = (self._head + 1) % len(self._way)
        self._way[self._head] = self._r

    def undo(self) -> None:
        """Go back to before the last `advance`."""
        self._fresh = self._was_fresh
        self._r[:] = self._past
        self._head = (self._head - 1) % len(self._way)
