"""A goal under way: how far it is, and what holds it up."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from rclpy.action.server import ServerGoalHandle

from tp_controller.causes import Cause, Kind, causes, trace_damping
from tp_controller.explanation import Explanation, explanations
from tp_controller.progress import Progress, Verdict
from tp_controller.ros.log import Log
from tp_controller.stack import Stack
from tp_controller.tasks import Task
from tp_interfaces.action import Reach
from tp_interfaces.msg import Cause as CauseMessage

FEEDBACK_PERIOD = 0.1
"""Time [s] between two feedback messages,"""
EXPLANATION_PERIOD = 0.5
"""and between two looks at what holds a goal up."""
TRIES = 2
"""How often a goal that gets stuck on its straight way is tried around."""


class _Lost(NamedTuple):
    """What a task lost velocity to."""

    task: str
    cause: Cause

    @property
    def text(self) -> str:
        amount = self.cause.amount
        return self.cause.text + (f' ({amount:.2g})' if amount > 0.0 else '')

    def message(self) -> CauseMessage:
        kind = getattr(CauseMessage, self.cause.kind.name)
        return CauseMessage(
            kind=kind, task=self.task, name=self.cause.name, amount=self.cause.amount
        )


class WatchedGoal:
    """A goal under way.

    Parameters
    ----------
    handle
        Its client's; None for a goal by topic, which nobody waits for.
    stack
        The stack that its tasks are part of.
    tasks
        What it is for; their targets are set.
    progress
        Judges their errors.
    now
        Time [s] at which it begins.
    around
        Whether it may be tried around though its tasks do not say so.

    Attributes
    ----------
    targets
        Targets of its tasks.
    tries
        How often it may still be tried around.
    cancelled
        Whether its client has asked for its end.
    verdict
        Set by `conclude`; an explanation is waited for then.
    """

    def __init__(
        self,
        handle: ServerGoalHandle | None,
        stack: Stack,
        tasks: Sequence[Task],
        progress: Progress,
        now: float,
        around: bool = False,
    ) -> None:
        self.handle, self.tasks, self.progress, self._stack = handle, tasks, progress, stack
        self.tries = TRIES if around or any(task.around for task in tasks) else 0
        self.targets = [task.settings[0] for task in tasks]
        self.cancelled = False
        self.verdict: Verdict | None = None
        self._now = now
        self._explanation: Iterator[Explanation] | None = None
        self._found: list[_Lost] = []
        self._lost: list[_Lost] = []
        """What holds it up, as of the last explanation."""
        self._explain_at = now + EXPLANATION_PERIOD
        self._feedback_at = now

    @property
    def names(self) -> list[str]:
        """Names of its tasks."""
        return [task.name for task in self.tasks]

    def retargeted(self) -> Task | None:
        """Task that got another target, None if none did."""
        for task, target in zip(self.tasks, self.targets, strict=True):
            if task.settings[0] is not target:
                return task
        return None

    def left(self) -> Task | None:
        """Task that is not in the hierarchy any more, None if all are."""
        for task in self.tasks:
            # A new task of the same name is another one.
            if not self._stack.is_listed(task.name) or self._stack.tasks[task.name] is not task:
                return task
        return None

    def judge(self, now: float, moving: bool) -> Verdict | None:
        """Judge the errors at a time [s], and whether the arm moves; None while it goes on."""
        verdict = self.progress.see(max(0.0, now - self._now), self._errors(), moving)
        self._now = now
        return verdict

    def wait(self, now: float) -> Verdict | None:
        """Let a time [s] come at which another task acts in place of its own."""
        verdict = self.progress.wait(max(0.0, now - self._now), self._errors())
        self._now, self._explanation, self._lost = now, None, []
        self._explain_at = now + EXPLANATION_PERIOD
        return verdict

    def restart(self, now: float) -> None:
        """Judge progress from a time [s] on."""
        self.progress.restart()
        self._explain_at = now + EXPLANATION_PERIOD

    def conclude(self, verdict: Verdict) -> None:
        """Set the verdict, and explain it."""
        self.verdict = verdict
        self._explanation, self._explain_at = None, self._now

    def _errors(self) -> NDArray[np.float64]:
        return np.array([math.sqrt(task.error @ task.error) for task in self.tasks])

    def explain(self, now: float, log: Log) -> bool | None:
        """Explain one level, if that is due.

        Returns
        -------
        bool or None
            Whether it was the last one: what holds the goal up is known; None if nothing is due.
        """
        if self._explanation is None:
            if now < self._explain_at:
                return None
            self._explain_at = now + EXPLANATION_PERIOD
            self._explanation, self._found = explanations(self._stack), []
        try:
            level = next(self._explanation, None)
        except Exception as error:
            # What cannot be explained is ended all the same.
            log.warning(f'~/reach: no explanation: {type(error).__name__}: {error}')
            level = None
        if level is not None:
            pending = [name for name in self._pending if name in level.tasks]
            if pending:
                bounds = [name for name, task in self._stack.tasks.items() if task.set_based]
                found = trace_damping(causes(level, bounds), level, self._stack)
                self._found += [_Lost(name, cause) for name in pending for cause in found]
            return False
        self._explanation, self._lost = None, self._found
        if notice := self._stack.arm.notice:
            arm = Cause(Kind.ARM, notice, math.nan)
            self._lost = [_Lost(name, arm) for name in self._pending] + self._lost
        return True

    @property
    def _pending(self) -> list[str]:
        """Names of its tasks that are not within tolerance."""
        pairs = zip(self.names, self.progress.pending, strict=True)
        return [name for name, pending in pairs if pending]

    def feedback_due(self, now: float) -> bool:
        """Whether feedback is due at a time [s]; the next one is due a period later."""
        due = now >= self._feedback_at
        if due:
            self._feedback_at = now + FEEDBACK_PERIOD
        return due

    def feedback(self, held_up_by: str | None = None) -> Reach.Feedback:
        """How far it is; ``held_up_by`` says why in place of the last explanation."""
        pending = self._pending
        lost = [entry for entry in self._lost if entry.task in pending]
        gains = np.array([_gain(task) for task in self.tasks])
        return Reach.Feedback(
            tasks=self.names,
            error_norms=self.progress.errors.tolist(),
            causes=[entry.message() for entry in lost],
            held_up_by=_words(lost) if held_up_by is None else held_up_by,
            time_left=self.progress.time_left(gains),
            time=self.progress.time,
        )

    def result(self, outcome: int, message: str) -> Reach.Result:
        """What became of it."""
        explained = outcome in (Reach.Result.STUCK, Reach.Result.TIMED_OUT)
        return Reach.Result(
            outcome=outcome,
            message=message,
            tasks=self.names,
            error_norms=self.progress.errors.tolist(),
            causes=[entry.message() for entry in self._lost] if explained else [],
            time=self.progress.time,
        )

    @property
    def reason(self) -> str:
        """Where the tasks that are not within tolerance stay, and why."""
        pairs = zip(self.names, self.progress.errors, self.progress.pending, strict=True)
        stay = ', '.join(f'{name} is {error:.3g} away' for name, error, left in pairs if left)
        if words := _words(self._lost):
            return f'{stay}; held up by {words}'
        if self.verdict is Verdict.TIMED_OUT:
            return f'{stay}, on its way'
        if self._stack.solver.findings() is None:
            return f'{stay}; why is not known with this solver.type'
        return f'{stay}; no loss was found'


def _words(lost: Iterable[_Lost]) -> str:
    """Losses by task in words."""
    by_task: dict[str, list[str]] = {}
    for entry in lost:
        by_task.setdefault(entry.task, []).append(entry.text)
    if len(by_task) == 1:
        return ', '.join(*by_task.values())
    return '; '.join(f'{", ".join(texts)} for {task}' for task, texts in by_task.items())


def _gain(task: Task) -> float:
    """Gain [1/s] along the task's error."""
    error, K = task.error, task.settings[2]
    size = float(error @ error)
    return float(error @ K @ error) / size if size > 0.0 else 0.0
