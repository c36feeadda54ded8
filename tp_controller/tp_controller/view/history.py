"""The last seconds of some values."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]


KEPT = 60.0
"""Time [s] that is kept."""


class History:
    """Values over the last seconds; its memory does not grow.

    Parameters
    ----------
    count
        Number of values.
    seconds
        Time [s] that is kept.
    rate
        Samples per second [Hz]; those that come sooner are left out.
    """

    def __init__(self, count: int, seconds: float = KEPT, rate: float = 10.0) -> None:
        self.seconds = seconds
        self._period = 1.0 / rate
        self._size = round(seconds * rate) + 1
        # The newest sample is the last one; at the end of the room it moves to the front.
        self._room = np.full((count + 1, 2 * self._size), np.nan)
        self._end = 0

    def add(self, time: float, values: Vector) -> bool:
        """Keep values (count,) at a time [s]; return whether they are kept.

        A time before the last one begins anew.
        """
        if self._end:
            since = time - self._room[0, self._end - 1]
            if since < 0.0:
                self._end = 0
            elif since < 0.99 * self._period:
                return False
        if self._end == self._room.shape[1]:
            self._room[:, : self._size] = self._room[:, self._size :]
            self._end = self._size
        self._room[0, self._end] = time
        self._room[1:, self._end] = values
        self._end += 1
        return True

    def clear(self) -> None:
        """Forget all values."""
        self._end = 0

    def recent(self) -> tuple[Vector, Matrix]:
        """Times (m,) [s], 0 for the newest and negative before, and values (count, m)."""
        first = max(self._end - self._size, 0)
        part = self._room[:, first : self._end]
        if not part.shape[1]:
            return part[0].copy(), part[1:].copy()
        times = part[0] - part[0, -1]
        kept = times >= -self.seconds
        return times[kept], part[1:, kept]
