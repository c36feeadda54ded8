"""Away from singularities, in whatever freedom is left."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from tp_controller.objectives import ManipulabilityObjective
from tp_controller.parameters import Parameter
from tp_controller.robot import Robot
from tp_controller.tasks.base import Task

if TYPE_CHECKING:
    from typing_extensions import Unpack

    from tp_controller.tasks.common import Common

Vector = NDArray[np.float64]


class ManipulabilityTask(Task):
    """Moves the joints along the gradient of the measure of Yoshikawa (1985).

    ``J`` is the unit matrix and ``error = ∂w/∂q``, see `ManipulabilityObjective`; the
    present value is ``w``. There is no target: the task has an answer for every joint and
    belongs on the lowest level, where it takes up what the others leave.

    Parameters
    ----------
    name
        Name of the task.
    robot
        The robot that carries the task out.
    measure
        The measure.
    settings
        Gain, target and the like, see `Common`.
    """

    type = 'manipulability'
    parameters: ClassVar[Mapping[str, Parameter]] = ManipulabilityObjective.parameters
    without = ('target', 'max_speed', 'time_scaling', 'around')
    target_words = ''
    feeds_back = False

    def __init__(
        self, name: str, robot: Robot, measure: ManipulabilityObjective, **settings: Unpack[Common]
    ) -> None:
        super().__init__(name, robot, robot.joints)
        self._measure = measure
        self.J[:] = np.eye(robot.n)
        self.set(settings)

    @classmethod
    def from_parameters(
        cls, name: str, robot: Robot, values: Mapping[str, Any]
    ) -> ManipulabilityTask:
        """Make the task from checked values."""
        return cls(name, robot, ManipulabilityObjective.from_parameters(robot, values))

    @property
    def frame_name(self) -> str:
        """Name of the frame whose velocity is judged."""
        return self._measure.frame.name

    @property
    def target_components(self) -> tuple[str, ...]:
        """Nothing: there is no target."""
        return ()

    @property
    def current(self) -> Vector:
        """Present value (1,) of the measure."""
        return np.array([self._measure.value])

    def update(self) -> None:
        """Compute `error`, the gradient, at the robot's present configuration."""
        self._measure.gradient(self.error)
