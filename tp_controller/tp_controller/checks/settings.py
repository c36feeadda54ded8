"""Gains, thresholds, limits and times that do not go together."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from tp_controller.checks.findings import Finding, note, warning
from tp_controller.config import Settings
from tp_controller.errors import listed
from tp_controller.stack import Stack
from tp_controller.tasks import Task

SLOWEST = 0.5
"""Gain times period that tasks keep to with limits of acceleration."""
RINGING = 1.0 / math.e
"""Gain times delay and lag from which an error overshoots."""
LEAST_STATES = 2.0
"""So many periods at least have to pass without a joint state before the arm is braked."""


def told_by_tasks(stack: Stack) -> Iterator[Finding]:
    """What tasks warn of themselves: gains and thresholds too tight for the rate."""
    for task in stack.tasks.values():
        for text in task.warnings:
            key, _, rest = text.partition(': ')
            yield warning(key, rest)


def gain_and_acceleration(stack: Stack) -> Iterator[Finding]:
    """Gains that limits of acceleration are too slow for."""
    period = stack.safety_filter.period
    if not (math.isfinite(period) and np.isfinite(stack.robot.limits.acceleration).any()):
        return
    for task, gain in _gains(stack):
        # From 1 on the task itself warns.
        if SLOWEST < gain * period < 1.0:
            yield warning(
                f'tasks.{task.name}.gain',
                f'{gain:g} at rate {1.0 / period:g} has K·dt = {gain * period:.3g}: with limits '
                'of acceleration joints may reverse again and again where levels meet',
                f'up to {SLOWEST / period:g}',
            )


def gain_and_delay(stack: Stack) -> Iterator[Finding]:
    """Gains that overshoot because the arm does what it is commanded only later."""
    late = stack.robot.response.late
    for task, gain in _gains(stack):
        if gain * late > RINGING:
            yield warning(
                f'tasks.{task.name}.gain',
                f'{gain:g} with robot.delay, lag and hold of {late:g} s together overshoots',
                f'up to {RINGING / late:.3g}',
            )


def limits(stack: Stack) -> Iterator[Finding]:
    """Joints without a limit of velocity or acceleration."""
    limits = stack.robot.limits
    for key, what in (
        ('velocity', 'commands of any size are sent'),
        ('acceleration', 'commands may change by any amount in a step, and a stop is at once'),
    ):
        free = [
            joint
            for joint, limit in zip(stack.robot.joints, getattr(limits, key), strict=True)
            if not math.isfinite(limit)
        ]
        if free:
            yield note(f'robot.limits.{key}', f'none for {listed(free)}: {what}')


def rate(stack: Stack) -> Iterator[Finding]:
    """A rate that is left out."""
    if math.isfinite(stack.safety_filter.period):
        return
    ranged = np.isfinite(stack.robot.limits.position_min) | np.isfinite(
        stack.robot.limits.position_max
    )
    rest = ': the arm rests until it is found from the joint states' if ranged.any() else ''
    yield warning('rate', f'no value{rest}', 'joint states per second')


def timeouts(settings: Settings) -> Iterator[Finding]:
    """A time-out that every lost joint state would exceed."""
    period, limit = settings.stack.safety_filter.period, settings.values['timeouts.joint_state']
    if math.isfinite(period) and limit < LEAST_STATES * period:
        yield warning(
            'timeouts.joint_state',
            f'{limit:g} s is {limit / period:.2g} periods: one joint state that is late or lost '
            'brakes the arm',
            f'at least {LEAST_STATES * period:g} s at rate {1.0 / period:g}',
        )


def hierarchy(stack: Stack) -> Iterator[Finding]:
    """No task at all."""
    if not stack.members:
        yield note('hierarchy', 'no task: the arm rests')


def _gains(stack: Stack) -> Iterator[tuple[Task, float]]:
    """Tasks that feed an error back, with the largest eigenvalue of their gain."""
    for level in stack.members:
        for task in level:
            if task.feeds_back and not task.set_based:
                yield task, float(np.abs(np.linalg.eigvals(task.gain)).max(initial=0.0))
