"""Joints kept inside a range."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from tp_controller.errors import InvalidValue, listed, shown
from tp_controller.parameters import NUMBERS, TEXTS, Parameter
from tp_controller.robot import Limits, Robot
from tp_controller.tasks.set_based import SetBasedTask
from tp_controller.tasks.thresholds import THRESHOLDS, Switching

if TYPE_CHECKING:
    from typing_extensions import Unpack

    from tp_controller.tasks.common import Common

Vector = NDArray[np.float64]


class JointLimitsTask(SetBasedTask):
    """Keeps joints inside a range, one row per joint: the distance from its nearer end.

    Parameters
    ----------
    name
        Name of the task.
    robot
        The robot that carries the task out.
    joints
        Names of the joints, or of coordinates of a base; all joints when left out.
    lower, upper
        The range [rad, m], one value or one per joint; the robot's limits when left out. An
        end may be infinite.
    period
        Time [s] of one step; infinite if unknown.
    switching
        How the rows come in and go out.
    settings
        Gain, target and the like, see `Common`.

    Raises
    ------
    InvalidValue
        If a joint is unknown, a range is empty, of a wrong number of values or not to be
        had, or as `SetBasedTask`.
    """

    type = 'joint_limits'
    parameters: ClassVar[Mapping[str, Parameter]] = {
        'joints': Parameter(
            TEXTS,
            'Joints, or coordinates of a base, to be kept in range; all joints when left out',
        ),
        'min': Parameter(
            NUMBERS,
            'Lower end of the range [rad, m], one value or one per joint; the limit of the robot '
            'when left out',
        ),
        'max': Parameter(NUMBERS, 'Upper end, in the same way'),
        **THRESHOLDS,
    }
    without = ('target', 'max_speed', 'time_scaling', 'around')
    target_words = ''

    def __init__(
        self,
        name: str,
        robot: Robot,
        joints: Sequence[str] | None = None,
        lower: Sequence[float] | None = None,
        upper: Sequence[float] | None = None,
        period: float = math.inf,
        switching: Switching = Switching(),  # noqa: B008 - a value
        **settings: Unpack[Common],
    ) -> None:
        names = robot.space.scalars if joints is None else tuple(joints)
        indices = np.array(robot.joint_indices(names), dtype=np.int64)
        if not names:
            raise InvalidValue('joints', 'no joint', f'some of {listed(robot.coordinates)}')
        self._indices, self._given, self.robot = indices, (lower, upper), robot
        self._lower, self._upper = self._range(robot.limits)
        self.bends = robot.space.bent(indices.tolist())
        reach = robot.space.rate_bounds()[indices]
        super().__init__(name, robot, names, reach, period, switching)
        self._marked = np.zeros(len(names))
        self._rates = robot.space.rates(robot.q)[indices]
        self.set(settings)

    @classmethod
    def from_parameters(
        cls, name: str, robot: Robot, values: Mapping[str, Any]
    ) -> JointLimitsTask:
        """Make the task from checked values."""
        return cls(
            name,
            robot,
            values['joints'],
            values['min'],
            values['max'],
            values['period'],
            Switching.of(values),
        )

    def prepare_limits(self, limits: Limits) -> Callable[[], None]:
        """Check limits that the robot is to have; see `Task.prepare_limits`."""
        ends, follow = self._range(limits), super().prepare_limits(limits)

        def take() -> None:
            self._lower, self._upper = ends
            follow()

        return take

    def _range(self, limits: Limits) -> tuple[Vector, Vector]:
        """Lower and upper ends (k,); those that are not given are the robot's."""
        given_lower, given_upper = self._given
        ends = np.full((2, self.robot.nq), [[-math.inf], [math.inf]])
        own = self.robot.space.own
        ends[0, own[own >= 0]] = limits.position_min[own >= 0]
        ends[1, own[own >= 0]] = limits.position_max[own >= 0]
        lower = _ends('min', given_lower, ends[0, self._indices])
        upper = _ends('max', given_upper, ends[1, self._indices])
        if not np.all(lower < upper):
            raise InvalidValue(
                'min', f'{shown(lower)} with max {shown(upper)}', 'values below max'
            )
        if np.isinf(lower).all() and np.isinf(upper).all():
            raise InvalidValue(
                'min', 'no value', 'min or max, or robot.limits.position_min or position_max'
            )
        return lower, upper

    @property
    def target_components(self) -> tuple[str, ...]:
        """Nothing: there is no target."""
        return ()

    @property
    def coordinates(self) -> tuple[int, ...]:
        """Which coordinate of a configuration each row is about (k,)."""
        return tuple(self._indices.tolist())

    @property
    def ends(self) -> tuple[Vector, Vector]:
        """Lower and upper ends (k,) [rad, m] of the ranges; copies."""
        return self._lower.copy(), self._upper.copy()

    @property
    def current(self) -> Vector:
        """Present positions (k,) [rad, m]; a copy."""
        return self.robot.q[self._indices]

    def measure(self) -> None:
        """Fill the distances from the nearer ends and their derivative."""
        if self.bends:
            self._rates = self.robot.space.rates(self.robot.q)[self._indices]
        self._compiled.ends(
            self.robot.q,
            self._indices,
            self._lower,
            self._upper,
            self._rates,
            self.distance,
            self._slope,
        )

    def probe(self, out: Vector, enough: Vector | None = None) -> None:
        """Write the distances (k,) at the robot's present configuration to ``out``."""
        q = self.robot.q[self._indices]
        np.minimum(q - self._lower, self._upper - q, out=out)

    def mark(self) -> None:
        """Keep the distances."""
        self.probe(self._marked)

    def between(self, bend: Vector, out: Vector) -> None:
        """Write the lesser of the distances at the ends to ``out``: of a joint none is below."""
        self.probe(out)
        np.minimum(out, self._marked, out=out)
        if self.bends:
            out -= bend


def _ends(key: str, values: Sequence[float] | None, otherwise: Vector) -> Vector:
    if values is None:
        return otherwise
    if len(values) not in (1, otherwise.size):
        raise InvalidValue(
            key, f'{len(values)} values {shown(values)}', f'1 value or {otherwise.size}'
        )
    return np.broadcast_to(np.array(values, dtype=float), otherwise.shape).copy()
