"""What the page in the browser and pictures draw of a robot and its tasks."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from tp_controller.robot import Robot, Shape
from tp_controller.tasks import ObstacleTask, Task, WholeArmTask

DISC = 0.02
"""Thickness [m] of an obstacle that counts in two axes."""


def is_planar(robot: Robot) -> bool:
    """Whether nothing of the robot leaves a plane of constant z."""
    return bool(np.all(np.abs(robot.twists[:, [2, 3, 4]]) < 1e-9))


def obstacle_shape(task: Task) -> Shape | None:
    """Shape of a task's obstacle in the base frame; of one in two axes a thin cylinder."""
    if isinstance(task, WholeArmTask):
        return task.obstacle
    if not isinstance(task, ObstacleTask):
        return None
    center = np.zeros(3)
    center[task.twist_rows] = task.center
    if len(task.twist_rows) == 3:
        return Shape('sphere', (task.radius,), pin.SE3(np.eye(3), center))
    left = [axis for axis in range(3) if axis not in task.twist_rows]
    z = np.eye(3)[left[0]]
    turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), z).toRotationMatrix()
    return Shape('cylinder', (task.radius, DISC), pin.SE3(turn, center))
