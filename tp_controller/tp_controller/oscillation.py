"""Oscillations that nobody asked for: which joints, how often, and what drives them."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tp_controller.asked_changes import AskedChanges, TaskChanges
from tp_controller.identification import Fit, search
from tp_controller.oscillation_cause import Evidence, acting_tasks, likely_cause
from tp_controller.reversals import N, Reversals, scale_rows, switch
from tp_controller.stack import Stack
from tp_controller.tasks import SetBasedTask

Vector = NDArray[np.float64]

UNLIMITED = 1.0
"""Velocity [rad/s, m/s] that joints without a limit are measured by."""
STATES = 192
"""States that are remembered, to find out what the arm makes of its commands."""
LONGEST_DELAY, LONGEST_LAG = 0.25, 0.5
"""Longest delay and lag [s] that are looked for."""
AGAIN = 2.0
"""Time [s] after which the cause is looked for anew."""

LEAST_SWITCHES = 4
"""Changes in a row of a row that comes in and goes out again and again."""


class Oscillation(NamedTuple):
    """What oscillates."""

    joints: tuple[str, ...]
    """Joints, the one with the largest share of its limit first."""
    reversals: float
    """Reversals per second of the first one."""
    amplitude: float
    """Amplitude of its command [rad/s, m/s]."""
    level: int
    """The level that reverses most, 0 is the highest; -1 if none does."""
    task: str
    """The task of it whose requested velocity does; empty if none does."""
    cause: str
    """Likely cause and what to do, empty while it is looked for."""

    def __str__(self) -> str:
        more = f' (also {", ".join(self.joints[1:])})' if len(self.joints) > 1 else ''
        return (
            f'{self.joints[0]}{more} reverses {self.reversals:.3g} times per second '
            f'({0.5 * self.reversals:.3g} Hz) with {self.amplitude:.3g} rad/s or m/s: {self.cause}'
        )


class OscillationWatch:
    """Tells joints whose commands reverse again and again although nobody asks for it.

    To be fed once per command. A joint oscillates as `Reversals` says, unless targets,
    feedforwards or settings change nearly as often, by amounts that could do that.

    Where one does, it is found out what the arm makes of its commands, in pieces of some ten
    microseconds per cycle; with that, the velocities that the tasks request, and the rows that
    come in and go out, a cause is named.

    Parameters
    ----------
    stack
        Computes the commands.
    """

    def __init__(self, stack: Stack) -> None:
        self._stack = stack
        n = stack.robot.n
        self._joints = Reversals(n)
        self._speed, self._way = np.zeros((2, n))
        self._place = stack.robot.neutral
        self._limits: object = None
        self._times = np.zeros(STATES)
        self._commands, self._positions = np.zeros((2, STATES, n))
        self._asked = AskedChanges()
        self._now = 0.0
        self.restart()

    def restart(self) -> None:
        """Forget what was seen: commands were not those of `Stack.step`."""
        self._joints.restart()
        self._worst = -1
        self._looking: Iterator[None] | None = None
        self._looked = -math.inf
        self._cause: tuple[int, str, str] | None = None
        self._seen = 0
        self._J: object = None

    @property
    def found(self) -> Oscillation | None:
        """What oscillates now; None if nothing does, or its cause is still looked for."""
        if self._cause is None or self._worst < 0:
            return None
        joints = np.flatnonzero(self._joints.found)
        order = joints[np.argsort(-self._joints.amplitude[joints], kind='stable')]
        names = self._stack.robot.joints
        return Oscillation(
            tuple(names[i] for i in order),
            self._joints.rate(self._worst),
            float(self._joints.amplitude[self._worst] * self._speed[self._worst]),
            *self._cause,
        )

    def _unrolled(self, q: Vector) -> Vector:
        """Positions (n,) of joints, and of poses how far each velocity has led so far."""
        space = self._stack.robot.space
        positions = space.positions(q)
        if space.blocks:
            self._way += space.difference(self._place, q)
            self._place[:] = q
            positions = np.where(space.ranged, positions, self._way)
        return positions

    def see(self, q: Vector, command: Vector, elapsed: float) -> bool:
        """Take a state and the command that answered it.

        Parameters
        ----------
        q
            Measured configuration (nq,) [rad, m].
        command
            Velocities (n,) [rad/s, m/s].
        elapsed
            Time [s] since the state before; infinite or zero if unknown.

        Returns
        -------
        bool
            Whether something is `found`.
        """
        if not 0.0 < elapsed < math.inf:
            self.restart()
            elapsed = self._stack.safety_filter.period
            if not math.isfinite(elapsed):
                return False
        self._now += elapsed
        self._look_at_settings()
        i = self._seen % STATES
        self._times[i], self._commands[i] = self._now, command
        self._positions[i] = self._unrolled(q)
        self._seen += 1
        worst = self._joints.see(command, self._speed, elapsed)
        self._rows.see(self._requested, self._scale, elapsed)
        switch(self._acts, self._now, self._acted, self._switched_at, self._switches)
        joints = self._joints
        if worst < 0 or self._asked.explain(
            joints.rate(worst), float(joints.amplitude[worst]), self._now
        ):
            self._worst, self._cause, self._looking = -1, None, None
            self._looked = -math.inf
            return False
        self._worst = worst
        self._look_for_cause(worst)
        return self._cause is not None

    # What is asked for

    def _look_at_settings(self) -> None:
        stack = self._stack
        rows = stack.rows
        if stack.robot.limits is not self._limits:
            self._limits = stack.robot.limits
            speed = stack.robot.limits.velocity
            self._speed[:] = np.where(np.isfinite(speed), speed, UNLIMITED)
            self._asked.count(1.0, self._now)
        if rows.J is not self._J:
            self._follow_hierarchy()
        np.copyto(self._acts, stack.solver.acting)
        scale_rows(rows.J, self._speed, self._acts, self._one_sided, self._scale)
        for changes in self._changes:
            size = changes.size(self._scale)
            if size > 0.0:
                self._asked.count(size, self._now)

    def _follow_hierarchy(self) -> None:
        rows = self._stack.rows
        k = rows.J.shape[0]
        self._J, self._requested = rows.J, rows.requested
        self._rows = Reversals(k)
        self._scale, self._switches = np.zeros((2, k))
        self._acts, self._acted, self._one_sided = np.zeros((3, k), dtype=bool)
        self._switched_at = np.zeros((k, N))
        self._changes = []
        for task, part in acting_tasks(self._stack):
            self._one_sided[part] = task.one_sided
            self._changes.append(TaskChanges(task, part))
        self._acted[:] = self._stack.solver.acting
        self._asked.count(1.0, self._now)

    # What drives it

    def _driver(self) -> tuple[int, str]:
        """Level and task whose request reverses with the largest share of what joints can do."""
        best, level, name = 0.0, -1, ''
        rows = self._rows
        for task_name, part in self._stack.rows.parts.items():
            for i in range(part.start, part.stop):
                if rows.count(i) >= N // 2 and rows.amplitude[i] > best:
                    best, name = float(rows.amplitude[i]), task_name
        if name:
            level = self._stack.level_of(name)
        return level, name

    def _look_for_cause(self, joint: int) -> None:
        if self._looking is None:
            if self._now - self._looked < AGAIN:
                return
            self._looking = self._look(joint)
        if next(self._looking, self) is self:
            self._looking, self._looked = None, self._now

    def _look(self, joint: int) -> Iterator[None]:
        """Find the cause in pieces."""
        level, name = self._driver()
        fit: Fit | None = None
        recorded = self._recording(joint)
        if recorded is not None:
            for piece in search(*recorded):
                fit = piece
                yield
        evidence = Evidence(
            joint,
            self._joints.rate(joint),
            float(self._joints.amplitude[joint] * self._speed[joint]),
            name,
            self._period(),
            fit,
            *self._switching(),
        )
        self._cause = level, name, likely_cause(self._stack, evidence)

    def _recording(self, joint: int) -> tuple[Vector, Vector, Vector, float, float] | None:
        """Times, commands and positions of late, and the longest delay and lag that they show."""
        m = min(self._seen, STATES)
        order = np.arange(self._seen - m, self._seen) % STATES
        times = self._times[order] - self._times[order[0]]
        longest = min(LONGEST_DELAY, times[-1] / 3.0)
        if m < STATES // 4:
            return None
        return (
            times,
            np.ascontiguousarray(self._commands[order, joint]),
            np.ascontiguousarray(self._positions[order, joint]),
            longest,
            min(LONGEST_LAG, 2.0 * longest),
        )

    def _period(self) -> float:
        """Time [s] of one step, as it was of late."""
        m = min(self._seen, STATES)
        newest = (self._seen - 1) % STATES
        oldest = (self._seen - m) % STATES
        return float(self._times[newest] - self._times[oldest]) / max(m - 1, 1)

    def _switching(self) -> tuple[SetBasedTask | None, float, float]:
        """Set-based task whose rows change most often.

        Returns
        -------
        SetBasedTask or None
            The task.
        float
            How often its rows do in all [Hz].
        float
            How often the one does that does it most often [Hz].
        """
        found, most, most_of_one = None, 0.0, 0.0
        for task, part in acting_tasks(self._stack):
            if not isinstance(task, SetBasedTask):
                continue
            rates = [self._change_rate(i) for i in range(part.start, part.stop)]
            if sum(rates) > most:
                found, most, most_of_one = task, sum(rates), max(rates)
        return found, most, most_of_one

    def _change_rate(self, row: int) -> float:
        """How often a row comes in and goes out [Hz]."""
        k = int(self._switches[row])
        if k < LEAST_SWITCHES:
            return 0.0
        last = min(k, N)
        times = self._switched_at[row]
        span = float(times[(k - 1) % N] - times[(k - last) % N])
        return (last - 1) / span if span > 0.0 else 0.0
