"""Goal and feedforward messages: to the arrays of a task, and from values that people type."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tp_controller.errors import InvalidValue, listed, plural, shown
from tp_controller.robot import Robot
from tp_controller.ros.codecs import GOALS, Frames, feedforward_types, finite
from tp_controller.tasks import Task
from tp_interfaces.msg import TaskState

Vector = NDArray[np.float64]


class GoalReader(Frames):
    """Turns goal and feedforward messages into values of a task, see `GoalCodec`.

    Parameters
    ----------
    robot
        The robot, in whose frames goals may be given.
    """

    def __init__(self, robot: Robot) -> None:
        super().__init__(robot)

    def target(self, task: Task, msg: Any) -> Vector:
        """Target (target_size,) of the task that the message asks for.

        Raises
        ------
        InvalidValue
            For a frame that is not the robot's, a value that is not finite, a zero
            quaternion, or joints that are not the task's.
        """
        return GOALS[task.type].target(task, msg, self)

    def feedforward(self, task: Task, msg: Any, configured: Vector) -> Vector:
        """Desired task velocity (k,) that the message asks for.

        Joints that a message does not name keep their configured value.

        Raises
        ------
        InvalidValue
            As for `target`.
        """
        return GOALS[task.type].feedforward(task, msg, configured, self)


def goal_message(task: TaskState, values: Sequence[float], frame_id: str = '') -> Any:
    """Message for a goal given as the values of a target.

    Parameters
    ----------
    task
        The task as `~/state` tells it.
    values
        As ``target`` in a parameter file: one per axis, joint or angle; a quaternion
        x, y, z, w for two or three rotation axes.
    frame_id
        Frame that the values are given in; empty for the one that the task is seen from.

    Raises
    ------
    InvalidValue
        If the values are not those of such a task.
    """
    codec = GOALS.get(task.type)
    if codec is None:
        raise InvalidValue(task.name, f'a goal for a {task.type} task', listed(GOALS))
    names = list(task.target_components)
    numbers = _one_each(task, values, [codec.word(name) for name in names])
    msg = _in_frame(codec.message(), task, frame_id)
    codec.fill(msg, names, numbers)
    return msg


def feedforward_message(task: TaskState, values: Sequence[float], frame_id: str = '') -> Any:
    """Message for a feedforward given as one velocity per row of the task.

    Parameters
    ----------
    task
        The task as `~/state` tells it.
    values
        Velocity per row [m/s, rad/s].
    frame_id
        Frame that the values are given in; empty for the base frame.

    Raises
    ------
    InvalidValue
        If the values are not those of such a task.
    """
    codec = GOALS.get(task.type)
    if codec is None or codec.feedforward_message is None:
        raise InvalidValue(
            task.name, f'a feedforward for a {task.type} task', listed(feedforward_types())
        )
    rows = list(task.components)
    numbers = _one_each(task, values, rows)
    msg = _in_frame(codec.feedforward_message(), task, frame_id)
    codec.fill_feedforward(msg, rows, numbers)
    return msg


def _one_each(task: TaskState, values: Sequence[float], words: Sequence[str]) -> list[float]:
    """Finite numbers, one for each word."""
    if len(values) != len(words):
        got = plural(len(values), 'value')
        raise InvalidValue(task.name, got, f'{len(words)}: {listed(words)}')
    finite(task.name, values)
    return [float(value) for value in values]


def _in_frame(msg: Any, task: TaskState, frame_id: str) -> Any:
    """Return a message with its frame set, if it has one."""
    if hasattr(msg, 'header'):
        msg.header.frame_id = frame_id
    elif frame_id:
        got = f'the frame {shown(frame_id)} for a {task.type} task'
        raise InvalidValue(task.name, got, 'no frame')
    return msg
