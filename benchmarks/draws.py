"""Random starts and goals of the arms in config/, the same ones for all that are compared."""

from __future__ import annotations

import numpy as np

from tp_controller.robot import Robot

ARMS = {'panda': 'Panda', 'ur5': 'UR5', 'kinova': 'Kinova'}
SEED = 1


def draw(robot: Robot, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Starts and configurations of goals (count, n) [rad], uniform inside the ranges.

    A joint that turns without end takes any angle.
    """
    limits = robot.limits
    lower = np.where(np.isinf(limits.position_min), -np.pi, limits.position_min)
    upper = np.where(np.isinf(limits.position_max), np.pi, limits.position_max)
    pairs = np.random.default_rng(SEED).uniform(lower, upper, (count, 2, robot.n))
    return pairs[:, 0], pairs[:, 1]
