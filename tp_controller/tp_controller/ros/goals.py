"""Goal and feedforward messages: to the arrays of a task, and from values that people type."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, TypeAlias

import numpy as np
from geometry_msgs.msg import (
    PointStamped,
    PoseStamped,
    QuaternionStamped,
    TwistStamped,
)
from numpy.typing import NDArray
from sensor_msgs.msg import JointState

from tp_controller.errors import InvalidValue, listed, plural, shown
from tp_controller.robot import Frame, Robot
from tp_controller.rotations import rotation_from_quaternion
from tp_controller.tasks import FrameTask, JointTask, ObstacleTask, Task, WholeArmTask
from tp_controller.tasks.base import LARGEST
from tp_interfaces.msg import TaskState

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]
GoalMessage: TypeAlias = PointStamped | QuaternionStamped | PoseStamped | JointState

GOAL_TYPES: dict[str, type] = {
    'position': PointStamped,
    'orientation': QuaternionStamped,
    'pose': PoseStamped,
    'gaze': PointStamped,
    'obstacle': PointStamped,
    'joint': JointState,
    'posture': JointState,
}
"""Message that carries the goal of each task type that has one."""

_FINITE = 'finite numbers'


FEEDFORWARD_TYPES: dict[str, type] = {
    name: JointState if goal is JointState else TwistStamped
    for name, goal in GOAL_TYPES.items()
    if name != 'obstacle'
}
"""Message that carries the feedforward of each task type that has one."""


class GoalReader:
    """Turns goal and feedforward messages into values of a task.

    Parameters
    ----------
    robot
        The robot, in whose frames goals may be given.
    """

    def __init__(self, robot: Robot) -> None:
        self._robot = robot
        self.robot_seen = False
        """Whether the robot's configuration is known: set after the first joint state."""

    def target(self, task: Task, msg: GoalMessage) -> Vector:
        """Target (target_size,) of the task that the message asks for.

        Raises
        ------
        InvalidValue
            For a frame that is not the robot's, a value that is not finite, a zero
            quaternion, or joints that are not the task's.
        """
        if isinstance(task, JointTask):
            self._check_frame(msg.header.frame_id)
            whole = set(msg.name) == set(task.components)
            if task.target is None and not whole:
                raise InvalidValue(
                    'goal',
                    f'joints {shown(list(msg.name))} before the first joint state',
                    f'all of {listed(task.components)}',
                )
            values = np.zeros(task.k) if task.target is None else task.target
            return task.check_target(task.with_joints(values, msg.name, msg.position))
        assert isinstance(task, FrameTask | ObstacleTask | WholeArmTask)
        source, seen = self._frame(msg.header.frame_id, task), task.reference
        position, rotation = _pose(msg)
        if source is not seen:
            position = source.position + source.rotation @ position - seen.position
            position = seen.rotation.T @ position
            rotation = seen.rotation.T @ source.rotation @ rotation
        return task.check_target(task.target_from_pose(position, rotation))

    def feedforward(
        self, task: Task, msg: TwistStamped | JointState, configured: Vector
    ) -> Vector:
        """Desired task velocity (k,) that the message asks for.

        Joints that a message does not name keep their configured value.

        Raises
        ------
        InvalidValue
            As for `target`.
        """
        if isinstance(task, JointTask):
            return task.check_feedforward(task.with_joints(configured, msg.name, msg.velocity))
        assert isinstance(task, FrameTask)
        source = self._frame(msg.header.frame_id, task)
        v, w = msg.twist.linear, msg.twist.angular
        twist = _bounded('feedforward', [v.x, v.y, v.z, w.x, w.y, w.z])
        if source is not task.axes:
            A = task.axes.rotation.T @ source.rotation
            twist = np.concatenate([A @ twist[:3], A @ twist[3:]])
        return task.feedforward_from_twist(twist)

    def _frame(self, frame_id: str, task: FrameTask | ObstacleTask | WholeArmTask) -> Frame:
        """Frame that the message is given in; the one that the task is seen from if empty."""
        robot, seen = self._robot, task.reference
        if frame_id in ('', seen.name):
            return seen
        self._check_frame(frame_id)
        if not self.robot_seen:
            raise InvalidValue(
                'header.frame_id',
                f'{shown(frame_id)} before the first joint state',
                f"'' or {seen.name} until then",
            )
        return robot.base if frame_id == robot.base_frame else robot.frame(frame_id)

    def _check_frame(self, frame_id: str) -> None:
        known = dict.fromkeys(('', self._robot.base_frame, *self._robot.frames))
        if frame_id not in known:
            accepts = listed(name or "''" for name in known)
            raise InvalidValue('header.frame_id', shown(frame_id), accepts)


def _finite(key: str, values: Sequence[float]) -> Vector:
    array = np.array(values)
    if not np.isfinite(array).all():
        raise InvalidValue(key, shown(array), _FINITE)
    return array


def _bounded(key: str, values: Sequence[float]) -> Vector:
    """Values as they were sent, checked before they are transformed."""
    array = _finite(key, values)
    if np.abs(array).max() > LARGEST:
        raise InvalidValue(key, shown(array), f'numbers up to {LARGEST:g} in size')
    return array


def _pose(msg: PointStamped | QuaternionStamped | PoseStamped) -> tuple[Vector, Matrix]:
    """Position and rotation of a message; what it does not carry is zero."""
    position, rotation = np.zeros(3), np.eye(3)
    point = msg.point if isinstance(msg, PointStamped) else None
    quaternion = msg.quaternion if isinstance(msg, QuaternionStamped) else None
    if isinstance(msg, PoseStamped):
        point, quaternion = msg.pose.position, msg.pose.orientation
    if point is not None:
        position = _bounded('goal position', [point.x, point.y, point.z])
    if quaternion is not None:
        xyzw = _finite('goal quaternion', [quaternion.x, quaternion.y, quaternion.z, quaternion.w])
        largest = np.abs(xyzw).max()
        if largest == 0.0:
            raise InvalidValue('goal quaternion', 'all zeros', 'a quaternion that is not zero')
        rotation = rotation_from_quaternion(xyzw / largest)
    return position, rotation


def goal_message(task: TaskState, values: Sequence[float], frame_id: str = '') -> GoalMessage:
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
    if task.type not in GOAL_TYPES:
        raise InvalidValue(task.name, f'a goal for a {task.type} task', listed(GOAL_TYPES))
    words, fill = _form(task)
    if len(values) != len(words):
        got = plural(len(values), 'value')
        raise InvalidValue(task.name, got, f'{len(words)}: {listed(words)}')
    _finite(task.name, values)
    msg: GoalMessage = GOAL_TYPES[task.type]()
    msg.header.frame_id = frame_id
    fill(msg, [float(value) for value in values])
    return msg


def feedforward_message(
    task: TaskState, values: Sequence[float], frame_id: str = ''
) -> TwistStamped | JointState:
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
    if task.type not in FEEDFORWARD_TYPES:
        raise InvalidValue(
            task.name, f'a feedforward for a {task.type} task', listed(FEEDFORWARD_TYPES)
        )
    rows = list(task.components)
    if len(values) != len(rows):
        got = plural(len(values), 'value')
        raise InvalidValue(task.name, got, f'{len(rows)}: {listed(rows)}')
    _finite(task.name, values)
    if FEEDFORWARD_TYPES[task.type] is JointState:
        msg = JointState(name=rows, velocity=[float(value) for value in values])
    else:
        msg = TwistStamped()
        for row, value in zip(rows, values, strict=True):
            part = msg.twist.linear if len(row) == 1 else msg.twist.angular
            setattr(part, row[-1], float(value))
    msg.header.frame_id = frame_id
    return msg


def _form(task: TaskState) -> tuple[list[str], Callable[[Any, list[float]], None]]:
    """What the values of a goal are called, and how they are put into its message."""
    names = list(task.target_components)
    if GOAL_TYPES[task.type] is JointState:

        def fill_joints(msg: JointState, values: list[float]) -> None:
            msg.name, msg.position = names, values

        return [f'{name} [rad or m]' for name in names], fill_joints

    def fill(msg: Any, values: list[float]) -> None:
        pose = getattr(msg, 'pose', None)
        point: Any = pose.position if pose else getattr(msg, 'point', None)
        quaternion: Any = pose.orientation if pose else getattr(msg, 'quaternion', None)
        for name, value in zip(names, values, strict=True):
            if name in ('x', 'y', 'z'):
                setattr(point, name, value)
            elif name.startswith('q'):
                setattr(quaternion, name[1], value)
            else:
                setattr(quaternion, name[1], float(np.sin(value / 2.0)))
                quaternion.w = float(np.cos(value / 2.0))

    return [_word(name) for name in names], fill


def _word(name: str) -> str:
    """What a value of a target is, for messages."""
    if name in ('x', 'y', 'z'):
        return f'{name} [m]'
    return f'quaternion {name[1]}' if name.startswith('q') else f'angle about {name[1]} [rad]'
