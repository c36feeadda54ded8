"""Lookahead: whether the arm can stop without a distance that becomes too small."""

from __future__ import annotations

from collections.abc import Iterable
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tp_controller.arm import Arm
from tp_controller.prepared import Prepared
from tp_controller.robot import Robot
from tp_controller.tasks import SetBasedTask

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]

CLEAR = 1e-6
"""Distance [m, rad] that is left for rounding, or a tenth of a margin."""
LEEWAY = 1e-3
"""By how much [m, rad] a distance that is negative may be lower between two samples: with bounds
alone nothing can be proven of one that must not become smaller at all."""
COMMAND, LEAST, MOST, ACCELERATION, STEP, TOGETHER = range(1, 7)
"""Places among the arguments of `tp_controller.braking_distances.doubts`."""
PROBES = 200
"""Largest number of configurations that are looked at in one step. A command that is not proven
safe by then counts as unsafe."""

Near = list[tuple[SetBasedTask, slice]]
"""Tasks with the rows of their distances."""


class Stretch(NamedTuple):
    """A part of a braking trajectory."""

    begin: int
    finish: int
    """Its first and its last step."""
    before: Vector
    after: Vector
    """Configurations (nq,) there."""
    gone: Vector
    going: Vector
    """How far the joints have got until then (n,), since they began to brake."""


class Lookahead:
    """Checks the distances of tasks on the way that a command leads to, braking included.

    These are the distances themselves, not their linearisation: at the configuration that the
    command leads to, at those of the braking trajectory from there, all joints together or else
    each as hard as it can, and in between. A distance that is negative already must not become
    smaller.

    Parameters
    ----------
    robot
        The robot, with its limits and its response.
    arm
        What the arm makes of the commands.
    tasks
        Whose distances are kept.

    Attributes
    ----------
    tasks
        The tasks, with the rows of their distances.
    together
        Whether the braking trajectory found last has all joints stop at the same time.
    short
        Names of the tasks whose distances forbade the last command.
    probes
        How many configurations were looked at for the last command, apart from the ends.
    """

    def __init__(self, robot: Robot, arm: Arm, tasks: Iterable[SetBasedTask]) -> None:
        self._robot, self._arm = robot, arm
        self.tasks: Near = []
        rows = 0
        for task in tasks:
            self.tasks.append((task, slice(rows, rows + task.k)))
            rows += task.k
        self._reach: Matrix = np.zeros((rows, robot.n))
        for task, part in self.tasks:
            self._reach[part] = task.reach
        margins = [np.full(task.k, task.margin) for task, _ in self.tasks]
        self._clear = np.minimum(0.1 * np.concatenate([*margins, np.zeros(0)]), CLEAR)
        self._lowest, self._found = self._clear.copy(), self._clear.copy()
        self._past_lowest = self._clear.copy()
        self._distance, self._required, self._leeway, self._most, self._bend = np.zeros((5, rows))
        self._doubtful = np.zeros(rows, dtype=np.bool_)
        response = robot.response
        # Noise counts twice where the arm may do something else than the model.
        noise = response.noise * (2.0 if response.hold else 1.0)
        self._reserve = self._clear + self._reach @ noise
        # A row that was too near counts as near until it is half way to its margin.
        half = 0.5 * (self._reserve + np.concatenate([*margins, np.zeros(0)]))
        self._apart = np.maximum(self._reserve, half)
        self._near, self._past_near = np.zeros((2, rows), dtype=np.bool_)
        self._late = not response.ideal
        self._rest, self._way, self._speed = np.zeros((3, robot.n))
        self._q = robot.neutral
        self._acceleration = robot.limits.acceleration
        self._accelerates = bool(np.isfinite(self._acceleration).any())
        self._line = np.zeros((4, robot.n))
        self.probes = 0
        self.together = self._past_together = True
        self.short: tuple[str, ...] = ()

    @cached_property
    def _compiled(self) -> tuple[Any, Any]:
        """Modules that are compiled, or loaded, for arms that move."""
        from tp_controller import braking, braking_distances

        return braking, braking_distances

    @cached_property
    def _require(self) -> Prepared:
        """The call that finds what is required of the distances."""
        return Prepared(
            self._compiled[1].require,
            self._lowest,
            self._distance,
            self._clear,
            LEEWAY,
            self._required,
            self._leeway,
        )

    @cached_property
    def _doubts(self) -> Prepared:
        """The call that finds distances that could become too small."""
        limits = self._robot.limits
        return Prepared(
            self._compiled[1].doubts,
            self._arm.z,
            self._way,
            limits.position_min,
            limits.position_max,
            limits.acceleration,
            float(self._arm.step),
            True,
            self._distance,
            self._required,
            self._clear,
            self._reach,
            self._rest,
            self._speed,
            self._doubtful,
            self._found,
        )

    def keep(self) -> None:
        """Let `undo` lead to the present state."""
        self._past_lowest[:], self._past_together = self._lowest, self.together
        self._past_near[:] = self._near

    def undo(self) -> None:
        """Go back by a step."""
        self._lowest[:], self.together = self._past_lowest, self._past_together
        self._near[:] = self._past_near

    def begin(self) -> None:
        """Take over the distances of the tasks' last update, at the reference configuration."""
        self._q[:] = self._arm.reference
        self.probes = 0
        self.short = ()
        for task, part in self.tasks:
            self._distance[part] = task.distance
        if self._late:
            # What was found before does not count: noise would take it down, step by step.
            np.minimum(self._distance, self._reserve, out=self._required)
            self._near &= self._distance < self._apart
            self._near |= self._distance < self._reserve
            # A distance above zero may be lower by this much, but not below zero.
            np.clip(self._distance, 0.0, LEEWAY, out=self._leeway)
            self._leeway[self._distance < self._clear] = LEEWAY
            self._leeway[~self._near] = 0.0
        else:
            self._require.run()

    def is_safe(self, command: Vector, acceleration: Vector) -> bool:
        """Whether the arm can stop from a command, in one way or the other.

        Parameters
        ----------
        command
            Velocities (n,) of the step.
        acceleration
            Limits (n,) in changes of velocity by `Arm.step`.
        """
        if acceleration is not self._acceleration:
            self._acceleration = acceleration
            self._accelerates = bool(np.isfinite(acceleration).any())
        if self._late:
            return self._stops_late(command)
        for together in (True, False) if self._accelerates else (True,):
            if self._stops(command, together):
                self._lowest[:] = self._found
                self.together = together
                return True
        return False

    def _stops(self, command: Vector, together: bool) -> bool:
        """Whether every distance stays above what is required, until the arm has stopped."""
        limits, dt, doubtful = self._robot.limits, self._arm.step, self._doubtful
        call = self._doubts
        call.replace(COMMAND, command)
        call.replace(LEAST, limits.position_min)
        call.replace(MOST, limits.position_max)
        call.replace(ACCELERATION, self._acceleration)
        call.put(STEP, dt)
        call.put(TOGETHER, together)
        doubts = call.run()
        if doubts < 0:
            return False
        if doubts == 0:
            return True
        # The present configuration is left behind: what lies ahead may not fall back to it.
        self._found[doubtful] = self._clear[doubtful]
        near = [(task, part) for task, part in self.tasks if doubtful[part].any()]
        step, rest = dt * command, self._rest.copy()
        after = self._robot.integrate(self._q, step)
        steps = self._compiled[0].steps_to_rest(command, self._acceleration, dt)
        end = self._braked(command, together, (0, steps), after, rest)
        # Of a row that cannot use up its room on the whole way, that is enough. No joint turns
        # back while it brakes.
        enough = self._required + self._reach @ (np.abs(step) + np.abs(rest))
        enough[~doubtful] = -np.inf
        first, last = np.full((2, doubtful.size), np.inf)
        start = np.where(doubtful, self._distance, np.inf)
        stretch = Stretch(0, steps, after, end, np.zeros_like(rest), rest)
        try:
            return (
                self._is_wide(near, end, last, enough)
                and self._is_wide(near, after, first, enough)
                and self._straight(near, self._q, step, after, start, first)
                and self._along(near, command, together, stretch, first, last)
            )
        finally:
            self._robot.update(self._q)

    def _braked(
        self, command: Vector, together: bool, steps: tuple[int, int], q: Vector, way: Vector
    ) -> Vector:
        """Configuration (nq,) to which some steps of the braking trajectory lead.

        Parameters
        ----------
        command, together
            From where and how the arm brakes.
        steps
            The first and the last step.
        q, way
            Configuration (nq,) at the first step, and how far the joints get from there (n,).
        """
        if together or not self._robot.space.blocks:
            # All velocities keep their direction, or the order does not matter.
            return self._robot.integrate(q, way)
        before, after = np.zeros((2, way.size))
        for i in range(*steps):
            for number, out in ((i, before), (i + 1, after)):
                self._compiled[0].coast(
                    command, self._acceleration, self._arm.step, together, number, out, self._speed
                )
            q = self._robot.integrate(q, after - before)
        return q

    def _along(
        self,
        near: Near,
        command: Vector,
        together: bool,
        stretch: Stretch,
        first: Vector,
        last: Vector,
    ) -> bool:
        """Whether distances are large enough between two steps of the braking trajectory.

        No joint turns back while it brakes, so that no distance changes by more than the lengths
        of the joints' ways allow. The trajectory leaves the straight line between its ends by no
        more than the acceleration allows, not at all where the joints brake together. Where
        neither tells, the step in the middle is looked at.

        Parameters
        ----------
        near
            Tasks that count.
        command, together
            From where and how the arm brakes.
        stretch
            The two steps, and where they are.
        first, last
            The distances (k,) there; these are infinite for rows that do not count.
        """
        braking, distances = self._compiled
        begin, finish, before, after, gone, going = stretch
        distances.lengths(going - gone, self._reach, self._most, self._bend)
        short = 0.5 * (first + last - self._most) < self._required
        if not short.any():
            return True
        if finish - begin <= 1:
            return self._straight(near, before, going - gone, after, first, last)
        near = [(task, part) for task, part in near if short[part].any()]
        if together or not self._robot.space.blocks:
            if not together:
                time = (finish - begin) * self._arm.step
                aside = 0.125 * time * time * self._acceleration
                self._bend += self._reach @ np.minimum(np.abs(going - gone), aside)
            short &= self._lowest_between(near, before, after) < self._required
            if not short.any():
                return True
        self.short = _below(near, np.where(short, -np.inf, np.inf), self._required)
        if self.probes >= PROBES:
            return False
        self.probes += 1
        middle = (begin + finish) // 2
        braking.coast(
            command, self._acceleration, self._arm.step, together, middle, self._way, self._speed
        )
        way = self._way.copy()
        q = self._braked(command, together, (begin, middle), before, way - gone)
        # Either half is at most as long as the whole; other rows are done with.
        enough = np.where(short, self._required + self._most, -np.inf)
        near = [(task, part) for task, part in near if short[part].any()]
        distance = np.full(short.size, np.inf)
        halves = (
            Stretch(begin, middle, before, q, gone, way),
            Stretch(middle, finish, q, after, way, going),
        )
        return (
            self._is_wide(near, q, distance, enough)
            and self._along(near, command, together, halves[0], first, distance)
            and self._along(near, command, together, halves[1], distance, last)
        )

    def _stops_late(self, command: Vector) -> bool:
        """As `_stops`, for an arm that may do something else before it brakes."""
        limits, required = self._robot.limits, self._required
        if not self._arm.line(
            command,
            self._acceleration,
            limits.position_min,
            limits.position_max,
            self._line,
        ):
            return True
        start, way, tube = self._line[:3]
        begin = self._arm.configuration(start)
        end = self._robot.integrate(begin, way)
        doubtful = self._doubtful
        if not self._compiled[1].line_doubts(
            way, tube, self._distance, required, self._reach, doubtful
        ):
            return True
        near = [(task, part) for task, part in self.tasks if doubtful[part].any()]
        first, last = np.full((2, doubtful.size), np.inf)
        enough = required + self._reach @ (np.abs(way) + tube)
        enough[~doubtful] = -np.inf
        try:
            self._probe(near, end, last, enough)
            self._probe(near, begin, first, enough)
            first[~doubtful] = last[~doubtful] = np.inf
            # Where the arm is too near already, it must not get nearer. The tube does not count
            # there: no command keeps the arm out of where it may be already.
            floor = np.where(required < self._reserve, np.minimum(required, first), first)
            required = np.where(self._near, floor, required + self._reach @ tube)
            for distance in (first, last):
                if np.any(distance < required):
                    self.short = _below(near, distance, required)
                    return False
            return self._straight(near, begin, way.copy(), end, first, last, required)
        finally:
            self._robot.update(self._q)

    def _is_wide(self, near: Near, q: Vector, out: Vector, enough: Vector) -> bool:
        """Fill distances (k,) at a configuration; whether they are what is required.

        Those of rows that do not count, of which nothing is enough, are infinite.
        """
        self._probe(near, q, out, enough)
        out[enough == -np.inf] = np.inf
        if np.any(out < self._required):
            self.short = _below(near, out, self._required)
            return False
        np.minimum(self._found, out, out=self._found)
        return True

    def _probe(self, near: Near, q: Vector, out: Vector, enough: Vector) -> None:
        """Fill the distances of tasks at a configuration, where the robot stays."""
        self._robot.place(q)
        for task, part in near:
            task.probe(out[part], enough[part])

    def _lowest_between(self, near: Near, before: Vector, after: Vector) -> Vector:
        """Lower bounds (k,) of the distances between two configurations (n,).

        No point of a link leaves the straight line between its places by more than the bend;
        the bound is infinite for rows of other tasks.
        """
        lowest = np.full(self._bend.size, np.inf)
        self._robot.place(before)
        for task, _ in near:
            task.mark()
        self._robot.place(after)
        for task, part in near:
            task.between(self._bend[part], lowest[part])
        return lowest

    def _straight(
        self,
        near: Near,
        before: Vector,
        way: Vector,
        after: Vector,
        first: Vector,
        last: Vector,
        required: Vector | None = None,
    ) -> bool:
        """Whether distances are large enough on the way that constant velocities lead along.

        No distance changes by more than its reach allows, and no point of a link leaves the
        straight line between its places by more than the bend of the way. Where that does not
        tell, the way is halved (conservative advancement, by bisection).

        Parameters
        ----------
        near
            Tasks that count.
        before, way, after
            The configuration (nq,) at the beginning, how far the joints get (n,), and the
            configuration at the end.
        first, last
            The distances (k,) there, infinite for rows that do not count.
        required
            What is required (k,); of the present command when left out.
        """
        if required is None:
            required = self._required
        most = self._most
        self._compiled[1].lengths(way, self._reach, most, self._bend)
        short = 0.5 * (first + last - most) < required - self._leeway
        if not short.any():
            return True
        near = [(task, part) for task, part in near if short[part].any()]
        short &= self._lowest_between(near, before, after) < required - self._leeway
        if not short.any():
            return True
        self.short = _below(near, np.where(short, -np.inf, np.inf), required)
        if self.probes >= PROBES:
            return False
        self.probes += 1
        near = [(task, part) for task, part in near if short[part].any()]
        # Half the way is as long as half of it; other rows are done with.
        enough = np.where(short, required + 0.5 * most, -np.inf)
        half, distance = 0.5 * way, np.full(short.size, np.inf)
        middle = self._robot.integrate(before, half)
        self._probe(near, middle, distance, enough)
        distance[~short] = np.inf
        if np.any(distance < required - self._leeway):
            return False
        return self._straight(
            near, before, half, middle, first, distance, required
        ) and self._straight(near, middle, half, after, distance, last, required)


def _below(near: Near, distance: Vector, required: Vector) -> tuple[str, ...]:
    """Names of the tasks of which a distance (k,) is below what is required."""
    short = distance < required
    return tuple(task.name for task, part in near if short[part].any())
