"""What is known of the arm, by what it was sent and by what is measured."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from tp_controller.arm_chart import ArmChart
from tp_controller.arm_judgement import Judgement
from tp_controller.arm_model import ArmModel
from tp_controller.errors import NO_VALUE, InvalidValue, shown
from tp_controller.robot.response import Response
from tp_controller.robot.space import Space

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]


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
    response, period
        As given.
    known
        Whether a state was taken since the last `rest`.
    z
        Its reference positions (n,) [rad, m]; overwritten by the next state.
    p
        Positions (n,) [rad, m] of the arm by the model; overwritten by the next state.
    upper, lower, held_upper, held_lower
        As `tp_controller.commands_under_way.farthest`; not for an ideal arm.
    """

    def __init__(
        self,
        joints: Sequence[str],
        response: Response,
        period: float,
        space: Space | None = None,
    ) -> None:
        if not (response.ideal or math.isfinite(period)):
            accepts = 'a number above 0, for robot.delay, lag, noise or hold'
            raise InvalidValue('rate', NO_VALUE, accepts)
        self.response, self.period = response, period
        self._model = model = ArmModel(response, period, len(joints))
        self._chart = ArmChart(Space(joints) if space is None else space, model)
        self._judgement = Judgement(joints, model, self._chart)
        self.z, self.p = model.state.z, model.state.p
        self.upper, self.lower = model.upper, model.lower
        self.held_upper, self.held_lower = model.held_upper, model.held_lower
        self.known = self._blind = False
        self._past = self.known, self._blind

    @property
    def memory(self) -> tuple[object, ...]:
        """Objects whose attributes are all that is remembered of the arm."""
        return (self, self._model, self._chart, self._judgement)

    @property
    def step(self) -> float:
        """Time [s] of a step that bounds are for: the period, or more after late cycles."""
        return self._model.step

    @property
    def following(self) -> bool:
        """Whether the arm does what it is commanded to."""
        return self._judgement.following

    @property
    def notice(self) -> str:
        """What was wrong with the last state, by joint and amount; empty if nothing was."""
        return self._judgement.notice

    @property
    def limit(self) -> Vector:
        """Velocity limits (n,) [rad/s, m/s] that tell a jump."""
        return self._judgement.limit

    @limit.setter
    def limit(self, limit: Vector) -> None:
        self._judgement.limit = limit

    @property
    def late(self) -> float:
        """How long [s] after its state the last command was sent."""
        return self._judgement.late

    @late.setter
    def late(self, seconds: float) -> None:
        self._judgement.late = seconds

    @property
    def reference(self) -> Vector:
        """Reference configuration (nq,) [rad, m]; overwritten by the next state."""
        return self._chart.reference

    def configuration(self, positions: Vector) -> Vector:
        """Configuration (nq,) with positions (n,) of the model."""
        return self._chart.configuration(positions)

    @property
    def settled(self) -> bool:
        """Whether the arm is where all commands until now take it to, by the model."""
        return self._model.settled

    @property
    def parted(self) -> Vector:
        """By how much the arm has parted from the model of late (n,) [rad, m]; a copy."""
        return self._model.state.parted.copy()

    @property
    def tolerance(self) -> Vector:
        """By how much it may part before it counts as not following (n,) [rad, m]."""
        return self._judgement.tolerance

    def rest(self) -> None:
        """Take the next state as it is, of an arm that stands still."""
        self.known = self._blind = False
        self._model.rest()
        self._judgement.rest()

    def keep(self) -> None:
        """Let `undo` lead to the present model."""
        self._past = self.known, self._blind
        self._model.keep()
        self._judgement.keep()
        if not self._chart.flat:
            self._chart.keep()

    def undo(self) -> None:
        """Go back to before the last state."""
        self.known, self._blind = self._past
        self._model.undo()
        self._judgement.undo()
        if not self._chart.flat:
            self._chart.undo()

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
        model, judgement = self._model, self._judgement
        judgement.notice = ''
        if not self._chart.plain:
            given, q = q, self._chart.placed(q, self.known, judgement.doubted)
            if not np.isfinite(q).all():
                judgement.notice = f'no joint can be at the position {shown(given)}'
                if self.known and model.timed:
                    model.advance(model.pass_time(elapsed))
                    model.refer()
                return False
        if not self.known:
            if model.timed:
                self.known = judgement.begin(q, before, qd)
            else:
                model.be_at(q)
                self.known = True
            return self.known
        if not model.timed:
            self.z[:] = q
            return True
        passed = model.pass_time(elapsed)
        if model.ideal and elapsed is None:
            model.be_at(q)
            self._blind = False
            return True
        if self._blind:
            model.advance(passed)
            credible = judgement.accept(q, before, qd)
            self._blind = not credible
        elif judgement.follow(q, passed, before, qd):
            if judgement.following or model.ideal:
                return True
            credible = True
        else:
            credible = judgement.believe(q, passed, before, qd)
        model.refer()
        return credible

    def expected(self, elapsed: float) -> Vector:
        """Positions (n,) that the model has so much time [s] later; it stays as it is.

        Raises
        ------
        InvalidValue
            If the period is unknown.
        """
        if not self._model.timed:
            raise InvalidValue('rate', NO_VALUE, 'a number above 0')
        return self._model.expected(elapsed)

    def go_on(self, elapsed: float) -> None:
        """Let time [s] pass in which no state came.

        What the arm did meanwhile is not known, so that the next state is taken as it is. It
        is not gone back to before this, see `undo`.
        """
        model = self._model
        if not (self.known and model.timed):
            return
        self._judgement.notice, self._blind = '', True
        model.go_on(elapsed)
        self._chart.forget()

    def line(
        self,
        command: Vector,
        acceleration: Vector,
        position_min: Vector,
        position_max: Vector,
        out: Matrix,
    ) -> bool:
        """Line along which the arm moves until it has braked to rest, if this is sent.

        See `tp_controller.braking_line.line`.

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
        moves = self._model.line(command, acceleration, position_min, position_max, out)
        if moves:
            self._chart.widen(out[1], out[2])
        return moves

    def send(self, command: Vector) -> None:
        """Take note of the velocities (n,) that answer the last state."""
        self._model.send(command)
        if not self._model.ideal:
            self._judgement.send()
