"""Goals and feedforwards of tasks: the newest of each, a bounded amount of them at a time."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.node import Node
from rclpy.subscription import Subscription

from tp_controller.config import Settings
from tp_controller.errors import InvalidValue
from tp_controller.ros.feedforward import FeedforwardOverrides
from tp_controller.ros.goals import FEEDFORWARD_TYPES, GOAL_TYPES, GoalReader
from tp_controller.ros.state import StateMessage
from tp_controller.ros.warnings import Warnings
from tp_controller.tasks import Task

LONGEST_PAUSE = 0.005
"""Time [s] between two messages of one topic that are taken over; a period if shorter."""


class _Gate(MutuallyExclusiveCallbackGroup):
    """Callbacks of one subscription, closed for a moment after each.

    The executor does not wait for the subscription meanwhile, whose newest message stays with
    the middleware: a flood of messages wakes up nobody.
    """

    def __init__(self) -> None:
        super().__init__()
        self.opens = -np.inf

    def can_execute(self, entity: Any) -> bool:
        """Whether the executor may take a message."""
        return time.monotonic() >= self.opens and bool(super().can_execute(entity))


class TaskInputs:
    """Listens to goals and feedforwards.

    A message that arrives is put aside only; a later one of the same topic takes its place.
    `handle` takes them over. Of each topic one message in a period is taken, the newest.

    Parameters
    ----------
    node
        The controller's node.
    settings
        What it runs on.
    state
        Where messages are counted, and new targets shown.
    warnings
        Where refused messages are told.
    period
        Time [s] of one cycle; infinite if unknown.

    Attributes
    ----------
    feedforwards
        Those that hold at present.
    """

    def __init__(
        self,
        node: Node,
        settings: Settings,
        state: StateMessage,
        warnings: Warnings,
        period: float,
    ) -> None:
        self._node = node
        self._settings = settings
        self._state = state
        self._warnings = warnings
        self._reader = GoalReader(settings.stack.robot)
        self.feedforwards = FeedforwardOverrides(
            settings.values['timeouts.feedforward'], self._configured
        )
        self.know_period(period)
        self._subscriptions: dict[str, list[Subscription]] = {}
        self._waiting: dict[tuple[str, str], tuple[Callable[[Task, Any], None], Task, Any]] = {}

    def know_period(self, period: float) -> None:
        """Take over the time [s] of one cycle."""
        self._pause = min(period, LONGEST_PAUSE)

    def robot_seen(self) -> None:
        """Take note that the robot's configuration is known."""
        self._reader.robot_seen = True

    def listen(self, task: Task) -> Iterator[None]:
        """Take goals and feedforwards of a task, with a pause after each subscription."""
        subscriptions = self._subscriptions[task.name] = []
        for types, topic, handler in (
            (GOAL_TYPES, 'goal', self._on_goal),
            (FEEDFORWARD_TYPES, 'feedforward', self._on_feedforward),
        ):
            if task.type in types:
                subscriptions.append(self._subscribe(types[task.type], task, topic, handler))
                yield

    def _subscribe(
        self, message_type: type, task: Task, topic: str, handler: Callable[[Task, Any], None]
    ) -> Subscription:
        gate = _Gate()

        def put_aside(msg: Any) -> None:
            gate.opens = time.monotonic() + self._pause
            self._waiting[task.name, topic] = handler, task, msg

        # Of more than one message a newer one would take the place anyway.
        return self._node.create_subscription(
            message_type, f'~/{task.name}/{topic}', put_aside, 1, callback_group=gate
        )

    def forget(self, task: Task) -> None:
        """Let a task's topics be."""
        for subscription in self._subscriptions.pop(task.name):
            self._node.destroy_subscription(subscription)
        for key in [key for key in self._waiting if key[0] == task.name]:
            del self._waiting[key]
        self.feedforwards.forget(task)

    def handle(self, seconds: float) -> bool:
        """Take over what waits, until a time [s] is over.

        Returns
        -------
        bool
            Whether anything was taken over or refused.
        """
        if not self._waiting:
            return False
        end = time.monotonic() + seconds
        for key in list(self._waiting):
            handler, task, msg = self._waiting.pop(key)
            try:
                handler(task, msg)
            except InvalidValue as error:
                self._reject(task, key[1], str(error))
            except Exception as error:
                # One message must not end the control of the arm.
                self._reject(task, key[1], f'{type(error).__name__}: {error}')
            if time.monotonic() >= end:
                break
        return True

    def _on_goal(self, task: Task, msg: Any) -> None:
        task.target = self._reader.target(task, msg)
        self._state.task(task.name).accepted_goals += 1
        self._state.refresh_target(task.name, self._reader.robot_seen)

    def _on_feedforward(self, task: Task, msg: Any) -> None:
        task.feedforward = self._reader.feedforward(task, msg, self._configured(task))
        self._state.task(task.name).accepted_feedforwards += 1
        self.feedforwards.begin(task)

    def _configured(self, task: Task) -> np.ndarray:
        return np.array(self._settings.values[f'tasks.{task.name}.feedforward'])

    def _reject(self, task: Task, what: str, problem: str) -> None:
        self._state.msg.rejected_goals += 1
        entry = self._state.task(task.name)
        entry.rejected_goals += 1
        entry.message = f'{what} rejected: {problem}'
        self._warnings.warn(f'{task.name} {what}', f'{task.name}: {entry.message}')
