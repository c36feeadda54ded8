"""``~/reach``: goals that are watched until they are reached, or cannot be.

An action server of rclpy runs a function that waits for the end of its goal. Here the cycle looks
at the goals after each command instead, and the result is handed over when it is known.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rclpy.action import ActionServer, CancelResponse
from rclpy.action.server import ServerGoalHandle
from rclpy.node import Node

from tp_controller.errors import InvalidValue, listed
from tp_controller.progress import Progress, Verdict
from tp_controller.ros.around import Around, End
from tp_controller.ros.log import Log
from tp_controller.ros.reach_request import read_request
from tp_controller.ros.task_inputs import TaskInputs
from tp_controller.ros.watched_goal import WatchedGoal
from tp_controller.stack import Stack
from tp_controller.tasks import Task
from tp_interfaces.action import Reach

Vector = NDArray[np.float64]

MOVING = 1e-3
"""Command [rad/s, m/s] from which on the arm is not at rest."""
SILENCE = 3.0
"""Time [s] without joint states after which goals are given up."""
SILENT_FEEDBACK = 0.5
"""Time [s] between two feedback messages until then."""
RESULT_KEPT = 10
"""Time [s] for which a result can be asked for."""
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
        command: Vector,
        log: Log,
        refuse_at_rest: Callable[[str], None],
        around: Around,
    ) -> None:
        self._refuse_at_rest, self._around = refuse_at_rest, around
        self._goes_around: WatchedGoal | None = None
        """Goal that the excursion under way is for."""
        self._stack, self._inputs, self._release = stack, inputs, inputs.release
        self._answered, self._command, self._log = inputs.answered, command, log
        self._goals: list[WatchedGoal] = []
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

    def interrupt(self, cause: str) -> None:
        """End all goals."""
        for goal in list(self._goals):
            self._finish(goal, Reach.Result.INTERRUPTED, cause)

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
            self._add(WatchedGoal(None, self._stack, [task], progress, self._answered.now))

    def _add(self, goal: WatchedGoal) -> None:
        self._goals.append(goal)
        self._seen = self._spoken = time.monotonic()
        self.active = True

    # Requests

    def _on_goal(self, handle: ServerGoalHandle) -> None:
        handle.execute()
        request = handle.request
        try:
            if request.around and self._stack.robot.space.blocks:
                got = 'true for a robot with joints that have a pose'
                raise InvalidValue('around', got, 'false, or an arm whose joints turn or slide')
            self._refuse_at_rest('goals')
            tasks, targets, progress = read_request(request, self._stack, self._inputs)
        except InvalidValue as error:
            self._refuse(handle, request, str(error))
            return
        for other in list(self._goals):
            if shared := set(other.names) & {task.name for task in tasks}:
                self._replace(other, f'a newer goal for {listed(sorted(shared))}', tasks)
        for task, target in zip(tasks, targets, strict=True):
            self._inputs.aim(task, target)
        now = self._answered.now
        goal = WatchedGoal(handle, self._stack, tasks, progress, now, request.around)
        self._add(goal)
        if request.around:
            self._go_around(goal, straight=True)

    def _on_cancel(self, handle: ServerGoalHandle) -> CancelResponse:
        for goal in self._goals:
            if goal.handle is handle:
                goal.cancelled = True
                return CancelResponse.ACCEPT
        return CancelResponse.REJECT

    # Goals under way

    def _see(self, goal: WatchedGoal) -> None:
        now = self._answered.now
        if goal.cancelled:
            self._finish(goal, Reach.Result.CANCELLED, 'cancelled')
            return
        if (task := goal.retargeted()) is not None:
            self._replace(goal, f'{task.name} got another target')
            return
        if (task := goal.left()) is not None:
            cause = f'{task.name} left the hierarchy'
            self._finish(goal, Reach.Result.INTERRUPTED, cause)
            return
        if self._stack.stand_in is not None:
            self._await(goal, now)
            return
        if goal.verdict is None:
            moving = bool(np.abs(self._command).max() > MOVING)
            verdict = goal.judge(now, moving)
            if verdict is Verdict.REACHED:
                self._finish(goal, Reach.Result.REACHED, 'reached')
                return
            if verdict is Verdict.STUCK and goal.tries:
                self._go_around(goal, straight=False)
                return
            if verdict is not None:
                goal.conclude(verdict)
        explained = goal.explain(now, self._log)
        if goal.verdict is None:
            if explained is None and goal.feedback_due(now):
                self._publish(goal)
        elif explained:
            self._finish(goal, OUTCOMES[goal.verdict], goal.verdict.value)

    def _await(self, goal: WatchedGoal, now: float) -> None:
        """Let a goal wait while another task acts in place of its own."""
        due = goal.feedback_due(now)
        if due:
            for task in goal.tasks:
                # Nobody else does it.
                task.update()
        verdict = goal.wait(now)
        if verdict is not None:
            goal.conclude(verdict)
            self._finish(goal, OUTCOMES[verdict], verdict.value)
        elif due:
            self._publish(goal, '')

    def _go_around(self, goal: WatchedGoal, straight: bool) -> None:
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

    def _went(self, goal: WatchedGoal, end: End, why: str) -> None:
        """Go on straight after an excursion, or end a goal that no way leads to."""
        self._goes_around = None
        goal.restart(self._answered.now)
        if end is End.NONE:
            self._finish(goal, Reach.Result.STUCK, 'stuck', why=why)

    def _publish(self, goal: WatchedGoal, held_up_by: str | None = None) -> None:
        """Give feedback; see `WatchedGoal.feedback`."""
        if goal.handle is None:
            return
        feedback = goal.feedback(held_up_by)
        if goal is self._goes_around:
            feedback.time_left, feedback.phase = self._around.time_left, self._around.phase
        goal.handle.publish_feedback(feedback)

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

    def _replace(self, goal: WatchedGoal, cause: str, taken: Sequence[Task] = ()) -> None:
        self._finish(goal, Reach.Result.REPLACED, f'replaced: {cause}', taken)

    def _finish(
        self,
        goal: WatchedGoal,
        outcome: int,
        message: str,
        taken: Sequence[Task] = (),
        why: str = '',
    ) -> None:
        """End a goal; its tasks stay where they come to rest, but for those that others have."""
        self._goals.remove(goal)
        self.active = bool(self._goals)
        if goal is self._goes_around:
            self._goes_around = None
            self._around.end()
        if outcome == Reach.Result.INTERRUPTED:
            message = f'interrupted: {message}'
        message += f' after {goal.progress.time:.3g} s'
        if outcome in (Reach.Result.STUCK, Reach.Result.TIMED_OUT):
            message += f': {why or goal.reason}'
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
        self._server.finish(goal.handle, goal.result(outcome, message))


def _unused(_: ServerGoalHandle) -> Reach.Result:
    raise AssertionError('results are handed over by finish')
