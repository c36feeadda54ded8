"""Orientation of a frame."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from tp_controller.errors import InvalidValue, shown
from tp_controller.parameters import REQUIRED, TEXT, Parameter
from tp_controller.robot import Robot
from tp_controller.rotations import (
    heading,
    heading_rows,
    quaternion_from_rotation,
    rotation_error,
    rotation_from_quaternion,
    wrap,
)
from tp_controller.tasks.frame import FrameTask, axis_rows

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]


class OrientationTask(FrameTask):
    """Turns a frame to a desired orientation, about chosen base axes.

    With one axis the variable is the `heading` about it, an angle, and the error is
    wrapped. With two or three it is the rotation, its target a quaternion x, y, z, w, and
    the error is the chosen components of ``log(R_des Rᵀ)``; ``J`` has the rows of the
    frame's angular velocity.

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

    type = 'orientation'
    parameters: ClassVar[Mapping[str, Parameter]] = {
        'frame': Parameter(TEXT, 'Controlled frame', default=REQUIRED),
        'axes': Parameter(TEXT, 'Controlled axes of the base frame, out of xyz', default='xyz'),
    }

    def __init__(self, name: str, robot: Robot, frame: str, axes: str = 'xyz') -> None:
        super().__init__(name, robot, frame, axis_rows('axes', axes, first=3))
        self._axis = int(self.rows[0]) - 3
        self._R_des: Matrix = np.eye(3)

    @classmethod
    def from_parameters(
        cls, name: str, robot: Robot, values: Mapping[str, Any]
    ) -> OrientationTask:
        """Make the task from checked values."""
        return cls(name, robot, values['frame'], values['axes'])

    @property
    def target_words(self) -> str:  # type: ignore[override]
        """What the values of a target are."""
        return 'angle [rad]' if self.k == 1 else 'quaternion x y z w'

    @property
    def target_size(self) -> int:
        """One angle with one axis, else a quaternion."""
        return 1 if self.k == 1 else 4

    @property
    def current(self) -> Vector:
        """Present angle (1,) [rad] or quaternion x, y, z, w (4,); a copy."""
        return self.target_from_pose(self.frame.position, self.frame.rotation)

    def check_target(self, values: Sequence[float] | Vector) -> Vector:
        """As `Task.check_target`; a quaternion is brought to unit length."""
        target = super().check_target(values)
        if self.k > 1:
            # Scaled first: the square of a tiny or huge component leaves the range of floats.
            largest = np.abs(target).max()
            if largest == 0.0:
                raise InvalidValue('target', shown(target), 'a quaternion that is not zero')
            target /= largest
            target /= np.linalg.norm(target)
        return target

    @property
    def target(self) -> Vector | None:
        """Desired angle or quaternion, None before the first one; a copy."""
        return super().target

    @target.setter
    def target(self, values: Sequence[float] | Vector) -> None:
        self._target = self.check_target(values)
        if self.k > 1:
            self._R_des = rotation_from_quaternion(self._target)

    def hold(self) -> None:
        """Take the present orientation as the target."""
        self.target = self.current

    def target_from_pose(self, position: Vector, rotation: Matrix) -> Vector:
        """Angle (1,) or quaternion (4,) of the rotation (3, 3)."""
        if self.k == 1:
            return np.array([heading(rotation, self._axis)])
        return quaternion_from_rotation(rotation)

    def update(self) -> None:
        """Compute `error` [rad] and `J` at the robot's present configuration."""
        R = self.frame.rotation
        if self.k == 1:
            self.error[0] = wrap(self._target[0] - heading(R, self._axis))
            np.dot(heading_rows(R, self._axis), self.frame.jacobian[3:], out=self.J[0])
        else:
            self.error[:] = rotation_error(self._R_des, R)[self.rows - 3]
            np.take(self.frame.jacobian, self.rows, axis=0, out=self.J)
