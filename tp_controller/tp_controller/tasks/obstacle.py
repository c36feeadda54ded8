"""A frame kept out of a circle or a sphere, or a whole arm out of an obstacle."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from tp_controller.errors import NO_VALUE, InvalidValue, listed, shown
from tp_controller.parameters import BOOLEAN, NUMBER, NUMBERS, REQUIRED, TEXT, TEXTS, Parameter
from tp_controller.robot import Robot
from tp_controller.tasks.frame import LABELS, axis_rows
from tp_controller.tasks.set_based import SetBasedTask
from tp_controller.tasks.thresholds import THRESHOLDS, Switching
from tp_controller.tasks.whole_arm import SHAPES, Measures, WholeArmTask

if TYPE_CHECKING:
    from typing_extensions import Unpack

    from tp_controller.tasks.common import Common

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]


class ObstacleTask(SetBasedTask):
    """Keeps the origin of a frame out of a sphere; with two axes out of a circle.

    The distance is ``‖p - c‖ - radius`` along the axes, its derivative the outward unit
    vector times the rows of the frame's linear velocity. A goal moves the centre.

    Parameters
    ----------
    name
        Name of the task.
    robot
        The robot that carries the task out.
    frame
        Name of the frame.
    center
        Centre, one coordinate per axis [m] in the base frame.
    radius
        Radius [m].
    axes
        Letters of the base axes that count: xyz for a sphere, xy for a cylinder along z.
    period
        Time [s] of one step; infinite if unknown.
    switching
        How the row comes in and goes out.
    settings
        Gain, target and the like, see `Common`.

    Raises
    ------
    InvalidValue
        If the robot has no such frame, the centre or the radius cannot be used, or as
        `SetBasedTask`.
    """

    type = 'obstacle'
    parameters: ClassVar[Mapping[str, Parameter]] = {
        'frame': Parameter(
            TEXT, 'Controlled frame, whose origin stays outside; with whole_arm none'
        ),
        'center': Parameter(
            NUMBERS,
            'Centre of the obstacle [m], one value per axis; of a half-space any point of '
            'its surface',
            default=REQUIRED,
        ),
        'radius': Parameter(NUMBER, 'Radius of a sphere or a cylinder [m]', above=0.0),
        'axes': Parameter(
            TEXT, 'Axes that count: xyz for a sphere, xy for a cylinder along z', default='xyz'
        ),
        'whole_arm': Parameter(
            BOOLEAN, 'Whether links stay outside with their shapes, one row per link', False
        ),
        'links': Parameter(
            TEXTS, 'Links that stay outside, with whole_arm; all that have a shape when left out'
        ),
        'shape': Parameter(
            TEXT, 'Shape of the obstacle, with whole_arm', default=SHAPES[0], choices=SHAPES
        ),
        'size': Parameter(NUMBERS, 'Sides of a box along its x, y and z [m]', above=0.0),
        'length': Parameter(NUMBER, 'Length of a cylinder along its z [m]', above=0.0),
        'normal': Parameter(NUMBERS, 'Direction x y z out of a half-space'),
        'orientation': Parameter(
            NUMBERS,
            'Quaternion x y z w of a box or a cylinder; along the base frame when left out',
        ),
        **THRESHOLDS,
    }
    without = ('target', 'max_speed', 'time_scaling', 'around')
    target_key = 'center'
    target_words = 'centre per axis [m]'

    def __init__(
        self,
        name: str,
        robot: Robot,
        frame: str,
        center: Sequence[float],
        radius: float,
        axes: str = 'xyz',
        period: float = math.inf,
        switching: Switching = Switching(),  # noqa: B008 - a value
        **settings: Unpack[Common],
    ) -> None:
        self.frame, self.reference = robot.frame(frame), robot.base
        self.twist_rows = np.array(axis_rows('axes', axes))
        if not 0.0 < radius < math.inf:
            raise InvalidValue('radius', shown(radius), 'a number above 0')
        self.radius = radius
        self._marked = np.zeros(self.twist_rows.size)
        super().__init__(name, robot, ['distance'], robot.reach(frame)[None], period, switching)
        try:
            self.target = center
        except InvalidValue as error:
            raise InvalidValue('center', error.got, error.accepts) from None
        self.set(settings)

    @classmethod
    def from_parameters(
        cls, name: str, robot: Robot, values: Mapping[str, Any]
    ) -> ObstacleTask | WholeArmTask:
        """Make the task from checked values; for a whole arm it is a `WholeArmTask`."""
        if values['whole_arm']:
            for key, left_out in (('frame', None), ('axes', 'xyz')):
                if values[key] != left_out:
                    got = f'{shown(values[key])} with whole_arm'
                    raise InvalidValue(key, got, 'no value')
            return WholeArmTask.from_parameters(name, robot, values)
        if values['frame'] is None:
            accepts = f'one of {listed(robot.frames)}, or whole_arm: true'
            raise InvalidValue('frame', NO_VALUE, accepts)
        if values['shape'] != SHAPES[0]:
            got = f'{shown(values["shape"])} for a frame'
            raise InvalidValue('shape', got, f'{SHAPES[0]}, or whole_arm: true')
        if values['radius'] is None:
            raise InvalidValue('radius', NO_VALUE, 'a number above 0')
        for key in ('links', *Measures._fields):
            if key != 'radius' and values[key] is not None:
                got = f'{shown(values[key])} for a frame'
                raise InvalidValue(key, got, 'no value, or whole_arm: true')
        return cls(
            name,
            robot,
            values['frame'],
            values['center'],
            values['radius'],
            values['axes'],
            values['period'],
            Switching.of(values),
        )

    @property
    def frame_name(self) -> str:
        """Name of the frame."""
        return self.frame.name

    @property
    def target_components(self) -> tuple[str, ...]:
        """Letters of the axes, for the centre."""
        return tuple(LABELS[row] for row in self.twist_rows)

    @property
    def current(self) -> Vector:
        """Present position of the frame per axis [m]; a copy."""
        return self.frame.position[self.twist_rows]

    @property
    def center(self) -> Vector:
        """Centre along the axes [m], the target; a copy."""
        return self._target.copy()

    def target_from_pose(self, position: Vector, rotation: Matrix) -> Vector:
        """Coordinates of the position (3,) along the axes."""
        return position[self.twist_rows]

    def measure(self) -> None:
        """Fill the distance from the surface and its derivative."""
        self._compiled.sphere(
            self.frame.position,
            self.twist_rows,
            self._target,
            self.radius,
            self.frame.jacobian,
            self.distance,
            self._slope,
        )

    def probe(self, out: Vector, enough: Vector | None = None) -> None:
        """Write the distance from the surface at the robot's present configuration to ``out``."""
        way = self.frame.position[self.twist_rows] - self._target
        out[0] = math.sqrt(way @ way) - self.radius

    def mark(self) -> None:
        """Keep the position of the frame."""
        self._marked[:] = self.frame.position[self.twist_rows]

    def between(self, bend: Vector, out: Vector) -> None:
        """Write a lower bound of the distance since `mark` to ``out``: that of a straight line."""
        way = self.frame.position[self.twist_rows] - self._marked
        to = self._target - self._marked
        square = float(way @ way)
        share = min(max(float(to @ way) / square, 0.0), 1.0) if square > 0.0 else 0.0
        to = to - share * way
        out[0] = math.sqrt(to @ to) - self.radius - bend[0]
