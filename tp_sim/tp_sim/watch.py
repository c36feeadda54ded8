"""What a long run looks for: distances, ranges, speeds, and commands that go back and forth."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tp_controller.distances import Distances
from tp_controller.stack import Stack
from tp_controller.tasks import PositionTask, SetBasedTask

Vector = NDArray[np.float64]

REACHED = 0.01
"""Error [m] of a goal that is reached."""
ROUNDING = 1e-9
"""A limit that is exceeded by less than this share of it is not broken."""
STILL = 1e-3
"""Share of a velocity limit below which a command has no sign."""


class Outcome(NamedTuple):
    """What was seen in one long run."""

    steps: int
    least_distance: float
    """Of every set-based task at the true configuration [m, rad]; infinite if there is none."""
    least_room: float
    """Of every true joint position from the nearer end of its range [rad, m]."""
    speed: float
    """Largest share of a velocity limit, of the commands."""
    acceleration: float
    """Largest share of an acceleration limit, of the commands; zero if there is none."""
    activations: int
    """How often a row of a set-based task began to act."""
    braked: int
    """Steps in which the command had to give way to braking."""
    astray: int
    """Steps in which the controller took the arm for one that does not follow, or did not
    believe the state."""
    reversals: int
    """Steps at rest in which the command of a joint changed its sign."""
    resting: int
    """Steps at rest: in the second half of a goal's time."""
    goals: int
    reached: int
    seconds: float
    """Time that it took [s]."""
    allowance: float = 0.0
    """By how much [m, rad] noise may make distances and ranges be missed."""

    @property
    def broken(self) -> bool:
        """Whether any limit was."""
        return (
            self.least_distance < -self.allowance
            or self.least_room < -self.allowance
            or max(self.speed, self.acceleration) > 1.0 + ROUNDING
        )

    @property
    def restless(self) -> float:
        """Share of the steps at rest in which the command of a joint changed its sign."""
        return self.reversals / max(self.resting, 1)


class Watch:
    """Looks at every command of a stack, and at the true configuration that comes of it.

    Distances and errors are those of a second stack, at the true configuration, whatever the
    controller believes.

    Parameters
    ----------
    stack
        The stack; its arm stands still.
    truth
        Another one of the same parameters.
    """

    def __init__(self, stack: Stack, truth: Stack) -> None:
        self._stack, self._truth = stack, truth
        self._sets = _sets(stack)
        self._acted = [task.acting.copy() for task in self._sets]
        n = stack.robot.n
        self._before, self._sign = np.zeros((2, n))
        self._bounds = [Distances(task) for task in _sets(truth)]
        self.steps = self.activations = self.braked = self.astray = 0
        self.reversals = self.resting = self.goals = self.reached = 0
        self.distance = self.room = math.inf
        self.speed = self.acceleration = 0.0

    def see_place(self, q: Vector) -> None:
        """Take note of a true configuration (nq,)."""
        limits = self._stack.robot.limits
        self.steps += 1
        placed = False
        for distances in self._bounds:
            if distances.first_below(self.distance, q[None]) == 0:
                if not placed:
                    self._truth.robot.place(q)
                    placed = True
                self.distance = min(self.distance, distances.look(q))
        positions = self._stack.robot.space.positions(q)
        room = np.minimum(positions - limits.position_min, limits.position_max - positions)
        self.room = min(self.room, float(room.min()))

    def see_command(
        self, command: Vector, astray: bool, at_rest: bool, moves: Vector | None = None
    ) -> None:
        """Take note of a new command (n,).

        Parameters
        ----------
        command
            The command.
        astray
            Whether the controller said that the arm does not do what it should.
        at_rest
            Whether the arm has had the time to come to rest.
        moves
            True velocities (n,) [rad/s, m/s] of an arm that does not do what it should, or was
            stopped as it got no command for too long: the next one may go on from them.
        """
        limits, safety = self._stack.robot.limits, self._stack.safety_filter
        self.speed = max(self.speed, float(np.max(np.abs(command) / limits.velocity)))
        low = high = self._before
        if moves is not None:
            low, high = np.minimum(low, moves), np.maximum(high, moves)
        change = np.maximum(low - command, command - high) / (limits.acceleration * safety.period)
        self.acceleration = max(self.acceleration, float(change.max()))
        self._before[:] = command
        for i, task in enumerate(self._sets):
            acts = task.acting if task.one_sided else task.on
            self.activations += int(np.count_nonzero(acts & ~self._acted[i]))
            self._acted[i][:] = acts
        self.braked += bool(safety.stopped_by)
        self.astray += astray
        least = np.where(np.isfinite(limits.velocity), STILL * limits.velocity, STILL)
        sign = np.where(np.abs(command) > least, np.sign(command), self._sign)
        if at_rest:
            self.resting += 1
            self.reversals += bool(np.any(sign * self._sign < 0.0))
        self._sign[:] = sign

    def count_goal(self, q: Vector) -> None:
        """Take note of how near the true configuration (nq,) came to a goal."""
        self._truth.robot.update(q)
        self.goals += 1
        errors = []
        for name, task in self._stack.tasks.items():
            if isinstance(task, PositionTask) and task.target is not None:
                own = self._truth.tasks[name]
                own.target = task.target
                own.update()
                errors.append(float(np.linalg.norm(own.error)))
        self.reached += max(errors) < REACHED

    def outcome(self, seconds: float, allowance: float) -> Outcome:
        """What was seen until now, in so much time [s]; see `Outcome.allowance`."""
        return Outcome(
            self.steps,
            self.distance,
            self.room,
            self.speed,
            self.acceleration,
            self.activations,
            self.braked,
            self.astray,
            self.reversals,
            self.resting,
            self.goals,
            self.reached,
            seconds,
            allowance,
        )


def _sets(stack: Stack) -> list[SetBasedTask]:
    return [
        task
        for task in stack.tasks.values()
        if isinstance(task, SetBasedTask) and stack.level_of(task.name) >= 0
    ]
