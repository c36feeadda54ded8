"""Poses in the plane and in space as matrices: independent of the code under test."""

import numpy as np


def exponential(A):
    """Exponential of a matrix (n, n), by its series after halving it often enough."""
    halvings = max(0, int(np.ceil(np.log2(max(np.abs(A).sum(), 1e-9)))) + 4)
    A = A / 2.0**halvings
    result, term = np.eye(len(A)), np.eye(len(A))
    for i in range(1, 16):
        term = term @ A / i
        result = result + term
    for _ in range(halvings):
        result = result @ result
    return result


def twist_matrix(twist):
    """Matrix (4, 4) of a twist [v; w] (6,) along the axes of the body."""
    v, (a, b, c) = twist[:3], twist[3:]
    A = np.zeros((4, 4))
    A[:3, :3] = [[0.0, -c, b], [c, 0.0, -a], [-b, a, 0.0]]
    A[:3, 3] = v
    return A


def turn_about_z(angle):
    """Rotation (3, 3)."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def turn_of(quaternion):
    """Rotation (3, 3) of a quaternion x y z w, by turning the three axes (p' = q p q*)."""
    x, y, z, w = np.array(quaternion) / np.linalg.norm(quaternion)
    u = np.array([x, y, z])
    axes = np.eye(3)
    return np.stack(
        [e + 2.0 * w * np.cross(u, e) + 2.0 * np.cross(u, np.cross(u, e)) for e in axes], axis=1
    )


def pose(coordinates):
    """Pose (4, 4) of coordinates (3,) in the plane or (7,) in space."""
    M = np.eye(4)
    if len(coordinates) == 3:
        M[:3, :3] = turn_about_z(coordinates[2])
        M[:2, 3] = coordinates[:2]
    else:
        M[:3, :3] = turn_of(coordinates[3:])
        M[:3, 3] = coordinates[:3]
    return M


def full_twist(kind, velocities):
    """Twist [v; w] (6,) of a base with its velocities."""
    twist = np.zeros(6)
    places = {'planar': [0, 1, 5], 'differential': [0, 5], 'floating': list(range(6))}
    twist[places[kind]] = velocities
    return twist


def moved(kind, coordinates, velocities):
    """Pose (4, 4) of a base after its velocities have acted for one unit of time."""
    return pose(coordinates) @ exponential(twist_matrix(full_twist(kind, velocities)))


def coordinates(kind, M):
    """Coordinates of a pose (4, 4): x y yaw, or x y z and a quaternion x y z w."""
    R = M[:3, :3]
    if kind != 'floating':
        return np.array([M[0, 3], M[1, 3], np.arctan2(R[1, 0], R[0, 0])])
    # The eigenvector of Bar-Itzhack's symmetric matrix (2000) is the quaternion.
    xx, xy, xz = R[:, 0]
    yx, yy, yz = R[:, 1]
    zx, zy, zz = R[:, 2]
    K = np.array(
        [
            [xx - yy - zz, yx + xy, zx + xz, yz - zy],
            [yx + xy, yy - xx - zz, zy + yz, zx - xz],
            [zx + xz, zy + yz, zz - xx - yy, xy - yx],
            [yz - zy, zx - xz, xy - yx, xx + yy + zz],
        ]
    )
    return np.concatenate([M[:3, 3], np.linalg.eigh(K)[1][:, -1]])


class Body:
    """A base with a planar arm, moved by commands: no line of the code under test.

    Coordinates are measured as sensors do: yaw between half turns, any sign of the quaternion.
    """

    def __init__(self, kind, lengths, joints, foot=0.0):
        self.kind, self.lengths, self.foot = kind, lengths, foot
        self.base, self.joints = np.eye(4), np.array(joints, dtype=float)

    @property
    def q(self):
        return np.concatenate([coordinates(self.kind, self.base), self.joints])

    def after(self, command, dt):
        """The same body a time later."""
        _, nv = sizes(self.kind)
        body = Body(self.kind, self.lengths, self.joints + dt * command[nv:], self.foot)
        twist = full_twist(self.kind, dt * np.asarray(command[:nv]))
        body.base = self.base @ exponential(twist_matrix(twist))
        return body

    @property
    def hand(self):
        """Pose (4, 4) of the end."""
        foot = np.eye(4)
        foot[0, 3] = self.foot
        return self.base @ foot @ arm_pose(self.joints, self.lengths)


def sizes(kind):
    """How many coordinates and velocities a base has."""
    return {'planar': (3, 3), 'differential': (3, 2), 'floating': (7, 6)}[kind]


def arm_pose(q, lengths):
    """Pose (4, 4) of the end of links that turn about z, on the pose of their foot."""
    M = np.eye(4)
    for angle, length in zip(q, lengths, strict=True):
        step = np.eye(4)
        step[:3, :3] = turn_about_z(angle)
        step[:3, 3] = step[:3, :3] @ [length, 0.0, 0.0]
        M = M @ step
    return M
