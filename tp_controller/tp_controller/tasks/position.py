"""Position of a frame."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from tp_controller.parameters import REQUIRED, TEXT, Parameter
from tp_controller.robot import Robot
from tp_controller.tasks.frame import FrameTask, axis_rows

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]


class PositionTask(FrameTask):
    """Brings the origin of a frame to a point, along chosen base axes.

    ``error = p_des - p`` and ``J`` the rows of the frame's linear velocity.

    Parameters
    ----------
    name
        Name of the task.
    robot
        The robot that carries the task out.
    frame
        Name of the controlled frame.
    axes
        Letters of the controlled base axes.
    """

    type = 'position'
    parameters: ClassVar[Mapping[str, Parameter]] = {
        'frame': Parameter(TEXT, 'Controlled frame', default=REQUIRED),
        'axes': Parameter(TEXT, 'Controlled axes of the base frame, out of xyz', default='xyz'),
    }
    target_words = 'position per axis [m]'

    def __init__(self, name: str, robot: Robot, frame: str, axes: str = 'xyz') -> None:
        super().__init__(name, robot, frame, axis_rows('axes', axes))

    @classmethod
    def from_parameters(cls, name: str, robot: Robot, values: Mapping[str, Any]) -> PositionTask:
        """Make the task from checked values."""
        return cls(name, robot, values['frame'], values['axes'])

    @property
    def target_size(self) -> int:
        """One value per axis."""
        return self.k

    @property
    def current(self) -> Vector:
        """Present position per axis (k,) [m]; a copy."""
        return self.frame.position[self.rows]

    def target_from_pose(self, position: Vector, rotation: Matrix) -> Vector:
        """Coordinates of the position (3,) along the controlled axes."""
        return position[self.rows]

    def update(self) -> None:
        """Compute `error` [m] and `J` at the robot's present configuration."""
        np.take(self.frame.position, self.rows, out=self.error)
        np.subtract(self._target, self.error, out=self.error)
        np.take(self.frame.jacobian, self.rows, axis=0, out=self.J)
