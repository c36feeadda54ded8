"""Tasks that take their present value as the target, and targets while the arm is held."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np
from numpy.typing import NDArray

from tp_controller.tasks import Task

Vector = NDArray[np.float64]


class Aims:
    """Which tasks wait for a target, and what the targets were when a hold began.

    Parameters
    ----------
    tasks
        Tasks that take their value at the next step as the target, if they have none.

    Attributes
    ----------
    waiting
        Tasks that may be without a target.
    targets
        Targets by name when a hold began, as `Task.settings` has them; None without one.
    """

    def __init__(self, tasks: Iterable[Task]) -> None:
        self.waiting = [task for task in tasks if task.target_size]
        self._just_aimed: list[Task] = []
        self.targets: dict[str, Vector] | None = None

    def add(self, task: Task) -> None:
        """Let a task take its value at the next step, if it has no target by then."""
        if task.target_size and task not in self.waiting:
            self.waiting.append(task)

    def remove(self, task: Task) -> None:
        """Forget a task."""
        self.waiting = [other for other in self.waiting if other is not task]

    def take(self) -> None:
        """Let tasks without a target take their value at the robot's present configuration."""
        for task in self.waiting:
            if task.target is None:
                task.hold()
                self._just_aimed.append(task)
                if self.targets is not None:
                    self.targets[task.name] = task.settings[0]

    def settle(self) -> None:
        """Keep the targets that were taken."""
        self.waiting, self._just_aimed = [], []

    def take_back(self) -> None:
        """Forget the targets that were taken in a step that came to nothing."""
        for task in self._just_aimed:
            task.forget_target()
        self._just_aimed = []

    def hold(self, tasks: Mapping[str, Task]) -> None:
        """Take note of the targets, unless that was done already."""
        if self.targets is None:
            self.targets = {name: task.settings[0] for name, task in tasks.items()}

    def resume(self) -> None:
        """End the hold."""
        self.targets = None
