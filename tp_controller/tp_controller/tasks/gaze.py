"""An axis of a frame that points at a point."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from tp_controller.parameters import TEXT, Parameter
from tp_controller.robot import Robot
from tp_controller.tasks.frame import FRAME, LABELS, FrameTask

if TYPE_CHECKING:
    from typing_extensions import Unpack

    from tp_controller.tasks.common import Common

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]

AXES = ('x', 'y', 'z', '-x', '-y', '-z')
NEAR = 1e-9
"""Distance [m] and sine below which a direction is not told from rounding."""


class GazeTask(FrameTask):
    """Points an axis of a frame at a point; turns about the axis stay free.

    The error is the rotation vector (2,) [rad] that turns the axis ``a`` into the direction
    ``d`` of the target by the shortest way, along the two other axes of the frame, in which
    it has no further component. ``J`` has the rows of ``ω + d x v / distance``: the angular
    velocity of the frame less that of the direction, which turns when the frame moves. With
    one gain the angle then falls at exactly that rate. A target behind the frame is turned
    to about the first of the two axes.

    Parameters
    ----------
    name
        Name of the task.
    robot
        The robot that carries the task out.
    frame
        Name of the controlled frame.
    axis
        The axis that points, a letter out of xyz, with a minus for the other way.
    settings
        Gain, target and the like, see `Common`.
    """

    type = 'gaze'
    without = ('time_scaling',)
    parameters: ClassVar[Mapping[str, Parameter]] = {
        **FRAME,
        'axis': Parameter(TEXT, 'Axis of the frame that points', default='z', choices=AXES),
    }
    target_words = 'point x y z [m]'

    def __init__(
        self, name: str, robot: Robot, frame: str, axis: str = 'z', **settings: Unpack[Common]
    ) -> None:
        AXIS.read('axis', axis)
        index = 'xyz'.index(axis[-1])
        others = sorted({0, 1, 2} - {index})
        super().__init__(name, robot, frame, [3 + i for i in others], axes_frame=frame)
        self._others = np.array(others)
        self._a = np.zeros(3)
        self._a[index] = -1.0 if axis.startswith('-') else 1.0
        self.set(settings)

    @classmethod
    def from_parameters(cls, name: str, robot: Robot, values: Mapping[str, Any]) -> GazeTask:
        """Make the task from checked values."""
        return cls(name, robot, values['frame'], values['axis'])

    @property
    def target_components(self) -> tuple[str, ...]:
        """Coordinates of the point."""
        return LABELS[:3]

    @property
    def current(self) -> Vector:
        """Point (3,) [m] on the axis as far away as the target, at 1 m before there is one."""
        target = self._target if self._target.size else None
        far = 1.0 if target is None else float(np.linalg.norm(target - self.frame.position))
        return self.frame.position + far * self.frame.rotation @ self._a

    def target_from_pose(self, position: Vector, rotation: Matrix) -> Vector:
        """Return the position (3,)."""
        return position

    def update(self) -> None:
        """Compute `error` [rad] and `J` at the robot's present configuration."""
        R = self.frame.rotation
        way = R.T @ (self._target - self.frame.position)
        distance = math.sqrt(way @ way)
        if distance < NEAR:
            # The point is in the frame's origin: every direction is right.
            self.error[:] = 0.0
            self.J[:] = 0.0
            return
        d = way / distance
        normal = np.cross(self._a, d)
        sine, cosine = math.sqrt(normal @ normal), float(self._a @ d)
        if sine > NEAR:
            self.error[:] = math.atan2(sine, cosine) / sine * normal[self._others]
        else:
            self.error[:] = math.pi if cosine < 0.0 else 0.0, 0.0
        v, w = R.T @ self.frame.jacobian[:3], R.T @ self.frame.jacobian[3:]
        self.J[:] = (w + np.cross(d, v, axisb=0).T / distance)[self._others]

    def hessian(self, out: NDArray[np.float64]) -> None:
        """Write the second derivatives (2, n, n) of the variables, direction held, to ``out``."""
        R = self.frame.rotation
        way = R.T @ (self._target - self.frame.position)
        distance = max(math.sqrt(way @ way), NEAR)
        hessian = 0.5 * (self.frame.hessian + self.frame.hessian.swapaxes(1, 2))
        linear, angular = (np.tensordot(R.T, part, 1) for part in (hessian[:3], hessian[3:]))
        bent = np.cross(way / distance, linear, axisb=0, axisc=0) / distance
        np.take(angular + bent, self._others, axis=0, out=out)


AXIS = GazeTask.parameters['axis']
