"""Shapes of the library in the scene."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
import trimesh
import viser
from numpy.typing import NDArray

from tp_controller.robot import Shape

WALL = 2.0
"""Sides [m] of the square that stands for a half-space."""
THICKNESS = 0.01
"""Thickness [m] of that square."""

Color = tuple[int, int, int]
AXES: tuple[Color, ...] = ((204, 0, 0), (0, 204, 0), (0, 0, 204))
"""Colors of x, y and z."""


class Paint(NamedTuple):
    """How a solid looks."""

    color: Color
    opacity: float | None = None
    """None: nothing shines through."""
    shadow: bool = True


def add_solid(
    scene: viser.SceneApi, name: str, shape: Shape, paint: Paint, visible: bool = True
) -> viser.SceneNodeHandle:
    """Add a shape at its pose in the node above."""
    pose = shape.pose
    if shape.kind == 'half_space':
        pose = pose.act(pin.SE3(np.eye(3), np.array([0.0, 0.0, -0.5 * THICKNESS])))
    options: dict[str, Any] = {
        'color': paint.color,
        'opacity': paint.opacity,
        'cast_shadow': paint.shadow,
        'receive_shadow': paint.shadow,
        'position': pose.translation,
        'wxyz': wxyz(pose.rotation),
        'visible': visible,
        # What is flat looks the same with a material that takes less of a processor.
        'material': 'toon5' if _is_flat(shape) else 'standard',
    }
    if shape.kind == 'box':
        return scene.add_box(name, dimensions=shape.size, **options)  # type: ignore[arg-type]
    if shape.kind == 'half_space':
        return scene.add_box(name, dimensions=(WALL, WALL, THICKNESS), **options)
    if shape.kind == 'sphere':
        return scene.add_icosphere(name, shape.size[0], subdivisions=3, **options)
    if shape.kind == 'cylinder':
        return scene.add_cylinder(name, shape.size[0], shape.size[1], **options)
    mesh = trimesh.creation.capsule(shape.size[1], shape.size[0], count=[16, 16])
    # The middle of what trimesh makes is at its centre or at one end, by version.
    vertices = mesh.vertices - mesh.bounds.mean(axis=0)
    return scene.add_mesh_simple(name, vertices, mesh.faces, **options)


def _is_flat(shape: Shape) -> bool:
    disc = shape.kind == 'cylinder' and shape.size[1] < shape.size[0]
    return disc or shape.kind == 'half_space'


def add_axes(scene: viser.SceneApi, name: str, length: float) -> viser.LineSegmentsHandle:
    """Add the axes of a frame, each of a length [m] in its usual color."""
    ends = np.stack([np.zeros((3, 3)), length * np.eye(3)], axis=1).astype(np.float32)
    colors = np.repeat(np.array(AXES, np.uint8)[:, None], 2, axis=1)
    return scene.add_line_segments(name, ends, colors, thickness=4.0, thickness_units='screen')


def wxyz(rotation: NDArray[np.float64]) -> NDArray[np.float64]:
    """Quaternion w, x, y, z of a rotation matrix (3, 3)."""
    x, y, z, w = pin.Quaternion(rotation).normalized().coeffs()
    return np.array([w, x, y, z])


def put(handle: viser.SceneNodeHandle, place: pin.SE3) -> None:
    """Move a node to a pose, if it is not there."""
    if np.abs(handle.position - place.translation).max() > 1e-6:
        handle.position = place.translation
    turn = wxyz(place.rotation)
    if np.abs(handle.wxyz - turn).max() > 1e-6:
        handle.wxyz = turn
