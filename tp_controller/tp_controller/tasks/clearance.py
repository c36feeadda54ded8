"""What tasks share that keep whole links clear of something."""

from __future__ import annotations

import math
from abc import abstractmethod

import numpy as np
from numpy.typing import NDArray

from tp_controller.robot import Clearance
from tp_controller.tasks.set_based import SetBasedTask
from tp_controller.tasks.thresholds import Switching, Thresholds

Vector = NDArray[np.float64]


BEYOND = 1.01
"""Distances are computed up to so many times as far as rows come in."""
WIDE = 0.1
"""A margin [m] above this one that nobody asked for is told."""


class ClearanceTask(SetBasedTask):
    """Keeps the signed distances between simple convex shapes positive, see `Clearance`.

    Of a row that is too far to come in, the distance is a lower bound. What is in contact at
    the first configuration that the task sees, nearer than what it keeps, is named in
    `warnings` and `take_notices`.

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
        self._seen = False
        self._contact = ''
        self._notices: list[str] = []
        reach = clearance.reach
        super().__init__(name, clearance.robot, clearance.names, reach, period, switching)
        # Filled by the clearance itself.
        self.distance, self._slope = clearance.distance, clearance.slope

    def _take(self, thresholds: Thresholds) -> None:
        super()._take(thresholds)
        # Just beyond where rows come in or go out.
        edge = thresholds.release if thresholds.edge is None else thresholds.edge
        self._near: Vector = np.empty(self.k)
        self.clearance.threshold = BEYOND * edge

    def expect(self, speed: Vector) -> None:
        """Let only rows come in that such speeds (n,) could break; see `SetBasedTask.expect`."""
        if self.one_sided:
            self._narrow(speed)
            assert self._edge is not None
            np.multiply(BEYOND, self._edge, out=self._near)
            self.clearance.threshold = self._near

    def _wide_margin(self) -> str:
        velocity = self.robot.limits.velocity
        joint = int(np.argmax(np.where(self.reach.any(axis=0), velocity, 0.0)))
        return (
            f'tasks.{self.name}.margin: {self.margin:.3g} m are kept, as far as the bend of the '
            f'way may lead in one step; {self.robot.joints[joint]} may turn at '
            f'{velocity[joint]:g} rad/s: lower robot.limits.velocity, or give a margin'
        )

    @property
    def kept_distance(self) -> float:
        """Distance [m] below which a row is in contact: what is kept, or where rows come in."""
        return self.margin if self.one_sided else self.activation

    @property
    def warnings(self) -> tuple[str, ...]:
        """What a user should know of the settings, and of contacts at the first step."""
        found = super().warnings
        if self.one_sided and self._switching.margin is None and self.margin > WIDE:
            found = (*found, self._wide_margin())
        return (*found, self._contact) if self._contact else found

    def take_notices(self) -> list[str]:
        """What a user should know that was found in steps, one line each; each told once."""
        told, self._notices = self._notices, []
        return told

    @abstractmethod
    def contact_text(self, rows: NDArray[np.intp]) -> str:
        """One line about the rows that are in contact at the first configuration."""

    def _look_for_contacts(self) -> NDArray[np.bool_]:
        """Rows (k,) that are in contact, told once."""
        self._seen = True
        near: NDArray[np.bool_] = self.distance < self.kept_distance
        if near.any():
            text = self.contact_text(np.flatnonzero(near))
            self._contact = f'tasks.{self.name}: {text}'
            self._notices.append(self._contact)
        return near

    @property
    def memory(self) -> tuple[object, ...]:
        """The task and its clearance, which remembers distances."""
        return (self, self.clearance)

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
        if not self._seen:
            self._look_for_contacts()

    def probe(self, out: Vector, enough: Vector | None = None) -> None:
        """Write the distances (k,) at the robot's present configuration to ``out``."""
        self.clearance.probe(out, enough)
