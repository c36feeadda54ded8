"""Goals and the like of tasks: the newest of each, a bounded amount of them at a time."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from rclpy.node import Node
from rclpy.subscription import Subscription

from tp_controller.config import Settings
from tp_controller.errors import InvalidValue
from tp_controller.ros.answered_time import AnsweredTime
from tp_controller.ros.codecs import codec_of
from tp_controller.ros.feedforward import FeedforwardOverrides
from tp_controller.ros.goals import GoalReader, goal_message
from tp_controller.ros.polled import subscribe, taker
from tp_controller.ros.release import Release
from tp_controller.ros.state import StateMessage
from tp_controller.ros.trajectories import Trajectories
from tp_controller.ros.trajectory_bytes import FIELDS, trajectory_message
from tp_controller.ros.warnings import Warnings
from tp_controller.tasks import Task

GOAL, FEEDFORWARD, TRAJECTORY = 'goal', 'feedforward', 'trajectory'
"""What a task listens to; also the last part of the topic's name."""
LONGEST_PAUSE = 0.005
"""Time [s] between two messages of one topic that are taken over; a period if shorter."""


class _Topic:
    """One topic of a task.

    Parameters
    ----------
    subscription
        Polled, of depth 1: of more than one message a newer one would take the place anyway.
    task, what
        The task, and what a message is: `GOAL`, `FEEDFORWARD` or `TRAJECTORY`.
    """

    def __init__(self, subscription: Subscription, task: Task, what: str) -> None:
        self.subscription, self.task, self.what = subscription, task, what
        self.take = taker(subscription)
        self.opens = -math.inf
        """Steady time [s] from which on the next message may be taken."""


class TaskInputs:
    """Listens to goals, feedforwards and trajectories.

    Messages stay with the middleware until `handle` takes them over: of each topic one message
    in a period, the newest. A flood of messages wakes up nobody.

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
    refuse_at_rest
        Raises InvalidValue for the key that it is called with while the arm is kept at rest.

    Attributes
    ----------
    feedforwards
        Those that hold at present.
    answered
        Time of the joint states, which they end by.
    release
        Tasks that follow the arm to its rest.
    trajectories
        Those that follow a path.
    """

    def __init__(
        self,
        node: Node,
        settings: Settings,
        state: StateMessage,
        warnings: Warnings,
        period: float,
        refuse_at_rest: Callable[[str], None],
    ) -> None:
        self._node = node
        self._settings = settings
        self._state = state
        self._warnings = warnings
        self._reader = GoalReader(settings.stack.robot)
        self.feedforwards = FeedforwardOverrides(
            settings.values['timeouts.feedforward'], self._configured
        )
        self.answered = AnsweredTime(self.feedforwards)
        self.release = Release(settings.stack, self.answered)
        self.trajectories = Trajectories(
            settings.stack,
            lambda: state.msg.header.stamp,
            self.release,
            self._configured,
            settings.values['timeouts.feedforward'],
            refuse_at_rest,
            lambda task, problem: self._reject(task, 'trajectory', problem),
        )
        self.answered.follow(self.trajectories)
        self._handlers: Mapping[str, Callable[[Task, Any], None]] = {
            GOAL: self._on_goal,
            FEEDFORWARD: self._on_feedforward,
            TRAJECTORY: self._on_trajectory,
        }
        self.know_period(period)
        self._topics: list[_Topic] = []
        self._first = 0
        """Topic that is looked at first."""
        self.active = False
        """Whether the node is active: a velocity that comes before may not wait for that."""
        self.aimed: Callable[[Task], None] = _unwatched
        """Called after a goal by topic."""

    def know_period(self, period: float) -> None:
        """Take over the time [s] of one cycle."""
        self._pause = min(period, LONGEST_PAUSE)

    def robot_seen(self) -> None:
        """Take note that the robot's configuration is known."""
        self._reader.robot_seen = True

    def robot_lost(self) -> None:
        """Take note that the arm may move unseen from now on."""
        self._reader.robot_seen = False

    def end_motion(self) -> None:
        """End what moves tasks by itself: trajectories, and feedforwards from topics."""
        self.trajectories.end_all()
        self.feedforwards.end_all()

    @property
    def subscriptions(self) -> list[Subscription]:
        """All subscriptions, in no order."""
        return [topic.subscription for topic in self._topics]

    def listen(self, task: Task) -> Iterator[None]:
        """Take goals and feedforwards of a task, with a pause after each subscription."""
        codec = codec_of(task)
        if codec is not None:
            yield from self._subscribe(codec.message, task, GOAL)
            yield from self._subscribe(codec.feedforward_message, task, FEEDFORWARD)

    def listen_to_trajectories(self, task: Task) -> Iterator[None]:
        """Take trajectories of a task, with a pause after the subscription."""
        codec = codec_of(task)
        if codec is not None:
            yield from self._subscribe(codec.trajectory_message, task, TRAJECTORY)

    def _subscribe(self, message: type | None, task: Task, what: str) -> Iterator[None]:
        if message is not None:
            raw = what == TRAJECTORY and message in FIELDS
            subscription = subscribe(self._node, message, f'~/{task.name}/{what}', 1, raw)
            self._topics.append(_Topic(subscription, task, what))
            yield

    def forget(self, task: Task) -> None:
        """Let a task's topics be."""
        for topic in self._topics:
            if topic.task is task:
                self._node.destroy_subscription(topic.subscription)
        self._topics = [topic for topic in self._topics if topic.task is not task]
        self._first = 0
        self.feedforwards.end(task)
        self.trajectories.end(task)
        self.release.end(task)

    def handle(self, seconds: float) -> bool:
        """Take over what waits, until a time [s] is over.

        Returns
        -------
        bool
            Whether anything was taken over or refused.
        """
        begin = time.monotonic()
        found, topics, count = False, self._topics, len(self._topics)
        for i in range(self._first, self._first + count):
            topic = topics[i % count]
            if begin < topic.opens:
                continue
            taken = topic.take()
            if taken is None:
                continue
            msg, found = taken[0], True
            topic.opens = begin + self._pause
            self.take_over(topic.task, topic.what, msg)
            if time.monotonic() >= begin + seconds:
                # The others come first next time.
                self._first = (i + 1) % count
                break
        return found

    def take_over(self, task: Task, what: str, msg: Any) -> None:
        """Take over a message, or reject it: `what` says which kind it is."""
        try:
            self._handlers[what](task, msg)
        except InvalidValue as error:
            self._reject(task, what, str(error))
        except Exception as error:
            # One message must not end the control of the arm.
            self._reject(task, what, f'{type(error).__name__}: {error}')

    def target_of(self, task: Task, msg: Any) -> np.ndarray:
        """Target (target_size,) that a goal message asks for.

        Raises
        ------
        InvalidValue
            If it cannot be used.
        """
        return self._reader.target(task, msg)

    def read_goal(self, task: Task, values: Sequence[float], frame_id: str) -> np.ndarray:
        """Target (target_size,) of a task from values in a frame, as `goal_message` has them.

        Raises
        ------
        InvalidValue
            If they cannot be used.
        """
        msg = goal_message(self._state.task(task.name), values, frame_id)
        return self._reader.target(task, msg)

    def _on_goal(self, task: Task, msg: Any) -> None:
        self.aim(task, self.target_of(task, msg))
        self.aimed(task)

    def aim(self, task: Task, target: np.ndarray) -> None:
        """Set and show a task's target (target_size,)."""
        self.release.end(task)
        task.target = target
        self._state.task(task.name).accepted_goals += 1
        self._state.refresh_target(task.name, self._reader.robot_seen)

    def _on_trajectory(self, task: Task, msg: Any) -> None:
        codec = codec_of(task)
        if codec is not None and codec.trajectory_message is not None:
            msg = trajectory_message(msg, codec.trajectory_message)
        self.trajectories.begin(task, msg, self._reader)
        self.feedforwards.end(task)
        self._state.task(task.name).accepted_goals += 1

    def _on_feedforward(self, task: Task, msg: Any) -> None:
        if self.trajectories.runs(task):
            got = 'one while a trajectory runs, which has its own'
            raise InvalidValue('feedforward', got, 'ones without a trajectory')
        if not self.active:
            raise InvalidValue(
                'feedforward', 'one while the node is not active', 'ones once it is'
            )
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


def _unwatched(_: Task) -> None:
    """Nobody watches goals by topic."""
