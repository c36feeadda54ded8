"""A whole arm kept clear of an obstacle."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from tp_controller.errors import NO_VALUE, InvalidValue, plural, shown
from tp_controller.robot import Robot, Shape, obstacle_clearance
from tp_controller.robot.shapes import rotation_to
from tp_controller.rotations import rotation_from_quaternion
from tp_controller.tasks.clearance import ClearanceTask
from tp_controller.tasks.thresholds import Switching

if TYPE_CHECKING:
    from typing_extensions import Unpack

    from tp_controller.tasks.common import Common

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]

MEASURES: Mapping[str, tuple[str, ...]] = {
    'sphere': ('radius',),
    'box': ('size', 'orientation'),
    'cylinder': ('radius', 'length', 'orientation'),
    'half_space': ('normal',),
}
"""Parameters of each shape of an obstacle."""
SHAPES = tuple(MEASURES)
OPTIONAL = ('orientation',)


class Measures(NamedTuple):
    """What the shapes of an obstacle are described by; each has some of these."""

    radius: float | None = None
    """Sphere, cylinder [m]."""
    size: Sequence[float] | None = None
    """Box: sides along its x, y and z [m]."""
    length: float | None = None
    """Cylinder: along its z [m]."""
    normal: Sequence[float] | None = None
    """Half-space: direction out of it."""
    orientation: Sequence[float] | None = None
    """Box, cylinder: quaternion x, y, z, w; along the base frame when left out."""

    def shape(self, kind: str, center: Vector) -> Shape:
        """Shape of that kind around a centre (3,) [m], a half-space's any point of its surface.

        Raises
        ------
        InvalidValue
            If a measure is missing, belongs to another shape, or cannot be used.
        """
        if kind not in MEASURES:
            raise InvalidValue('shape', shown(kind), f'one of {", ".join(SHAPES)}')
        for key, value in self._asdict().items():
            if value is None and key in MEASURES[kind] and key not in OPTIONAL:
                raise InvalidValue(key, NO_VALUE, f'a value, for the shape {kind}')
            if value is not None and key not in MEASURES[kind]:
                raise InvalidValue(key, f'{shown(value)} with the shape {kind}', 'no value')
        size = _sizes(self)
        if kind == 'half_space':
            rotation = rotation_to(_direction('normal', self.normal or (), 3))
        elif self.orientation is None:
            rotation = np.eye(3)
        else:
            rotation = rotation_from_quaternion(_direction('orientation', self.orientation, 4))
        return Shape(kind, size, pin.SE3(rotation, np.array(center, dtype=float)))


def _sizes(measures: Measures) -> tuple[float, ...]:
    """Size of a shape, see `Shape`."""
    sizes: list[float] = []
    for key, count in (('radius', 1), ('length', 1), ('size', 3)):
        value = getattr(measures, key)
        if value is None:
            continue
        found = [float(item) for item in (value if count > 1 else [value])]
        if len(found) != count or not all(0.0 < item < math.inf for item in found):
            accepts = 'a number above 0' if count == 1 else f'{count} numbers above 0'
            raise InvalidValue(key, shown(value), accepts)
        sizes += found
    return tuple(sizes)


def _direction(key: str, values: Sequence[float], count: int) -> Vector:
    direction = np.array(values, dtype=float)
    if direction.size != count:
        raise InvalidValue(
            key, f'{plural(direction.size, "value")} {shown(values)}', f'{count} values'
        )
    if not np.all(np.isfinite(direction)) or not direction.any():
        raise InvalidValue(key, shown(values), 'finite numbers that are not all zero')
    return direction / np.abs(direction).max()


class WholeArmTask(ClearanceTask):
    """Keeps links of the arm out of an obstacle, one row per link. A goal moves its centre.

    Parameters
    ----------
    name
        Name of the task.
    robot
        The robot, with `bodies`.
    center
        Centre (3,) [m] in the base frame, of a half-space any point of its surface.
    shape
        ``sphere``, ``box``, ``cylinder`` or ``half_space``.
    measures
        What that shape is described by.
    links
        The links; all that have a shape and move when left out.
    period
        Time [s] of one step; infinite if unknown.
    switching
        How the rows come in and go out.
    settings
        Gain, target and the like, see `Common`.

    Raises
    ------
    InvalidValue
        If a link has no shape, the centre or a measure cannot be used, or as
        `SetBasedTask`.
    """

    type = 'obstacle'
    without = ('target', 'max_speed', 'time_scaling', 'around')
    target_key = 'center'
    target_words = 'centre [m]'

    def __init__(
        self,
        name: str,
        robot: Robot,
        center: Sequence[float],
        shape: str,
        measures: Measures,
        links: Sequence[str] | None = None,
        period: float = math.inf,
        switching: Switching = Switching(),  # noqa: B008 - a value
        **settings: Unpack[Common],
    ) -> None:
        self.reference = robot.base
        obstacle = measures.shape(shape, np.zeros(3))
        clearance = obstacle_clearance(robot, robot.bodies, obstacle, links)
        super().__init__(name, clearance, period, switching)
        try:
            self.target = center
        except InvalidValue as error:
            raise InvalidValue('center', error.got, error.accepts) from None
        self._placed = np.zeros(0)
        self._follow()
        self.set(settings)

    @classmethod
    def from_parameters(cls, name: str, robot: Robot, values: Mapping[str, Any]) -> WholeArmTask:
        """Make the task from checked values of an obstacle's parameters."""
        return cls(
            name,
            robot,
            values['center'],
            values['shape'],
            Measures(*(values[key] for key in Measures._fields)),
            values['links'],
            values['period'],
            Switching.of(values),
        )

    @property
    def target_components(self) -> tuple[str, ...]:
        """Letters of the axes, for the centre."""
        return ('x', 'y', 'z')

    @property
    def center(self) -> Vector:
        """Centre [m], the target; a copy."""
        return self._target.copy()

    @property
    def obstacle(self) -> Shape:
        """The obstacle where it is now."""
        self._follow()
        assert self.clearance.obstacle is not None
        return self.clearance.obstacle

    def target_from_pose(self, position: Vector, rotation: Matrix) -> Vector:
        """Coordinates (3,) of the position."""
        return position

    def measure(self) -> None:
        """Fill the distances of rows that may be in, and their derivative."""
        self._follow()
        super().measure()

    def probe(self, out: Vector, enough: Vector | None = None) -> None:
        """Write the distances (k,) at the robot's present configuration to ``out``."""
        self._follow()
        super().probe(out, enough)

    def contact_text(self, rows: NDArray[np.intp]) -> str:
        """One line about the rows that are in contact at the first configuration."""
        links = self.clearance.links
        names = self.clearance.names
        found = ', '.join(f'{names[i]} ({self.distance[i]:.3g} m)' for i in rows)
        touching = {links[i][0] for i in rows}
        left = [link for link in dict(links) if link not in touching]
        return (
            f'nearer than {self.kept_distance:.3g} at the first joint state: {found}; these are '
            f'moved away. Without links that always touch: links: [{", ".join(left)}]'
        )

    def _follow(self) -> None:
        """Move the obstacle to the target, if that is a new one."""
        if self._placed is not self._target:
            self._placed = self._target
            assert self.clearance.obstacle is not None
            rotation = self.clearance.obstacle.pose.rotation
            self.clearance.move(pin.SE3(rotation, self._target))
