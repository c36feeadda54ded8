"""How tasks tell compiled code what their rows are."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from tp_controller.robot import Frame

POSITION, HEADING, ROTATION, TILT, JOINTS = range(5)
"""Kinds of parts: the position of a frame; its angle about one axis, its rotation, its rotation
but for turns about one axis; positions of joints."""

KIND, FIRST, COUNT, FRAME, REFERENCE, AXES, AXIS, CARRIED = range(8)
"""Columns of a plan: kind, first row, number of rows, which of the frames is controlled, seen
from and gives the axes (`BASE`, or `REFERENCES` axes), the axis of `HEADING` and `TILT`, and
whether that is carried by the frame."""
COLUMNS = 8
BASE, REFERENCES = -1, -2
"""In place of a frame: the base; the frame that is seen from."""


class Part(NamedTuple):
    """Rows of a task that are errors of one kind."""

    kind: int
    places: Sequence[int]
    """Which row of a twist, or which joint, each row is."""
    frame: Frame | None = None
    """Frame that is controlled."""
    reference: Frame | None = None
    """Frame that it is seen from; the base if None."""
    axes: Frame | None = None
    """Frame along whose axes the rows are; those of the reference if None."""
    axis: int = -1
    """The one axis that counts, or that does not."""
    carried: bool = False
    """Whether that axis turns with the frame."""
    wraps: Sequence[int] = ()
    """Rows whose error wraps."""
