"""How goals and the like of each task type travel in messages; other packages may add some."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Any

import numpy as np
from geometry_msgs.msg import PointStamped, PoseStamped, QuaternionStamped, TwistStamped
from numpy.typing import NDArray
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, MultiDOFJointTrajectory

from tp_controller.errors import InvalidValue, listed, shown
from tp_controller.plugins import Registry
from tp_controller.robot import Frame, Robot
from tp_controller.ros.trajectory_messages import Begin, frame_path, joint_path
from tp_controller.rotations import rotation_from_quaternion
from tp_controller.tasks import FrameTask, JointTask, ObstacleTask, Task, WholeArmTask
from tp_controller.tasks.checks import LARGEST
from tp_controller.trajectory import TaskPath

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]


class Frames:
    """Frames that messages may be given in.

    Parameters
    ----------
    robot
        The robot whose frames they are.
    """

    def __init__(self, robot: Robot) -> None:
        self._robot = robot
        self.robot_seen = False
        """Whether the robot's configuration is known: after the first joint state since the node
        became active."""

    def named(self, frame_id: str, otherwise: Frame) -> Frame:
        """Frame of a message's header; another one if the name is empty.

        Raises
        ------
        InvalidValue
            For a frame that is not the robot's, or while its configuration is unknown.
        """
        robot = self._robot
        if frame_id in ('', otherwise.name):
            return otherwise
        self.check(frame_id)
        if not self.robot_seen:
            raise InvalidValue(
                'header.frame_id',
                f'{shown(frame_id)} before the first joint state',
                f"'' or {otherwise.name} until then",
            )
        return robot.base if frame_id == robot.base_frame else robot.frame(frame_id)

    def check(self, frame_id: str) -> None:
        """Check that a name is empty or that of a frame.

        Raises
        ------
        InvalidValue
            If it is not.
        """
        known = dict.fromkeys(('', self._robot.base_frame, *self._robot.frames))
        if frame_id not in known:
            accepts = listed(name or "''" for name in known)
            raise InvalidValue('header.frame_id', shown(frame_id), accepts)


class GoalCodec(ABC):
    """Goals and feedforwards of one task type as messages.

    Parameters
    ----------
    message
        Message that carries a goal.
    feedforward
        Message that carries a feedforward, None if the type has none.
    trajectory
        Message that carries a trajectory, None if the type has none.
    """

    def __init__(
        self, message: type, feedforward: type | None = None, trajectory: type | None = None
    ) -> None:
        self.message = message
        self.feedforward_message = feedforward
        self.trajectory_message = trajectory

    @abstractmethod
    def target(self, task: Any, msg: Any, frames: Frames) -> Vector:
        """Target (target_size,) of the task that a goal message asks for.

        Raises
        ------
        InvalidValue
            If the message cannot be used; `Task.check_target` finds most of it.
        """

    @abstractmethod
    def fill(self, msg: Any, names: Sequence[str], values: list[float]) -> None:
        """Put the values of a target into a goal message.

        Parameters
        ----------
        msg
            An empty message.
        names
            The task's `target_components`.
        values
            One for each name.
        """

    def word(self, name: str) -> str:
        """What a value of a target is, for messages; its name unless overridden."""
        return name

    def feedforward(self, task: Any, msg: Any, configured: Vector, frames: Frames) -> Vector:
        """Desired task velocity (k,) that a feedforward message asks for.

        Raises
        ------
        InvalidValue
            As for `target`.
        """
        raise NotImplementedError

    def fill_feedforward(self, msg: Any, rows: Sequence[str], values: list[float]) -> None:
        """Put one velocity per row of the task, the `components`, into a feedforward message."""
        raise NotImplementedError

    def path(self, task: Any, msg: Any, frames: Frames, begin: Begin) -> TaskPath:
        """Path of the task that a trajectory message of one point or more asks for.

        Raises
        ------
        InvalidValue
            As for `target`.
        """
        raise NotImplementedError


class JointGoal(GoalCodec):
    """Joints by name, as JointState; a goal may name some of the task's joints only."""

    def __init__(self) -> None:
        super().__init__(JointState, JointState, JointTrajectory)

    def target(self, task: JointTask, msg: JointState, frames: Frames) -> Vector:
        """Positions (k,); joints that are not named keep their target."""
        frames.check(msg.header.frame_id)
        whole = set(msg.name) == set(task.components)
        if task.target is None and not whole:
            raise InvalidValue(
                'goal',
                f'joints {shown(list(msg.name))} before the first joint state',
                f'all of {listed(task.components)}',
            )
        values = np.zeros(task.k) if task.target is None else task.target
        return task.check_target(task.with_joints(values, msg.name, msg.position))

    def fill(self, msg: JointState, names: Sequence[str], values: list[float]) -> None:
        """Put in names and positions."""
        msg.name, msg.position = list(names), values

    def word(self, name: str) -> str:
        """Return the joint's name with the unit."""
        return f'{name} [rad or m]'

    def feedforward(
        self, task: JointTask, msg: JointState, configured: Vector, frames: Frames
    ) -> Vector:
        """Velocities (k,); joints that are not named keep the configured one."""
        return task.check_feedforward(task.with_joints(configured, msg.name, msg.velocity))

    def fill_feedforward(self, msg: JointState, rows: Sequence[str], values: list[float]) -> None:
        """Put in names and velocities."""
        msg.name, msg.velocity = list(rows), values

    def path(
        self, task: JointTask, msg: JointTrajectory, frames: Frames, begin: Begin
    ) -> TaskPath:
        """Path of the named joints; the others stay."""
        frames.check(msg.header.frame_id)
        return joint_path(task, msg, begin)


class FrameGoal(GoalCodec):
    """A point, a quaternion or a pose, in any frame of the robot; feedforwards are twists."""

    def __init__(
        self,
        message: type,
        feedforward: type | None = TwistStamped,
        trajectory: type | None = None,
    ) -> None:
        super().__init__(message, feedforward, trajectory)

    def target(
        self, task: FrameTask | ObstacleTask | WholeArmTask, msg: Any, frames: Frames
    ) -> Vector:
        """Target of the pose, as seen from the frame that the task is seen from."""
        seen = task.reference
        source = frames.named(msg.header.frame_id, seen)
        position, rotation = _pose(msg)
        if source is not seen:
            position = source.position + source.rotation @ position - seen.position
            position = seen.rotation.T @ position
            rotation = seen.rotation.T @ source.rotation @ rotation
        return task.check_target(task.target_from_pose(position, rotation))

    def fill(self, msg: Any, names: Sequence[str], values: list[float]) -> None:
        """Put in coordinates, and a quaternion or an angle about one axis."""
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

    def word(self, name: str) -> str:
        """What a value of a target is."""
        if name in ('x', 'y', 'z'):
            return f'{name} [m]'
        return f'quaternion {name[1]}' if name.startswith('q') else f'angle about {name[1]} [rad]'

    def feedforward(
        self, task: FrameTask, msg: TwistStamped, configured: Vector, frames: Frames
    ) -> Vector:
        """Rows of the twist along the task's axes."""
        source = frames.named(msg.header.frame_id, task.reference)
        v, w = msg.twist.linear, msg.twist.angular
        twist = _bounded('feedforward', [v.x, v.y, v.z, w.x, w.y, w.z])
        if source is not task.axes:
            A = task.axes.rotation.T @ source.rotation
            twist = np.concatenate([A @ twist[:3], A @ twist[3:]])
        return task.feedforward_from_twist(twist)

    def fill_feedforward(
        self, msg: TwistStamped, rows: Sequence[str], values: list[float]
    ) -> None:
        """Put each row's velocity into the twist."""
        for row, value in zip(rows, values, strict=True):
            part = msg.twist.linear if len(row) == 1 else msg.twist.angular
            setattr(part, row[-1], value)

    def path(
        self, task: FrameTask, msg: MultiDOFJointTrajectory, frames: Frames, begin: Begin
    ) -> TaskPath:
        """Path of the pose, as seen from the frame that the task is seen from."""
        return frame_path(task, msg, frames.named(msg.header.frame_id, task.reference), begin)


def finite(key: str, values: Sequence[float]) -> Vector:
    """Array of values that are all finite.

    Raises
    ------
    InvalidValue
        If one is not.
    """
    array = np.array(values)
    if not np.isfinite(array).all():
        raise InvalidValue(key, shown(array), 'finite numbers')
    return array


def _bounded(key: str, values: Sequence[float]) -> Vector:
    """Values as they were sent, checked before they are transformed."""
    array = finite(key, values)
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
        xyzw = finite('goal quaternion', [quaternion.x, quaternion.y, quaternion.z, quaternion.w])
        largest = np.abs(xyzw).max()
        if largest == 0.0:
            raise InvalidValue('goal quaternion', 'all zeros', 'a quaternion that is not zero')
        rotation = rotation_from_quaternion(xyzw / largest)
    return position, rotation


def _check(name: str, codec: Any) -> None:
    if not isinstance(codec, GoalCodec):
        raise InvalidValue(name, shown(codec), 'an instance of GoalCodec')


GOALS: Registry[GoalCodec] = Registry(
    'tp_controller.goals',
    {
        'position': FrameGoal(PointStamped, trajectory=MultiDOFJointTrajectory),
        'orientation': FrameGoal(QuaternionStamped, trajectory=MultiDOFJointTrajectory),
        'pose': FrameGoal(PoseStamped, trajectory=MultiDOFJointTrajectory),
        'gaze': FrameGoal(PointStamped),
        'obstacle': FrameGoal(PointStamped, None),
        'joint': JointGoal(),
        'posture': JointGoal(),
    },
    _check,
)
"""Codecs by the task types that have goals; other packages may add some."""


def feedforward_types() -> list[str]:
    """Task types whose feedforward may come by message."""
    return [name for name, codec in GOALS.items() if codec.feedforward_message is not None]


def codec_of(task: Task) -> GoalCodec | None:
    """Codec of a task's goals, None if the type has none."""
    return GOALS.get(task.type)
