"""Changes of what tasks are asked for: how often they come, and how large they are."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from tp_controller.reversals import LEAST
from tp_controller.tasks import Task

Vector = NDArray[np.float64]

ASKED_TIME = 2.0
"""Time [s] over which it is counted how often something is asked for."""
OCTAVES = 12
"""What is asked for is counted by its size, in powers of two."""
ASKED_SIZE = 0.1
"""A change that is asked for counts if it is at least this share of the swing of a joint."""
ASKED_REVERSALS = 3.0
"""So many reversals of a joint may come of one of them."""


class AskedChanges:
    """Counts changes that are asked for by their size, those of long ago for less."""

    def __init__(self) -> None:
        self._counts = np.zeros(OCTAVES)
        self._at = 0.0

    def count(self, size: float, now: float) -> None:
        """Count one, by its size as a share of the limits, at a time [s]."""
        self._fade(now)
        octave = min(max(0, math.ceil(-math.log2(max(size, 1e-9)) - 1e-9)), OCTAVES - 1)
        self._counts[octave] += 1.0 / ASKED_TIME

    def explain(self, rate: float, amplitude: float, now: float) -> bool:
        """Whether enough is asked for to make a joint reverse so often [Hz].

        The amplitude is that of its velocity, as a share of its limit.
        """
        self._fade(now)
        size = ASKED_SIZE * 2.0 * amplitude
        octaves = min(max(1, math.floor(-math.log2(max(size, LEAST))) + 1), OCTAVES)
        return rate <= ASKED_REVERSALS * float(self._counts[:octaves].sum())

    def _fade(self, now: float) -> None:
        if now > self._at:
            self._counts *= math.exp((self._at - now) / ASKED_TIME)
            self._at = now


class TaskChanges:
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
            largest = largest_gain(self._task) * self._turns[0].swing(last[0], target)
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


def largest_gain(task: Task | None) -> float:
    """Largest gain [1/s] of a task, 0 without one."""
    return 0.0 if task is None else float(np.abs(task.gain).max(initial=0.0))
