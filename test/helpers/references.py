"""Independent computations in plain numpy, to compare the library with."""

import math

import numpy as np


def dh_poses(dh, q):
    """Poses (4, 4) of every link by the textbooks' matrices of DH parameters."""
    modified = dh.get('convention') == 'modified'
    pose = np.eye(4)
    x, y, z, roll, pitch, yaw = dh.get('base_pose', [0.0] * 6)
    pose[:3, :3] = about('z', yaw) @ about('y', pitch) @ about('x', roll)
    pose[:3, 3] = x, y, z
    poses = []
    rows = zip(dh['theta'], dh['d'], dh['a'], dh['alpha'], dh['types'], q, strict=True)
    for theta, d, a, alpha, kind, position in rows:
        angle, length = (theta + position, d) if kind == 'revolute' else (theta, d + position)
        ct, st = math.cos(angle), math.sin(angle)
        ca, sa = math.cos(alpha), math.sin(alpha)
        if modified:
            matrix = [
                [ct, -st, 0.0, a],
                [st * ca, ct * ca, -sa, -sa * length],
                [st * sa, ct * sa, ca, ca * length],
                [0.0, 0.0, 0.0, 1.0],
            ]
            pose = pose @ np.array(matrix)
            poses.append(pose)
            continue
        pose = pose @ np.array(
            [
                [ct, -st * ca, st * sa, a * ct],
                [st, ct * ca, -ct * sa, a * st],
                [0.0, sa, ca, length],
                [0.0, 0.0, 0.0, 1.0],
            ]
        )
        poses.append(pose)
    return poses


def about(axis, angle):
    """Rotation matrix (3, 3) about a base axis."""
    i = 'xyz'.index(axis)
    j, k = (i + 1) % 3, (i + 2) % 3
    R = np.eye(3)
    R[j, j] = R[k, k] = math.cos(angle)
    R[k, j] = math.sin(angle)
    R[j, k] = -R[k, j]
    return R


def rotation(vector):
    """Rotation matrix of a rotation vector, by Rodrigues' formula."""
    angle = float(np.linalg.norm(vector))
    if angle == 0.0:
        return np.eye(3)
    x, y, z = np.asarray(vector) / angle
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + math.sin(angle) * cross + (1.0 - math.cos(angle)) * cross @ cross


def quaternion_rotation(quaternion):
    """Rotation matrix of a quaternion x, y, z, w of any length but zero."""
    quaternion = np.asarray(quaternion) / np.linalg.norm(quaternion)
    v, w = quaternion[:3], quaternion[3]
    cross = np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])
    return np.eye(3) + 2.0 * w * cross + 2.0 * cross @ cross


def rotation_vector(R):
    """Rotation vector of a rotation matrix, exact up to half a turn.

    The unit quaternion is the eigenvector of Bar-Itzhack's symmetric matrix (2000) for its
    largest eigenvalue.
    """
    K = np.zeros((4, 4))
    K[:3, :3] = R + R.T - np.trace(R) * np.eye(3)
    K[:3, 3] = K[3, :3] = R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]
    K[3, 3] = np.trace(R)
    quaternion = np.linalg.eigh(K)[1][:, -1]
    quaternion *= math.copysign(1.0, quaternion[3])
    sine = float(np.linalg.norm(quaternion[:3]))
    if sine == 0.0:
        return np.zeros(3)
    return quaternion[:3] / sine * 2.0 * math.atan2(sine, quaternion[3])


def heading(R, axis):
    """Angle about a base axis of the image of the next axis, seen along that axis."""
    i = 'xyz'.index(axis)
    return math.atan2(R[(i + 2) % 3, (i + 1) % 3], R[(i + 1) % 3, (i + 1) % 3])


def recursion(levels, damping, rank_gap=1e-6):
    """Joint velocity of the recursion with explicit projectors.

    Parameters
    ----------
    levels
        Pairs of task Jacobian (k, n) and desired task velocity (k,), highest first.
    damping
        λ; 0 takes the pseudo-inverse instead of damped least squares.
    rank_gap
        Singular values below this share of ‖J‖ count as zero.

    Returns
    -------
    qd, shares
        Joint velocity (n,), and every singular value of J P as a share of ‖J‖.
    """
    n = levels[0][0].shape[1]
    qd, P, shares = np.zeros(n), np.eye(n), []
    for J, velocity in levels:
        # Rows of nothing but rounding are rows of zeros.
        J = J * (np.linalg.norm(J, axis=1, keepdims=True) > 1e-13)  # noqa: PLW2901
        size = max(float(np.linalg.norm(J)), 1e-300)
        J_bar = J @ P
        shares += list(np.linalg.svd(J_bar, compute_uv=False) / size)
        pseudo_inverse = clear_pinv(J_bar, rank_gap * size)
        if damping == 0.0:
            inverse = pseudo_inverse
        else:
            square = J_bar @ J_bar.T + damping**2 * np.eye(len(J))
            inverse = J_bar.T @ np.linalg.inv(square)
        qd = qd + inverse @ (velocity - J @ qd)
        P = P - pseudo_inverse @ J_bar
    return qd, np.array(shares)


def clear_pinv(J, smallest):
    """Pseudo-inverse that takes singular values below an absolute bound for zero."""
    largest = np.linalg.norm(J, 2)
    return np.linalg.pinv(J, rcond=smallest / largest if largest > smallest else 1.0)


def away_from_rank_changes(shares, low=1e-12, high=1e-2):
    """Whether every singular value is clearly zero or clearly not."""
    return bool(np.all((shares < low) | (shares > high)))
