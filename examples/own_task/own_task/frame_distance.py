"""Distance between two frames."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from tp_controller import InvalidValue, Robot, Task
from tp_controller.parameters import REQUIRED, TEXT, Parameter

Vector = NDArray[np.float64]

NEAR = 1e-9
"""Distance [m] below which it has no direction."""


class FrameDistanceTask(Task):
    """Brings the origins of two frames to a distance of each other.

    ``error = d_des - d`` with ``d = ‖p - p_other‖``; with the unit vector ``u`` from the other
    frame to the frame, ``J = uᵀ (J_frame - J_other)``, rows of linear velocity alone.

    Parameters
    ----------
    name
        Name of the task.
    robot
        The robot that carries the task out.
    frame, other
        Names of the frames.
    settings
        Gain, target [m] and the like, see `Common`.
    """

    type = 'frame_distance'
    parameters: ClassVar[Mapping[str, Parameter]] = {
        'frame': Parameter(TEXT, 'One of the frames', default=REQUIRED),
        'other': Parameter(TEXT, 'The other frame', default=REQUIRED),
    }
    target_words = 'distance [m]'

    def __init__(self, name: str, robot: Robot, frame: str, other: str, **settings: Any) -> None:
        super().__init__(name, robot, ['distance'])
        self._frame, self._other = robot.frame(frame), robot.frame(other)
        self.set(settings)

    @property
    def frame_name(self) -> str:
        """Name of the frame that `~/state` tells."""
        return self._frame.name

    @property
    def target_components(self) -> tuple[str, ...]:
        """What the one value of a target is called."""
        return ('distance',)

    @property
    def current(self) -> Vector:
        """Present distance (1,) [m]; a copy."""
        way = self._frame.position - self._other.position
        return np.array([math.sqrt(way @ way)])

    def check_target(self, values: Sequence[float] | Vector) -> Vector:
        """As `Task.check_target`; a distance is at least 0."""
        target = super().check_target(values)
        if target[0] < 0.0:
            raise InvalidValue('target', str(target[0]), 'a distance of at least 0')
        return target

    def update(self) -> None:
        """Compute `error` [m] and `J` at the robot's present configuration."""
        distance, u, moved = self._parts()
        self.error[0] = self._target[0] - distance
        np.dot(u, moved, out=self.J[0])

    @property
    def bend(self) -> Vector:
        """No bound on the second derivatives: `hessian` is asked for where they matter."""
        return np.full(1, math.inf)

    def hessian(self, out: NDArray[np.float64]) -> None:
        """Write the second derivatives (1, n, n) of the distance to ``out``.

        ``Aᵀ (I - u uᵀ) A / d + uᵀ H`` with the derivative A (3, n) of the way and its second
        derivative H (3, n, n).
        """
        distance, u, moved = self._parts()
        along = u @ moved
        bent = np.tensordot(u, self._frame.hessian[:3] - self._other.hessian[:3], 1)
        out[0] = 0.5 * (bent + bent.T)
        out[0] += (moved.T @ moved - np.outer(along, along)) / max(distance, NEAR)

    def _parts(self) -> tuple[float, Vector, NDArray[np.float64]]:
        """Distance, unit vector (3,) and derivative (3, n) of the way between the frames."""
        way = self._frame.position - self._other.position
        distance = math.sqrt(way @ way)
        u = way / distance if distance > NEAR else np.zeros(3)
        return distance, u, self._frame.jacobian[:3] - self._other.jacobian[:3]
