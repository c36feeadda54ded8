"""Joints whose configuration is a pose: planar and floating ones, and differential drives.

Coordinates are the pose of the link after the joint in the frame before it. Velocities are the
twist of that link along its own axes, as for Pinocchio's ``JointModelPlanar`` and
``JointModelFreeFlyer``. A constant twist leads along an arc: the exponential of SE(2) or SE(3).
A differential drive is a planar joint with two of its three velocities.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from typing import ClassVar

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from tp_controller.errors import InvalidValue, listed, shown
from tp_controller.rotations import wrap

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]

FIXED, PLANAR, FLOATING, DIFFERENTIAL = BASES = ('fixed', 'planar', 'floating', 'differential')
"""Kinds of bases, values of ``robot.base``."""
SCALAR = 'scalar'
"""Kind of a joint with one coordinate whose derivative is the velocity."""
BASE = 'base'
"""Name of the joint that ``robot.base`` puts in front of an arm."""
WORLD = 'odom'
"""Name of the frame that a base moves in, if none is given."""
FREE = 6
"""Number of velocities of a floating joint."""
BENDING = 0.5
"""Least bound [m/rad] for the turns of a planar or floating joint. While it moves along an arc,
the second derivative of a point's position is up to the product of both speeds: half of it by
each."""
NO_LENGTH = 1e-6
"""A quaternion shorter than this has no direction."""
QUATERNION = math.pi / math.sqrt(2.0)
"""Bound on an angle [rad] up to half a turn over the change of its unit quaternion: with the chord
``c = 2 sin(angle / 4)`` the angle is at most that many times c."""


def check_base(kind: str) -> None:
    """Check the kind of a base.

    Raises
    ------
    InvalidValue
        If it is none of `BASES`.
    """
    if kind not in BASES:
        raise InvalidValue('robot.base', shown(kind), f'one of {listed(BASES)}')


class Motion(ABC):
    """A joint with a pose as its configuration."""

    coordinates: ClassVar[tuple[str, ...]]
    velocities: ClassVar[tuple[str, ...]]

    @staticmethod
    @abstractmethod
    def neutral() -> Vector:
        """Coordinates of the pose at the origin."""

    @staticmethod
    @abstractmethod
    def moved(q: Vector, twist: Vector) -> Vector:
        """Coordinates after a twist, along the link's axes, has acted for one unit of time."""

    @staticmethod
    @abstractmethod
    def way(q0: Vector, q1: Vector) -> Vector:
        """Twist that leads from one pose to another in one unit of time."""

    @staticmethod
    @abstractmethod
    def rates(q: Vector) -> Matrix:
        """Derivative of the coordinates by the velocities."""

    @staticmethod
    @abstractmethod
    def velocity(q: Vector, rates: Vector) -> Vector:
        """Velocities out of the time derivatives of the coordinates."""

    @staticmethod
    @abstractmethod
    def model(q: Vector) -> Vector:
        """Pinocchio's coordinates."""

    @staticmethod
    @abstractmethod
    def spread(reach: Matrix) -> Matrix:
        """Bounds per change of the coordinates, out of bounds per velocity; both in columns."""


class Planar(Motion):
    """Pose in a plane: x, y [m] and yaw [rad], a real number that counts turns."""

    coordinates = ('x', 'y', 'yaw')
    velocities = ('forward', 'left', 'yaw')

    @staticmethod
    def neutral() -> Vector:
        """Coordinates (3,) of the pose at the origin."""
        return np.zeros(3)

    @staticmethod
    def moved(q: Vector, twist: Vector) -> Vector:
        """Coordinates (3,) after a twist (3,) [m, m, rad]: exponential of SE(2)."""
        x, y, yaw = q.tolist()
        u, v, w = twist.tolist()
        s, c = 1.0, 0.0
        if w != 0.0:
            half = math.sin(0.5 * w)
            s, c = math.sin(w) / w, 2.0 * half * half / w
        a, b = s * u - c * v, c * u + s * v
        cos, sin = math.cos(yaw), math.sin(yaw)
        return np.array([x + cos * a - sin * b, y + sin * a + cos * b, yaw + w])

    @staticmethod
    def way(q0: Vector, q1: Vector) -> Vector:
        """Twist (3,) from one pose to another: logarithm of SE(2), by the shorter turn."""
        dx, dy = float(q1[0] - q0[0]), float(q1[1] - q0[1])
        cos, sin = math.cos(q0[2]), math.sin(q0[2])
        a, b = cos * dx + sin * dy, cos * dy - sin * dx
        w = wrap(float(q1[2] - q0[2]))
        half = 0.5 * w
        f = half / math.tan(half) if half != 0.0 else 1.0
        return np.array([f * a + half * b, f * b - half * a, w])

    @staticmethod
    def rates(q: Vector) -> Matrix:
        """Derivative (3, 3) of the coordinates by the velocities: the rotation about z."""
        cos, sin = math.cos(q[2]), math.sin(q[2])
        return np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])

    @staticmethod
    def velocity(q: Vector, rates: Vector) -> Vector:
        """Velocities (3,) out of the time derivatives (3,) of the coordinates."""
        found: Vector = Planar.rates(q).T @ rates
        return found

    @staticmethod
    def model(q: Vector) -> Vector:
        """Pinocchio's coordinates (4,): x, y, cosine and sine."""
        return np.array([q[0], q[1], math.cos(q[2]), math.sin(q[2])])

    @staticmethod
    def spread(reach: Matrix) -> Matrix:
        """Bounds (k, 3) per change of the coordinates, out of bounds (k, 3) per velocity."""
        linear = reach[:, :2].max(axis=1)
        return np.stack([linear, linear, reach[:, 2]], axis=1)


class Floating(Motion):
    """Pose in space: x, y, z [m] and the unit quaternion x, y, z, w; both signs are the same."""

    coordinates = ('x', 'y', 'z', 'qx', 'qy', 'qz', 'qw')
    velocities = ('forward', 'left', 'up', 'roll', 'pitch', 'yaw')

    @staticmethod
    def neutral() -> Vector:
        """Coordinates (7,) of the pose at the origin."""
        return np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])

    @staticmethod
    def moved(q: Vector, twist: Vector) -> Vector:
        """Coordinates (7,) after a twist (6,) [m, rad]: exponential of SE(3)."""
        step, turn = pin.exp6(twist), _quaternion(q)
        after = (turn * pin.Quaternion(step.rotation)).coeffs()
        length = math.copysign(float(np.linalg.norm(after)), float(after @ q[3:]))
        place = q[:3] + turn.toRotationMatrix() @ step.translation
        return np.concatenate([place, after / length])

    @staticmethod
    def way(q0: Vector, q1: Vector) -> Vector:
        """Twist (6,) from one pose to another: logarithm of SE(3), by the shorter turn."""
        before, after = (pin.SE3(_quaternion(q), q[:3]) for q in (q0, q1))
        found: Vector = pin.log6(before.actInv(after)).vector
        return found

    @staticmethod
    def rates(q: Vector) -> Matrix:
        """Derivative (7, 6) of the coordinates by the velocities."""
        turn = _quaternion(q)
        x, y, z, w = turn.coeffs().tolist()
        found = np.zeros((7, 6))
        found[:3, :3] = turn.toRotationMatrix()
        found[3:, 3:] = [[w, -z, y], [z, w, -x], [-y, x, w], [-x, -y, -z]]
        found[3:, 3:] *= 0.5
        return found

    @staticmethod
    def velocity(q: Vector, rates: Vector) -> Vector:
        """Velocities (6,) out of the time derivatives (7,) of the coordinates."""
        found: Vector = Floating.rates(q).T @ rates
        found[3:] *= 4.0
        return found

    @staticmethod
    def model(q: Vector) -> Vector:
        """Pinocchio's coordinates (7,): the same, with a quaternion of length 1."""
        return np.concatenate([q[:3], _quaternion(q).coeffs()])

    @staticmethod
    def spread(reach: Matrix) -> Matrix:
        """Bounds (k, 7) per change of the coordinates, out of bounds (k, 6) per velocity."""
        linear, angular = reach[:, :3].max(axis=1), QUATERNION * reach[:, 3:].max(axis=1)
        return np.stack([linear] * 3 + [angular] * 4, axis=1)


def _quaternion(q: Vector) -> pin.Quaternion:
    turn = pin.Quaternion(q[3:])
    turn.normalize()
    return turn


MOTIONS: dict[str, type[Motion]] = {PLANAR: Planar, DIFFERENTIAL: Planar, FLOATING: Floating}
KEPT = {PLANAR: (0, 1, 2), DIFFERENTIAL: (0, 2), FLOATING: (0, 1, 2, 3, 4, 5)}
"""Which velocities of the joint each kind has."""


class Block:
    """Where the coordinates and velocities of a planar or floating joint are.

    Attributes
    ----------
    joint, kind
        Name of the joint, and its kind out of `BASES`.
    motion
        Its configuration space.
    q, v
        Its coordinates, and its velocities, among those of the robot.
    kept
        Which velocities of the motion these are.
    size, turns
        Number of velocities of the motion, and how many of them, the last ones, are turns.
    positions
        Number of coordinates that are a position, the first ones.
    """

    def __init__(self, joint: str, kind: str, first_q: int, first_v: int) -> None:
        self.joint, self.kind = joint, kind
        self.motion, self.kept = MOTIONS[kind], np.array(KEPT[kind])
        self.size = len(self.motion.velocities)
        self.turns = 3 if self.size == FREE else 1
        self.positions = self.size - self.turns
        self.q = slice(first_q, first_q + len(self.motion.coordinates))
        self.v = slice(first_v, first_v + self.kept.size)

    def twist(self, v: Vector) -> Vector:
        """All velocities of the motion, those that the joint does not have being zero."""
        twist = np.zeros(self.size)
        twist[self.kept] = v[self.v]
        return twist
