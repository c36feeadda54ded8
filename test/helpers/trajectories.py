"""Trajectory messages for tests."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from builtin_interfaces.msg import Duration
from geometry_msgs.msg import Quaternion, Transform, Twist, Vector3
from trajectory_msgs.msg import (
    JointTrajectory,
    JointTrajectoryPoint,
    MultiDOFJointTrajectory,
    MultiDOFJointTrajectoryPoint,
)


def duration(seconds: float) -> Duration:
    """Time [s] as a message."""
    nanoseconds = round(1e9 * seconds)
    return Duration(sec=nanoseconds // 10**9, nanosec=nanoseconds % 10**9)


def joint_trajectory(
    joints: Sequence[str],
    times: Sequence[float],
    positions: Any,
    velocities: Any = None,
    accelerations: Any = None,
) -> JointTrajectory:
    """Trajectory of joints; rows are points."""
    msg = JointTrajectory(joint_names=list(joints))
    for i, time in enumerate(times):
        point = JointTrajectoryPoint(time_from_start=duration(time))
        columns = {
            'positions': positions,
            'velocities': velocities,
            'accelerations': accelerations,
        }
        for key, rows in columns.items():
            if rows is not None:
                setattr(point, key, [float(value) for value in rows[i]])
        msg.points.append(point)
    return msg


def frame_trajectory(
    times: Sequence[float],
    places: Any,
    quaternions: Any = None,
    velocities: Any = None,
    frame: str = '',
) -> MultiDOFJointTrajectory:
    """Trajectory of a frame; rows of places and velocities have x y and, if need be, z."""
    msg = MultiDOFJointTrajectory()
    msg.header.frame_id = frame
    for i, time in enumerate(times):
        point = MultiDOFJointTrajectoryPoint(time_from_start=duration(time))
        transform = Transform(translation=_vector(places[i]))
        if quaternions is not None:
            x, y, z, w = (float(value) for value in quaternions[i])
            transform.rotation = Quaternion(x=x, y=y, z=z, w=w)
        point.transforms = [transform]
        if velocities is not None:
            point.velocities = [Twist(linear=_vector(velocities[i]))]
        msg.points.append(point)
    return msg


def _vector(values: Sequence[float]) -> Vector3:
    return Vector3(**dict(zip('xyz', (float(value) for value in values), strict=False)))


def circle(start: Sequence[float], radius: float, period: float, times: Any) -> tuple[Any, Any]:
    """Places and velocities (m, 2) of a circle from a point on, at times (m,)."""
    angle = 2.0 * np.pi * np.asarray(times) / period
    round_ = np.stack([np.cos(angle) - 1.0, np.sin(angle)], axis=1)
    speed = 2.0 * np.pi / period * np.stack([-np.sin(angle), np.cos(angle)], axis=1)
    return np.array(start[:2]) + radius * round_, radius * speed
