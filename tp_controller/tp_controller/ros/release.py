"""Tasks that stay where the arm comes to rest."""

from __future__ import annotations

import numpy as np

from tp_controller.ros.answered_time import AnsweredTime
from tp_controller.stack import Stack
from tp_controller.tasks import Task

LONGEST = 2.0
"""Time [s] for which a task follows the arm to its rest at most."""
AT_REST = 1e-4
"""Velocity [m/s, rad/s] of a task at rest."""
PRESENT = 1e-9
"""Largest error [m, rad] of a task whose target is its present value."""


class Release:
    """Lets tasks follow the arm while it brakes, so that it does not move back afterwards.

    Parameters
    ----------
    stack
        The tasks.
    answered
        Time of the joint states.
    """

    def __init__(self, stack: Stack, answered: AnsweredTime) -> None:
        self._stack, self._answered = stack, answered
        self._ends: dict[Task, float] = {}

    def __bool__(self) -> bool:
        """Whether a task still follows."""
        return bool(self._ends)

    def follows(self, task: Task) -> bool:
        """Whether a task still follows."""
        return task in self._ends

    def begin(self, task: Task) -> None:
        """Let a task take its present values as targets until it is at rest."""
        self._stack.aim_at_present(task)
        self._ends[task] = self._answered.now + LONGEST

    def end(self, task: Task) -> None:
        """Leave the target of a task as it is."""
        self._ends.pop(task, None)

    def end_all(self) -> None:
        """Let tasks that still follow take the values that they have at the next state."""
        for task in self._ends:
            self._stack.aim_at_present(task)
        self._ends.clear()

    def look(self) -> None:
        """Go on after an answer."""
        for task, end in list(self._ends.items()):
            # Without a target yet: the next step sets it.
            if task.settings[0].size and not self._goes_on(task, end):
                del self._ends[task]

    def _goes_on(self, task: Task, end: float) -> bool:
        stack, name = self._stack, task.name
        # A target that is not the present value is another one's.
        if self._answered.now >= end or stack.level_of(name) < 0:
            return False
        if np.abs(task.error).max() > PRESENT:
            return False
        if np.abs(stack.velocities_of(name)[1]).max() <= AT_REST:
            return False
        stack.aim_at_present(task)
        return True
