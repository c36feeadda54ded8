"""What every task is: an error, a Jacobian and a desired velocity."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, ClassVar, NoReturn, TypedDict

import numpy as np
from numpy.typing import NDArray

from tp_controller.errors import InvalidValue, plural, shown
from tp_controller.parameters import BOOLEAN, NUMBER, NUMBERS, REQUIRED, TEXT, Parameter
from tp_controller.problem import Level
from tp_controller.robot import Limits, Robot, State, moved
from tp_controller.snapshot import unchanged
from tp_controller.solvers.inverses import INVERSES, Inverse

if TYPE_CHECKING:
    from tp_controller.tasks.compiled import CompiledRows
    from tp_controller.tasks.parts import Part

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]

COMMON: Mapping[str, Parameter] = {
    'type': Parameter(TEXT, 'Kind of task', default=REQUIRED),
    'enabled': Parameter(
        BOOLEAN,
        'Whether the task takes part; off, it is as if hierarchy did not list it',
        default=True,
        runtime=True,
    ),
    'gain': Parameter(
        NUMBERS,
        'Gain [1/s]: one value, one per row, or a full matrix row by row',
        default=(1.0,),
        runtime=True,
    ),
    'feedforward': Parameter(
        NUMBERS,
        'Desired task velocity added to the gain term, one value per row; zero when left out',
        runtime=True,
    ),
    'max_speed': Parameter(
        NUMBERS,
        'Largest speed [m/s, rad/s] that the task asks for, by its gain and feedforward together: '
        'one value, for a pose also one for the position and one for the rotation, for joints '
        'also one per joint; none when left out',
        runtime=True,
    ),
    'inverse': Parameter(
        TEXT, "This level's inverse in place of solver.inverse", choices=INVERSES
    ),
    'damping': Parameter(NUMBER, "This level's λ in place of solver.damping", minimum=0.0),
    'singular_region': Parameter(
        NUMBER, "This level's ε in place of solver.singular_region", above=0.0
    ),
    'weight': Parameter(
        NUMBER, 'Weight among all tasks with solver.type weighted', 1.0, above=0.0, runtime=True
    ),
    'time_scaling': Parameter(
        BOOLEAN,
        'Whether the time of a trajectory runs slower while limits or higher levels hold the task '
        'up, so that it stays on its path; else it falls behind and catches up',
        default=False,
        runtime=True,
    ),
    'around': Parameter(
        BOOLEAN,
        'Whether a way around is looked for by itself when a goal gets stuck',
        default=False,
        runtime=True,
    ),
    'target': Parameter(
        NUMBERS,
        'Desired value at start, that at the first joint state when left out; goals replace it',
        runtime=True,
    ),
}

LARGEST = 1e9
"""Size of a value of a target, feedforward or gain up to which nothing is lost to rounding."""
OSCILLATING, OVERSHOOTING = 2.0, 1.0
"""Gains times the period from which on an error grows, or changes its sign, at every step."""


class Common(TypedDict, total=False):
    """Settings that every task takes as keyword arguments; properties of the same names."""

    gain: float | Sequence[float]
    """Gain [1/s]: one value, one per row, or a full matrix (k, k) row by row; 1 when left out."""
    feedforward: Sequence[float] | Vector
    """Desired task velocity (k,) added to the gain term; zero when left out."""
    max_speed: float | Sequence[float] | Vector
    """Largest speed [m/s, rad/s] that it asks for: one value, or one for each of its
    `speed_groups`; none when left out."""
    target: Sequence[float] | Vector
    """Desired value (target_size,); that at the first step when left out."""
    inverse: Inverse
    """How its level is inverted; what is left open is the solver's way."""
    enabled: bool
    """Whether it takes part where the hierarchy lists it; True when left out."""
    weight: float
    """Weight in the scheme ``weighted``; 1 when left out."""


class Task(ABC):
    """A task variable to be brought to a desired value.

    The desired task velocity is ``K error + feedforward`` with ``error = desired - current``,
    made shorter to `max_speed` where it is longer.

    Parameters
    ----------
    name
        Name of the task.
    robot
        The robot that carries the task out.
    components
        Name of each of the k rows.

    Attributes
    ----------
    error
        Desired minus current (k,), rotations by the shortest way; filled by `update`.
    J
        Task Jacobian (k, n); filled by `update`.
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
    parameters: ClassVar[Mapping[str, Parameter]]
    """Parameters of the kind beside the common ones, in parameter files."""
    target_words: ClassVar[str]
    """What the values of a target are, for messages."""
    set_based: ClassVar[bool] = False
    """Whether the rows come and go."""
    one_sided: bool = False
    """Whether the desired velocity is the least one allowed."""
    target_key: ClassVar[str] = 'target'
    """Parameter that the target is at the start."""
    without: ClassVar[tuple[str, ...]] = ()
    """Common parameters that the kind has no use for."""
    feeds_back: ClassVar[bool] = True
    """Whether moving as desired makes the error smaller by as much."""

    def __init__(self, name: str, robot: Robot, components: Sequence[str]) -> None:
        self.name = name
        self.robot = robot
        self.components = tuple(components)
        self.k = len(self.components)
        self.error: Vector = np.zeros(self.k)
        self.J: Matrix = np.zeros((self.k, robot.n))
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
        self._rows: CompiledRows | None = None
        self._enabled = True
        self.changed: Callable[[], None] = _nothing

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

    @classmethod
    def from_parameters(cls, name: str, robot: Robot, values: Mapping[str, Any]) -> Task:
        """Make the task from the checked values of its `parameters`.

        Unless overridden, the constructor is called with those that have a value, by name.
        """
        given = {key: values[key] for key in cls.parameters if values.get(key) is not None}
        return cls(name, robot, **given)

    @property
    def frame_name(self) -> str:
        """Name of the controlled frame, empty if there is none."""
        return ''

    @property
    def relative_to(self) -> str:
        """Name of the frame that the task is seen from, empty for the base."""
        return ''

    @property
    def active(self) -> bool:
        """Whether the task acts now."""
        return True

    @property
    def warnings(self) -> tuple[str, ...]:
        """What a user should know of the settings, one line each."""
        share = self._gain_share(self._K)
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

    def take_notices(self) -> list[str]:
        """What a user should know that was found in steps, one line each; each told once."""
        return []

    def _gain_share(self, K: Matrix) -> float:
        """Largest eigenvalue of a gain matrix (k, k) times the period, ``K·dt``.

        A step leaves the part ``1 - K dt`` of the error, which is larger than before from 2 on.
        """
        if not self.feeds_back or not math.isfinite(self.period):
            return 0.0
        return float(np.abs(np.linalg.eigvals(K)).max(initial=0.0) * self.period)

    def prepare_limits(self, limits: Limits) -> Callable[[], None]:
        """Check limits that the robot is to have.

        Returns
        -------
        callable
            Makes the task follow them; it cannot fail. To be called when the robot has them.

        Raises
        ------
        InvalidValue
            If the task could not be made for a robot with these limits.
        """
        return _nothing

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
    @abstractmethod
    def current(self) -> Vector:
        """Present value, in the form of a target if the task has one; a copy."""

    @property
    def parts(self) -> tuple[Part, ...]:
        """Rows that compiled code can fill, all of them; none if `update` does it itself."""
        return ()

    def part_values(self) -> tuple[Vector, ...]:
        """Target of every part, as its kind of rows needs it."""
        return ()

    def update(self) -> None:
        """Compute `error` and `J` at the robot's present configuration."""
        if not self.parts:
            raise NotImplementedError(f'{type(self).__name__}: either parts or update')
        self._own_rows().fill()

    @property
    def memory(self) -> tuple[object, ...]:
        """Objects whose attributes are all that the task remembers: itself, unless overridden."""
        return (self,)

    def rows(self, state: State) -> Level:
        """Return what the task asks for at a state, as a level of a problem.

        An equality task has ``J qd = velocity`` with ``velocity = K error + feedforward``; a task
        with smooth switching has ``C qd >= least``. Rows that are out are zero. A task without a
        target takes its value at the state as the target. With hysteresis, whether rows are in
        also depends on whether they are in now.

        For the time of the call the robot is moved to the state. Afterwards robot and task are as
        they were before.

        Parameters
        ----------
        state
            A state of the task's robot.

        Returns
        -------
        Level
            Jacobian (k, n) and velocity (k,) [m/s, rad/s], with the task's inverse, its weight
            and names; the arrays are the caller's own.

        Raises
        ------
        InvalidValue
            If the state is another robot's.
        """
        state.check(self.robot)
        velocity = np.zeros(self.k)
        if self.parts:
            self._own_rows()  # is kept
        with unchanged(*self.memory), moved(self.robot, state.q):
            if self.target_size and not self._target.size:
                self.hold()
            self.update()
            self.desired_velocity(velocity)
            J, revision = self.J.copy(), self.revision
        if revision != self.revision:
            # What was compiled for that target may not be taken for the next one.
            self.revision = revision + 1
        names = tuple(f'{self.name} {component}' for component in self.components)
        if self.one_sided:
            return Level(None, None, J, velocity, self.weight, self.inverse, (self.name,), names)
        return Level(J, velocity, None, None, self.weight, self.inverse, (self.name,), names)

    def _own_rows(self) -> CompiledRows:
        if self._rows is None:
            from tp_controller.tasks.compiled import CompiledRows

            unused = np.zeros((2, self.k))
            self._rows = CompiledRows(self.robot, [(self, 0)], self.J, self.error, *unused)
        return self._rows

    @property
    def bend(self) -> Vector:
        """Bounds (k,) on the second derivatives of the variables by unit joint motions."""
        return np.zeros(self.k)

    def hessian(self, out: NDArray[np.float64]) -> None:
        """Write the second derivatives (k, n, n) of the variables, symmetric, to ``out``.

        They are those of ``-error`` at the last update; without parts zero unless overridden.
        Axes that turn with the robot are taken as they are then.
        """
        out[:] = 0.0
        if self.parts:
            self._own_rows().fill_hessians(out)

    def leave(self) -> None:
        """Forget what belongs to a place in the hierarchy; nothing, unless rows come and go."""
        return

    def place(self, J: Matrix, error: Vector) -> None:
        """Keep Jacobian and error in given arrays (k, n) and (k,) from now on."""
        J[:], error[:] = self.J, self.error
        self.J, self.error = J, error
        self._rows = None

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
        if len(values) != self.target_size:
            self._refuse_target(values)
        target = np.array(values, dtype=float)
        if not np.all(np.isfinite(target)):
            raise InvalidValue('target', shown(target), 'finite numbers')
        if np.abs(target[self.sized]).max(initial=0.0) > LARGEST:
            raise InvalidValue('target', shown(target), f'numbers up to {LARGEST:g} in size')
        return target

    def _refuse_target(self, values: Sequence[float] | Vector) -> NoReturn:
        raise InvalidValue(
            'target',
            _counted(values),
            f'{plural(self.target_size, "value")} ({self.target_words})',
        )

    @property
    def settings(self) -> tuple[Vector, Vector, Matrix, Vector]:
        """Target, feedforward, gain and largest speeds, not copied: new ones when they are set."""
        return self._target, self._feedforward, self._K, self._max_speed

    def hold(self) -> None:
        """Take the present value as the target."""
        self._target = self.current
        self.revision += 1

    def forget_target(self) -> None:
        """Have no target, as before the first one."""
        self._target = np.zeros(0)
        self.revision += 1

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
        k = self.k
        if len(values) not in (1, k, k * k):
            accepts = '1 value' if k == 1 else f'1, {k} or {k * k} values'
            words = '' if k == 1 else f' (for all rows, one per row, a {k}x{k} matrix row by row)'
            raise InvalidValue('gain', _counted(values), accepts + words)
        K = np.array(values, dtype=float)
        if not np.all(np.isfinite(K)):
            raise InvalidValue('gain', shown(K), 'finite numbers')
        K = K.reshape(k, k) if K.size == k * k else np.diag(np.broadcast_to(K, (k,)))
        if np.abs(K).max(initial=0.0) > LARGEST:
            raise InvalidValue('gain', shown(K), f'numbers up to {LARGEST:g}')
        if np.linalg.eigvalsh(K + K.T).min() < -1e-9 * np.abs(K).max(initial=0.0):
            raise InvalidValue(
                'gain', shown(list(values)), 'values of at least 0, or a positive matrix'
            )
        if (share := self._gain_share(K)) >= OSCILLATING:
            rate = 1.0 / self.period
            raise InvalidValue(
                'gain',
                f'{shown(list(values))}, which makes K·dt = {share:.3g} at rate {rate:g}',
                f'gains below {OSCILLATING * rate:g}; the largest sensible one is {rate:g}',
            )
        return K

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
        if len(values) != self.k:
            accepts = f'{plural(self.k, "value")} ({", ".join(self.components)})'
            raise InvalidValue('feedforward', _counted(values), accepts)
        velocity = np.array(values, dtype=float)
        if not np.all(np.isfinite(velocity)):
            raise InvalidValue('feedforward', shown(velocity), 'finite numbers')
        if np.abs(velocity).max(initial=0.0) > LARGEST:
            accepts = f'numbers up to {LARGEST:g} in size'
            raise InvalidValue('feedforward', shown(velocity), accepts)
        return velocity

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
        groups = len(self.speed_groups)
        if len(values) not in (1, groups):
            accepts = '1 value' if groups == 1 else f'1 or {groups} values'
            raise InvalidValue('max_speed', _counted(values), accepts)
        speeds = np.array(values, dtype=float)
        if not np.all((speeds > 0.0) & (speeds <= LARGEST)):
            raise InvalidValue(
                'max_speed', shown(speeds), f'numbers above 0 and up to {LARGEST:g}'
            )
        return np.broadcast_to(speeds, groups).copy()

    def desired_velocity(self, out: Vector) -> None:
        """Write ``K error + feedforward`` (k,) of the last update to ``out``, not too fast."""
        np.dot(self._K, self.error, out=out)
        out += self._feedforward
        if self._max_speed.size:
            out *= self._shares(out)

    def left_out(self) -> Vector:
        """What `max_speed` takes from ``K error + feedforward`` (k,) of the last update."""
        if not self._max_speed.size:
            return np.zeros(self.k)
        velocity = self._unlimited()
        return velocity * (1.0 - self._shares(velocity))

    @property
    def slowness(self) -> float:
        """By what `max_speed` divided the speed at the last update; 1 where it changed nothing."""
        if not self._max_speed.size:
            return 1.0
        return 1.0 / float(self._shares(self._unlimited()).min(initial=1.0))

    def limited_feedforward(self, out: Vector) -> None:
        """Write the part (k,) of the feedforward in the desired velocity to ``out``."""
        out[:] = self._feedforward
        if self._max_speed.size:
            out *= self._shares(self._unlimited())

    def _unlimited(self) -> Vector:
        """``K error + feedforward`` (k,) of the last update."""
        velocity: Vector = self._K @ self.error + self._feedforward
        return velocity

    def _shares(self, velocity: Vector) -> Vector:
        """Share (k,) of each row of a velocity that `max_speed` leaves."""
        shares = np.ones(self.k)
        for rows, most in zip(self.speed_groups, self._max_speed, strict=False):
            speed = float(np.linalg.norm(velocity[rows]))
            if speed > most:
                shares[rows] = most / speed
        return shares


def _nothing() -> None:
    """Follow limits, or a change, without doing anything."""


def _counted(values: Sequence[float] | Vector) -> str:
    return f'{plural(len(values), "value")} {shown(values)}'
