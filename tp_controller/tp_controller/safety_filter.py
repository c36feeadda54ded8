"""Safety filter: changes commands so that the arm can always brake before it breaks a limit."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from tp_controller.arm import Arm
from tp_controller.errors import NO_VALUE, InvalidValue, shown
from tp_controller.robot import Limits, Robot
from tp_controller.solvers import Bounds
from tp_controller.tasks import SetBasedTask

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]

CLEAR = 1e-6
"""Distance [m, rad] that is left for rounding, or a tenth of a margin."""
LEAST_CHANGE = 1e-9
"""Least change of a velocity [rad/s, m/s] in a step that an acceleration limit may allow."""
SHARES = (0.5, 0.25, 0.125)
"""How much of a command that cannot be sent is tried, the rest being braking."""
AT_LIMIT = 1e-9
"""A velocity is at its limit within this share of it."""
LEEWAY = 1e-3
"""By how much [m, rad] a distance that is negative may be lower between two samples: with bounds
alone nothing can be proven of one that must not become smaller at all."""
PROBES = 40
"""Configurations between two samples that are looked at before a command counts as unsafe."""

Near = list[tuple[SetBasedTask, slice]]
"""Tasks with the rows of their distances."""


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
    stopped_by
        Names of the tasks for which the last command had to give way to braking.
    """

    def __init__(self, robot: Robot, period: float = math.inf) -> None:
        self._robot = robot
        self.period = period
        self._before, self._rest, self._way, self._speed, self._q = np.zeros((5, robot.n))
        self._past = np.zeros(robot.n)
        self._line = np.zeros((4, robot.n))
        self._limits: Limits | None = None
        self._plain, self._accelerates = True, False
        self._step, self._acceleration = period, robot.limits.acceleration
        self._bounds = Bounds.of_speed(robot.limits.velocity)
        self._together = self._past_together = True
        self._short: tuple[str, ...] = ()
        self.arm = Arm(robot.joints, robot.response, period)
        self._late = not robot.response.ideal
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
        self._tasks: list[tuple[SetBasedTask, slice]] = []
        rows = 0
        for task in tasks if math.isfinite(self.period) else ():
            self._tasks.append((task, slice(rows, rows + task.k)))
            rows += task.k
        self._reach: Matrix = np.zeros((rows, self._robot.n))
        for task, part in self._tasks:
            self._reach[part] = task.reach
        margins = [np.full(task.k, task.margin) for task, _ in self._tasks]
        self._clear = np.minimum(0.1 * np.concatenate([*margins, np.zeros(0)]), CLEAR)
        self._lowest, self._found = self._clear.copy(), self._clear.copy()
        self._past_lowest = self._clear.copy()
        self._distance, self._required, self._leeway = np.zeros((3, rows))
        self._most, self._bend, self._budget = *np.zeros((2, rows)), 0
        self._doubtful = np.zeros(rows, dtype=np.bool_)
        # Noise counts twice where the arm may do something else than the model.
        noise = self._robot.response.noise * (2.0 if self._robot.response.hold else 1.0)
        self._reserve = self._clear + self._reach @ noise

    @property
    def kept(self) -> tuple[str, ...]:
        """Names of the tasks whose distances are looked at."""
        return tuple(task.name for task, _ in self._tasks)

    def know_period(self, period: float) -> None:
        """Take over the time [s] of one step, which was unknown so far; the arm stands still.

        Tasks have to be watched anew.
        """
        self.period = self._step = period
        self.arm = Arm(self._robot.joints, self._robot.response, period)
        self._before[:] = 0.0
        self._limits = None

    def rest(self) -> None:
        """Go on from standstill."""
        self._before[:] = self._past[:] = 0.0
        self.arm.rest()

    def undo(self) -> None:
        """Go back by a step: its configuration comes again, no time has passed."""
        self._before[:], self._lowest[:] = self._past, self._past_lowest
        self._together = self._past_together
        self.arm.undo()

    def take(self, q: Vector, elapsed: float | None = None, qd: Vector | None = None) -> bool:
        """Go on to a measured state; false if it cannot be believed. See `Arm.take`."""
        self._keep()
        return self.arm.take(q, self._before, elapsed, qd)

    def bounds(self) -> Bounds:
        """Bounds on the next velocities, at the reference configuration.

        Their arrays are written to again by the next call.
        """
        limits = self._robot.limits
        if limits is not self._limits:
            self._use(limits)
        if self._plain:
            return self._bounds
        arm = self.arm
        if arm.step != self._step:
            # The change by one command stays the same when commands are farther apart.
            self._step = arm.step
            slower = self.period / arm.step
            self._acceleration = (
                limits.acceleration if slower == 1.0 else _fixed(limits.acceleration * slower)
            )
        if self._late:
            self._braking.bound_late(
                arm.p,
                self._before,
                limits.velocity,
                limits.position_min,
                limits.position_max,
                self._acceleration,
                arm.step,
                self.period,
                arm.response.noise,
                arm.upper,
                arm.lower,
                arm.held_upper,
                arm.held_lower,
                *self._bounds[1:5],
            )
            return self._bounds
        self._braking.bound(
            arm.z,
            self._before,
            limits.velocity,
            limits.position_min,
            limits.position_max,
            self._acceleration,
            arm.step,
            *self._bounds[1:5],
        )
        return self._bounds

    def _use(self, limits: Limits) -> None:
        # Compiled, or loaded, with the solver's kernel, not to refuse a parameter file.
        from tp_controller import braking, following

        self._braking, self._following = braking, following
        self._limits = limits
        self.arm.limit = limits.velocity
        self._step, self._acceleration = self.period, limits.acceleration
        endless = np.isinf(np.concatenate([limits.position_min, limits.position_max]))
        self._accelerates = bool(np.isfinite(limits.acceleration).any())
        self._plain = not math.isfinite(self.period) or (
            bool(endless.all()) and not self._accelerates
        )
        if self._plain:
            self._bounds = Bounds.of_speed(limits.velocity)
        else:
            low, high, soon_low, soon_high = np.zeros((4, self._robot.n))
            self._bounds = Bounds(
                limits.velocity, low, high, soon_low, soon_high, not endless.all()
            )

    def pass_on(self, command: Vector) -> None:
        """Turn a wished command (n,), inside the velocity limits, into one that can be sent.

        `take` and `bounds` were called for the state that it answers, and the robot is at the
        reference configuration.

        Parameters
        ----------
        command
            The wished velocities, and then those to be sent.
        """
        if not self._plain:
            self._braking.approach(
                command,
                self._before,
                self._robot.limits.acceleration,
                self.period,
                self._bounds.soon_lower,
                self._bounds.soon_upper,
                command,
            )
        if self._tasks:
            # The robot's own configuration moves meanwhile.
            self._q[:] = self.arm.z
            self._look_ahead(self._q, command)
        self._before[:] = command
        self.arm.send(command)

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
            self.bounds()
            self._brake(command)
        else:
            command[:] = 0.0
        self._before[:] = command
        self.arm.send(command)
        if elapsed is not None:
            self._keep()
            self.arm.keep()

    def _keep(self) -> None:
        """Let `undo` lead to the present state."""
        self._past[:], self._past_lowest[:] = self._before, self._lowest
        self._past_together = self._together

    def _brake(self, command: Vector) -> None:
        """Fill the velocities (n,) of the next step of the braking trajectory."""
        if not math.isfinite(self.period):
            command[:] = 0.0
            return
        self._braking.coast(
            self._before,
            self._acceleration,
            self.arm.step,
            self._together,
            1,
            self._way,
            command,
        )
        if self._late and not self._plain:
            np.clip(command, self._bounds.soon_lower, self._bounds.soon_upper, out=command)

    def _look_ahead(self, q: Vector, command: Vector) -> None:
        self.stopped_by = ()
        for task, part in self._tasks:
            self._distance[part] = task.distance
        if self._late:
            # What was found before does not count: noise would take it down, step by step.
            np.minimum(self._distance, self._reserve, out=self._required)
        else:
            np.minimum(self._lowest, self._distance, out=self._required)
            np.minimum(self._required, self._clear, out=self._required)
        np.multiply(LEEWAY, self._distance < self._clear, out=self._leeway)
        together = self._together
        if self._is_safe(q, command):
            return
        self.stopped_by = self._short
        stop = np.zeros(self._robot.n)
        self._brake(stop)
        for share in SHARES:
            trial = stop + share * (command - stop)
            if self._is_safe(q, trial):
                command[:] = trial
                return
        command[:], self._together = stop, together

    def _is_safe(self, q: Vector, command: Vector) -> bool:
        """Whether the arm can stop from there, in one way or the other."""
        if self._late:
            return self._stops_late(q, command)
        for together in (True, False) if self._accelerates else (True,):
            if self._stops(q, command, together):
                self._lowest[:] = self._found
                self._together = together
                return True
        return False

    def _stops(self, q: Vector, command: Vector, together: bool) -> bool:
        """Whether every distance stays above what is required, until the arm has stopped."""
        limits, dt = self._robot.limits, self.arm.step
        acceleration = self._acceleration
        rest, way, speed, doubtful = self._rest, self._way, self._speed, self._doubtful
        doubts = self._braking.doubts(
            q,
            command,
            limits.position_min,
            limits.position_max,
            acceleration,
            dt,
            together,
            self._distance,
            self._required,
            self._reach,
            rest,
            speed,
            doubtful,
        )
        if doubts < 0:
            return False
        np.minimum(self._distance, self._clear, out=self._found)
        if doubts == 0:
            return True
        near = [(task, part) for task, part in self._tasks if doubtful[part].any()]
        distance = np.full(doubtful.size, np.inf)
        last, steps = self._braking.steps_to_rest(command, acceleration, dt), 0
        before, known, straight = q, self._distance, True
        self._mark(near)
        try:
            while True:
                self._braking.coast(command, acceleration, dt, together, steps, way, speed)
                after = q + dt * command + way
                self._probe(near, after, distance)
                if np.any(distance < self._required):
                    self._short = _below(near, distance, self._required)
                    return False
                self._budget = PROBES
                if straight and not self._between(
                    near, before, after, known, distance, self._required - self._leeway
                ):
                    return False
                np.minimum(self._found, distance, out=self._found)
                room = distance - self._required
                if steps >= last or np.all(self._reach @ np.abs(rest - way) <= room):
                    return True
                # So many steps at the present speed cannot use up the room.
                pace = self._reach @ (dt * np.abs(speed))
                moving = pace > 0.0
                ahead = float(np.min(room[moving] / pace[moving], initial=last))
                straight = ahead < 1.0
                steps += max(1, int(min(ahead, last)))
                if straight:
                    self._robot.place(after)
                    self._mark(near)
                    before, known = after, distance.copy()
        finally:
            self._robot.update(q)

    def _stops_late(self, q: Vector, command: Vector) -> bool:
        """As `_stops`, for an arm that may do something else before it brakes."""
        limits, required = self._robot.limits, self._required
        if not self.arm.line(
            command,
            self._acceleration,
            limits.position_min,
            limits.position_max,
            self._line,
        ):
            return True
        start, way, tube = self._line[:3]
        doubtful = self._doubtful
        if not self._following.line_doubts(
            way, tube, self._distance, required, self._reach, doubtful
        ):
            return True
        near = [(task, part) for task, part in self._tasks if doubtful[part].any()]
        first, last = np.full((2, doubtful.size), np.inf)
        end = start + way
        enough = required + self._reach @ (np.abs(way) + tube)
        enough[~doubtful] = -np.inf
        try:
            self._probe(near, end, last, enough)
            self._probe(near, start, first, enough)
            first[~doubtful] = last[~doubtful] = np.inf
            # Where the arm is already too near it must not get nearer.
            required = np.minimum(required, first) + self._reach @ tube
            for distance in (first, last):
                if np.any(distance < required):
                    self._short = _below(near, distance, required)
                    return False
            self._mark(near)
            self._robot.place(end)
            self._budget = PROBES
            required -= self._leeway
            return self._between(near, start.copy(), end, first, last, required)
        finally:
            self._robot.update(q)

    def _probe(self, near: Near, q: Vector, out: Vector, enough: Vector | None = None) -> None:
        """Fill the distances of tasks at a configuration, where the robot stays."""
        self._robot.place(q)
        for task, part in near:
            task.probe(out[part], None if enough is None else enough[part])

    def _mark(self, near: Near) -> None:
        for task, _ in near:
            task.mark()

    def _between(
        self,
        near: Near,
        before: Vector,
        after: Vector,
        first: Vector,
        last: Vector,
        required: Vector,
    ) -> bool:
        """Whether distances are large enough on the straight way between two configurations.

        No distance changes by more than its reach allows, and no point of a link leaves the
        straight line between its places by more than the bend of the way. Where that does not
        tell, the way is halved (conservative advancement, by bisection).

        Parameters
        ----------
        near
            Tasks that count, marked at the first configuration; the robot is at the second.
        before, after
            The configurations (n,).
        first, last, required
            The distances (k,) there, infinite for other tasks, and what is required.
        """
        most, bend = self._most, self._bend
        self._following.lengths(before, after, self._reach, most, bend)
        short = 0.5 * (first + last - most) < required
        short &= self._doubtful
        if not short.any():
            return True
        lowest = np.full(short.size, np.inf)
        for task, part in near:
            if short[part].any():
                task.between(bend[part], lowest[part])
        short &= lowest < required
        if not short.any():
            return True
        self._short = _below(near, np.where(short, -np.inf, np.inf), required)
        if self._budget <= 0:
            return False
        self._budget -= 1
        near = [(task, part) for task, part in near if short[part].any()]
        # Half the way is as long as half of it; other rows are done with.
        enough = np.where(short, required + 0.5 * most, -np.inf)
        middle, distance = 0.5 * (before + after), np.full(short.size, np.inf)
        self._probe(near, middle, distance, enough)
        distance[~short] = np.inf
        if np.any(distance < required):
            return False
        self._robot.place(before)
        self._mark(near)
        self._robot.place(middle)
        if not self._between(near, before, middle, first, distance, required):
            return False
        self._robot.place(middle)
        self._mark(near)
        self._robot.place(after)
        return self._between(near, middle, after, distance, last, required)

    def active_limits(self, command: Vector) -> list[str]:
        """Which limits a command (n,) that was sent meets, by joint, and who stopped it."""
        found = []
        limits = self._robot.limits
        for i, joint in enumerate(self._robot.joints):
            value, speed = float(command[i]), float(limits.velocity[i])
            if abs(value) >= speed * (1.0 - AT_LIMIT):
                found.append(f'{joint} velocity')
            elif not self._plain:
                found += self._met(joint, i, value)
        return found + [f'{name} distance' for name in self.stopped_by]

    def _met(self, joint: str, i: int, value: float) -> list[str]:
        bounds = self._bounds
        for free, soon, sign in (
            (bounds.range_upper[i], bounds.soon_upper[i], 1.0),
            (bounds.range_lower[i], bounds.soon_lower[i], -1.0),
        ):
            if sign * value >= sign * soon - AT_LIMIT * max(1.0, abs(soon)):
                return [f'{joint} {"position" if sign * free <= sign * soon else "acceleration"}']
        return []


def _below(near: Near, distance: Vector, required: Vector) -> tuple[str, ...]:
    """Names of the tasks of which a distance (k,) is below what is required."""
    short = distance < required
    return tuple(task.name for task, part in near if short[part].any())


def _fixed(values: Vector) -> Vector:
    values.flags.writeable = False
    return values
