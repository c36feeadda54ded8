"""What set-based tasks share: they act near the boundary of their set, and only there."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from tp_controller.errors import NO_VALUE, InvalidValue, shown
from tp_controller.parameters import NUMBER, Parameter
from tp_controller.robot import Robot
from tp_controller.tasks.base import Task

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]

THRESHOLDS: Mapping[str, Parameter] = {
    'activation': Parameter(
        NUMBER,
        'Distance [m or rad] from the boundary at which the task comes in; left out, what '
        'one step can travel and a quarter more, by rate and robot.limits.velocity',
        above=0.0,
    ),
    'release': Parameter(
        NUMBER,
        'Distance [m or rad] at which it goes out again; one and a half times activation when '
        'left out',
        above=0.0,
    ),
}


class SetBasedTask(Task):
    """Keeps distances positive (Moe, Antonelli, Teel, Pettersen and Schrimpf 2016).

    A row comes in when its distance falls to ``activation`` and goes out when it has grown
    to ``release``. In between it asks for the rate ``K (2 release - activation - distance)``
    of the distance: away from the boundary, and beyond the release. A row that is out has a
    zero Jacobian and takes no freedom from the levels below.

    Parameters
    ----------
    name
        Name of the task.
    robot
        The robot that carries the task out.
    components
        Name of each of the k rows.
    travel
        What the distance can change by in one step (k,) [m, rad]; infinite if unknown.
    activation, release
        The two thresholds [m, rad]; safe ones when left out.

    Raises
    ------
    InvalidValue
        If the release is not farther than the activation, or there is no activation and no
        travel to find a safe one from.

    Attributes
    ----------
    distance
        Distance from the boundary (k,), negative beyond it; filled by `update`.
    on
        Whether each row is in (k,).
    """

    set_based = True

    def __init__(
        self,
        name: str,
        robot: Robot,
        components: Sequence[str],
        travel: Vector,
        activation: float | None = None,
        release: float | None = None,
    ) -> None:
        super().__init__(name, robot, components)
        self.distance: Vector = np.full(self.k, math.nan)
        self.on: NDArray[np.bool_] = np.zeros(self.k, dtype=bool)
        self._slope: Matrix = np.zeros((self.k, robot.n))
        self._travel = float(travel.max())
        if activation is None:
            if not math.isfinite(self._travel):
                raise InvalidValue(
                    'activation',
                    NO_VALUE,
                    'a number above 0 (or give rate and robot.limits.velocity)',
                )
            # One step from beyond it does not cross the boundary; the rest is for the bend of
            # the way in the step after, when the row has come in.
            activation = 1.25 * self._travel
        if release is None:
            release = 1.5 * activation
        if not release > activation > 0.0:
            raise InvalidValue(
                'release', shown(release), f'more than the activation, {activation:g}'
            )
        self.activation, self.release = activation, release
        self._beyond = 2.0 * release - activation

    @property
    def warnings(self) -> tuple[str, ...]:
        """What a user should know of the settings."""
        if not math.isfinite(self._travel) or self.activation >= self._travel:
            return ()
        return (
            f'tasks.{self.name}.activation: {self.activation:g} is less than one step can '
            f'travel, {self._travel:.3g}: the boundary may be crossed',
        )

    @property
    def active(self) -> bool:
        """Whether any row is in."""
        return bool(self.on.any())

    def place(self, J: Matrix) -> None:
        """Keep the Jacobian in a given array (k, n) from now on, with every row out."""
        self.on[:] = False
        self.J[:] = 0.0
        super().place(J)

    @abstractmethod
    def measure(self) -> None:
        """Fill `distance` and its derivative (k, n) at the robot's present configuration."""

    def update(self) -> None:
        """Compute `distance`, `error` and `J` at the robot's present configuration."""
        self.measure()
        np.less_equal(self.distance, np.where(self.on, self.release, self.activation), out=self.on)
        self.error[:] = 0.0
        np.subtract(self._beyond, self.distance, out=self.error, where=self.on)
        np.multiply(self._slope, self.on[:, None], out=self.J)

    def desired_velocity(self, out: Vector) -> None:
        """Write ``K error + feedforward`` (k,) of the rows that are in to ``out``."""
        super().desired_velocity(out)
        out *= self.on
