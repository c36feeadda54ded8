"""Paths of tasks in time: targets, with the velocity that goes with them."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from tp_controller.interpolation import RotationPath, VectorPath
from tp_controller.tasks import FrameTask, Task

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]


class Aim(NamedTuple):
    """What a task is to do at a time."""

    target: Vector
    """(target_size,)."""
    feedforward: Vector
    """Task velocity (k,) that leads from here to the next step [m/s, rad/s]."""


class TaskPath(ABC):
    """The path of one task.

    Parameters
    ----------
    times
        Times (m,) [s] of its points.
    """

    def __init__(self, times: Vector) -> None:
        self.duration = float(times[-1])
        """Time [s] of its last point."""

    @abstractmethod
    def aim(self, task: Task, time: float, step: float) -> Aim:
        """Target at a time [s] and mean velocity from then until a step [s] later.

        An arm on its path is carried by the mean velocity of a step to where the path is at its
        end, which neither the velocity at its beginning nor that in its middle does; so the
        target is the point at the beginning, where the joint state was measured. For a step of
        zero it is the velocity at the time.
        """


class JointPath(TaskPath):
    """The path of a joint task.

    Parameters
    ----------
    path
        Positions (m, k) of its joints.
    """

    def __init__(self, path: VectorPath) -> None:
        super().__init__(path.times)
        self.path = path

    def aim(self, task: Task, time: float, step: float) -> Aim:
        """As `TaskPath.aim`."""
        values, velocity = self.path.at(time)
        if step > 0.0:
            velocity = (self.path.at(time + step)[0] - values) / step
        return Aim(values, velocity)


class FramePath(TaskPath):
    """The path of a frame, as seen from the frame that its task is seen from.

    Parameters
    ----------
    position
        Positions (m, 3) [m].
    rotation
        Rotations.
    """

    def __init__(self, position: VectorPath, rotation: RotationPath) -> None:
        super().__init__(position.times)
        self.position, self.rotation = position, rotation

    def pose(self, time: float) -> tuple[Vector, Matrix, Vector]:
        """Position (3,), rotation (3, 3) and twist (6,) at a time [s]."""
        p, v = self.position.at(time)
        R, w = self.rotation.at(time)
        return p, R, np.concatenate([v, w])

    def aim(self, task: Task, time: float, step: float) -> Aim:
        """As `TaskPath.aim`."""
        assert isinstance(task, FrameTask)
        p, R, twist = self.pose(time)
        if step > 0.0:
            q, S, _ = self.pose(time + step)
            twist = np.concatenate([q - p, R @ pin.log3(R.T @ S)]) / step
        if task.axes is not task.reference:
            A = task.axes.rotation.T @ task.reference.rotation
            twist = np.concatenate([A @ twist[:3], A @ twist[3:]])
        return Aim(task.target_from_pose(p, R), task.feedforward_from_twist(twist))


class Straight(TaskPath):
    """A path of another one's only point that goes on at the velocity given there.

    Parameters
    ----------
    path
        A path that ends with a velocity.
    velocity
        That velocity: of the joints (k,), or a twist (6,) of the frame.
    longest
        Time [s] for which it goes on.
    """

    def __init__(self, path: JointPath | FramePath, velocity: Vector, longest: float) -> None:
        super().__init__(np.array([path.duration + longest]))
        self._path, self._velocity = path, velocity
        times = np.array([path.duration, path.duration + longest])
        if isinstance(path, JointPath):
            self._on: JointPath | FramePath = JointPath(
                _line(times, path.path.values[-1], velocity)
            )
        else:
            p, R, _ = path.pose(path.duration)
            turned = np.stack([R, pin.exp3(velocity[3:] * longest) @ R])
            turning = RotationPath(times, turned, np.tile(velocity[3:], (2, 1)))
            self._on = FramePath(_line(times, p, velocity[:3]), turning)
        self._split = times[0]

    def aim(self, task: Task, time: float, step: float) -> Aim:
        """As `TaskPath.aim`."""
        path = self._path if time < self._split else self._on
        return path.aim(task, time, step)


def _line(times: Vector, value: Vector, velocity: Vector) -> VectorPath:
    values = np.stack([value, value + velocity * (times[1] - times[0])])
    return VectorPath(times, values, np.tile(velocity, (2, 1)))
