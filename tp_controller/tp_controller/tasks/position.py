"""Position of a frame."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from tp_controller.parameters import TEXT, Parameter
from tp_controller.robot import Robot
from tp_controller.tasks.frame import FRAME, LABELS, VIEW, FrameTask, axis_rows
from tp_controller.tasks.parts import POSITION, Part

if TYPE_CHECKING:
    from typing_extensions import Unpack

    from tp_controller.tasks.common import Common

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]


class PositionTask(FrameTask):
    """Brings the origin of a frame to a point, along chosen axes.

    ``error = p_des - p`` as seen from the reference frame, along its axes; the target has
    one value per axis. With ``axes_frame`` the target has all three coordinates in the
    reference frame and the error is seen along the axes of that frame, ``R_Xᵀ (p_des - p)``,
    which may move with the robot. ``J`` is the rate of ``-error`` in every case.

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

    type = 'position'
    parameters: ClassVar[Mapping[str, Parameter]] = {
        **FRAME,
        'axes': Parameter(TEXT, 'Controlled axes, out of xyz', default='xyz'),
        **VIEW,
    }
    target_words = 'position per axis [m]'

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
        super().__init__(name, robot, frame, axis_rows('axes', axes), relative_to, axes_frame)
        # Along axes of its own the error needs all of the target.
        self._targeted = np.arange(3) if self._own_axes else self.twist_rows
        self.set(settings)

    @classmethod
    def from_parameters(cls, name: str, robot: Robot, values: Mapping[str, Any]) -> PositionTask:
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
    def target_components(self) -> tuple[str, ...]:
        """Letters of the axes that a target has values for."""
        return tuple(LABELS[row] for row in self._targeted)

    @property
    def current(self) -> Vector:
        """Present position per axis [m]; a copy."""
        return self._position()[self._targeted]

    def target_from_pose(self, position: Vector, rotation: Matrix) -> Vector:
        """Coordinates of the position (3,) that a target has."""
        return position[self._targeted]

    @property
    def parts(self) -> tuple[Part, ...]:
        """The position of the frame."""
        return (self._part(POSITION, self.twist_rows),)

    def part_values(self) -> tuple[Vector, ...]:
        """Target by coordinate, zero for those without."""
        if self._target.size == 3:
            return (self._target,)
        values = np.zeros(3)
        values[self._targeted] = self._target
        return (values,)
