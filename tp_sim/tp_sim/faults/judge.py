"""Whether commands were allowed, from what was recorded. Knows neither ROS nor the controller."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from tp_sim.faults.record import Command, Pause, Sent, paused

Vector = NDArray[np.float64]

TOLERANCE = 1e-9
"""Share of a limit that rounding may add."""
SLACK = 1e-6
"""The same of the change, whose limit comes from times."""
MEASURED = 0.01
"""Share of a step by which the velocity of a joint that does something else than its command may
be seen otherwise: in positions say."""
STILL = 1e-6
"""A command below this share of the velocity limit moves nothing."""
EARLY = 1e-3
"""Time [s] by which the clocks of two processes may seem to differ."""
EXAMPLES = 3
"""So many commands that are not allowed are described, of each kind."""


@dataclass(frozen=True)
class Allowed:
    """What a controller may send.

    Parameters
    ----------
    velocity
        Largest joint velocity (n,) [rad/s, m/s].
    acceleration
        Largest change of a joint velocity (n,) [rad/s², m/s²]; infinite if not limited.
    period
        Time [s] between joint states.
    oldest
        Age [s] of a joint state that may not move the arm any more.
    hold
        Time [s] after which an arm without a command rests.
    """

    velocity: Vector
    acceleration: Vector
    period: float
    oldest: float
    hold: float


@dataclass
class Findings:
    """What was seen of the commands.

    Attributes
    ----------
    commands
        How many came.
    speed
        Largest share of a velocity limit.
    change
        Largest share of an acceleration limit.
    age
        Age [s] of the oldest joint state that moved the arm.
    gap
        Longest time [s] between two commands.
    wrong
        What was not allowed, in words.
    """

    commands: int = 0
    speed: float = 0.0
    change: float = 0.0
    age: float = 0.0
    gap: float = 0.0
    wrong: list[str] = field(default_factory=list)

    def include(self, other: Findings) -> None:
        """Take over what was seen of other commands."""
        self.commands += other.commands
        for name in ('speed', 'change', 'age', 'gap'):
            setattr(self, name, max(getattr(self, name), getattr(other, name)))
        self.wrong += other.wrong


def judge(
    sent: Sequence[Sent],
    commands: Sequence[Command],
    allowed: Allowed,
    *,
    pauses: Sequence[Pause] = (),
    stamped: bool = True,
    mixed: bool = False,
    forwarded: bool = False,
) -> Findings:
    """Judge all commands of a case.

    A command is one of these:

    - it has the stamp of a joint state: that has to be usable and young enough, unless the command
      is zero or shrinks;
    - it has another stamp: it has to be zero or shrink, which is braking.

    Where stamps tell nothing, the newest usable joint state that was sent before it is meant.
    Commands of one controller change within the acceleration limit, seen from the last command of
    the joint, from the velocity that it had in the joint state, or from between: a joint that is
    blocked or late may start from what it does. When no command came for `Allowed.hold` the arm
    rests, and the next one starts from there. Time in which the machine paused makes no command
    old.

    Parameters
    ----------
    sent, commands
        In the order of their times.
    allowed
        The limits.
    pauses
        When the machine paused.
    stamped
        Whether stamps of joint states and commands belong together.
    mixed
        Whether there were several controllers or arms: changes of commands and braking are not
        judged then.
    forwarded
        Whether ages count from when a joint state was passed on, not from when the relay got it.
    """
    found, wrong = Findings(len(commands)), _Wrong()
    states = _States(sent, stamped)
    before, last = np.zeros(allowed.velocity.size), -math.inf
    for number, command in enumerate(commands):
        u = np.array(command.velocity, dtype=float)
        if u.shape != before.shape or not np.isfinite(u).all():
            wrong.add('form', f'command {number} is {list(command.velocity)}')
            continue
        share = float(np.max(np.abs(u) / allowed.velocity))
        found.speed = max(found.speed, share)
        if share > 1.0 + TOLERANCE:
            wrong.add('speed', f'command {number} is {share:.4g} of the velocity limit')
        gap = command.time - last
        if math.isfinite(last):
            found.gap = max(found.gap, gap)
        if gap > allowed.hold:
            before[:] = 0.0
        state = states.answered_by(command)
        if not mixed:
            span = max(allowed.period, min(gap, allowed.hold))
            moving = before if state is None else np.array(state.velocity)
            step = allowed.acceleration * allowed.period
            unsure = np.where(np.abs(moving - before) > step, MEASURED * step, 0.0)
            low, high = np.minimum(before, moving - unsure), np.maximum(before, moving + unsure)
            change = np.abs(u - np.clip(u, low, high)) / (allowed.acceleration * span)
            found.change = max(found.change, float(change.max()))
            if change.max() > 1.0 + SLACK:
                wrong.add('change', f'command {number} changes by {change.max():.4g} of the limit')
        if share > STILL:
            shrinks = _shrinks(u, before)
            ways = (shrinks, mixed, forwarded)
            _judge_data(number, command, state, ways, allowed, pauses, found, wrong)
        before, last = u, command.time
    found.wrong = wrong.told()
    return found


def _judge_data(
    number: int,
    command: Command,
    state: Sent | None,
    ways: tuple[bool, bool, bool],
    allowed: Allowed,
    pauses: Sequence[Pause],
    found: Findings,
    wrong: _Wrong,
) -> None:
    """Judge what a command that moves the arm was computed from.

    ``ways``: whether it shrinks, whether controllers are mixed, whether ages count from when a
    joint state was passed on.
    """
    shrinks, mixed, forwarded = ways
    if state is None:
        if not (shrinks or mixed):
            wrong.add('none', f'command {number} moves the arm and answers no joint state')
        return
    if not state.usable:
        if not shrinks:
            wrong.add('unusable', f'command {number} moves the arm by an unusable joint state')
        return
    if command.time < state.time - EARLY:
        wrong.add('early', f'command {number} answers a joint state that was sent after it')
    if shrinks:
        return
    since = state.time if forwarded else state.taken
    age = command.time - since
    excused = paused(pauses, since, command.time)
    found.age = max(found.age, age)
    if age - excused > allowed.oldest:
        wrong.add('old', f'command {number} moves the arm by data {1e3 * age:.4g} ms old')


class _States:
    """Joint states by what tells which of them a command answers."""

    def __init__(self, sent: Sequence[Sent], stamped: bool) -> None:
        self.stamped = stamped
        self._by_stamp: dict[int, Sent] = {}
        for state in sent:
            # A copy that is sent later does not make the data younger.
            self._by_stamp.setdefault(state.stamp, state)
        self._usable = [state for state in sent if state.usable]
        self._times = [state.time for state in self._usable]

    def answered_by(self, command: Command) -> Sent | None:
        if self.stamped:
            return self._by_stamp.get(command.stamp)
        index = bisect_right(self._times, command.time) - 1
        return self._usable[index] if index >= 0 else None


class _Wrong:
    """Counts what is not allowed and keeps a few examples of each kind."""

    def __init__(self) -> None:
        self._examples: dict[str, list[str]] = {}
        self._counts: dict[str, int] = {}

    def add(self, kind: str, text: str) -> None:
        self._counts[kind] = self._counts.get(kind, 0) + 1
        if self._counts[kind] <= EXAMPLES:
            self._examples.setdefault(kind, []).append(text)

    def told(self) -> list[str]:
        lines = []
        for kind, examples in self._examples.items():
            more = self._counts[kind] - len(examples)
            lines.append('; '.join(examples) + (f'; and {more} more' if more else ''))
        return lines


def _shrinks(u: Vector, before: Vector) -> bool:
    """Whether no joint becomes faster or turns round, and one becomes slower."""
    same_way = bool(np.all(u * before >= 0.0))
    slower = np.abs(u) <= np.abs(before) + TOLERANCE
    return same_way and bool(slower.all()) and float(np.abs(u).sum()) < float(np.abs(before).sum())
