"""Nearness to a posture."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from tp_controller.errors import InvalidValue, plural, shown
from tp_controller.objectives.base import Objective
from tp_controller.parameters import NUMBERS, REQUIRED, Parameter
from tp_controller.robot import Robot
from tp_controller.rotations import wrap

Vector = NDArray[np.float64]


class PostureObjective(Objective):
    """``H = -½ ‖q - q₀‖²``, continuous joints by the shortest way.

    Parameters
    ----------
    robot
        The robot.
    positions
        The posture q₀ [rad, m], one position per joint; a base has no part in it.

    Raises
    ------
    InvalidValue
        For a wrong number of positions or one that is not finite.
    """

    type = 'posture'
    parameters: ClassVar[Mapping[str, Parameter]] = {
        'positions': Parameter(
            NUMBERS, 'Posture to be near, one position [rad, m] per joint', default=REQUIRED
        )
    }

    def __init__(self, robot: Robot, positions: Sequence[float]) -> None:
        super().__init__(robot)
        self._positions = np.array(positions, dtype=float)
        space = robot.space
        if self._positions.shape != (len(space.scalars),):
            got = f'{plural(len(positions), "value")} {shown(positions)}'
            raise InvalidValue('positions', got, plural(len(space.scalars), 'value'))
        if not np.isfinite(self._positions).all():
            raise InvalidValue('positions', shown(self._positions), 'finite numbers')
        self._positions = np.zeros(robot.n)
        self._positions[space.ranged] = positions
        own = enumerate(space.own.tolist())
        self._wrapping = [j for j, i in own if i >= 0 and robot.wrapping[i]]
        self._way = np.zeros(robot.n)

    @classmethod
    def from_parameters(cls, robot: Robot, values: Mapping[str, Any]) -> PostureObjective:
        """Make the objective from checked values."""
        return cls(robot, values['positions'])

    @property
    def value(self) -> float:
        """H at the robot's present configuration [rad², m²]."""
        self.gradient(self._way)
        return -0.5 * float(self._way @ self._way)

    def gradient(self, out: Vector) -> None:
        """Write ``q₀ - q`` (n,) to ``out``."""
        np.subtract(self._positions, self.robot.positions, out=out)
        for i in self._wrapping:
            out[i] = wrap(out[i])
