"""What a user sets of a task while it runs: target, gain, feedforward, largest speeds."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from tp_controller.errors import InvalidValue, shown
from tp_controller.solvers.inverses import Inverse
from tp_controller.tasks.checks import (
    OVERSHOOTING,
    checked_feedforward,
    checked_gain,
    checked_speeds,
    checked_target,
    gain_share,
)
from tp_controller.tasks.common import Common

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]


class TaskSettings(ABC):
    """Settings of a task with k rows; every one is checked when it is set.

    Parameters
    ----------
    name
        Name of the task.
    components
        Name of each of the k rows.

    Attributes
    ----------
    inverse
        How its level is inverted, where that differs from the solver's way.
    weight
        Its share in a weighted sum of all tasks.
    time_scaling
        Whether the time of its trajectories runs slower while it is held up.
    around
        Whether a way around is looked for when a goal gets stuck.
    period
        Time [s] of one step, which gains are judged by; infinite if unknown.
    revision
        Goes up whenever target, gain, feedforward or largest speed are set.
    changed
        Called after `enabled` or `gain` was set; the stack that has the task then follows. What
        it raises takes `enabled` back.
    """

    type: ClassVar[str]
    """Name of the kind in parameter files."""
    target_words: ClassVar[str]
    """What the values of a target are, for messages."""
    feeds_back: ClassVar[bool] = True
    """Whether moving as desired makes the error smaller by as much."""

    def __init__(self, name: str, components: Sequence[str]) -> None:
        self.name = name
        self.components = tuple(components)
        self.k = len(self.components)
        self.inverse = Inverse()
        self.weight = 1.0
        self.time_scaling = False
        self.around = False
        self.period = math.inf
        self._K: Matrix = np.eye(self.k)
        self._feedforward: Vector = np.zeros(self.k)
        self._max_speed: Vector = np.zeros(0)  # empty without a limit
        self._target: Vector = np.zeros(0)  # empty before the first one
        self.revision = 0
        self._enabled = True
        self.changed: Callable[[], None] = do_nothing

    def set(self, settings: Common) -> None:
        """Set several settings by name.

        Raises
        ------
        InvalidValue
            For a value that cannot be used.
        TypeError
            For another name.
        """
        for key, value in settings.items():
            if key not in Common.__annotations__:
                kind = self.__class__.__name__
                raise TypeError(f'{kind}() got an unexpected keyword argument {key!r}')
            setattr(self, key, value)

    @property
    @abstractmethod
    def target_components(self) -> tuple[str, ...]:
        """Name of each value of a target: x y z, an angle rx ry or rz, qx qy qz qw, joints."""

    @property
    def target_size(self) -> int:
        """Number of values of a target; 0 if the task has none."""
        return len(self.target_components)

    @property
    def sized(self) -> slice:
        """Values of a target whose size is bounded; of a quaternion only the direction counts."""
        return slice(None)

    @property
    def target(self) -> Vector | None:
        """Desired value, None before the first one; a copy."""
        return self._target.copy() if self._target.size else None

    @target.setter
    def target(self, values: Sequence[float] | Vector) -> None:
        self._target = self.check_target(values)
        self.revision += 1

    def check_target(self, values: Sequence[float] | Vector) -> Vector:
        """Copy of a desired value (target_size,) in its normal form.

        Raises
        ------
        InvalidValue
            For a wrong number of values, one that is not finite or one above `LARGEST`.
        """
        if not self.target_size:
            raise InvalidValue('target', shown(values), f'none: a {self.type} task has no target')
        return checked_target(values, self.target_size, self.target_words, self.sized)

    def forget_target(self) -> None:
        """Have no target, as before the first one."""
        self._target = np.zeros(0)
        self.revision += 1

    @property
    def settings(self) -> tuple[Vector, Vector, Matrix, Vector]:
        """Target, feedforward, gain and largest speeds, not copied: new ones when they are set."""
        return self._target, self._feedforward, self._K, self._max_speed

    @property
    def enabled(self) -> bool:
        """Whether the task takes part where the hierarchy lists it."""
        return self._enabled

    @enabled.setter
    def enabled(self, value: bool) -> None:
        before = self._enabled
        self._enabled = self.check_enabled(value)
        try:
            self.changed()
        except InvalidValue:
            self._enabled = before
            raise

    def switch(self, on: bool) -> None:
        """Set `enabled` for a stack that follows by itself: `changed` is not called."""
        self._enabled = self.check_enabled(on)

    def check_enabled(self, value: bool) -> bool:
        """Whether the task is to take part.

        Raises
        ------
        InvalidValue
            For anything but true or false.
        """
        if not isinstance(value, bool):
            raise InvalidValue('enabled', shown(value), 'true or false')
        return value

    @property
    def gain(self) -> Matrix:
        """Gain matrix K (k, k) [1/s]; a copy."""
        return self._K.copy()

    @gain.setter
    def gain(self, values: float | Sequence[float]) -> None:
        self._K = self.check_gain([values] if isinstance(values, int | float) else values)
        self.revision += 1
        self.changed()

    def check_gain(self, values: Sequence[float]) -> Matrix:
        """Gain matrix (k, k) of one value, k values or k*k values row by row.

        Raises
        ------
        InvalidValue
            For a wrong number of values, one that is not finite, or a gain that drives a
            task away from its target (a negative value; a matrix whose symmetric part
            has a negative eigenvalue; with a period one that makes the error grow from step
            to step, ``K·dt`` of 2 or more).
        """
        return checked_gain(values, self.k, self._judged_by)

    @property
    def _judged_by(self) -> float:
        """Period [s] that gains are judged by."""
        return self.period if self.feeds_back else math.inf

    @property
    def feedforward(self) -> Vector:
        """Desired task velocity added to the gain term (k,); a copy."""
        return self._feedforward.copy()

    @feedforward.setter
    def feedforward(self, values: Sequence[float] | Vector) -> None:
        self._feedforward = self.check_feedforward(values)
        self.revision += 1

    def check_feedforward(self, values: Sequence[float] | Vector) -> Vector:
        """Copy of a desired task velocity (k,).

        Raises
        ------
        InvalidValue
            For a wrong number of values, one that is not finite or one above `LARGEST`.
        """
        return checked_feedforward(values, self.components)

    @property
    def speed_groups(self) -> tuple[slice, ...]:
        """Rows whose speeds are limited together, by the length of their velocity."""
        return (slice(0, self.k),)

    @property
    def max_speed(self) -> Vector | None:
        """Largest speed of each of the `speed_groups` [m/s, rad/s], None without; a copy."""
        return self._max_speed.copy() if self._max_speed.size else None

    @max_speed.setter
    def max_speed(self, values: float | Sequence[float] | Vector) -> None:
        self._max_speed = self.check_max_speed(
            [values] if isinstance(values, int | float) else values
        )
        self.revision += 1

    def check_max_speed(self, values: Sequence[float] | Vector) -> Vector:
        """Largest speeds (groups,) from one value or one per group.

        Raises
        ------
        InvalidValue
            For a wrong number of values, or one that is not above zero.
        """
        return checked_speeds(values, len(self.speed_groups))

    @property
    def warnings(self) -> tuple[str, ...]:
        """What a user should know of the settings, one line each."""
        share = gain_share(self._K, self._judged_by)
        if share < OVERSHOOTING:
            return ()
        rate = 1.0 / self.period
        return (
            f'tasks.{self.name}.gain: {self._K.max():g} at rate {rate:g} has K·dt = {share:.3g}: '
            f'the error overshoots at every step; the largest sensible gain is {rate:g}, and '
            f'{0.5 * rate:g} with limits of acceleration',
        )

    def know_period(self, period: float) -> None:
        """Take over the time [s] of one step, which was unknown so far."""
        self.period = period


def do_nothing() -> None:
    """Follow limits, or a change, without doing anything."""
