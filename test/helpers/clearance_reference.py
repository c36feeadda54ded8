"""Distances of capsules from simple shapes in plain numpy, to compare the library with.

A shape is a pair of its kind and its measures; points, poses (4, 4) and lengths in metres.
"""

import numpy as np


def moved(pose, point):
    """Point (3,) given in a frame, in that frame's base."""
    return pose[:3, :3] @ point + pose[:3, 3]


def point_distance(shape, pose, point):
    """Signed distance of a point from a shape, as in Quilez, Distance functions."""
    kind, size = shape
    x, y, z = pose[:3, :3].T @ (point - pose[:3, 3])
    if kind == 'half_space':
        return z
    if kind == 'sphere':
        return np.linalg.norm([x, y, z]) - size[0]
    if kind == 'box':
        beyond = np.abs([x, y, z]) - 0.5 * np.array(size)
    else:
        beyond = np.array([np.hypot(x, y) - size[0], abs(z) - 0.5 * size[1]])
    return np.linalg.norm(np.maximum(beyond, 0.0)) + min(beyond.max(), 0.0)


def line_distance(shape, pose, start, end):
    """Least signed distance of the points of a line from a convex shape.

    Along the line it is a convex function, whose least value the golden section finds.
    """
    ratio = (np.sqrt(5.0) - 1.0) / 2.0

    def along(t):
        return point_distance(shape, pose, start + t * (end - start))

    low, high = 0.0, 1.0
    a, b = high - ratio * (high - low), low + ratio * (high - low)
    at_a, at_b = along(a), along(b)
    for _ in range(60):
        if at_a < at_b:
            high, b, at_b = b, a, at_a
            a = high - ratio * (high - low)
            at_a = along(a)
        else:
            low, a, at_a = a, b, at_b
            b = low + ratio * (high - low)
            at_b = along(b)
    return min(at_a, at_b, along(0.0), along(1.0))


def lines_distance(p, q, r, s):
    """Distance between two lines from p to q and from r to s (Ericson 2005, section 5.1.9).

    The nearest points are at the end of one line or, if the lines cross as seen along their
    common normal, inside of both.
    """
    found = [
        point_line(p, r, s),
        point_line(q, r, s),
        point_line(r, p, q),
        point_line(s, p, q),
    ]
    one, other, way = q - p, s - r, p - r
    a, b, c = one @ one, one @ other, other @ other
    squared = a * c - b * b
    if squared > 1e-12:
        t = (b * (other @ way) - c * (one @ way)) / squared
        u = (a * (other @ way) - b * (one @ way)) / squared
        if 0.0 <= t <= 1.0 and 0.0 <= u <= 1.0:
            found.append(np.linalg.norm(p + t * one - r - u * other))
    return min(found)


def point_line(point, start, end):
    """Distance of a point from the line between two others."""
    way = end - start
    length = way @ way
    t = np.clip((point - start) @ way / length, 0.0, 1.0) if length > 0.0 else 0.0
    return np.linalg.norm(start + t * way - point)


def support(shape, pose, direction):
    """Largest coordinate of a shape along a direction (3,)."""
    kind, size = shape
    local = pose[:3, :3].T @ direction
    middle = direction @ pose[:3, 3]
    if kind == 'sphere':
        return middle + size[0] * np.linalg.norm(local)
    if kind == 'box':
        return middle + 0.5 * np.abs(local) @ size
    if kind == 'half_space':
        return middle if local[2] > 1.0 - 1e-9 else np.inf
    along = middle + 0.5 * size[1] * abs(local[2])
    return along + size[0] * (np.linalg.norm(local) if kind == 'capsule' else np.hypot(*local[:2]))


def gap(one, pose, other, other_pose, normal):
    """Width of the empty slab between two shapes across a normal (3,), negative if none.

    The signed distance of convex shapes is the widest gap of all normals.
    """
    return -support(one, pose, -normal) - support(other, other_pose, normal)
