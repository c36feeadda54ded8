"""Safety filter: changes commands so that the arm can always brake before it breaks a limit."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tp_controller.arm import Arm
from tp_controller.errors import NO_VALUE, InvalidValue, UnusableState, shown
from tp_controller.joint_bounds import JointBounds, include_zero
from tp_controller.lookahead import Lookahead
from tp_controller.problem import checked_array
from tp_controller.robot import Limits, Robot
from tp_controller.solvers import Bounds
from tp_controller.tasks import SetBasedTask
from tp_controller.transition import Transition

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]

LEAST_CHANGE = 1e-9
"""Least change of a velocity [rad/s, m/s] in a step that an acceleration limit may allow."""
SHARES = (0.5, 0.25, 0.125)
"""How much of a command that cannot be sent is tried, the rest being braking."""


class SafetyFilter:
    """Changes every command so that the arm can always brake before it breaks a limit.

    Two things follow every solver. The command goes from the last one towards the wished one
    inside the joints' bounds of position, velocity and acceleration. Then the configurations
    that it leads to are checked themselves, not their linearisation: the next one and those
    of the braking trajectory from there, all joints together or else each as hard as it can,
    and what lies between. If a distance would fall below zero in any of them, less of the
    command is sent and more braking; the braking trajectory of the step before was checked in
    that step, so there is always an answer. A distance that is negative already must not
    become smaller.

    For an arm that is not ideal both consider what it still carries out of earlier commands,
    and how long it may go on with this one.

    Without a period only the velocity limits are known to hold.

    Parameters
    ----------
    robot
        The robot, with its limits and its response.
    period
        Time [s] of one step; infinite if unknown.

    Raises
    ------
    InvalidValue
        As `check_limits` and `Arm`.

    Attributes
    ----------
    arm
        What the arm makes of the commands.
    transition
        Narrows the bounds for a time after the stack has changed.
    stopped_by
        Names of the tasks for which the last command had to give way to braking.
    """

    def __init__(self, robot: Robot, period: float = math.inf) -> None:
        self._robot = robot
        self.period = period
        self._before, self._past = np.zeros((2, robot.n))
        self.arm = self._model(robot)
        self._joints = JointBounds(robot, self.arm, period, self._before)
        self.transition = Transition()
        self._ahead = Lookahead(robot, self.arm, ())
        self.watch(())
        self.check_limits(robot.limits)

    def check_limits(self, limits: Limits) -> None:
        """Check that limits can be enforced.

        Raises
        ------
        InvalidValue
            For an acceleration limit without a period, or one that allows no change at all.
        """
        if np.isfinite(limits.acceleration).any() and not math.isfinite(self.period):
            raise InvalidValue('rate', NO_VALUE, 'a number above 0, for robot.limits.acceleration')
        if np.any(limits.acceleration * self.period < LEAST_CHANGE):
            least = LEAST_CHANGE / self.period
            accepts = f'at least {least:g}, which is {LEAST_CHANGE:g} in a step'
            raise InvalidValue('robot.limits.acceleration', shown(limits.acceleration), accepts)

    def watch(self, tasks: Iterable[SetBasedTask]) -> None:
        """Look at the distances of these tasks from now on."""
        self.stopped_by: tuple[str, ...] = ()
        tasks = tasks if math.isfinite(self.period) else ()
        together = self._ahead.together
        self._ahead = Lookahead(self._robot, self.arm, tasks)
        # A braking trajectory that is under way goes on as it was found safe.
        self._ahead.together = together
        self._ahead.keep()

    @property
    def memory(self) -> tuple[object, ...]:
        """Objects whose attributes are all that the filter remembers."""
        return (self, self._joints, *self.arm.memory, self._ahead, self.transition)

    @property
    def last_bounds(self) -> Bounds:
        """Bounds by the limits, as of the last call of `bounds`, which writes to their arrays."""
        return self._joints.bounds

    @property
    def kept(self) -> tuple[str, ...]:
        """Names of the tasks whose distances are looked at."""
        return tuple(task.name for task, _ in self._ahead.tasks)

    def know_period(self, period: float) -> None:
        """Take over the time [s] of one step, which was unknown so far; the arm stands still.

        Tasks have to be watched anew.
        """
        self.period = self._step = period
        self.arm = self._model(self._robot)
        self._joints = JointBounds(self._robot, self.arm, period, self._before)
        self._before[:] = 0.0

    def rest(self) -> None:
        """Go on from standstill."""
        self._before[:] = self._past[:] = 0.0
        self.arm.rest()

    def undo(self) -> None:
        """Go back by a step: its configuration comes again, no time has passed."""
        self._before[:] = self._past
        self.transition.undo()
        self._ahead.undo()
        self.arm.undo()

    def take(self, q: Vector, elapsed: float | None = None, qd: Vector | None = None) -> bool:
        """Go on to a measured state; false if it cannot be believed. See `Arm.take`."""
        self._keep()
        return self.arm.take(q, self._before, elapsed, qd)

    def bounds(self) -> Bounds:
        """Bounds on the next velocities, at the reference configuration.

        In a transition they are narrower than the limits. Their arrays are written to again by
        the next call.
        """
        bounds = self._joints.by_limits()
        if not self.transition.under_way:
            return bounds
        step = self.arm.step
        return self.transition.narrowed(
            bounds, self._before, self._robot.limits, step, self._joints.fill
        )

    def _model(self, robot: Robot) -> Arm:
        """A model of the arm that knows from its first state on how fast joints can be."""
        arm = Arm(robot.joints, robot.response, self.period, robot.space)
        arm.limit = robot.limits.velocity
        return arm

    def pass_on(self, command: Vector) -> None:
        """Turn a wished command (n,), inside the velocity limits, into one that can be sent.

        `take` and `bounds` were called for the state that it answers, and the robot is at the
        reference configuration.

        Parameters
        ----------
        command
            The wished velocities, and then those to be sent.
        """
        transition = self.transition
        if transition.under_way:
            transition.pass_by(command)
            self.approach(command)
        elif not self._joints.plain:
            self.approach(command)
        if self._ahead.tasks:
            self._give_way(command)
        self._before[:] = command
        self.arm.send(command)

    def let_rest(self) -> None:
        """Let joints stay outside their ranges in this step: braking does not bring them back.

        To be called after `bounds` and before `pass_on`.
        """
        self._joints.let_rest()
        if self.transition.under_way:
            include_zero(self.transition.bounds)

    def approach(self, command: Vector) -> None:
        """Bring a wished command (n,) to what this step allows, in the same direction."""
        transition = self.transition
        if transition.under_way:
            acceleration, bounds = transition.acceleration(self._before), transition.bounds
        else:
            acceleration, bounds = self._robot.limits.acceleration, self._joints.bounds
        self._joints.approach(command, acceleration, bounds)

    def step(
        self,
        wish: ArrayLike,
        q: Vector,
        elapsed: float | None = None,
        qd: Vector | None = None,
    ) -> Vector:
        """Turn a wished velocity into the command that answers a measured state.

        The whole step of the filter by itself: it goes on to the state, moves the robot there,
        measures the distances that it keeps and changes the velocity. Call it once a period.
        A wish outside the bounds of the joints is brought to them joint by joint. While the arm
        does not follow its commands the filter brakes, whatever is wished.

        Parameters
        ----------
        wish
            Wished joint velocity (n,) [rad/s, m/s].
        q
            Measured configuration (nq,) [rad, m].
        elapsed, qd
            Time [s] since the state before and measured velocities (n,), see `Arm.take`.

        Returns
        -------
        Vector
            The command (n,) [rad/s, m/s]; the caller's own.

        Raises
        ------
        InvalidValue
            If the wish has a wrong shape or is not finite.
        UnusableState
            If the state is not finite, or no joint can have moved so; in that case the error
            has a command that brakes.
        """
        wished = checked_array('wish', wish, (self._robot.n,))
        if not np.isfinite(q).all():
            raise UnusableState(f'no finite command follows from the position {shown(q)}')
        command = np.zeros(self._robot.n)
        # A copy: what cannot be written to is another type to compiled code.
        if not self.take(np.array(q, dtype=float), elapsed, qd):
            self.brake(command)
            raise UnusableState(self.arm.notice, command)
        self._robot.update(self.arm.reference)
        bounds = self.bounds()
        for task, _ in self._ahead.tasks:
            task.update()
        if self.arm.following:
            np.clip(wished, bounds.soon_lower, bounds.soon_upper, out=command)
        else:
            self.transition.give_way()
            self.let_rest()
        self.pass_on(command)
        return command

    def brake(self, command: Vector, elapsed: float | None = None) -> None:
        """Brake: fill the velocities (n,) to be sent.

        Parameters
        ----------
        command
            Velocities of the next step of the braking trajectory; zero once that has ended.
        elapsed
            Time [s] since the last command if no state came since; `undo` does not go back to
            before that. Left out, it answers the state that `take` was called for.
        """
        if elapsed is not None:
            self.arm.go_on(elapsed)
        # At rest nothing is compiled or loaded for it.
        if self._before.any():
            self._joints.by_limits()
            self.slow_down(command)
        else:
            command[:] = 0.0
        self._before[:] = command
        self.arm.send(command)
        if elapsed is not None:
            self._keep()
            self.arm.keep()

    def _keep(self) -> None:
        """Let `undo` lead to the present state."""
        self._past[:] = self._before
        self.transition.keep()
        if self._ahead.tasks:
            self._ahead.keep()

    def slow_down(self, command: Vector) -> None:
        """Fill the velocities (n,) of the next step of the braking trajectory; nothing is sent."""
        self._joints.coast(self._ahead.together, command)

    def _give_way(self, command: Vector) -> None:
        """Send less of a command (n,) and more braking where a distance would be too small."""
        ahead = self._ahead
        ahead.begin()
        self.stopped_by = ()
        if ahead.is_safe(command, self._joints.acceleration):
            return
        self.stopped_by = ahead.short
        stop = np.zeros(self._robot.n)
        self.slow_down(stop)
        for share in SHARES:
            trial = stop + share * (command - stop)
            if ahead.is_safe(trial, self._joints.acceleration):
                command[:] = trial
                return
        command[:] = stop

    def active_limits(self, command: Vector) -> list[str]:
        """Which limits a command (n,) that was sent meets, by joint, and who stopped it."""
        stopped = [f'{name} distance' for name in self.stopped_by]
        return self._joints.met_by(command) + stopped
