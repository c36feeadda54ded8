"""Conversions of rotations, all in the base frame."""

from __future__ import annotations

import math

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]


def wrap(angle: float) -> float:
    """Angle [rad] moved by whole turns into [-pi, pi]."""
    return math.remainder(angle, math.tau)


def rotation_from_quaternion(quaternion: Vector) -> Matrix:
    """Rotation matrix (3, 3) of a quaternion x, y, z, w of any length but zero."""
    x, y, z, w = quaternion
    R: Matrix = pin.Quaternion(w, x, y, z).normalized().toRotationMatrix()
    return R


def rotations_from_quaternions(quaternions: Matrix) -> Matrix:
    """Rotation matrices (m, 3, 3) of quaternions (m, 4), see `rotation_from_quaternion`."""
    x, y, z, w = quaternions.T / np.linalg.norm(quaternions, axis=1)
    rows = [
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
        [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
        [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
    ]
    return np.array(rows).transpose(2, 0, 1)


def quaternion_from_rotation(R: Matrix) -> Vector:
    """Unit quaternion x, y, z, w (4,) of a rotation matrix, with w >= 0."""
    quaternion: Vector = pin.Quaternion(np.asarray(R)).coeffs().copy()
    return -quaternion if quaternion[3] < 0 else quaternion


def heading(R: Matrix, axis: int) -> float:
    """Angle [rad] of a rotation about one base axis.

    The angle, in the plane normal to base axis ``axis``, of the image of the next axis
    in cyclic order: for ``axis = 2`` the yaw ``atan2(R[1, 0], R[0, 0])``. For a rotation
    about that axis alone it is the rotation's own angle.
    """
    i, j = (axis + 1) % 3, (axis + 2) % 3
    return math.atan2(R[j, i], R[i, i])
