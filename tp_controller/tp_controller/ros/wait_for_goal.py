"""A goal by ``~/reach`` for people: progress in the terminal, then what became of it."""

from __future__ import annotations

import math
import signal
import sys
import time
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import rclpy
from rclpy.action import ActionClient
from rclpy.node import Node
from rich.console import Console
from rich.markup import escape
from rich.status import Status

from tp_controller.ros.parent import end_with_ros2
from tp_controller.ros.waiting import spin_until
from tp_interfaces.action import Reach

LINE_PERIOD = 1.0
"""Time [s] between two lines of progress where the output is no terminal."""
SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
"""Signals that cancel the goal; the second one ends the wait for its end."""


class GoalWaiter:
    """Sends a goal and waits for its end.

    Parameters
    ----------
    node
        Node of this process.
    controller
        Name of the controller's node.
    timeout
        Time [s] for an answer of the controller.
    """

    def __init__(self, node: Node, controller: str, timeout: float) -> None:
        self._node, self._timeout = node, timeout
        self._client = ActionClient(node, Reach, f'{controller}/reach')
        self._topic = node.resolve_topic_name(f'{controller}/reach')
        self._signals = 0
        self._heard = time.monotonic()
        self._show: Callable[[str], None] = _Lines()

    def run(self, goal: Reach.Goal) -> Reach.Result:
        """Send a goal, show its progress and return its result.

        Raises
        ------
        TimeoutError
            If the controller does not answer, or is gone.
        """
        for number in SIGNALS:
            signal.signal(number, self._on_signal)
        end_with_ros2()
        wait = partial(spin_until, self._node, self._timeout)
        wait(self._ready, f'no controller takes goals on {self._topic}')
        sent = self._client.send_goal_async(goal, feedback_callback=self._on_feedback)
        # A signal meanwhile cancels the goal once it is known: the controller may have it.
        wait(sent.done, 'the controller did not answer')
        handle = sent.result()
        result = handle.get_result_async()
        console = Console(stderr=True)
        if not console.is_terminal:
            self._wait_for_end(handle, result)
        else:
            with console.status('on its way') as status:
                self._show = _Spinner(status)
                self._wait_for_end(handle, result)
        found: Reach.Result = result.result().result
        return found

    def _wait_for_end(self, handle: Any, result: Any) -> None:
        self._heard = time.monotonic()
        asked = False
        while not result.done():
            if self._signals and not asked:
                asked = True
                handle.cancel_goal_async()
                self._heard = time.monotonic()
            silent = time.monotonic() - self._heard > self._timeout
            if self._signals > 1 or (asked and silent):
                raise TimeoutError('cancelled, but the controller did not say so')
            if silent and not self._client.server_is_ready():
                raise TimeoutError('the controller is gone')
            rclpy.spin_once(self._node, timeout_sec=0.1)

    def _on_signal(self, number: int, frame: Any) -> None:
        self._signals += 1

    def _on_feedback(self, message: Any) -> None:
        self._heard = time.monotonic()
        self._show(progress_line(message.feedback))

    def _ready(self) -> bool:
        if self._signals:
            raise TimeoutError('interrupted')
        return self._client.server_is_ready()


def progress_line(feedback: Reach.Feedback) -> str:
    """Feedback in one line."""
    text = f'{feedback.time:.1f} s: '
    text += f'{feedback.phase}, ' if feedback.phase else ''
    text += _errors(feedback.tasks, feedback.error_norms)
    if math.isfinite(feedback.time_left):
        text += f', about {feedback.time_left:.1f} s left'
    if feedback.held_up_by:
        text += f', held up by {feedback.held_up_by}'
    return text


def _errors(tasks: Sequence[str], norms: Sequence[float]) -> str:
    pairs = zip(tasks, norms, strict=True)
    return ', '.join(f'{task} {norm:.3g} away' for task, norm in pairs)


class _Lines:
    """One line a second."""

    def __init__(self) -> None:
        self._due = -math.inf

    def __call__(self, text: str) -> None:
        now = time.monotonic()
        if now >= self._due:
            self._due = now + LINE_PERIOD
            print(text, file=sys.stderr, flush=True)


class _Spinner:
    """One line of the terminal, written anew."""

    def __init__(self, status: Status) -> None:
        self._status = status

    def __call__(self, text: str) -> None:
        self._status.update(escape(text))
