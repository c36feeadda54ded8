"""What a stack tells of a step."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]


class LevelResult(NamedTuple):
    """What one level asked for and got in the last step."""

    tasks: tuple[str, ...]
    """Names of the level's tasks, in the order of their rows."""
    requested: Vector
    """Desired task velocity (k,) [m/s, rad/s]."""
    achieved: Vector
    """Task velocity of the command (k,) [m/s, rad/s]."""


class Rows(NamedTuple):
    """All rows of the hierarchy; arrays that steps write to until the hierarchy changes."""

    parts: Mapping[str, slice]
    """Which rows belong to each task, by name."""
    J: Matrix
    """Jacobian (K, n)."""
    requested: Vector
    """Desired task velocity (K,)."""


class System(NamedTuple):
    """One level of the last step, row by row."""

    J: Matrix
    """Jacobian (k, n)."""
    counts: NDArray[np.bool_]
    """Whether each row was resolved (k,); bounds that nothing breaks are not."""
    requested: Vector
    """Desired task velocity (k,)."""
    answered: Vector
    """Task velocity of the solver's answer (k,)."""
    achieved: Vector
    """Task velocity of the command (k,), which the safety filter may have changed."""


Layout = list[tuple[tuple[str, ...], slice, slice]]
"""Names of the tasks of every level, and where a step has what it asked for and got."""


class Step:
    """Result of one step.

    Attributes
    ----------
    command
        Joint velocity (n,) [rad/s, m/s].
    scale
        What the velocity limits cost, see `Solver.solve`; 1 if none was reached.
    """

    __slots__ = ('_answers', '_layout', 'command', 'scale')

    def __init__(self, answers: Vector, n: int, scale: float, layout: Layout) -> None:
        self._answers, self._layout = answers, layout
        self.command, self.scale = answers[:n], scale

    @property
    def levels(self) -> tuple[LevelResult, ...]:
        """One result per level, highest first."""
        found = self._answers
        levels = [
            LevelResult(names, found[asked], found[got]) for names, asked, got in self._layout
        ]
        return tuple(levels)


def read_only(array: Vector) -> Vector:
    """View of an array that cannot be written to."""
    view = array.view()
    view.flags.writeable = False
    return view
