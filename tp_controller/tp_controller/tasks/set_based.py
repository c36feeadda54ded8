"""What set-based tasks share: they act near the boundary of their set, and only there."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Callable, Sequence
from functools import cached_property, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tp_controller.robot import Limits, Robot
from tp_controller.tasks.base import Task
from tp_controller.tasks.thresholds import SMOOTH, Switching, Thresholds, safe_thresholds

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]


class SetBasedTask(Task):
    """Keeps distances positive.

    With ``smooth`` switching a row is a bound on the rate of its distance d, a velocity damper
    (Faverjon and Tournassoud 1987)::

        rate >= -(d - margin) / τ       outside the margin
        rate >= K (margin - d)          inside it

    with ``τ = (activation - margin) / v``, where v is the fastest that the distance can change
    at all: at the activation the bound holds by itself, so a row comes in and goes out without
    a step. What it does to the command grows from zero, as with the activation functions of
    Simetti and Casalino (2016), and only where the rest of the hierarchy would break it.

    With ``hysteresis`` (Moe, Antonelli, Teel, Pettersen and Schrimpf 2016) a row comes in when
    its distance falls to ``activation`` and goes out when it has grown to ``release``. In
    between it asks for the rate ``K (2 release - activation - d)``: away from the boundary,
    and beyond the release.

    A row that is out has a zero Jacobian and takes no freedom from the levels below.

    Parameters
    ----------
    name
        Name of the task.
    robot
        The robot that carries the task out.
    components
        Name of each of the k rows.
    reach
        Bound (k, n) on the derivative of the distances by the joints, at any configuration.
    period
        Time [s] of one step; infinite if unknown.
    switching
        How the rows come in and go out.

    Raises
    ------
    InvalidValue
        As `safe_thresholds`.

    Attributes
    ----------
    distance
        Distance from the boundary (k,), negative beyond it; filled by `update`.
    on
        Whether each row is in (k,).
    acting
        With smooth switching, whether each row's bound decides on the command (k,); filled
        by the solver.
    """

    set_based = True
    bends: bool = True
    """Whether the distance is a curved function of the joints."""

    def __init__(
        self,
        name: str,
        robot: Robot,
        components: Sequence[str],
        reach: Matrix,
        period: float = math.inf,
        switching: Switching = Switching(),  # noqa: B008 - a value
    ) -> None:
        super().__init__(name, robot, components)
        self.distance: Vector = np.full(self.k, math.nan)
        self.on: NDArray[np.bool_] = np.zeros(self.k, dtype=bool)
        self.acting = self.on.copy()
        self.reach = reach
        self._slope: Matrix = np.zeros((self.k, robot.n))
        self.period, self._switching = period, switching
        self.one_sided = switching.type == SMOOTH
        self._take(self._thresholds(robot.limits))

    def prepare_limits(self, limits: Limits) -> Callable[[], None]:
        """Check limits that the robot is to have; see `Task.prepare_limits`."""
        return partial(self._take, self._thresholds(limits))

    def know_period(self, period: float) -> None:
        """Take over the time [s] of one step, which was unknown so far."""
        super().know_period(period)
        self._take(self._thresholds(self.robot.limits))

    def _thresholds(self, limits: Limits) -> Thresholds:
        return safe_thresholds(
            self._switching, self.reach, limits, self.robot.response, self.period, self.bends
        )

    def _take(self, thresholds: Thresholds) -> None:
        self.activation, self.release, self.margin = thresholds[:3]
        self._needed, self._travel = thresholds.needed, thresholds.travel
        self._time, self._edge = thresholds.time, thresholds.edge
        self._beyond = 2.0 * thresholds.release - thresholds.activation

    @cached_property
    def _compiled(self) -> Any:
        """Module that is compiled, or loaded, for tasks that are resolved."""
        from tp_controller.tasks import damper

        return damper

    @property
    def warnings(self) -> tuple[str, ...]:
        """What a user should know of the settings, one line each."""
        found = super().warnings
        # Thresholds that were left out are exactly what is needed.
        if self.activation >= self._needed * (1.0 - 1e-9):
            return found
        if self.one_sided:
            return (
                *found,
                f'tasks.{self.name}.activation: {self.activation:g} is less than it takes to '
                f'brake from full speed, {self._needed:.3g}: the arm may be stopped abruptly',
            )
        return (
            *found,
            f'tasks.{self.name}.activation: {self.activation:g} is less than one step can '
            f'travel, {self._travel:.3g}: the boundary may be crossed',
        )

    @property
    def active(self) -> bool:
        """Whether any row acts."""
        return bool((self.acting if self.one_sided else self.on).any())

    @property
    def kept(self) -> Vector:
        """Distance (k,) [m, rad] that each row keeps: the margin, or where hysteresis begins."""
        return np.full(self.k, self.margin if self.one_sided else self.activation)

    @property
    def slope(self) -> Matrix:
        """Derivative (k, n) of the distances, filled by `measure`; not to be written to."""
        return self._slope

    def leave(self) -> None:
        """Let every row go out, as outside the hierarchy."""
        self.on[:] = self.acting[:] = False
        self.J[:] = 0.0

    def distances(self) -> Vector:
        """Every distance (k,), however far away, at the robot's present configuration."""
        return self.distance

    @abstractmethod
    def measure(self) -> None:
        """Fill `distance` and its derivative (k, n) at the robot's present configuration."""

    @abstractmethod
    def probe(self, out: Vector, enough: Vector | None = None) -> None:
        """Write the distances (k,) at the robot's present configuration to ``out``.

        Nothing of the last update changes.

        Parameters
        ----------
        out
            The distances.
        enough
            Of a distance that is larger than this (k,) a lower bound will do.
        """

    def mark(self) -> None:
        """Keep what `between` needs of the robot's present configuration."""

    def between(self, bend: Vector, out: Vector) -> None:
        """Write lower bounds (k,) of the distances since `mark` to ``out``.

        Parameters
        ----------
        bend
            By how much (k,) a point may leave the straight line between its places, the robot
            having moved straight from the one configuration to the other.
        out
            The bounds; minus infinity where nothing better is known than that no distance
            changes by more than its reach allows.
        """
        out.fill(-math.inf)

    def expect(self, speed: Vector) -> None:
        """Take note of the largest speeds (n,) that joints can have in the next step.

        Called before `update`, if at all; what no such speeds can do need not be computed.
        """
        return

    def _narrow(self, speed: Vector) -> None:
        """Let rows come in as near only as the largest speeds (n,) of the next step call for.

        At a larger distance a row's bound holds by itself.
        """
        self._compiled.narrow(
            self.reach, speed, self._feedforward, self._time, self.margin, self._edge
        )

    def update(self) -> None:
        """Compute `distance`, `error` and `J` at the robot's present configuration."""
        self.measure()
        if self.one_sided:
            self._compiled.switch(
                self.distance,
                self._slope,
                self._edge,
                self.margin,
                self.on,
                self.error,
                self.J,
            )
            return
        near = np.where(self.on, self.release, self.activation)
        np.less_equal(self.distance, near, out=self.on)
        self.error[:] = 0.0
        np.subtract(self._beyond, self.distance, out=self.error, where=self.on)
        np.multiply(self._slope, self.on[:, None], out=self.J)

    def desired_velocity(self, out: Vector) -> None:
        """Write the rate (k,) that the rows which are in ask for to ``out``.

        With smooth switching it is the least one that is allowed.
        """
        if not self.one_sided:
            super().desired_velocity(out)
            np.copyto(out, 0.0, where=~self.on)
            return
        self._compiled.least_rates(
            self.distance,
            self.on,
            self.error,
            self._K,
            self._feedforward,
            self.margin,
            self._time,
            out,
        )
