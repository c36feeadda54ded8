"""Feedforward from topics, which gives way to the configured value when it grows old."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
from builtin_interfaces.msg import Time
from numpy.typing import NDArray

from tp_controller.tasks import Task


class FeedforwardOverrides:
    """Tasks whose feedforward came by topic, and until when it holds.

    Ages are measured by the stamps of the joint states, so that a simulation faster or
    slower than real time sees the same; by the steady clock where these carry no stamp.

    Parameters
    ----------
    timeout
        Age [s] at which a feedforward ends.
    configured
        Gives the value (k,) that a task goes back to.
    """

    def __init__(self, timeout: float, configured: Callable[[Task], NDArray[np.float64]]) -> None:
        self._timeout = timeout
        self._configured = configured
        self._ends: dict[Task, float | None] = {}

    def __bool__(self) -> bool:
        return bool(self._ends)

    def begin(self, task: Task) -> None:
        """Let the task's feedforward, just set, hold from the next joint state on."""
        self._ends[task] = None

    def forget(self, task: Task) -> None:
        """Let a task's feedforward be."""
        self._ends.pop(task, None)

    def expire(self, stamp: Time) -> None:
        """Give every task whose feedforward is too old its configured value back.

        Parameters
        ----------
        stamp
            Stamp of the joint state being answered.
        """
        now = stamp.sec + 1e-9 * stamp.nanosec or time.monotonic()
        for task, end in list(self._ends.items()):
            if end is None:
                self._ends[task] = now + self._timeout
            elif now > end:
                task.feedforward = self._configured(task)
                del self._ends[task]
