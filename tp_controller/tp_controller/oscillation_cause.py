"""What makes a joint oscillate, by what was seen of it, and what to do."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from tp_controller.asked_changes import largest_gain
from tp_controller.identification import Fit
from tp_controller.stack import Stack
from tp_controller.tasks import SetBasedTask, Task

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
OFTEN = 0.3
"""Rows that change so many times as often as the joints reverse are what makes them reverse."""
SHORTFALL = 1e-3
"""Share of what a level asked for that it may miss while it counts as getting it."""


class Evidence(NamedTuple):
    """What was seen of a joint that oscillates."""

    joint: int
    """The joint."""
    rate: float
    """How often it reverses [Hz]."""
    swing: float
    """Amplitude of its command [rad/s, m/s]."""
    task: str
    """The task whose requested velocity reverses, too; empty if there is none."""
    period: float
    """Time [s] of one step."""
    fit: Fit | None
    """What the arm makes of its commands, if that is known."""
    switching: SetBasedTask | None
    """The set-based task whose rows change most often."""
    changes: float
    """How often its rows come in and go out in all [Hz],"""
    changes_of_one: float
    """and how often the one does that does it most often [Hz]."""


def likely_cause(stack: Stack, seen: Evidence) -> str:
    """Likely cause of an oscillation, and what to do."""
    robot, arm, period, name = stack.robot, stack.arm, seen.period, seen.task
    task = stack.tasks.get(name)
    gain = largest_gain(task)
    changing, changes, of_one = seen.switching, seen.changes, seen.changes_of_one
    if changing is not None and not changing.one_sided and changes >= OFTEN * seen.rate:
        return (
            f'rows of tasks.{changing.name} come in and go out {of_one:.3g} times per '
            f'second; tasks.{changing.name}.switching: smooth does not, or make its release '
            'larger'
        )
    late = _late(stack, seen)
    if late and (gain * abs(late) >= LOOP or changing is not None):
        return _say_late(stack, seen, task)
    if task is not None and gain * period >= 1.0:
        return (
            f'tasks.{name}.gain of {gain:.3g} is too high for periods of '
            f'{1e3 * period:.3g} ms; use at most {0.5 / period:.3g}'
        )
    noise = _noise(stack, seen)
    if task is not None and noise and seen.swing <= NOISY * gain * noise:
        return (
            f'tasks.{name}.gain of {gain:.3g} makes it of the noise in measured positions, '
            f'{noise:.2g} rad or m; lower the gain, or set robot.noise: {noise:.2g}'
        )
    if late:
        return _say_late(stack, seen, task)
    if noise and seen.swing <= NOISY * noise / period:
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
    if changing is not None and changes >= OFTEN * seen.rate:
        return (
            f'bounds of tasks.{changing.name} act and let go {of_one:.3g} times per second; '
            'a larger activation makes that slower'
        )
    if not stack.settle and (missing := _missing(stack)):
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


def _late(stack: Stack, seen: Evidence) -> float:
    """Delay and lag [s] beyond those that are declared, 0 if about the same or unknown."""
    fit = seen.fit
    if fit is None or not fit.explains:
        return 0.0
    late = fit.delay + fit.lag - _declared(stack, seen.joint)
    return late if abs(late) > LATE * min(seen.period, LONGEST_PERIOD) else 0.0


def _declared(stack: Stack, joint: int) -> float:
    response = stack.arm.response
    return float(response.delay[joint] + response.lag[joint])


def _noise(stack: Stack, seen: Evidence) -> float:
    """Noise [rad, m] of the measured positions, 0 if declared or unknown."""
    fit = seen.fit
    if fit is None:
        return 0.0
    declared = float(stack.arm.response.noise[seen.joint])
    return fit.residual if fit.residual > max(NO_NOISE, DECLARED * declared) else 0.0


def _say_late(stack: Stack, seen: Evidence, task: Task | None) -> str:
    fit = seen.fit
    assert fit is not None
    late = fit.delay + fit.lag
    calm = 1.0 / (math.e * late) if late > 0.0 else math.inf
    lower = ''
    if task is None or largest_gain(task) <= calm:
        task = max(_equalities(stack), key=largest_gain, default=None)
    if task is not None and largest_gain(task) > calm:
        lower = f', or tasks.{task.name}.gain below {calm:.3g}'
    return (
        f'{stack.robot.joints[seen.joint]} moves {1e3 * late:.3g} ms after its commands, '
        f'robot.delay and robot.lag say {1e3 * _declared(stack, seen.joint):.3g} ms; set '
        f'robot.delay: {round(fit.delay, 4):g} and robot.lag: {round(fit.lag, 4):g}{lower}'
    )


def _missing(stack: Stack) -> str:
    """Task of the highest level that does not get what it asks for, empty if all do."""
    for task in _equalities(stack):
        requested, achieved = stack.velocities_of(task.name)
        wanted = float(np.linalg.norm(requested))
        if float(np.linalg.norm(requested - achieved)) > SHORTFALL * wanted:
            return task.name
    return ''


def _equalities(stack: Stack) -> Iterator[Task]:
    for task, _ in acting_tasks(stack):
        if not task.set_based:
            yield task


def acting_tasks(stack: Stack) -> Iterator[tuple[Task, slice]]:
    """Tasks that act, with their rows."""
    parts = stack.rows.parts
    for level in stack.members:
        for task in level:
            yield task, parts[task.name]
