"""What tasks share that keep whole links clear of something."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from tp_controller.robot import Clearance
from tp_controller.tasks.set_based import SetBasedTask, Switching

Vector = NDArray[np.float64]


class ClearanceTask(SetBasedTask):
    """Keeps the signed distances between simple convex shapes positive, see `Clearance`.

    Of a row that is too far to come in, the distance is a lower bound.

    Parameters
    ----------
    name
        Name of the task.
    clearance
        The distances (k,).
    period
        Time [s] of one step; infinite if unknown.
    switching
        How the rows come in and go out.

    Raises
    ------
    InvalidValue
        As `SetBasedTask`.
    """

    def __init__(
        self,
        name: str,
        clearance: Clearance,
        period: float = math.inf,
        switching: Switching = Switching(),  # noqa: B008 - a value
    ) -> None:
        self.clearance = clearance
        reach = clearance.reach
        super().__init__(name, clearance.robot, clearance.names, reach, period, switching)
        # Just beyond where rows come in or go out.
        clearance.threshold = 1.01 * (self._edge if self.one_sided else self.release)

    @property
    def current(self) -> Vector:
        """Distances (k,) of the last update [m]; a copy."""
        return self.distance.copy()

    def distances(self) -> Vector:
        """Every distance (k,), however far away, at the robot's present configuration."""
        return self.clearance.distances()

    def measure(self) -> None:
        """Fill the distances of rows that may be in, and their derivative."""
        self.clearance.update()
        self.distance[:] = self.clearance.distance
        self._slope[:] = self.clearance.slope

    def probe(self, out: Vector, enough: Vector | None = None) -> None:
        """Write the distances (k,) at the robot's present configuration to ``out``."""
        self.clearance.probe(out, enough)
