"""A configuration of a robot as a value."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tp_controller.errors import InvalidValue, shown

if TYPE_CHECKING:
    from tp_controller.robot.model import Robot

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]


class State:
    """A configuration with its frames and Jacobians; made by `Robot.state`.

    It has kinematics of its own: what the robot does afterwards does not change it. All arrays
    are read-only.

    Attributes
    ----------
    robot
        The robot whose configuration it is.
    q
        Configuration (nq,) [rad, m].
    """

    def __init__(self, robot: Robot, q: ArrayLike) -> None:
        try:
            values = np.array(q, dtype=float)
        except (TypeError, ValueError):
            raise InvalidValue('q', shown(q), f'{robot.nq} numbers') from None
        if values.shape != (robot.nq,):
            raise InvalidValue('q', f'shape {values.shape}', f'shape ({robot.nq},)')
        if not np.isfinite(values).all():
            raise InvalidValue('q', shown(values), 'finite numbers')
        self.robot = robot
        self._own = robot.twin()
        self._own.update(values)
        self.q: Vector = self._own.q

    @property
    def frames(self) -> tuple[str, ...]:
        """Names of the frames, from the base outwards."""
        return self._own.frames

    def position(self, frame: str) -> Vector:
        """Origin (3,) [m] of a frame, in the base frame.

        Raises
        ------
        InvalidValue
            If the robot has no such frame.
        """
        return self._own.frame(frame).position

    def rotation(self, frame: str) -> Matrix:
        """Orientation (3, 3) of a frame, in the base frame; errors as `position`."""
        return self._own.frame(frame).rotation

    def jacobian(self, frame: str) -> Matrix:
        """Jacobian (6, n) of a frame to its twist [v; ω], in the base frame; errors as `position`.

        The first three rows are the velocity of the origin [m], the last three the angular
        velocity [rad], per unit of each joint velocity.
        """
        return self._own.frame(frame).jacobian

    def check(self, robot: Robot) -> None:
        """Check that the state is one of this robot.

        Raises
        ------
        InvalidValue
            If it is another robot's.
        """
        if self.robot is not robot:
            raise InvalidValue('state', 'a state of another robot', 'robot.state(q) of this one')


@contextmanager
def moved(robot: Robot, q: Vector) -> Iterator[None]:
    """Move a robot to a configuration (nq,) [rad, m], and back at the end."""
    before = robot.q.copy()
    robot.update(q)
    try:
        yield
    finally:
        robot.update(before)
