"""Position and orientation of a frame as one task."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from tp_controller.parameters import TEXT, Parameter
from tp_controller.robot import Robot
from tp_controller.tasks.frame import FRAME, VIEW, FrameTask, axis_rows
from tp_controller.tasks.orientation import OrientationTask
from tp_controller.tasks.parts import Part
from tp_controller.tasks.position import PositionTask

if TYPE_CHECKING:
    from typing_extensions import Unpack

    from tp_controller.tasks.common import Common

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]


class PoseTask(FrameTask):
    """Brings a frame to a position and an orientation at once.

    Its rows are those of a `PositionTask`, then those of an `OrientationTask`; on a planar
    arm with axes ``xy`` and ``z`` it is the configuration (x, y, angle).

    Parameters
    ----------
    name
        Name of the task.
    robot
        The robot that carries the task out.
    frame
        Name of the controlled frame.
    position_axes, orientation_axes
        Letters of the controlled axes.
    relative_to
        Name of the reference frame; the base when left out.
    axes_frame
        Name of the frame whose axes are meant; the reference when left out.
    settings
        Gain, target and the like, see `Common`.
    """

    type = 'pose'
    parameters: ClassVar[Mapping[str, Parameter]] = {
        **FRAME,
        'position_axes': Parameter(
            TEXT, 'Controlled axes of the position, out of xyz', default='xyz'
        ),
        'orientation_axes': Parameter(
            TEXT, 'Controlled axes of the orientation, out of xyz', default='xyz'
        ),
        **VIEW,
    }

    def __init__(
        self,
        name: str,
        robot: Robot,
        frame: str,
        position_axes: str = 'xyz',
        orientation_axes: str = 'xyz',
        relative_to: str | None = None,
        axes_frame: str | None = None,
        **settings: Unpack[Common],
    ) -> None:
        position_rows = axis_rows('position_axes', position_axes)
        orientation_rows = axis_rows('orientation_axes', orientation_axes, first=3)
        views = relative_to, axes_frame
        super().__init__(name, robot, frame, position_rows + orientation_rows, *views)
        self._place = PositionTask(name, robot, frame, position_axes, *views)
        self._turn = OrientationTask(name, robot, frame, orientation_axes, *views)
        self._split = self._place.target_size
        self.place(self.J, self.error)
        self.set(settings)

    def place(self, J: Matrix, error: Vector) -> None:
        """Keep Jacobian and error in given arrays (k, n) and (k,) from now on."""
        super().place(J, error)
        self._place.place(J[: self._place.k], error[: self._place.k])
        self._turn.place(J[self._place.k :], error[self._place.k :])

    @property
    def speed_groups(self) -> tuple[slice, ...]:
        """The rows of the position, and those of the orientation."""
        return slice(0, self._place.k), slice(self._place.k, self.k)

    @property
    def parts(self) -> tuple[Part, ...]:
        """The position, then the orientation."""
        return self._place.parts + self._turn.parts

    def part_values(self) -> tuple[Vector, ...]:
        """Targets of both."""
        return self._place.part_values() + self._turn.part_values()

    @classmethod
    def from_parameters(cls, name: str, robot: Robot, values: Mapping[str, Any]) -> PoseTask:
        """Make the task from checked values."""
        return cls(
            name,
            robot,
            values['frame'],
            values['position_axes'],
            values['orientation_axes'],
            values.get('relative_to'),
            values.get('axes_frame'),
        )

    @property
    def target_words(self) -> str:  # type: ignore[override]
        """What the values of a target are."""
        return f'{self._place.target_words}, then {self._turn.target_words}'

    @property
    def target_components(self) -> tuple[str, ...]:
        """Values of the position, then those of the orientation."""
        return self._place.target_components + self._turn.target_components

    @property
    def sized(self) -> slice:
        """The position; the orientation is checked by itself."""
        return slice(self._split)

    @property
    def current(self) -> Vector:
        """Present position values, then orientation values; a copy."""
        return np.concatenate([self._place.current, self._turn.current])

    def check_target(self, values: Sequence[float] | Vector) -> Vector:
        """As `Task.check_target`; a quaternion is brought to unit length."""
        target = super().check_target(values)
        target[self._split :] = self._turn.check_target(target[self._split :])
        return target

    @property
    def target(self) -> Vector | None:
        """Desired position values, then orientation values; a copy."""
        return super().target

    @target.setter
    def target(self, values: Sequence[float] | Vector) -> None:
        self._target = self.check_target(values)
        self.revision += 1
        self._place.target = self._target[: self._split]
        self._turn.target = self._target[self._split :]

    def hold(self) -> None:
        """Take the present pose as the target."""
        self.target = self.current

    def target_from_pose(self, position: Vector, rotation: Matrix) -> Vector:
        """Target of a pose, position values then orientation values."""
        return np.concatenate(
            [
                self._place.target_from_pose(position, rotation),
                self._turn.target_from_pose(position, rotation),
            ]
        )

    @property
    def bend(self) -> Vector:
        """Bounds (k,) of the position's rows, then the orientation's."""
        return np.concatenate([self._place.bend, self._turn.bend])
