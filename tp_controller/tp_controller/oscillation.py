"""Oscillations that nobody asked for: which joints, how often, and what drives them."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tp_controller.identification import Fit, search
from tp_controller.reversals import LEAST, N, Reversals, scale_rows, switch
from tp_controller.stack import Stack
from tp_controller.tasks import SetBasedTask, Task

Vector = NDArray[np.float64]

UNLIMITED = 1.0
"""Velocity [rad/s, m/s] that joints without a limit are measured by."""
STATES = 192
"""States that are remembered, to find out what the arm makes of its commands."""
LONGEST_DELAY, LONGEST_LAG = 0.25, 0.5
"""Longest delay and lag [s] that are looked for."""
AGAIN = 2.0
"""Time [s] after which the cause is looked for anew."""

ASKED_TIME = 2.0
"""Time [s] over which it is counted how often something is asked for."""
OCTAVES = 12
"""What is asked for is counted by its size, in powers of two."""
ASKED_SIZE = 0.1
"""A change that is asked for counts if it is at least this share of the swing of a joint."""
ASKED_REVERSALS = 3.0
"""So many reversals of a joint may come of one of them."""

LATE = 0.5
"""A delay and lag that was not declared counts from so many periods on."""
LOOP = 0.4
"""Gain times delay from which a task rings; 1/e is without overshoot."""
LONGEST_PERIOD = 0.05
"""Period [s] that is taken for longer ones there."""
DECLARED = 1.5
"""Noise is what was declared up to so many times of it."""
NOISY = 6.0
"""A swing of at most so many times gain times noise is made by the noise."""
NO_NOISE = 1e-7
"""Difference [rad, m] from what a joint should do that is no noise."""
LEAST_SWITCHES = 4
"""Changes in a row of a row that comes in and goes out again and again."""
OFTEN = 0.3
"""Rows that change so many times as often as the joints reverse are what makes them reverse."""
SHORTFALL = 1e-3
"""Share of what a level asked for that it may miss while it counts as getting it."""


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
        self._asked = np.zeros(OCTAVES)
        self._now = self._asked_at = 0.0
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
        if worst < 0 or self._is_asked(worst):
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
            self._ask(1.0)
        if rows.J is not self._J:
            self._follow_hierarchy()
        np.copyto(self._acts, stack.solver.acting)
        scale_rows(rows.J, self._speed, self._acts, self._one_sided, self._scale)
        for asked in self._asks:
            size = asked.size(self._scale)
            if size > 0.0:
                self._ask(size)

    def _follow_hierarchy(self) -> None:
        rows = self._stack.rows
        k = rows.J.shape[0]
        self._J, self._requested = rows.J, rows.requested
        self._rows = Reversals(k)
        self._scale, self._switches = np.zeros((2, k))
        self._acts, self._acted, self._one_sided = np.zeros((3, k), dtype=bool)
        self._switched_at = np.zeros((k, N))
        self._asks = []
        for task, part in self._parts():
            self._one_sided[part] = task.one_sided
            self._asks.append(_Asked(task, part))
        self._acted[:] = self._stack.solver.acting
        self._ask(1.0)

    def _ask(self, size: float) -> None:
        """Count a change that is asked for, by its size as a share of the limits."""
        self._fade()
        octave = min(max(0, math.ceil(-math.log2(max(size, 1e-9)) - 1e-9)), OCTAVES - 1)
        self._asked[octave] += 1.0 / ASKED_TIME

    def _fade(self) -> None:
        if self._now > self._asked_at:
            self._asked *= math.exp((self._asked_at - self._now) / ASKED_TIME)
            self._asked_at = self._now

    def _is_asked(self, joint: int) -> bool:
        """Whether enough is asked for to make a joint reverse so often."""
        self._fade()
        size = ASKED_SIZE * 2.0 * float(self._joints.amplitude[joint])
        octaves = min(max(1, math.floor(-math.log2(max(size, LEAST))) + 1), OCTAVES)
        asked = float(self._asked[:octaves].sum())
        return self._joints.rate(joint) <= ASKED_REVERSALS * asked

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
        self._cause = level, name, self._judge(joint, name, fit)

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

    def _judge(self, joint: int, name: str, fit: Fit | None) -> str:
        """Likely cause, and what to do."""
        stack = self._stack
        robot, arm = stack.robot, stack.arm
        period = self._period()
        task = stack.tasks.get(name)
        gain = _gain(task)
        rate = self._joints.rate(joint)
        changing, changes, of_one = self._switching()
        if changing is not None and not changing.one_sided and changes >= OFTEN * rate:
            return (
                f'rows of tasks.{changing.name} come in and go out {of_one:.3g} times per '
                f'second; tasks.{changing.name}.switching: smooth does not, or make its release '
                'larger'
            )
        late = self._late(joint, fit)
        if late and (gain * abs(late) >= LOOP or changing is not None):
            return self._say_late(joint, fit, task)
        if task is not None and gain * period >= 1.0:
            return (
                f'tasks.{name}.gain of {gain:.3g} is too high for periods of '
                f'{1e3 * period:.3g} ms; use at most {0.5 / period:.3g}'
            )
        swing = float(self._joints.amplitude[joint] * self._speed[joint])
        noise = self._noise(joint, fit)
        if task is not None and noise and swing <= NOISY * gain * noise:
            return (
                f'tasks.{name}.gain of {gain:.3g} makes it of the noise in measured positions, '
                f'{noise:.2g} rad or m; lower the gain, or set robot.noise: {noise:.2g}'
            )
        if late:
            return self._say_late(joint, fit, task)
        if noise and swing <= NOISY * noise / period:
            return (
                f'measured positions are wrong by up to {noise:.2g} rad or m, and bounds follow '
                f'them; set robot.noise: {noise:.2g}'
            )
        parted = arm.parted / arm.tolerance
        if not arm.following or float(parted.max()) > 0.5:
            return (
                f'{robot.joints[int(np.argmax(parted))]} does not do what is commanded; '
                'robot.delay, robot.lag and robot.noise may not be those of the arm'
            )
        if changing is not None and changes >= OFTEN * rate:
            return (
                f'bounds of tasks.{changing.name} act and let go {of_one:.3g} times per second; '
                'a larger activation makes that slower'
            )
        if not stack.settle and (missing := self._missing()):
            return (
                f'level {stack.level_of(missing)} ({missing}) does not get what it asks for, and '
                'solver.settle is false; true ends it'
            )
        if task is not None:
            return (
                f'the cause is not known; level {stack.level_of(name)} ({name}) asks for it, try '
                f'a lower tasks.{name}.gain'
            )
        return 'the cause is not known, and no task asks for it'

    def _late(self, joint: int, fit: Fit | None) -> float:
        """Delay and lag [s] beyond those that are declared, 0 if about the same or unknown."""
        if fit is None or not fit.explains:
            return 0.0
        late = fit.delay + fit.lag - self._declared(joint)
        return late if abs(late) > LATE * min(self._period(), LONGEST_PERIOD) else 0.0

    def _declared(self, joint: int) -> float:
        response = self._stack.arm.response
        return float(response.delay[joint] + response.lag[joint])

    def _noise(self, joint: int, fit: Fit | None) -> float:
        """Noise [rad, m] of the measured positions, 0 if declared or unknown."""
        if fit is None:
            return 0.0
        declared = float(self._stack.arm.response.noise[joint])
        return fit.residual if fit.residual > max(NO_NOISE, DECLARED * declared) else 0.0

    def _say_late(self, joint: int, fit: Fit | None, task: Task | None) -> str:
        assert fit is not None
        seen = fit.delay + fit.lag
        calm = 1.0 / (math.e * seen) if seen > 0.0 else math.inf
        lower = ''
        if task is None or _gain(task) <= calm:
            task = max(self._equalities(), key=_gain, default=None)
        if task is not None and _gain(task) > calm:
            lower = f', or tasks.{task.name}.gain below {calm:.3g}'
        return (
            f'{self._stack.robot.joints[joint]} moves {1e3 * seen:.3g} ms after its commands, '
            f'robot.delay and robot.lag say {1e3 * self._declared(joint):.3g} ms; set '
            f'robot.delay: {round(fit.delay, 4):g} and robot.lag: {round(fit.lag, 4):g}{lower}'
        )

    def _period(self) -> float:
        """Time [s] of one step, as it was of late."""
        m = min(self._seen, STATES)
        newest = (self._seen - 1) % STATES
        oldest = (self._seen - m) % STATES
        return float(self._times[newest] - self._times[oldest]) / max(m - 1, 1)

    def _missing(self) -> str:
        """Task of the highest level that does not get what it asks for, empty if all do."""
        for task in self._equalities():
            requested, achieved = self._stack.velocities_of(task.name)
            wanted = float(np.linalg.norm(requested))
            if float(np.linalg.norm(requested - achieved)) > SHORTFALL * wanted:
                return task.name
        return ''

    def _equalities(self) -> Iterator[Task]:
        for task, _ in self._parts():
            if not task.set_based:
                yield task

    def _parts(self) -> Iterator[tuple[Task, slice]]:
        """Tasks that act, with their rows."""
        parts = self._stack.rows.parts
        for level in self._stack.members:
            for task in level:
                yield task, parts[task.name]

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
        for task, part in self._parts():
            if not isinstance(task, SetBasedTask):
                continue
            rates = [self._changes(i) for i in range(part.start, part.stop)]
            if sum(rates) > most:
                found, most, most_of_one = task, sum(rates), max(rates)
        return found, most, most_of_one

    def _changes(self, row: int) -> float:
        """How often a row comes in and goes out [Hz]."""
        k = int(self._switches[row])
        if k < LEAST_SWITCHES:
            return 0.0
        last = min(k, N)
        times = self._switched_at[row]
        span = float(times[(k - 1) % N] - times[(k - last) % N])
        return (last - 1) / span if span > 0.0 else 0.0


def _gain(task: Task | None) -> float:
    """Largest gain [1/s] of a task, 0 without one."""
    return 0.0 if task is None else float(np.abs(task.gain).max(initial=0.0))


class _Asked:
    """Changes of a task's target, feedforward, gain and largest speed."""

    def __init__(self, task: Task, part: slice) -> None:
        self._task, self._part = task, part
        self._settings = task.settings
        self._turns = [_Turns(), _Turns()]

    def size(self, scale: Vector) -> float:
        """Size of a change since the last call as a share of what joints can do; 0 if none."""
        settings = self._task.settings
        target, feedforward, *others = settings
        last = self._settings
        other = any(new is not old for new, old in zip(others, last[2:], strict=True))
        if target is last[0] and feedforward is last[1] and not other:
            return 0.0
        self._settings = settings
        rows = scale[self._part]
        usable = rows[(rows > 0.0) & np.isfinite(rows)]
        if other or not usable.size:
            return 1.0
        largest = 0.0
        if target is not last[0]:
            largest = _gain(self._task) * self._turns[0].swing(last[0], target)
        if feedforward is not last[1]:
            largest = max(largest, self._turns[1].swing(last[1], feedforward))
        return largest / float(usable.min())


class _Turns:
    """How far values moved since they turned."""

    def __init__(self) -> None:
        self._way = self._turned = np.zeros(0)

    def swing(self, before: Vector, after: Vector) -> float:
        """Largest change of a value by this step, or if it turns here, since it turned last."""
        if before.size != after.size:
            self._way = np.zeros(0)
            return math.inf
        step = after - before
        if self._way.size != step.size:
            self._way, self._turned = step, before.copy()
            return float(np.abs(step).max(initial=0.0))
        turns = self._way * step < 0.0
        swing = max(
            float(np.abs(step).max(initial=0.0)),
            float(np.abs(before - self._turned)[turns].max(initial=0.0)),
        )
        self._turned[turns] = before[turns]
        self._way = np.where(step != 0.0, step, self._way)
        return swing
