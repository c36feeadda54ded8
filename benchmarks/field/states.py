"""States of the comparison: random ones, clear ones and a path."""

from collections.abc import Callable

import numpy as np

from field.robots import HAND, SPHERES
from tp_controller.robot import Robot

PERIOD = 1e-3
"""Time [s] from one step to the next."""
TIP = 0.01
"""Radius [m] of the sphere around the tip, for libraries that keep shapes apart, not points."""
MARGIN = 0.03
"""Distance [m] that every state has from obstacles."""
POINTS = [
    {'name': 'left', 'shape': 'sphere', 'center': [0.45, 0.35, 0.5], 'radius': 0.12 - TIP},
    {'name': 'right', 'shape': 'sphere', 'center': [0.45, -0.35, 0.5], 'radius': 0.12 - TIP},
    {'name': 'low', 'shape': 'sphere', 'center': [0.6, 0.0, 0.2], 'radius': 0.12 - TIP},
]
ROOM = [
    {'name': 'table', 'shape': 'box', 'center': [0.5, 0.0, -0.05], 'size': [2.0, 2.0, 0.1]},
    {'name': 'pillar', 'shape': 'box', 'center': [0.45, -0.45, 0.4], 'size': [0.15, 0.15, 0.8]},
    {'name': 'ball', 'shape': 'sphere', 'center': [0.5, 0.3, 0.6], 'radius': 0.12},
]
LINK_PAIRS = [
    ('panda_link2', 'panda_link5'),
    ('panda_link2', 'panda_link6'),
    ('panda_link2', 'panda_hand'),
    ('panda_link3', 'panda_link6'),
    ('panda_link3', 'panda_hand'),
]
"""Links of the Panda that can meet, and whose spheres are apart at rest."""


def random_states(
    robot: Robot, count: int, clear: Callable[[], bool] | None = None, singular: float = 0.05
) -> np.ndarray:
    """Configurations (count, n) within the ranges; a share of them has joints at zero.

    Joints at zero stretch the arm or align its axes, which is singular.
    """
    random = np.random.default_rng(5)
    lower = np.maximum(robot.limits.position_min, -np.pi)
    upper = np.minimum(robot.limits.position_max, np.pi)
    margin = 0.02 * (upper - lower)
    states: list[np.ndarray] = []
    while len(states) < count:
        q = random.uniform(lower + margin, upper - margin)
        if random.random() < singular:
            zero = np.clip(0.0, lower + margin, upper - margin)
            q = np.where(random.random(robot.n) < 0.7, zero, q)
        robot.update(q)
        if clear is None or clear():
            states.append(q)
    return np.array(states)


def path(robot: Robot, count: int, lead: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Smooth way (count, n) through most of the ranges, a time [s] ahead, and its velocity."""
    lower, upper = robot.limits.position_min, robot.limits.position_max
    rates = np.linspace(0.7, 1.3, robot.n)
    phases = np.outer(np.arange(count) * PERIOD + lead, rates) + np.arange(robot.n)
    size = 0.3 * (upper - lower)
    return (lower + upper) / 2 + size * np.sin(phases), size * rates * np.cos(phases)


def tip_is_clear(robot: Robot) -> bool:
    """Whether the tip is clear of all spheres."""
    tip = robot.frame(HAND).position
    return all(
        np.linalg.norm(tip - shape['center']) > shape['radius'] + TIP + MARGIN for shape in POINTS
    )


def arm_is_clear(robot: Robot) -> bool:
    """Whether all spheres of the arm are clear of the surroundings and of each other."""
    found = {}
    for link, spheres in SPHERES.items():
        frame = robot.frame(link)
        found[link] = [
            (np.array(frame.position) + frame.rotation @ np.array(ball[:3]), ball[3])
            for ball in spheres
        ]
    for place, radius in (ball for balls in found.values() for ball in balls):
        for shape in ROOM:
            offset = np.abs(place - shape['center']) - np.array(shape.get('size', [0.0] * 3)) / 2
            gap = np.linalg.norm(np.maximum(offset, 0.0)) - shape.get('radius', 0.0) - radius
            if 'radius' in shape:
                gap = np.linalg.norm(place - shape['center']) - shape['radius'] - radius
            if gap < MARGIN:
                return False
    return all(
        np.linalg.norm(one[0] - other[0]) > one[1] + other[1] + MARGIN
        for first, second in LINK_PAIRS
        for one in found[first]
        for other in found[second]
    )
