"""Distance from singular configurations."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from tp_controller.errors import InvalidValue, shown
from tp_controller.objectives.base import Objective
from tp_controller.parameters import REQUIRED, TEXT, Parameter
from tp_controller.robot import Robot

Vector = NDArray[np.float64]


class ManipulabilityObjective(Objective):
    """The measure of Yoshikawa (1985), ``H = √det(J Jᵀ)``, of chosen rows of a frame.

    ``∂H/∂qᵢ = H tr(J⁺ ∂J/∂qᵢ)``. Where H is zero it has no derivative; one of its slopes is
    written then, which leads away from the singularity.

    Parameters
    ----------
    robot
        The robot.
    frame
        Name of the frame.
    position_axes, orientation_axes
        Letters of the base axes whose velocity rows count.

    Raises
    ------
    InvalidValue
        If the robot has no such frame, the axes are not letters out of xyz or there are
        none, or there are more than joints: the measure would be zero everywhere.
    """

    type = 'manipulability'
    parameters: ClassVar[Mapping[str, Parameter]] = {
        'frame': Parameter(TEXT, 'Frame whose velocity is judged', default=REQUIRED),
        'position_axes': Parameter(
            TEXT, 'Axes of the linear velocity that count, out of xyz', default='xyz'
        ),
        'orientation_axes': Parameter(
            TEXT, 'Axes of the angular velocity that count, out of xyz', default=''
        ),
    }

    def __init__(
        self, robot: Robot, frame: str, position_axes: str = 'xyz', orientation_axes: str = ''
    ) -> None:
        super().__init__(robot)
        self.frame = robot.frame(frame)
        rows = []
        for key, axes, first in (
            ('position_axes', position_axes, 0),
            ('orientation_axes', orientation_axes, 3),
        ):
            if not set(axes) <= set('xyz') or len(set(axes)) != len(axes):
                raise InvalidValue(key, shown(axes), 'letters out of xyz, each at most once')
            rows += [first + 'xyz'.index(letter) for letter in sorted(axes)]
        if not 0 < len(rows) <= robot.n:
            raise InvalidValue(
                'position_axes', f'{len(rows)} axes in all', f'1 to {min(robot.n, 6)} axes in all'
            )
        self._rows = np.array(rows)

    @classmethod
    def from_parameters(cls, robot: Robot, values: Mapping[str, Any]) -> ManipulabilityObjective:
        """Make the objective from checked values."""
        return cls(robot, values['frame'], values['position_axes'], values['orientation_axes'])

    @property
    def value(self) -> float:
        """H at the robot's present configuration, in units of the rows' product."""
        s = np.linalg.svd(self.frame.jacobian[self._rows], compute_uv=False)
        return float(np.prod(s))

    def gradient(self, out: Vector) -> None:
        """Write ∂H/∂q (n,) to ``out``."""
        U, s, Vt = np.linalg.svd(self.frame.jacobian[self._rows], full_matrices=False)
        # H times J⁺ without dividing: each direction has the product of the others.
        others = np.array([np.prod(np.delete(s, i)) for i in range(len(s))])
        adjugate = (U * others) @ Vt
        np.einsum('ri,rij->j', adjugate, self.frame.hessian[self._rows], out=out)
