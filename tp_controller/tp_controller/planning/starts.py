"""Configurations that searches begin at."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from tp_controller.planning.conditions import Conditions, Descent
from tp_controller.robot import Robot
from tp_controller.robot.draws import random_configuration

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]

SAMPLE = 256
"""Configurations of the stored sample,"""
NEAREST = 24
"""of which so many are starts, those with the least errors."""


def starts(conditions: Conditions, descent: Descent, seed: int) -> Iterator[Vector]:
    """Configurations (nq,) to begin at, without end."""
    yield conditions.q
    sample = stored_sample(conditions.robot)
    sizes = [float(np.linalg.norm(descent.errors(q))) for q in sample]
    order = np.argsort(sizes)
    rng = np.random.default_rng(seed)
    # Near ones may lie in one place; every other start is anywhere.
    for i in order[:NEAREST]:
        yield sample[i]
        yield random_configuration(conditions.robot, rng)
    while True:
        yield random_configuration(conditions.robot, rng)


_samples: dict[int, tuple[Robot, Matrix]] = {}


def stored_sample(robot: Robot) -> Matrix:
    """Random configurations (m, nq) of a robot inside its ranges, the same at every call."""
    if id(robot) not in _samples or _samples[id(robot)][0] is not robot:
        rng = np.random.default_rng(0)
        drawn = [random_configuration(robot, rng) for _ in range(SAMPLE)]
        _samples.clear()
        _samples[id(robot)] = robot, np.array(drawn)
    return _samples[id(robot)][1]
