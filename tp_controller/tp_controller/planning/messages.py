"""What is asked of a planner in a process of its own, and what it replies."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tp_controller.config import Settings
from tp_controller.config.changes import HIERARCHY
from tp_controller.interpolation import VectorPath
from tp_controller.parameters import Flat
from tp_controller.planning.planner import Phase, Plan
from tp_controller.stack import Stack

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]


class Request(NamedTuple):
    """What is asked of a planner."""

    number: int
    """Comes back with every reply."""
    parameters: Flat
    """Parameters of the controller by dotted key, without targets."""
    description: str | None
    """URDF for parameters that name no robot."""
    targets: Mapping[str, Vector]
    """Targets of all tasks that have one, centres of obstacles included."""
    goals: Mapping[str, Vector]
    tolerances: Mapping[str, float]
    q: Vector
    """Configuration (nq,) [rad, m] of the arm at rest."""
    straight: bool
    """Whether the straight way is looked at first."""
    rest: tuple[VectorPath, float] | None = None
    """A way, and the time [s] on it: whether what is left of it is clear is all that is asked."""


class Found(NamedTuple):
    """A plan, with what is shown of it."""

    plan: Plan
    places: Matrix
    """Places (m, 3) [m] of the controlled frame along the way; none without a way."""


class Judged(NamedTuple):
    """What a way is that was asked about."""

    clear: bool


class Failed(NamedTuple):
    """Nothing can be planned."""

    text: str


Reply = Phase | Found | Judged | Failed


def asked_parameters(settings: Settings) -> Flat:
    """Parameters of a request: those of a controller as they are now, without targets."""
    hierarchy = {HIERARCHY: tuple(settings.stack.hierarchy) or ('',)}
    return {
        key: value
        for key, value in (settings.values | hierarchy).items()
        if value not in (None, ()) and not (key.startswith('tasks.') and key.endswith('.target'))
    }


def asked_targets(stack: Stack) -> dict[str, Vector]:
    """Targets of a request: those of all tasks that have one."""
    return {
        name: task.settings[0]
        for name, task in stack.tasks.items()
        if task.target_size and task.settings[0].size
    }
