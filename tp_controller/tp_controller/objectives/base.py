"""What every objective is: a function of the configuration that is to become large."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from tp_controller.parameters import Parameter
from tp_controller.robot import Robot

Vector = NDArray[np.float64]


class Objective(ABC):
    """A function H of the configuration, to be made large.

    Parameters
    ----------
    robot
        The robot whose configuration it judges.

    Attributes
    ----------
    gain
        Factor κ of the gradient.
    """

    type: ClassVar[str]
    """Name of the kind in parameter files."""
    parameters: ClassVar[Mapping[str, Parameter]]
    """Parameters of the kind, in parameter files."""

    def __init__(self, robot: Robot) -> None:
        self.robot = robot
        self.gain = 1.0

    @classmethod
    @abstractmethod
    def from_parameters(cls, robot: Robot, values: Mapping[str, Any]) -> Objective:
        """Make the objective from the checked values of its `parameters`."""

    @property
    @abstractmethod
    def value(self) -> float:
        """H at the robot's present configuration."""

    @abstractmethod
    def gradient(self, out: Vector) -> None:
        """Write ∂H/∂q (n,) at the robot's present configuration to ``out``."""

    def climb(self, out: Vector) -> None:
        """Write κ ∂H/∂q (n,) to ``out``."""
        self.gradient(out)
        out *= self.gain
