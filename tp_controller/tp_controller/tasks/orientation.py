"""Orientation of a frame."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from tp_controller.errors import InvalidValue, shown
from tp_controller.parameters import TEXT, Parameter
from tp_controller.robot import Frame, Robot
from tp_controller.rotations import (
    heading,
    quaternion_from_rotation,
    rotation_from_quaternion,
)
from tp_controller.tasks.frame import FRAME, VIEW, FrameTask, axis_rows
from tp_controller.tasks.parts import HEADING, ROTATION, TILT, Part

if TYPE_CHECKING:
    from typing_extensions import Unpack

    from tp_controller.tasks.common import Common

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]


QUATERNION = ('qx', 'qy', 'qz', 'qw')


class OrientationTask(FrameTask):
    """Turns a frame to a desired orientation, about chosen axes.

    With one axis of the reference frame the variable is the `heading` about it, an angle,
    and the error is wrapped. Else it is the rotation, its target a quaternion x, y, z, w.
    With three axes the error is ``log(R_des Rᵀ)``. With two it is the tilt: the shortest
    rotation after which only a turn about the third axis is left, see `tilt_error`; turns
    about that axis, the free spin, change nothing about its size. With one axis of
    ``axes_frame`` it is that component of the logarithm. The errors are along the axes of
    the reference or of ``axes_frame``; ``J`` has the rows of the angular velocity along the
    same axes, so that the size of the error falls at the rate ``error · J qd / |error|``
    (axes that belong neither to the frame nor to its reference are taken as standing still).
    The target and R are seen from the reference frame.

    Parameters
    ----------
    name
        Name of the task.
    robot
        The robot that carries the task out.
    frame
        Name of the controlled frame.
    axes
        Letters of the controlled axes.
    relative_to
        Name of the reference frame; the base when left out.
    axes_frame
        Name of the frame whose axes are meant; the reference when left out.
    settings
        Gain, target and the like, see `Common`.
    """

    type = 'orientation'
    parameters: ClassVar[Mapping[str, Parameter]] = {
        **FRAME,
        'axes': Parameter(TEXT, 'Controlled axes, out of xyz', default='xyz'),
        **VIEW,
    }

    def __init__(
        self,
        name: str,
        robot: Robot,
        frame: str,
        axes: str = 'xyz',
        relative_to: str | None = None,
        axes_frame: str | None = None,
        **settings: Unpack[Common],
    ) -> None:
        rows = axis_rows('axes', axes, first=3)
        super().__init__(name, robot, frame, rows, relative_to, axes_frame)
        self._turns = self.twist_rows - 3
        self._axis = int(self._turns[0])
        self._is_heading = self.k == 1 and not self._own_axes
        self._free = ({0, 1, 2} - set(self._turns.tolist())).pop() if self.k == 2 else -1
        # A free axis that is fixed to the frame itself turns with it.
        self._carried = self._own_axes and _same_body(robot, self.axes, self.frame)
        self._R_des: Matrix = np.eye(3)
        self.set(settings)

    @classmethod
    def from_parameters(
        cls, name: str, robot: Robot, values: Mapping[str, Any]
    ) -> OrientationTask:
        """Make the task from checked values."""
        return cls(
            name,
            robot,
            values['frame'],
            values['axes'],
            values.get('relative_to'),
            values.get('axes_frame'),
        )

    @property
    def target_words(self) -> str:  # type: ignore[override]
        """What the values of a target are."""
        return 'angle [rad]' if self._is_heading else 'quaternion x y z w'

    @property
    def target_components(self) -> tuple[str, ...]:
        """One angle with one axis of the reference, else a quaternion."""
        return self.components if self._is_heading else QUATERNION

    @property
    def sized(self) -> slice:
        """An angle, nothing of a quaternion."""
        return slice(None if self._is_heading else 0)

    @property
    def current(self) -> Vector:
        """Present angle (1,) [rad] or quaternion x, y, z, w (4,); a copy."""
        return self.target_from_pose(np.zeros(3), self._rotation())

    def check_target(self, values: Sequence[float] | Vector) -> Vector:
        """As `Task.check_target`; a quaternion is brought to unit length."""
        target = super().check_target(values)
        if not self._is_heading:
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
        self.revision += 1
        if not self._is_heading:
            self._R_des = rotation_from_quaternion(self._target)

    def hold(self) -> None:
        """Take the present orientation as the target."""
        self.target = self.current

    def target_from_pose(self, position: Vector, rotation: Matrix) -> Vector:
        """Angle (1,) or quaternion (4,) of the rotation (3, 3)."""
        if self._is_heading:
            return np.array([heading(rotation, self._axis)])
        return quaternion_from_rotation(rotation)

    @property
    def parts(self) -> tuple[Part, ...]:
        """The angle, the rotation, or the tilt."""
        if self._is_heading:
            return (self._part(HEADING, self.twist_rows, self._axis),)
        if self._free >= 0:
            return (self._part(TILT, self.twist_rows, self._free, self._carried),)
        return (self._part(ROTATION, self.twist_rows),)

    def part_values(self) -> tuple[Vector, ...]:
        """Angle (1,), or rotation (9,) row by row."""
        return (self._target if self._is_heading else self._R_des.ravel(),)


def _same_body(robot: Robot, one: Frame, other: Frame) -> bool:
    """Whether no joint is between two frames."""
    if robot.base in (one, other):
        return False
    joints = [robot.model.frames[frame.index].parentJoint for frame in (one, other)]
    return bool(joints[0] == joints[1])
