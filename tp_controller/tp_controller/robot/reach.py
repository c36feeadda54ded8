"""How far along a chain of joints a shape can be, and hence how fast each joint can move it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]

Path = Sequence[tuple[int, bool]]
"""Joints that are crossed on the way from one link to another, each with whether that leads
towards the base."""


def joint_path(model: pin.Model, start: int, end: int) -> list[tuple[int, bool]]:
    """Joints between the link of one joint and that of another; joint 0 carries the base."""
    up, down = _ancestors(model, start), _ancestors(model, end)
    path = [(joint, True) for joint in up if joint not in down]
    return path + [(joint, False) for joint in reversed(down) if joint not in up]


def path_speeds(
    model: pin.Model, slides: Vector, path: Path, points: Matrix, radius: float
) -> Vector:
    """Bound (m,) on the speed of a shape seen from the end of a path, per joint speed.

    At any configuration: for a turning joint the farthest that the shape can be from the
    joint's axis, which is the length of the chain in between without what lies along the
    axis; for a sliding one 1. Joints that are not on the path have zero.

    Parameters
    ----------
    model
        The model, with m joints of one position each.
    slides
        Farthest position (m,) [m] of every sliding joint from its zero, either way.
    path
        Joints from the link with the shape outwards.
    points, radius
        Balls around points (p, 3) [m] of that link, in the frame of its joint, whose convex
        hull contains the shape.
    """
    bounds, data = np.zeros(model.nv), model.createData()
    for joint, up in path:
        row = model.joints[joint].idx_v
        placement = model.jointPlacements[joint]
        if not up:
            points = (points - placement.translation) @ placement.rotation
        subspace = np.ravel(data.joints[joint].S)
        turning = bool(subspace[3:].any())
        axis = subspace[3:] if turning else subspace[:3]
        aside = points - np.outer(points @ axis, axis)
        bounds[row] = radius + _longest(aside) if turning else 1.0
        radius += _longest(points) + (0.0 if turning else slides[row])
        points = placement.translation[None] if up else np.zeros((1, 3))
    return bounds


def _ancestors(model: pin.Model, joint: int) -> list[int]:
    chain = []
    while joint > 0:
        chain.append(joint)
        joint = model.parents[joint]
    return chain


def _longest(vectors: Matrix) -> float:
    return float(np.sqrt(np.einsum('ij,ij->i', vectors, vectors).max()))
