"""Random configurations of an arm."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from tp_controller.robot.model import Robot

Vector = NDArray[np.float64]

TURN = 2.0 * math.pi
"""Range [rad, m] of random positions of a joint without limits, about zero."""


def random_configuration(robot: Robot, rng: np.random.Generator) -> Vector:
    """Draw a configuration (nq,) [rad, m] uniformly inside the ranges.

    A joint that has no end gets half a turn to that side of zero. A base goes the first half of
    such a way, turns, and goes the rest: so it gets everywhere, whatever its velocities are.
    """
    limits = robot.limits
    low = np.where(np.isfinite(limits.position_min), limits.position_min, -0.5 * TURN)
    high = np.where(np.isfinite(limits.position_max), limits.position_max, 0.5 * TURN)
    way: Vector = rng.uniform(low, high)
    if not robot.space.blocks:
        return way
    return robot.integrate(robot.integrate(robot.neutral, 0.5 * way), 0.5 * way)
