"""The last word on a command: joints and distances that can still be kept when it is sent."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from tp_controller.errors import NO_VALUE, InvalidValue, shown
from tp_controller.robot import Limits, Robot
from tp_controller.solvers import Bounds
from tp_controller.tasks import SetBasedTask

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]

CLEAR = 1e-6
"""Distance [m, rad] that the last check leaves for rounding, or a tenth of a margin."""
LEAST_CHANGE = 1e-9
"""Least change of a velocity [rad/s, m/s] in a step that an acceleration limit may allow."""
SHARES = (0.5, 0.25, 0.125)
"""How much of a command that cannot be sent is tried, the rest being braking."""
AT_LIMIT = 1e-9
"""A velocity is at its limit within this share of it."""


class Guard:
    """Keeps every command such that the arm can still stop in time.

    Two things follow every solver. The command goes from the last one towards the wished one
    inside the joints' bounds of position, velocity and acceleration. Then the configurations
    that it leads to are looked at themselves, not their linearisation: the next one and those
    of braking to a standstill from there, all joints together or else each as hard as it can.
    If a distance would fall below zero in any of them, less of the command is sent and more
    braking; the braking of the step before was looked at in that step, so there is always an
    answer. A distance that is negative already must not become smaller.

    Without a period only the velocity limits are known to hold.

    Parameters
    ----------
    robot
        The robot, with its limits.
    period
        Time [s] of one step; infinite if unknown.

    Raises
    ------
    InvalidValue
        As `check_limits`.

    Attributes
    ----------
    stopped_by
        Names of the tasks for which the last command had to give way to braking.
    """

    def __init__(self, robot: Robot, period: float = math.inf) -> None:
        self._robot = robot
        self.period = period
        self._before, self._rest, self._way, self._speed, self._q = np.zeros((5, robot.n))
        self._past = np.zeros(robot.n)
        self._limits: Limits | None = None
        self._together = self._past_together = True
        self._short: tuple[str, ...] = ()
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
        self._distance, self._required = np.zeros((2, rows))
        self._doubtful = np.zeros(rows, dtype=np.bool_)

    @property
    def kept(self) -> tuple[str, ...]:
        """Names of the tasks whose distances are looked at."""
        return tuple(task.name for task, _ in self._tasks)

    def rest(self) -> None:
        """Go on from standstill."""
        self._before[:] = self._past[:] = 0.0

    def undo(self) -> None:
        """Go back by a step: its configuration comes again, no time has passed."""
        self._before[:], self._lowest[:] = self._past, self._past_lowest
        self._together = self._past_together

    def brake(self, command: Vector) -> None:
        """Write the next velocities (n,) of braking to rest to ``command``, without a state.

        Inside the acceleration limit, as the last check found it safe; zero without one.
        """
        self._speed[:] = 0.0
        if self._limits is not None and not self._plain:
            self._braking.coast(
                self._before,
                self._robot.limits.acceleration,
                self.period,
                self._together,
                1,
                self._way,
                self._speed,
            )
        self._before[:] = command[:] = self._speed
        self._past[:], self._past_lowest[:] = self._before, self._lowest
        self._past_together = self._together

    def bounds(self, q: Vector) -> Bounds:
        """Bounds on the next velocities at configuration ``q`` (n,) [rad, m].

        Their arrays are written to again by the next call.
        """
        limits = self._robot.limits
        if limits is not self._limits:
            self._take(limits)
        if self._plain:
            return self._bounds
        self._braking.bound(
            q,
            self._before,
            limits.velocity,
            limits.position_min,
            limits.position_max,
            limits.acceleration,
            self.period,
            *self._bounds[1:5],
        )
        return self._bounds

    def _take(self, limits: Limits) -> None:
        # Compiled, or loaded, with the solver's kernel, not to refuse a parameter file.
        from tp_controller import braking

        self._braking = braking
        self._limits = limits
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

    def pass_on(self, q: Vector, command: Vector) -> None:
        """Turn a wished command (n,), inside the velocity limits, into one that can be sent.

        Parameters
        ----------
        q
            Present configuration (n,) [rad, m]; `bounds` was called with it.
        command
            The wished velocities, and then those to be sent.
        """
        if self._plain and not self._tasks:
            self._before[:] = command
            return
        self._past[:], self._past_lowest[:] = self._before, self._lowest
        self._past_together = self._together
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
            # The configuration given may be the robot's own, which moves meanwhile.
            self._q[:] = q
            self._look_ahead(self._q, command)
        self._before[:] = command

    def _look_ahead(self, q: Vector, command: Vector) -> None:
        self.stopped_by = ()
        for task, part in self._tasks:
            self._distance[part] = task.distance
        np.minimum(self._lowest, self._distance, out=self._required)
        np.minimum(self._required, self._clear, out=self._required)
        together = self._together
        if self._is_safe(q, command):
            return
        self.stopped_by = self._short
        way, stop = np.zeros((2, self._robot.n))
        acceleration = self._robot.limits.acceleration
        self._braking.coast(self._before, acceleration, self.period, self._together, 1, way, stop)
        for share in SHARES:
            trial = stop + share * (command - stop)
            if self._is_safe(q, trial):
                command[:] = trial
                return
        command[:], self._together = stop, together

    def _is_safe(self, q: Vector, command: Vector) -> bool:
        """Whether the arm can stop from there, in one way or the other."""
        for together in (True, False) if self._accelerates else (True,):
            if self._stops(q, command, together):
                self._lowest[:] = self._found
                self._together = together
                return True
        return False

    def _stops(self, q: Vector, command: Vector, together: bool) -> bool:
        """Whether every distance stays above what is required, until the arm has stopped."""
        limits, dt = self._robot.limits, self.period
        acceleration = limits.acceleration
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
        try:
            while True:
                self._braking.coast(command, acceleration, dt, together, steps, way, speed)
                self._robot.place(q + dt * command + way)
                for task, part in near:
                    task.probe(distance[part])
                short = distance < self._required
                if short.any():
                    self._short = tuple(task.name for task, part in near if short[part].any())
                    return False
                np.minimum(self._found, distance, out=self._found)
                room = distance - self._required
                if steps >= last or np.all(self._reach @ np.abs(rest - way) <= room):
                    return True
                # So many steps at the present speed cannot use up the room.
                pace = self._reach @ (dt * np.abs(speed))
                moving = pace > 0.0
                ahead = float(np.min(room[moving] / pace[moving], initial=last))
                steps += max(1, int(min(ahead, last)))
        finally:
            self._robot.update(q)

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
