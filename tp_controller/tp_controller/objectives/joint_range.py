"""Distance from the ends of the joints' ranges."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from tp_controller.errors import InvalidValue, shown
from tp_controller.objectives.base import Objective
from tp_controller.parameters import Parameter
from tp_controller.robot import Robot

Vector = NDArray[np.float64]


class JointRangeObjective(Objective):
    """``H = -1/(2n) Σ ((q - q_mid) / (q_max - q_min))²`` (Liégeois 1977).

    Joints without a range do not count.

    Parameters
    ----------
    robot
        The robot; its position limits are read at every call.

    Raises
    ------
    InvalidValue
        If no joint has a range.
    """

    type = 'joint_range'
    parameters: ClassVar[Mapping[str, Parameter]] = {}

    def __init__(self, robot: Robot) -> None:
        super().__init__(robot)
        limits = robot.limits
        if not (np.isfinite(limits.position_min) & np.isfinite(limits.position_max)).any():
            raise InvalidValue(
                'type', shown(self.type), 'a robot with robot.limits.position_min and position_max'
            )

    @classmethod
    def from_parameters(cls, robot: Robot, values: Mapping[str, Any]) -> JointRangeObjective:
        """Make the objective from checked values."""
        return cls(robot)

    def _shares(self) -> tuple[Vector, Vector]:
        """Position in its range from -½ to ½ and length of the range, per joint (n,)."""
        lower, upper = self.robot.limits.position_min, self.robot.limits.position_max
        bounded = np.isfinite(lower) & np.isfinite(upper)
        length = np.where(bounded, upper - lower, np.inf)
        middle = 0.5 * (np.where(bounded, lower, 0.0) + np.where(bounded, upper, 0.0))
        return (self.robot.positions - middle) / length, length

    @property
    def value(self) -> float:
        """H at the robot's present configuration."""
        shares, _ = self._shares()
        return -0.5 * float(shares @ shares) / self.robot.n

    def gradient(self, out: Vector) -> None:
        """Write ∂H/∂q (n,) to ``out``."""
        shares, length = self._shares()
        np.divide(shares, -self.robot.n * length, out=out)
