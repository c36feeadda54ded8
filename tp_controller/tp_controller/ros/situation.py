"""What a plan is made for, and whether it is still so."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from tp_controller.stack import Stack

Vector = NDArray[np.float64]

MOVED = 1e-3
"""Change [m, rad] of an obstacle that counts."""


class Situation:
    """Levels, limits and obstacles of a stack at one time.

    Parameters
    ----------
    stack
        The stack.
    """

    def __init__(self, stack: Stack) -> None:
        self._stack = stack
        self._objects, self._levels = _objects(stack), stack.hierarchy
        self._obstacles = _obstacles(stack)

    @property
    def rearranged(self) -> bool:
        """Whether levels or limits are others by now."""
        objects = _objects(self._stack)
        same = len(objects) == len(self._objects) and all(
            a is b for a, b in zip(objects, self._objects, strict=True)
        )
        return not same or self._stack.hierarchy != self._levels

    @property
    def moved(self) -> bool:
        """Whether an obstacle is elsewhere by now; to be asked unless `rearranged`."""
        now = _obstacles(self._stack)
        pairs = zip(now, self._obstacles, strict=True)
        return any(np.abs(a - b).max(initial=0.0) > MOVED for a, b in pairs)


def _objects(stack: Stack) -> Sequence[object]:
    return [stack.robot.limits, *(task for level in stack.members for task in level)]


def _obstacles(stack: Stack) -> list[Vector]:
    return [task.settings[0] for level in stack.members for task in level if task.set_based]
