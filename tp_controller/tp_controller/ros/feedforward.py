"""Feedforward from topics, which gives way to the configured value when it grows old."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from tp_controller.tasks import Task


class FeedforwardOverrides:
    """Tasks whose feedforward came by topic, and until when it holds.

    Ages are measured by the time between the joint states that are answered, so that a
    simulation faster or slower than real time sees the same, whatever is done to its clock.

    Parameters
    ----------
    timeout
        Age [s] at which a feedforward ends.
    configured
        Gives the value (k,) that a task goes back to.
    """

    def __init__(self, timeout: float, configured: Callable[[Task], NDArray[np.float64]]) -> None:
        self._timeout = round(1e9 * timeout)
        self._now = 0
        self._configured = configured
        self._ends: dict[Task, int | None] = {}

    def begin(self, task: Task) -> None:
        """Let the task's feedforward, just set, hold from the next joint state on."""
        self._ends[task] = None

    def end(self, task: Task) -> None:
        """Give a task its configured value back, if its feedforward came by topic."""
        if task in self._ends:
            task.feedforward = self._configured(task)
            del self._ends[task]

    def end_all(self) -> None:
        """Give all tasks their configured values back."""
        for task in list(self._ends):
            self.end(task)

    def advance(self, seconds: float) -> None:
        """Let time pass; tasks whose feedforward is too old get their configured value back.

        Parameters
        ----------
        seconds
            Time [s] since the joint state that was answered before; negative takes time back.
        """
        if not self._ends:
            return
        if math.isfinite(seconds):
            self._now += round(1e9 * seconds)
        for task, end in list(self._ends.items()):
            if end is None:
                self._ends[task] = self._now + self._timeout
            elif self._now > end:
                self.end(task)
