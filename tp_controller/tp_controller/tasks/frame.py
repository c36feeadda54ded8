"""What the tasks of a frame share: rows of its twist, and the frames they are seen from."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Mapping, Sequence
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from tp_controller.errors import InvalidValue, listed, shown
from tp_controller.parameters import REQUIRED, TEXT, Parameter
from tp_controller.robot import Frame, Robot
from tp_controller.tasks.base import Task
from tp_controller.tasks.parts import Part

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]

LABELS = ('x', 'y', 'z', 'rx', 'ry', 'rz')
"""Names of the rows of a twist [v; ω]."""

FRAME: Mapping[str, Parameter] = {
    'frame': Parameter(TEXT, 'Controlled frame', default=REQUIRED),
}
VIEW: Mapping[str, Parameter] = {
    'relative_to': Parameter(
        TEXT, 'Frame that target, position and rotation are seen from; the base when left out'
    ),
    'axes_frame': Parameter(
        TEXT, 'Frame whose axes are the controlled ones; that of relative_to when left out'
    ),
}


class FrameTask(Task):
    """A task on the pose of one frame, as seen from another one.

    Parameters
    ----------
    name
        Name of the task.
    robot
        The robot that carries the task out.
    frame
        Name of the controlled frame.
    rows
        Rows of the twist [v; ω] that the task controls, 0 to 5.
    relative_to
        Name of the frame that the pose is seen from; the base when left out.
    axes_frame
        Name of the frame along and about whose axes the rows are; that of ``relative_to``
        when left out.

    Raises
    ------
    InvalidValue
        If the robot has no such frame, or a frame is to be seen from itself.

    Attributes
    ----------
    frame
        The controlled frame.
    reference
        The frame that it is seen from.
    axes
        The frame along and about whose axes the rows are.
    """

    def __init__(
        self,
        name: str,
        robot: Robot,
        frame: str,
        rows: Sequence[int],
        relative_to: str | None = None,
        axes_frame: str | None = None,
    ) -> None:
        super().__init__(name, robot, [LABELS[row] for row in rows])
        self.frame = robot.frame(frame)
        self.reference = _seen_from(robot, 'relative_to', relative_to, robot.base)
        self.axes = _seen_from(robot, 'axes_frame', axes_frame, self.reference)
        if relative_to == frame:
            others = (robot.base_frame, *(other for other in robot.frames if other != frame))
            raise InvalidValue('relative_to', shown(relative_to), f'one of {listed(others)}')
        self.twist_rows = np.array(rows)
        self._from_base = self.reference is robot.base
        self._own_axes = self.axes is not self.reference

    @property
    def frame_name(self) -> str:
        """Name of the controlled frame."""
        return self.frame.name

    @property
    def relative_to(self) -> str:
        """Name of the frame that it is seen from, empty for the base."""
        return '' if self._from_base else self.reference.name

    @property
    def pose(self) -> tuple[Vector, Matrix]:
        """Present position (3,) [m] and rotation (3, 3), as seen from the reference; copies."""
        return self._position().copy(), self._rotation().copy()

    @abstractmethod
    def target_from_pose(self, position: Vector, rotation: Matrix) -> Vector:
        """Target (target_size,) that a pose in the reference frame stands for."""

    def feedforward_from_twist(self, twist: Vector) -> Vector:
        """Task velocity (k,) that a twist (6,) [v; ω] along the task's axes stands for."""
        return twist[self.twist_rows]

    def _part(
        self, kind: int, places: NDArray[np.int64], axis: int = -1, carried: bool = False
    ) -> Part:
        """Rows of one kind, seen as this task sees them."""
        axes = self.axes if self._own_axes else None
        return Part(kind, places.tolist(), self.frame, self.reference, axes, axis, carried)

    def _position(self) -> Vector:
        """Position (3,) [m] of the frame as seen from the reference."""
        if self._from_base:
            return self.frame.position
        return self.reference.rotation.T @ (self.frame.position - self.reference.position)

    def _rotation(self) -> Matrix:
        """Rotation (3, 3) of the frame as seen from the reference."""
        if self._from_base:
            return self.frame.rotation
        return self.reference.rotation.T @ self.frame.rotation

    @cached_property
    def bend(self) -> Vector:
        """Bounds (k,) on the second derivatives of the variables by unit joint motions.

        No column of a second derivative is longer than the reach of the outer one of its two
        joints; rotations also bend by up to the square of their Jacobian.
        """
        reach = self.robot.reach(self.frame.name)
        if not self._from_base:
            reach = reach + self.robot.reach(self.reference.name)
        if not np.isfinite(reach).all():
            return np.full(self.k, math.inf)
        linear = float(np.linalg.norm(np.minimum.outer(reach, reach)))
        return np.where(self.twist_rows < 3, linear, float(2 * self.robot.n))


def _seen_from(robot: Robot, key: str, name: str | None, otherwise: Frame) -> Frame:
    if name is None:
        return otherwise
    if name == robot.base_frame:
        return robot.base
    try:
        return robot.frame(name)
    except InvalidValue as error:
        accepts = f'{robot.base_frame} or {error.accepts}'
        raise InvalidValue(key, error.got, accepts) from None


def axis_rows(key: str, axes: str, first: int = 0) -> list[int]:
    """Twist rows of axes given by letter, such as ``xz``.

    Parameters
    ----------
    key
        Name of the parameter, for the message.
    axes
        Letters out of x, y, z, each at most once.
    first
        Row of the x axis: 0 for positions, 3 for rotations.

    Raises
    ------
    InvalidValue
        If a letter is another, stands twice, or there is none.
    """
    if not axes or not set(axes) <= set('xyz') or len(set(axes)) != len(axes):
        raise InvalidValue(key, shown(axes), 'letters out of xyz, each at most once')
    return [first + 'xyz'.index(letter) for letter in sorted(axes)]
