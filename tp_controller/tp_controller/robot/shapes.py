"""Simple convex shapes, for the links of an arm and for what they keep clear of."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from tp_controller.errors import InvalidValue, plural, shown

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]

CAPSULE_WORDS = 'x y z of the start, x y z of the end and a radius above 0 [m]'
CENTRE_STEPS = 60
"""Steps towards the centre of the smallest circle: it is found within about one percent."""
DIRECTIONS = 400
"""Directions whose farthest vertices stand for a mesh while a capsule is fitted to it."""
TILTS = (0.3, 0.1, 0.03)
"""Changes [rad] of a capsule's axis that are tried while it is fitted."""


class Shape(NamedTuple):
    """A convex shape at a pose in a link or, an obstacle, in the base frame."""

    kind: str
    """``sphere``, ``capsule``, ``cylinder``, ``box`` or ``half_space``."""
    size: tuple[float, ...]
    """Sphere: radius. Capsule and cylinder: radius, and length along z between the centres
    of the ends. Box: sides along x, y and z. Half-space: nothing, it is all that is below
    z = 0. All in metres."""
    pose: pin.SE3
    """Of the centre; of any point of a half-space's surface."""

    def geometry(self) -> coal.CollisionGeometry:
        """Make the shape for coal."""
        if self.kind == 'sphere':
            # coal 3.0.3 leads a Sphere out of a Cylinder by the side only.
            return coal.Capsule(self.size[0], 0.0)
        if self.kind == 'capsule':
            return coal.Capsule(*self.size)
        if self.kind == 'cylinder':
            return coal.Cylinder(*self.size)
        if self.kind == 'box':
            return coal.Box(*self.size)
        return coal.Halfspace(np.array([0.0, 0.0, 1.0]), 0.0)

    def hull(self) -> tuple[Matrix, float]:
        """Points (p, 3) [m] and a radius [m]: balls whose convex hull contains the shape."""
        if self.kind == 'half_space':
            return self.pose.translation[None], math.inf
        if self.kind == 'box':
            signs = np.array(np.meshgrid(*[(-0.5, 0.5)] * 3)).reshape(3, -1).T
            points, radius = signs * self.size, 0.0
        else:
            half = 0.5 * self.size[1] if len(self.size) > 1 else 0.0
            ends = (-half, half) if half else (0.0,)
            points, radius = np.array([[0.0, 0.0, end] for end in ends]), self.size[0]
        return points @ self.pose.rotation.T + self.pose.translation, radius

    def ends(self) -> tuple[Shape, ...]:
        """Balls at the start and the end of a capsule; none of other shapes."""
        if self.kind != 'capsule':
            return ()
        points, radius = self.hull()
        return tuple(sphere(radius, point) for point in points)

    def moved(self, pose: pin.SE3) -> Shape:
        """Return the same shape as seen from a frame in which its own has that pose."""
        return self._replace(pose=pose * self.pose)


def sphere(radius: float, center: Sequence[float] | Vector = (0.0, 0.0, 0.0)) -> Shape:
    """Sphere of a radius [m] around a centre (3,) [m]."""
    return Shape('sphere', (float(radius),), pin.SE3(np.eye(3), np.array(center, dtype=float)))


def capsule(
    start: Sequence[float] | Vector, end: Sequence[float] | Vector, radius: float
) -> Shape:
    """All that is within a radius [m] of the line from start to end (3,) [m]."""
    start, end = np.array(start, dtype=float), np.array(end, dtype=float)
    length = float(np.linalg.norm(end - start))
    if length == 0.0:
        return sphere(radius, start)
    pose = pin.SE3(rotation_to(end - start), 0.5 * (start + end))
    return Shape('capsule', (float(radius), length), pose)


def half_space(point: Sequence[float] | Vector, normal: Sequence[float] | Vector) -> Shape:
    """All that lies behind the plane through a point (3,) [m] with an outward normal (3,)."""
    return Shape('half_space', (), pin.SE3(rotation_to(normal), np.array(point, dtype=float)))


def rotation_to(direction: Sequence[float] | Vector) -> Matrix:
    """Rotation (3, 3) that brings z to a direction (3,) of any length but zero."""
    z = np.array([0.0, 0.0, 1.0])
    turn = pin.Quaternion.FromTwoVectors(z, np.array(direction, dtype=float))
    return turn.toRotationMatrix()


def read_capsules(values: Sequence[float]) -> tuple[Shape, ...]:
    """Capsules of a parameter: for each x y z of its start, x y z of its end and a radius [m].

    Raises
    ------
    InvalidValue
        For a number of values that is not a multiple of seven, one that is not finite or a
        radius that is not above zero.
    """
    if not values or len(values) % 7:
        raise InvalidValue(
            'capsules',
            f'{plural(len(values), "value")} {shown(values)}',
            f'7 a capsule: {CAPSULE_WORDS}',
        )
    rows = np.array(values, dtype=float).reshape(-1, 7)
    for row in rows:
        if not (np.all(np.isfinite(row)) and row[6] > 0.0):
            raise InvalidValue('capsules', shown(row), CAPSULE_WORDS)
    return tuple(capsule(row[:3], row[3:6], row[6]) for row in rows)


def fitted_capsule(vertices: Matrix) -> Shape:
    """Fit a small capsule round points (v, 3) [m].

    Of the axes that are tried, the principal ones of the points, those of the frame and
    small tilts of the best, the one whose capsule has the smallest volume. Every point is
    inside, hence so is all that is spanned by them.
    """
    outer = vertices[np.unique(np.argmax(vertices @ _directions().T, axis=0))]
    spread = np.linalg.eigh(np.cov(outer.T) if len(outer) > 1 else np.eye(3))[1].T
    volume, _, axis = min(
        ((_volume(outer, axis), i, axis) for i, axis in enumerate([*spread, *np.eye(3)])),
        key=lambda found: found[:2],
    )
    for tilt in TILTS:
        for sideways in rotation_to(axis).T[:2]:
            for sign in (-tilt, tilt):
                other = axis + sign * sideways
                other /= np.linalg.norm(other)
                changed = _volume(outer, other)
                if changed < volume:
                    volume, axis = changed, other
    return capsule(*_ends(vertices, axis, _centre(outer, axis)))


def _directions() -> Matrix:
    """Directions (d, 3) all over a sphere, on Fibonacci's spiral."""
    i = np.arange(DIRECTIONS) + 0.5
    z, angle = 1.0 - 2.0 * i / DIRECTIONS, math.pi * (1.0 + math.sqrt(5.0)) * i
    ring = np.sqrt(1.0 - z * z)
    return np.stack([ring * np.cos(angle), ring * np.sin(angle), z], axis=1)


def _volume(points: Matrix, axis: Vector) -> float:
    start, end, radius = _ends(points, axis, _centre(points, axis))
    length = float(np.linalg.norm(end - start))
    return math.pi * radius**2 * (length + 4.0 / 3.0 * radius)


def _centre(points: Matrix, axis: Vector) -> Vector:
    """Point (3,) that the axis of a thin cylinder round points passes (Bădoiu, Clarkson 2003)."""
    flat = points - np.outer(points @ axis, axis)
    centre = 0.5 * (flat.min(axis=0) + flat.max(axis=0))
    for i in range(1, CENTRE_STEPS + 1):
        way = flat - centre
        farthest = np.argmax(np.einsum('ij,ij->i', way, way))
        centre = centre + way[farthest] / (i + 1)
    return centre


def _ends(points: Matrix, axis: Vector, centre: Vector) -> tuple[Vector, Vector, float]:
    """Ends of the shortest capsule round points whose axis passes a centre, and its radius."""
    heights = (points - centre) @ axis
    aside = points - centre - np.outer(heights, axis)
    squares = np.einsum('ij,ij->i', aside, aside)
    # A little more, so that rounding leaves no point outside.
    radius = (1.0 + 1e-9) * math.sqrt(float(squares.max())) + 1e-9
    caps = np.sqrt(radius**2 - squares)
    low, high = float((heights + caps).min()), float((heights - caps).max())
    if low > high:
        low = high = 0.5 * (low + high)
    return centre + low * axis, centre + high * axis, radius
