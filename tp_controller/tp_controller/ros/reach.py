"""``~/reach``: goals that are watched until they are reached, or cannot be.

An action server of rclpy runs a function that waits for the end of its goal. Here the cycle looks
at the goals after each command instead, and the result is handed over when it is known.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from rclpy.action import ActionServer, CancelResponse
from rclpy.action.server import ServerGoalHandle
from rclpy.node import Node

from tp_controller.causes import Cause, Kind, causes, trace_damping
from tp_controller.errors import InvalidValue, listed, shown
from tp_controller.explanation import Explanation, explanations
from tp_controller.progress import Progress, Verdict
from tp_controller.ros.answered_time import AnsweredTime
from tp_controller.ros.around import Around, End
from tp_controller.ros.codecs import codec_of
from tp_controller.ros.log import Log
from tp_controller.ros.task_inputs import TaskInputs
from tp_controller.stack import Stack
from tp_controller.tasks import Task
from tp_interfaces.action import Reach
from tp_interfaces.msg import Cause as CauseMessage
from tp_interfaces.msg import TaskGoal

Vector = NDArray[np.float64]

FEEDBACK_PERIOD = 0.1
"""Time [s] between two feedback messages,"""
EXPLANATION_PERIOD = 0.5
"""and between two looks at what holds a goal up."""
MOVING = 1e-3
"""Command [rad/s, m/s] from which on the arm is not at rest."""
SILENCE = 3.0
"""Time [s] without joint states after which goals are given up."""
SILENT_FEEDBACK = 0.5
"""Time [s] between two feedback messages until then."""
RESULT_KEPT = 10
"""Time [s] for which a result can be asked for."""
TRIES = 2
"""How often a goal that gets stuck on its straight way is tried around."""
OUTCOMES = {
    Verdict.REACHED: Reach.Result.REACHED,
    Verdict.STUCK: Reach.Result.STUCK,
    Verdict.TIMED_OUT: Reach.Result.TIMED_OUT,
}


class _Server(ActionServer):
    """An action server whose results are set from outside: no function runs per goal."""

    def notify_execute(self, goal_handle: ServerGoalHandle, execute_callback: Any) -> None:
        """Leave the goal to whoever has accepted it."""

    def finish(self, goal_handle: ServerGoalHandle, result: Reach.Result) -> None:
        """Hand over the result of a goal whose final state is set."""
        super().notify_execute(goal_handle, lambda _: result)


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


class _Goal:
    """A goal under way.

    Parameters
    ----------
    handle
        Its client's; None for a goal by topic, which nobody waits for.
    tasks
        What it is for; their targets are set.
    progress
        Judges their errors.
    now
        Time [s] at which it begins.
    """

    def __init__(
        self,
        handle: ServerGoalHandle | None,
        tasks: Sequence[Task],
        progress: Progress,
        now: float,
    ) -> None:
        self.handle, self.tasks, self.progress = handle, tasks, progress
        self.tries = TRIES if any(task.around for task in tasks) else 0
        """How often it may still be tried around."""
        self.targets = [task.settings[0] for task in tasks]
        self.now = now
        self.cancelled = False
        self.verdict: Verdict | None = None
        """Set once it is known; an explanation is waited for."""
        self.explanation: Iterator[Explanation] | None = None
        self.found: list[_Lost] = []
        self.lost: list[_Lost] = []
        """What holds it up, as of the last explanation."""
        self.explain_at = now + EXPLANATION_PERIOD
        self.feedback_at = now

    @property
    def names(self) -> list[str]:
        """Names of its tasks."""
        return [task.name for task in self.tasks]

    @property
    def pending(self) -> list[str]:
        """Names of those that are not within tolerance."""
        pairs = zip(self.names, self.progress.pending, strict=True)
        return [name for name, pending in pairs if pending]

    def retargeted(self) -> Task | None:
        """Task that got another target, None if none did."""
        for task, target in zip(self.tasks, self.targets, strict=True):
            if task.settings[0] is not target:
                return task
        return None


class ReachServer:
    """The action ``~/reach``.

    Parameters
    ----------
    node
        The controller's node.
    stack
        Its tasks.
    inputs
        Reads and sets goals.
    answered
        Time of the joint states.
    command
        The command sent last (n,) [rad/s, m/s]; it is kept up to date.
    log
        Has one line at the end of each goal.
    refuse_at_rest
        Raises InvalidValue for the key that it is called with while the arm is kept at rest.
    around
        Goes ways around.

    Attributes
    ----------
    active
        Whether there is anything to `look` at.
    """

    def __init__(
        self,
        node: Node,
        stack: Stack,
        inputs: TaskInputs,
        answered: AnsweredTime,
        command: Vector,
        log: Log,
        refuse_at_rest: Callable[[str], None],
        around: Around,
    ) -> None:
        self._refuse_at_rest = refuse_at_rest
        self._around = around
        self._goes_around: _Goal | None = None
        """Goal that the excursion under way is for."""
        self._stack, self._inputs, self._release = stack, inputs, inputs.release
        self._answered, self._command, self._log = answered, command, log
        self._goals: list[_Goal] = []
        self._seen = self._spoken = -math.inf
        self.active = False
        self._server = _Server(
            node,
            Reach,
            '~/reach',
            _unused,
            handle_accepted_callback=self._on_goal,
            cancel_callback=self._on_cancel,
            result_timeout=RESULT_KEPT,
        )

    def look(self) -> None:
        """See how far the goals are; to be called after every answer while `active`."""
        self._seen = time.monotonic()
        if self._around.active:
            self._around.look()
        for goal in list(self._goals):
            self._see(goal)
        self._note_active()

    def look_without_states(self) -> None:
        """Give up or tell what waits; to be called while no joint state is answered."""
        now = time.monotonic()
        for goal in list(self._goals):
            if goal.cancelled:
                self._finish(goal, Reach.Result.CANCELLED, 'cancelled')
            elif now >= self._seen + SILENCE:
                cause = f'no joint state for {SILENCE:g} s'
                self._finish(goal, Reach.Result.INTERRUPTED, cause)
            elif now >= self._spoken + SILENT_FEEDBACK:
                self._publish(goal, 'no joint states come')
        if now >= self._spoken + SILENT_FEEDBACK:
            self._spoken = now
        self._note_active()

    def interrupt(self, cause: str) -> None:
        """End all goals."""
        for goal in list(self._goals):
            self._finish(goal, Reach.Result.INTERRUPTED, cause)
        self._note_active()

    def close(self) -> None:
        """Serve no longer."""
        self._around.close()
        self._server.destroy()

    def watch(self, task: Task) -> None:
        """Watch a goal that came by topic, to go around if it gets stuck."""
        if task.around and self._stack.is_listed(task.name):
            for other in [one for one in self._goals if task in one.tasks]:
                self._replace(other, f'{task.name} got another target', [task])
            progress = Progress([Reach.Goal().tolerance])
            self._goals.append(_Goal(None, [task], progress, self._answered.now))
            self._seen = self._spoken = time.monotonic()
            self._note_active()

    def _note_active(self) -> None:
        self.active = bool(self._goals)

    # Requests

    def _on_goal(self, handle: ServerGoalHandle) -> None:
        handle.execute()
        request = handle.request
        try:
            tasks, targets, progress = self._read(request)
        except InvalidValue as error:
            self._refuse(handle, request, str(error))
            return
        for other in list(self._goals):
            if shared := set(other.names) & {task.name for task in tasks}:
                self._replace(other, f'a newer goal for {listed(sorted(shared))}', tasks)
        for task, target in zip(tasks, targets, strict=True):
            self._inputs.aim(task, target)
        goal = _Goal(handle, tasks, progress, self._answered.now)
        self._goals.append(goal)
        self._seen = self._spoken = time.monotonic()
        if request.around:
            goal.tries = TRIES
            self._go_around(goal, straight=True)
        self._note_active()

    def _on_cancel(self, handle: ServerGoalHandle) -> CancelResponse:
        for goal in self._goals:
            if goal.handle is handle:
                goal.cancelled = True
                return CancelResponse.ACCEPT
        return CancelResponse.REJECT

    def _read(self, request: Reach.Goal) -> tuple[list[Task], list[Vector], Progress]:
        """Check a request as a whole; nothing has changed yet.

        Raises
        ------
        InvalidValue
            If a part of it cannot be used.
        """
        stack = self._stack
        if request.around and stack.robot.space.blocks:
            got = 'true for a robot with joints that have a pose'
            raise InvalidValue('around', got, 'false, or an arm whose joints turn or slide')
        self._refuse_at_rest('goals')
        if not request.goals:
            raise InvalidValue('goals', 'none', 'one for each task')
        if len(request.goals) > len(stack.tasks):
            raise InvalidValue('goals', f'{len(request.goals)}', 'one for each task')
        limit = request.time_limit
        if not 0.0 <= limit < math.inf:
            raise InvalidValue('time_limit', shown(limit), 'seconds, 0 for none')
        tasks: list[Task] = []
        for goal in request.goals:
            task = self._task(goal.task)
            if task in tasks:
                raise InvalidValue('goals.task', f'{shown(goal.task)} twice', 'every task once')
            tasks.append(task)
        tolerances = [goal.tolerance or request.tolerance for goal in request.goals]
        progress = Progress(tolerances, limit or math.inf)
        pairs = zip(tasks, request.goals, strict=True)
        return tasks, [self._target(task, goal) for task, goal in pairs], progress

    def _task(self, name: str) -> Task:
        stack = self._stack
        able = [
            name
            for name, task in stack.tasks.items()
            if codec_of(task) is not None and not task.set_based
        ]
        if name not in able:
            task = stack.tasks.get(name)
            got = shown(name) if task is None else f'{name}, which is of type {task.type}'
            raise InvalidValue('goals.task', got, f'one of {listed(able)}')
        if not stack.is_listed(name):
            got = f'{name}, which is not in the hierarchy and would never be reached'
            raise InvalidValue('goals.task', got, f'one of {listed(stack.hierarchy)}')
        return stack.tasks[name]

    def _target(self, task: Task, goal: TaskGoal) -> Vector:
        try:
            return self._inputs.read_goal(task, goal.values, goal.frame_id)
        except InvalidValue as error:
            raise error if error.key == task.name else error.under(task.name) from None

    # Goals under way

    def _see(self, goal: _Goal) -> None:
        now = self._answered.now
        if goal.cancelled:
            self._finish(goal, Reach.Result.CANCELLED, 'cancelled')
            return
        if (task := goal.retargeted()) is not None:
            self._replace(goal, f'{task.name} got another target')
            return
        for task in goal.tasks:
            # A new task of the same name is another one.
            if not self._stack.is_listed(task.name) or self._stack.tasks[task.name] is not task:
                cause = f'{task.name} left the hierarchy'
                self._finish(goal, Reach.Result.INTERRUPTED, cause)
                return
        if self._stack.stand_in is not None:
            self._await(goal, now)
            return
        if goal.verdict is None:
            errors = np.array([math.sqrt(task.error @ task.error) for task in goal.tasks])
            moving = bool(np.abs(self._command).max() > MOVING)
            goal.verdict = goal.progress.see(max(0.0, now - goal.now), errors, moving)
            goal.now = now
            if goal.verdict is Verdict.REACHED:
                self._finish(goal, Reach.Result.REACHED, 'reached')
                return
            if goal.verdict is Verdict.STUCK and goal.tries:
                goal.verdict = None
                self._go_around(goal, straight=False)
                return
            if goal.verdict is not None:
                goal.explanation, goal.explain_at = None, now
        if goal.explanation is None and now >= goal.explain_at:
            goal.explain_at = now + EXPLANATION_PERIOD
            goal.explanation, goal.found = explanations(self._stack), []
        if goal.explanation is not None:
            self._explain(goal)
        elif goal.verdict is None and now >= goal.feedback_at:
            goal.feedback_at = now + FEEDBACK_PERIOD
            self._tell(goal)

    def _await(self, goal: _Goal, now: float) -> None:
        """Let a goal wait while another task acts in place of its own."""
        due = now >= goal.feedback_at
        if due:
            for task in goal.tasks:
                # Nobody else does it.
                task.update()
        errors = np.array([math.sqrt(task.error @ task.error) for task in goal.tasks])
        verdict = goal.progress.wait(max(0.0, now - goal.now), errors)
        goal.now, goal.explanation, goal.lost = now, None, []
        goal.explain_at = now + EXPLANATION_PERIOD
        if verdict is not None:
            goal.verdict = verdict
            self._finish(goal, OUTCOMES[verdict], verdict.value)
        elif due:
            goal.feedback_at = now + FEEDBACK_PERIOD
            self._publish(goal, '')

    def _go_around(self, goal: _Goal, straight: bool) -> None:
        """Look for a way to a goal, and go it."""
        goal.tries -= 1
        if self._goes_around is not None:
            self._replace(self._goes_around, 'a newer goal that goes around')
        names = goal.names
        tolerances = dict(zip(names, goal.progress.tolerances, strict=True))
        targets = dict(zip(names, goal.targets, strict=True))
        try:
            self._around.begin(targets, tolerances, straight, partial(self._went, goal))
        except InvalidValue as error:
            self._went(goal, End.NONE, str(error))
            return
        self._goes_around = goal

    def _went(self, goal: _Goal, end: End, why: str) -> None:
        """Go on straight after an excursion, or end a goal that no way leads to."""
        self._goes_around = None
        goal.progress.restart()
        goal.explain_at = self._answered.now + EXPLANATION_PERIOD
        if end is End.NONE:
            self._finish(goal, Reach.Result.STUCK, 'stuck', why=why)

    def _explain(self, goal: _Goal) -> None:
        """Explain one level; after the last one take note of what holds the goal up."""
        assert goal.explanation is not None
        try:
            level = next(goal.explanation, None)
        except Exception as error:
            # What cannot be explained is ended all the same.
            self._log.warning(f'~/reach: no explanation: {type(error).__name__}: {error}')
            level = None
        if level is not None:
            pending = [name for name in goal.pending if name in level.tasks]
            if pending:
                bounds = [name for name, task in self._stack.tasks.items() if task.set_based]
                found = trace_damping(causes(level, bounds), level, self._stack)
                goal.found += [_Lost(name, cause) for name in pending for cause in found]
            return
        goal.explanation, goal.lost = None, goal.found
        if notice := self._stack.arm.notice:
            lost = [_Lost(name, Cause(Kind.ARM, notice, math.nan)) for name in goal.pending]
            goal.lost = lost + goal.lost
        if goal.verdict is not None:
            self._finish(goal, OUTCOMES[goal.verdict], goal.verdict.value)

    def _tell(self, goal: _Goal) -> None:
        """Give feedback."""
        pending = goal.pending
        self._publish(goal, _words(lost for lost in goal.lost if lost.task in pending))

    def _publish(self, goal: _Goal, held_up_by: str) -> None:
        progress, pending = goal.progress, goal.pending
        if goal.handle is None:
            return
        goes_around = goal is self._goes_around
        time_left = progress.time_left(np.array([_gain(task) for task in goal.tasks]))
        goal.handle.publish_feedback(
            Reach.Feedback(
                tasks=goal.names,
                error_norms=progress.errors.tolist(),
                causes=[lost.message() for lost in goal.lost if lost.task in pending],
                held_up_by=held_up_by,
                time_left=self._around.time_left if goes_around else time_left,
                time=progress.time,
                phase=self._around.phase if goes_around else '',
            )
        )

    # Ends

    def _refuse(self, handle: ServerGoalHandle, request: Reach.Goal, problem: str) -> None:
        names = [goal.task for goal in request.goals[: len(self._stack.tasks)]]
        self._log.warning(f'~/reach refused: {problem}')
        handle.abort()
        self._server.finish(
            handle,
            Reach.Result(
                outcome=Reach.Result.REFUSED,
                message=f'refused: {problem}',
                tasks=names,
                error_norms=[math.nan] * len(names),
            ),
        )

    def _replace(self, goal: _Goal, cause: str, taken: Sequence[Task] = ()) -> None:
        self._finish(goal, Reach.Result.REPLACED, f'replaced: {cause}', taken)

    def _finish(
        self,
        goal: _Goal,
        outcome: int,
        message: str,
        taken: Sequence[Task] = (),
        why: str = '',
    ) -> None:
        """End a goal; its tasks stay where they come to rest, but for those that others have."""
        self._goals.remove(goal)
        if goal is self._goes_around:
            self._goes_around = None
            self._around.end()
        progress = goal.progress
        if outcome == Reach.Result.INTERRUPTED:
            message = f'interrupted: {message}'
        message += f' after {progress.time:.3g} s'
        explained = outcome in (Reach.Result.STUCK, Reach.Result.TIMED_OUT)
        lost = goal.lost if explained else []
        if explained:
            message += f': {why or self._reason(goal)}'
        if outcome != Reach.Result.REACHED:
            for task, target in zip(goal.tasks, goal.targets, strict=True):
                if task not in taken and task.settings[0] is target:
                    self._release.begin(task)
        if goal.handle is None:
            if outcome == Reach.Result.STUCK:
                self._log.warning(f'{", ".join(goal.names)}: {message}')
            return
        if outcome == Reach.Result.REACHED:
            goal.handle.succeed()
        elif outcome == Reach.Result.CANCELLED:
            goal.handle.canceled()
        else:
            goal.handle.abort()
        self._log.info(f'~/reach {", ".join(goal.names)}: {message}')
        result = Reach.Result(
            outcome=outcome,
            message=message,
            tasks=goal.names,
            error_norms=progress.errors.tolist(),
            causes=[entry.message() for entry in lost],
            time=progress.time,
        )
        self._server.finish(goal.handle, result)

    def _reason(self, goal: _Goal) -> str:
        """Where the tasks that are not within tolerance stay, and why."""
        pairs = zip(goal.names, goal.progress.errors, goal.progress.pending, strict=True)
        stay = ', '.join(f'{name} is {error:.3g} away' for name, error, left in pairs if left)
        if words := _words(goal.lost):
            return f'{stay}; held up by {words}'
        if goal.verdict is Verdict.TIMED_OUT:
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


def _unused(_: ServerGoalHandle) -> Reach.Result:
    raise AssertionError('results are handed over by finish')
