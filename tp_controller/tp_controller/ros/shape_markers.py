"""Shapes in RViz: obstacles and the bodies of an arm."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pinocchio as pin
from geometry_msgs.msg import Pose
from visualization_msgs.msg import Marker

from tp_controller.robot import Shape

WALL = 4.0
"""Sides [m] of the square that stands for a half-space."""
THICKNESS = 0.01
"""Thickness [m] of that square."""


def shape_markers(shape: Shape, pose: pin.SE3) -> Iterator[Marker]:
    """Markers of a shape in a frame, with type, pose and scale.

    Parameters
    ----------
    shape
        The shape.
    pose
        Pose of the frame that the shape is in.
    """
    place = pose * shape.pose
    if shape.kind == 'box':
        yield _marker(Marker.CUBE, place, shape.size)
    elif shape.kind == 'half_space':
        under = pin.SE3(np.eye(3), np.array([0.0, 0.0, -0.5 * THICKNESS]))
        yield _marker(Marker.CUBE, place * under, (WALL, WALL, THICKNESS))
    else:
        width = 2.0 * shape.size[0]
        if shape.kind != 'sphere':
            yield _marker(Marker.CYLINDER, place, (width, width, shape.size[1]))
        balls = shape.ends() if shape.kind == 'capsule' else (shape,)
        for ball in balls if shape.kind != 'cylinder' else ():
            yield _marker(Marker.SPHERE, pose * ball.pose, (width, width, width))


def _marker(kind: int, place: pin.SE3, scale: tuple[float, ...]) -> Marker:
    marker = Marker(type=kind, action=Marker.ADD, pose=pose_message(place))
    marker.scale.x, marker.scale.y, marker.scale.z = scale
    return marker


def pose_message(place: pin.SE3) -> Pose:
    """Message of a pose."""
    pose = Pose()
    x, y, z = place.translation.tolist()
    pose.position.x, pose.position.y, pose.position.z = x, y, z
    a, b, c, w = pin.Quaternion(place.rotation).coeffs().tolist()
    pose.orientation.x, pose.orientation.y, pose.orientation.z, pose.orientation.w = a, b, c, w
    return pose
