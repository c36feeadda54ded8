"""Settings that every kind of task has: as parameters, and as keyword arguments."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TypedDict

import numpy as np
from numpy.typing import NDArray

from tp_controller.parameters import BOOLEAN, NUMBER, NUMBERS, REQUIRED, TEXT, Parameter
from tp_controller.solvers.inverses import INVERSES, Inverse

Vector = NDArray[np.float64]

COMMON: Mapping[str, Parameter] = {
    'type': Parameter(TEXT, 'Kind of task', default=REQUIRED),
    'enabled': Parameter(
        BOOLEAN,
        'Whether the task takes part; off, it is as if hierarchy did not list it',
        default=True,
        runtime=True,
    ),
    'gain': Parameter(
        NUMBERS,
        'Gain [1/s]: one value, one per row, or a full matrix row by row',
        default=(1.0,),
        runtime=True,
    ),
    'feedforward': Parameter(
        NUMBERS,
        'Desired task velocity added to the gain term, one value per row; zero when left out',
        runtime=True,
    ),
    'max_speed': Parameter(
        NUMBERS,
        'Largest speed [m/s, rad/s] that the task asks for, by its gain and feedforward together: '
        'one value, for a pose also one for the position and one for the rotation, for joints '
        'also one per joint; none when left out',
        runtime=True,
    ),
    'inverse': Parameter(
        TEXT, "This level's inverse in place of solver.inverse", choices=INVERSES
    ),
    'damping': Parameter(NUMBER, "This level's λ in place of solver.damping", minimum=0.0),
    'singular_region': Parameter(
        NUMBER, "This level's ε in place of solver.singular_region", above=0.0
    ),
    'weight': Parameter(
        NUMBER, 'Weight among all tasks with solver.type weighted', 1.0, above=0.0, runtime=True
    ),
    'time_scaling': Parameter(
        BOOLEAN,
        'Whether the time of a trajectory runs slower while limits or higher levels hold the task '
        'up, so that it stays on its path; else it falls behind and catches up',
        default=False,
        runtime=True,
    ),
    'around': Parameter(
        BOOLEAN,
        'Whether a way around is looked for by itself when a goal gets stuck',
        default=False,
        runtime=True,
    ),
    'target': Parameter(
        NUMBERS,
        'Desired value at start, that at the first joint state when left out; goals replace it',
        runtime=True,
    ),
}


class Common(TypedDict, total=False):
    """Settings that every task takes as keyword arguments; properties of the same names."""

    gain: float | Sequence[float]
    """Gain [1/s]: one value, one per row, or a full matrix (k, k) row by row; 1 when left out."""
    feedforward: Sequence[float] | Vector
    """Desired task velocity (k,) added to the gain term; zero when left out."""
    max_speed: float | Sequence[float] | Vector
    """Largest speed [m/s, rad/s] that it asks for: one value, or one for each of its
    `speed_groups`; none when left out."""
    target: Sequence[float] | Vector
    """Desired value (target_size,); that at the first step when left out."""
    inverse: Inverse
    """How its level is inverted; what is left open is the solver's way."""
    enabled: bool
    """Whether it takes part where the hierarchy lists it; True when left out."""
    weight: float
    """Weight in the scheme ``weighted``; 1 when left out."""
