"""Where the target of a task is, and the values of a target that is somewhere else."""

from __future__ import annotations

import math
from collections.abc import Collection
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from tp_controller.robot import Frame, Robot
from tp_controller.rotations import rotation_from_quaternion

Vector = NDArray[np.float64]

AXES = ('x', 'y', 'z')
ANGLES = ('rx', 'ry', 'rz')
QUATERNION = ('qx', 'qy', 'qz', 'qw')


class Freedom(NamedTuple):
    """How a target can be moved."""

    axes: tuple[bool, bool, bool]
    """Along which axes of the frame that it is seen from."""
    turns: tuple[bool, bool, bool]
    """About which."""


def freedom(task: Any, types: Collection[str]) -> Freedom | None:
    """How the target of a task can be moved in space; None if it cannot.

    Parameters
    ----------
    task
        The task as ``~/state`` tells it.
    types
        Types of tasks that take goals.
    """
    names = set(task.target_components)
    if task.type not in types or not names or not names <= {*AXES, *ANGLES, *QUATERNION}:
        return None
    if not task.frame and task.type != 'obstacle':
        return None
    along = tuple(axis in names for axis in AXES)
    about = tuple('qw' in names or angle in names for angle in ANGLES)
    return Freedom(along, about)  # type: ignore[arg-type]


def has_values(task: Any) -> bool:
    """Whether the task has a target: it has none before the first joint state."""
    return len(task.desired) > 0 and all(math.isfinite(value) for value in task.desired)


def target_place(robot: Robot, task: Any) -> pin.SE3:
    """Pose of a task's target in the base frame; what it leaves free is as it is now.

    Parameters
    ----------
    robot
        The robot at its present configuration.
    task
        The task as ``~/state`` tells it.

    Raises
    ------
    InvalidValue
        If the robot has no such frame.
    """
    seen = _seen_from(robot, task)
    place = seen.actInv(_pose(robot.frame(task.frame))) if task.frame else pin.SE3.Identity()
    names = task.target_components if has_values(task) else ()
    values = dict(zip(names, task.desired, strict=False))
    for i, axis in enumerate(AXES):
        if axis in values:
            place.translation[i] = values[axis]
    if 'qw' in values:
        place.rotation = rotation_from_quaternion(np.array([values[name] for name in QUATERNION]))
    for i, angle in enumerate(ANGLES):
        if angle in values:
            place.rotation = pin.exp3(values[angle] * np.eye(3)[i])
    return seen.act(place)


def handle_place(robot: Robot, task: Any) -> pin.SE3:
    """`target_place`, with the axes of the frame seen from where it has no rotation."""
    place = target_place(robot, task)
    if not set(task.target_components) & {*ANGLES, *QUATERNION}:
        place.rotation = _seen_from(robot, task).rotation
    return place


def target_values(robot: Robot, task: Any, place: pin.SE3) -> list[float]:
    """Values of a task's target at a pose in the base frame, in the order of its components."""
    local = _seen_from(robot, task).actInv(place)
    x, y, z, w = pin.Quaternion(local.rotation).coeffs().tolist()
    found = dict(zip(AXES, local.translation.tolist(), strict=True))
    found |= {'qx': x, 'qy': y, 'qz': z, 'qw': w}
    for i, name in enumerate(ANGLES):
        j, k = (i + 1) % 3, (i + 2) % 3
        found[name] = math.atan2(local.rotation[k, j], local.rotation[j, j])
    return [float(found[name]) for name in task.target_components]


def _seen_from(robot: Robot, task: Any) -> pin.SE3:
    return _pose(robot.frame(task.relative_to) if task.relative_to else robot.base)


def _pose(frame: Frame) -> pin.SE3:
    return pin.SE3(np.array(frame.rotation), np.array(frame.position))
