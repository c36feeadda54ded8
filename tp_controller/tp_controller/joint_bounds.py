"""Bounds of the joints' velocities by their limits, and commands that keep to them."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from tp_controller.arm import Arm
from tp_controller.prepared import Prepared
from tp_controller.robot import Limits, Robot
from tp_controller.solvers import Bounds

Vector = NDArray[np.float64]

ACCELERATION, STEP = 5, 6
"""Places among the arguments of `tp_controller.braking.bound` and ``bound_late``."""
AT_LIMIT = 1e-9
"""A velocity is at its limit within this share of it."""


class JointBounds:
    """Bounds of the next velocities by the limits of position, velocity and acceleration.

    Parameters
    ----------
    robot
        The robot, whose limits may change.
    arm
        What the arm makes of the commands.
    period
        Time [s] of one step; infinite if unknown.
    before
        The last command (n,); it is written to by others.

    Attributes
    ----------
    bounds
        The bounds as of the last call of `by_limits`.
    plain
        Whether there are no limits but those of velocity.
    acceleration
        Limits of acceleration (n,) in changes of velocity by the step that the arm takes.
    """

    def __init__(self, robot: Robot, arm: Arm, period: float, before: Vector) -> None:
        self._robot, self._arm, self._period, self._before = robot, arm, period, before
        self._way = np.zeros(robot.n)
        self._late = not robot.response.ideal
        self._limits: Limits | None = None
        self.plain = True
        self._step, self.acceleration = period, robot.limits.acceleration
        self.bounds = Bounds.of_speed(robot.limits.velocity)

    def by_limits(self) -> Bounds:
        """Bounds at the reference configuration; their arrays are written to by the next call."""
        limits = self._robot.limits
        if limits is not self._limits:
            self._use(limits)
        if self.plain:
            return self.bounds
        step = self._arm.step
        if step != self._step:
            # The change by one command stays the same when commands are farther apart.
            self._step = step
            slower = self._period / step
            self.acceleration = (
                limits.acceleration if slower == 1.0 else _fixed(limits.acceleration * slower)
            )
            self.bounds = self.bounds._replace(step=step)
        self.fill(self.acceleration, self.bounds)
        return self.bounds

    def fill(self, acceleration: Vector, bounds: Bounds) -> None:
        """Fill the bounds for limits of acceleration (n,)."""
        call = self._bound
        given = call.arguments
        if given[-1] is not bounds.soon_upper or given[ACCELERATION] is not acceleration:
            call.replace(ACCELERATION, acceleration)
            for i, array in enumerate(bounds[1:5], len(given) - 4):
                call.replace(i, array)
        call.put(STEP, self._arm.step)
        call.run()

    def _prepare(self, limits: Limits) -> None:
        """Prepare the calls that fill bounds and bring commands to them."""
        # Compiled, or loaded, with the solver's kernel, not to refuse a parameter file.
        from tp_controller import braking

        arm, late = self._arm, self._late
        low, high, soon_low, soon_high = self.bounds[1:5]
        more = (float(self._period), arm.response.noise, arm.upper, arm.lower)
        self._braking = braking
        self._bound = Prepared(
            braking.bound_late if late else braking.bound,
            arm.p if late else arm.z,
            self._before,
            limits.velocity,
            limits.position_min,
            limits.position_max,
            limits.acceleration,
            float(self._period),
            *((*more, arm.held_upper, arm.held_lower) if late else ()),
            low,
            high,
            soon_low,
            soon_high,
        )
        self._approach = Prepared(
            braking.approach,
            self._way,
            self._before,
            limits.acceleration,
            float(self._period),
            soon_low,
            soon_high,
            self._way,
        )

    def _use(self, limits: Limits) -> None:
        self._limits = limits
        self._arm.limit = limits.velocity
        self._step, self.acceleration = self._period, limits.acceleration
        endless = np.isinf(np.concatenate([limits.position_min, limits.position_max]))
        self.plain = not math.isfinite(self._period) or (
            bool(endless.all()) and bool(np.isinf(limits.acceleration).all())
        )
        if self.plain:
            self.bounds = Bounds.of_speed(limits.velocity)
        else:
            low, high, soon_low, soon_high = np.zeros((4, self._robot.n))
            change = limits.acceleration * self._period
            self.bounds = Bounds(
                limits.velocity,
                low,
                high,
                soon_low,
                soon_high,
                not endless.all(),
                change if np.isfinite(change).any() else None,
                self._before if np.isfinite(change).any() else None,
                self._period,
            )
        self._prepare(limits)

    def let_rest(self) -> None:
        """Let joints stay outside their ranges until the next call of `by_limits`."""
        if not self.plain:
            include_zero(self.bounds)

    def approach(self, command: Vector, acceleration: Vector, bounds: Bounds) -> None:
        """Bring a wished command (n,) into bounds, in the direction from the last command."""
        call = self._approach
        wish, _, given, _, _, upper, _ = call.arguments
        if wish is not command or given is not acceleration or upper is not bounds.soon_upper:
            arrays = {0: command, 2: acceleration, 4: bounds.soon_lower, 5: bounds.soon_upper}
            for i, array in {**arrays, 6: command}.items():
                call.replace(i, array)
        call.run()

    def coast(self, together: bool, command: Vector) -> None:
        """Fill the velocities (n,) of the next step of the braking trajectory."""
        if not math.isfinite(self._period):
            command[:] = 0.0
            return
        self._braking.coast(
            self._before,
            self.acceleration,
            self._arm.step,
            together,
            1,
            self._way,
            command,
        )
        if self._late and not self.plain:
            # With zero among them, see `let_rest`.
            lower = np.minimum(self.bounds.soon_lower, 0.0)
            upper = np.maximum(self.bounds.soon_upper, 0.0)
            np.clip(command, lower, upper, out=command)

    def met_by(self, command: Vector) -> list[str]:
        """Which limits a command (n,) that was sent meets, by joint."""
        found = []
        limits = self._robot.limits
        for i, joint in enumerate(self._robot.joints):
            value, speed = float(command[i]), float(limits.velocity[i])
            if abs(value) >= speed * (1.0 - AT_LIMIT):
                found.append(f'{joint} velocity')
            elif not self.plain:
                found += self._met(joint, i, value)
        return found

    def _met(self, joint: str, i: int, value: float) -> list[str]:
        bounds = self.bounds
        for free, soon, sign in (
            (bounds.range_upper[i], bounds.soon_upper[i], 1.0),
            (bounds.range_lower[i], bounds.soon_lower[i], -1.0),
        ):
            if sign * value >= sign * soon - AT_LIMIT * max(1.0, abs(soon)):
                return [f'{joint} {"position" if sign * free <= sign * soon else "acceleration"}']
        return []


def include_zero(bounds: Bounds) -> None:
    """Widen bounds to have zero in them, also for joints outside their ranges."""
    np.minimum(bounds.soon_lower, 0.0, out=bounds.soon_lower)
    np.maximum(bounds.soon_upper, 0.0, out=bounds.soon_upper)


def _fixed(values: Vector) -> Vector:
    values.flags.writeable = False
    return values
