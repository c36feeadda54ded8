"""Going a way by the stack: a posture task in the place of the goals' levels and those below."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from tp_controller.interpolation import VectorPath
from tp_controller.stack import Stack
from tp_controller.tasks import PostureTask
from tp_controller.trajectory import JointPath

Vector = NDArray[np.float64]

NAME = 'way_around'
"""Name of the task; more of the last letter where the stack has one of that name."""
GAIN = 3.0
"""Gain [1/s] of the task,"""
SHARE = 0.2
"""and the largest share of the rate that it has."""
BESIDE, FAR = 0.01, 0.05
"""Largest error [rad, m] of a joint with which the way runs at full speed, and from which on it
waits;"""
SLOWING = 0.25
"""time [s] in which it comes to that."""
STALLED = 2.0
"""Time [s] without a tenth of that time of progress on the way, after which it is stuck."""
GAP = 0.1
"""Largest time [s] between two steps that counts for the way."""
NEAR = 1e-3
"""Error [rad, m] of a joint at the end of the way that is near enough,"""
PATIENCE = 1.0
"""and time [s] after which it ends anyhow."""


class Excursion:
    """A stack that rests, or follows a way in joint space, until it goes on to its goals.

    The levels above the goals, all set-based tasks, bounds and the safety filter stay. The time
    of the way runs slower, and its feedforward is smaller by as much, where they keep the arm
    beside it. Beginning and end are transitions.

    Parameters
    ----------
    stack
        The stack.
    names
        Tasks that have goals: their level and all below do not act meanwhile.

    Raises
    ------
    InvalidValue
        If the solver cannot resolve the levels.

    Attributes
    ----------
    task
        The task; at first it keeps the arm where it comes to rest.
    """

    def __init__(self, stack: Stack, names: Sequence[str]) -> None:
        self._stack = stack
        name = NAME
        while name in stack.tasks:
            name += NAME[-1]
        period = stack.safety_filter.period
        gain = min(GAIN, SHARE / period) if np.isfinite(period) else GAIN
        self.task = PostureTask(name, stack.robot, gain=gain)
        response = stack.robot.response
        self._lead = float(np.max(response.delay + response.lag))
        self._path: JointPath | None = None
        self._time = self._waited = 0.0
        self._speed = 1.0
        self._marks = (0.0, 0.0)
        self._begun = False
        stack.take_over(self.task, names)

    @property
    def acts(self) -> bool:
        """Whether the task acts in the stack."""
        return self._stack.stand_in is self.task

    @property
    def follows(self) -> bool:
        """Whether a way is followed."""
        return self._path is not None

    @property
    def time(self) -> float:
        """Time [s] on the way; 0 without one."""
        return self._time

    @property
    def time_left(self) -> float:
        """Time [s] to the end of the way at full speed; 0 without one."""
        return 0.0 if self._path is None else max(0.0, self._path.duration - self._time)

    def stay(self) -> None:
        """Follow no way any more, and keep the arm where it is at the next step."""
        self._path = None
        self.task.feedforward = np.zeros(self.task.k)
        self._stack.aim_at_present(self.task)

    def follow(self, path: VectorPath) -> None:
        """Follow a way from the next step on."""
        self._path = JointPath(path)
        self._time = self._waited = 0.0
        self._speed, self._begun = 1.0, False
        self._marks = (0.0, 0.0)

    def advance(self, seconds: float) -> None:
        """Let time [s] pass; to be called before each step; negative takes it back."""
        path, task = self._path, self.task
        if path is None or not self.acts:
            return
        if not np.isfinite(seconds):
            seconds = 0.0
        # Without joint states the arm has come to rest.
        seconds = min(GAP, max(-GAP, seconds))
        if self._begun:
            if seconds > 0.0:
                beside = float(np.abs(task.error).max())
                wanted = min(1.0, max(0.0, (FAR - beside) / (FAR - BESIDE)))
                change = seconds / SLOWING
                self._speed += min(change, max(-change, wanted - self._speed))
            self._time += self._speed * seconds
        self._begun = True
        self._waited += seconds
        time = self._time + self._lead
        period = self._stack.safety_filter.period
        aim = path.aim(task, min(time, path.duration), period if np.isfinite(period) else 0.0)
        task.target = aim.target
        rest = time >= path.duration
        task.feedforward = np.zeros(task.k) if rest else self._speed * aim.feedforward

    @property
    def over(self) -> bool:
        """Whether the arm is at the end of the way, or has had time to get there."""
        if self._path is None or self._time < self._path.duration:
            return False
        near = bool(np.abs(self.task.error).max() <= NEAR)
        return near or self._time >= self._path.duration + PATIENCE

    @property
    def stuck(self) -> bool:
        """Whether the way cannot be followed any further."""
        if self._path is None or self._time >= self._path.duration:
            return False
        time, waited = self._marks
        if self._waited - waited >= STALLED:
            if self._time - time < 0.1 * STALLED:
                return True
            self._marks = (self._time, self._waited)
        return False

    def end(self) -> None:
        """Let the goals' levels act again."""
        if self.acts:
            self._stack.give_back()
