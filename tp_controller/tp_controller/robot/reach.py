"""How far along a chain of joints a shape can be, and hence how fast each joint can move it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from tp_controller.robot.motions import BENDING, FREE

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


class Crossing(NamedTuple):
    """What a joint means for a shape beyond it; plain numbers, which are quicker one by one."""

    row: int
    """Its place among the velocities."""
    size: int
    """Number of its velocities: 1, 3 of a planar joint, 6 of a floating one."""
    turning: bool
    axis: tuple[float, float, float]
    """Direction of the axis in the joint's frame; of a planar joint that of its turns."""
    rotation: tuple[float, ...]
    """Of the joint's frame in that of the one before, row by row (9,)."""
    place: tuple[float, float, float]
    """Origin of the joint's frame in that of the one before [m]."""


def crossings(model: pin.Model) -> tuple[Crossing, ...]:
    """Facts about every joint of a model, that of the base included."""
    data, found = model.createData(), []
    for joint in range(model.njoints):
        pose = model.jointPlacements[joint]
        subspace = np.array(data.joints[joint].S).reshape(6, -1)[:, -1] if joint else np.zeros(6)
        turning = bool(subspace[3:].any())
        found.append(
            Crossing(
                model.joints[joint].idx_v,
                model.joints[joint].nv,
                turning,
                tuple((subspace[3:] if turning else subspace[:3]).tolist()),
                tuple(pose.rotation.ravel().tolist()),
                tuple(pose.translation.tolist()),
            )
        )
    return tuple(found)


def path_speeds(
    joints: Sequence[Crossing], slides: Vector, path: Path, points: Matrix, radius: float
) -> Vector:
    """Bound (m,) on the speed of a shape seen from the end of a path, per joint speed.

    At any configuration: for a turning joint the farthest that the shape can be from the
    joint's axis, which is the length of the chain in between without what lies along the
    axis; for a sliding one 1. A planar or floating joint slides and turns: it has both, and the
    turns of a floating one have the distance from its origin. Nothing is known of how far such a
    joint is from its parent. Joints that are not on the path have zero.

    Parameters
    ----------
    joints
        The `crossings` of the model, with m velocities.
    slides
        Farthest position (m,) [m] of every sliding joint from its zero, either way.
    path
        Joints from the link with the shape outwards.
    points, radius
        Balls around points (p, 3) [m] of that link, in the frame of its joint, whose convex
        hull contains the shape.
    """
    bounds, ends = np.zeros(sum(joint.size for joint in joints[1:])), points.tolist()
    for joint, up in path:
        row, size, turning, (a, b, c), rotation, (p, q, r) = joints[joint]
        if not up:
            ends = [_turned_back(rotation, x - p, y - q, z - r) for x, y, z in ends]
        far = max(x * x + y * y + z * z for x, y, z in ends)
        aside = max(
            (y * c - z * b) ** 2 + (z * a - x * c) ** 2 + (x * b - y * a) ** 2 for x, y, z in ends
        )
        if size > 1:
            # Seen from the parent, the shape is at an unknown distance from the axes.
            away = math.sqrt(far if size == FREE else aside) if up else math.inf
            bounds[row : row + size] = 1.0
            bounds[row + size - (3 if size == FREE else 1) : row + size] = max(
                BENDING, radius + away
            )
            radius = math.inf
        else:
            bounds[row] = radius + math.sqrt(aside) if turning else 1.0
            radius += math.sqrt(far) + (0.0 if turning else slides[row])
        ends = [(p, q, r) if up else (0.0, 0.0, 0.0)]
    return bounds


def _turned_back(R: Sequence[float], x: float, y: float, z: float) -> tuple[float, float, float]:
    """Vector in the frame of a rotation that is given row by row (9,)."""
    return (
        R[0] * x + R[3] * y + R[6] * z,
        R[1] * x + R[4] * y + R[7] * z,
        R[2] * x + R[5] * y + R[8] * z,
    )


def _ancestors(model: pin.Model, joint: int) -> list[int]:
    chain = []
    while joint > 0:
        chain.append(joint)
        joint = model.parents[joint]
    return chain
