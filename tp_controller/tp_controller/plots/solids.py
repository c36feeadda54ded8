"""Shapes as triangles, lit and sorted by depth with everything else of a picture."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pinocchio as pin
import trimesh
from numpy.typing import NDArray

from tp_controller.robot import Shape

Array = NDArray[np.float64]
LIGHT = np.array([0.35, -0.45, 0.82])
"""Direction to the light."""
DARK = 0.45
"""What is left of a color on the side that the light does not reach."""


def triangles(shape: Shape, wall: float = 1.0) -> Array:
    """Corners (f, 3, 3) [m] of a shape's surface in the frame of its pose.

    Parameters
    ----------
    shape
        The shape.
    wall
        Half the side [m] of the square that stands for a half-space.
    """
    if shape.kind == 'half_space':
        return moved(_square(wall, 12), shape.pose)
    if shape.kind == 'box':
        mesh = trimesh.creation.box(shape.size)
        mesh = mesh.subdivide_to_size(max(max(shape.size) / 6.0, 1e-3))
    elif shape.kind == 'sphere':
        mesh = trimesh.creation.icosphere(3, shape.size[0])
    elif shape.kind == 'cylinder':
        mesh = trimesh.creation.cylinder(shape.size[0], shape.size[1], sections=28)
    else:
        mesh = trimesh.creation.capsule(shape.size[1], shape.size[0], count=[12, 12])
        mesh.apply_translation(-mesh.bounds.mean(axis=0))
    return moved(np.array(mesh.triangles), shape.pose)


def tube(start: Array, end: Array, radius: float) -> Array:
    """Corners (f, 3, 3) [m] of a capsule between two points (3,) [m]."""
    from tp_controller.robot import capsule

    return triangles(capsule(start, end, radius))


def moved(corners: Array, pose: pin.SE3) -> Array:
    """Corners (f, 3, 3) at a pose."""
    return np.asarray(corners @ pose.rotation.T + pose.translation)


def lit(corners: Array, color: Any) -> Array:
    """Colors (f, 4) of triangles (f, 3, 3) by their direction to the light."""
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = normals / np.where(lengths > 0.0, lengths, 1.0)
    bright = DARK + (1.0 - DARK) * np.clip(0.5 + 0.5 * normals @ LIGHT, 0.0, 1.0)
    rgba = np.ones((len(corners), 4))
    rgba[:, : len(color)] = color
    rgba[:, :3] *= bright[:, None]
    return rgba


def _square(half: float, cells: int) -> Array:
    """A square of triangles in the plane z = 0: small ones are sorted well by depth."""
    line = np.linspace(-half, half, cells + 1)
    found = []
    for x, x_next in pairwise(line):
        for y, y_next in pairwise(line):
            a, b, c, d = (x, y, 0.0), (x_next, y, 0.0), (x_next, y_next, 0.0), (x, y_next, 0.0)
            found += [(a, b, c), (a, c, d)]
    return np.array(found)
