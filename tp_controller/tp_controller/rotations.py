"""Rotation errors and conversions, all in the base frame."""

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


def rotation_error(R_des: Matrix, R: Matrix) -> Vector:
    """Shortest rotation from ``R`` to ``R_des`` as a rotation vector (3,) [rad].

    The SO(3) logarithm of ``R_des Rᵀ``: in the base frame, of length at most pi.
    """
    error: Vector = pin.log3(R_des @ R.T)
    return error


def tilt_error(Q: Matrix, axis: int, carried: bool) -> Vector:
    """Shortest rotation that leaves of a rotation error only a turn about one axis.

    The swing of the swing-twist decomposition (Dobrowolski 2015, "Swing-twist decomposition
    in Clifford algebra", arXiv:1506.05481) of the rotation error ``Q = R_des Rᵀ`` with
    respect to the unit vector c of an axis: ``Q = T S`` with a turn T about c where c stands
    still, ``Q = S T`` where the frame that is turned carries c along. The rotation vector of S is

        e = θ / sin θ (a × b),   θ = atan2(|a × b|, a · b)

    with ``a = Qᵀ c, b = c`` (still) or ``a = c, b = Q c`` (carried). It has no component along
    c and does not depend on turns of R about c, and the rate of its size is ``-e · ω / θ``, the
    angular velocity along it. Half a turn away, where every axis across c is as good, it is
    about the next axis in cyclic order.

    Parameters
    ----------
    Q
        ``R_des Rᵀ`` (3, 3), along axes of which c is one.
    axis
        Which of them c is: 0, 1, 2.
    carried
        Whether c moves with R.

    Returns
    -------
    ndarray
        Rotation vector (3,) [rad], along the axes of ``Q``.
    """
    i, j = (axis + 1) % 3, (axis + 2) % 3
    x, y = (-Q[j, axis], Q[i, axis]) if carried else (Q[axis, j], -Q[axis, i])
    sine, cosine = math.hypot(x, y), float(Q[axis, axis])
    error = np.zeros(3)
    if sine > 0.0:
        scale = math.atan2(sine, cosine) / sine
        error[i], error[j] = scale * x, scale * y
    elif cosine < 0.0:
        error[i] = math.pi
    return error


def rotation_from_quaternion(quaternion: Vector) -> Matrix:
    """Rotation matrix (3, 3) of a quaternion x, y, z, w of any length but zero."""
    x, y, z, w = quaternion
    R: Matrix = pin.Quaternion(w, x, y, z).normalized().toRotationMatrix()
    return R


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


def heading_rows(R: Matrix, axis: int) -> Vector:
    """Row (3,) that maps an angular velocity in the base frame to the heading's rate.

    It is the unit row of ``axis`` while the image of the next axis stays in the plane.
    Where that image is normal to the plane the heading has no derivative; the unit row
    is returned there.
    """
    i, j = (axis + 1) % 3, (axis + 2) % 3
    a, b, c = R[i, i], R[j, i], R[axis, i]
    square = a * a + b * b
    row = np.zeros(3)
    row[axis] = 1.0
    if square > 1e-12:
        row[i] = -c * a / square
        row[j] = -c * b / square
    return row
