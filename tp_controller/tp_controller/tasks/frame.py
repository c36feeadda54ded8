"""What the tasks of a frame share: rows of its twist, and axes by letter."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from tp_controller.errors import InvalidValue, shown
from tp_controller.robot import Robot
from tp_controller.tasks.base import Task

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]


class FrameTask(Task):
    """A task on the pose of one frame, by axes of the base frame.

    Parameters
    ----------
    name
        Name of the task.
    robot
        The robot that carries the task out.
    frame
        Name of the controlled frame.
    rows
        Rows of the frame's twist [v; ω] that the task controls, 0 to 5.

    Raises
    ------
    InvalidValue
        If the robot has no such frame.
    """

    def __init__(self, name: str, robot: Robot, frame: str, rows: Sequence[int]) -> None:
        labels = ('x', 'y', 'z', 'rx', 'ry', 'rz')
        super().__init__(name, robot, [labels[row] for row in rows])
        self.frame = robot.frame(frame)
        self.rows = np.array(rows)

    @property
    def frame_name(self) -> str:
        """Name of the controlled frame."""
        return self.frame.name

    @abstractmethod
    def target_from_pose(self, position: Vector, rotation: Matrix) -> Vector:
        """Target (target_size,) that a pose in the base frame stands for."""

    def feedforward_from_twist(self, twist: Vector) -> Vector:
        """Task velocity (k,) that a twist (6,) [v; ω] in the base frame stands for."""
        return twist[self.rows]


def axis_rows(key: str, axes: str, first: int = 0) -> list[int]:
    """Twist rows of axes given by letter, such as ``xz``.

    Parameters
    ----------
    key
        Name of the parameter, for the message.
    axes
        Letters out of x, y, z, each at most once.
    first
        Row of the x axis: 0 for positions, 3 for rotations.

    Raises
    ------
    InvalidValue
        If a letter is another, stands twice, or there is none.
    """
    if not axes or not set(axes) <= set('xyz') or len(set(axes)) != len(axes):
        raise InvalidValue(key, shown(axes), 'letters out of xyz, each at most once')
    return [first + 'xyz'.index(letter) for letter in sorted(axes)]
