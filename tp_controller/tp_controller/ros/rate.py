"""The rate of joint states, found where the parameters do not tell it."""

from __future__ import annotations

import statistics
import time
from itertools import pairwise

from builtin_interfaces.msg import Time

STATES = 20
"""So many intervals between joint states are looked at."""


class RateEstimate:
    """Finds the rate of joint states from the first ones: the median of their intervals.

    Intervals are measured by the stamps; where these do not go on, by the steady clock.
    """

    def __init__(self) -> None:
        self._stamps: list[float] = []
        self._arrivals: list[float] = []

    def see(self, stamp: Time) -> float | None:
        """Take a joint state into account.

        Returns
        -------
        float or None
            The rate [Hz], once it is known.
        """
        self._stamps.append(stamp.sec + 1e-9 * stamp.nanosec)
        self._arrivals.append(time.monotonic())
        if len(self._stamps) <= STATES:
            return None
        for times in (self._stamps, self._arrivals):
            steps = [after - before for before, after in pairwise(times)]
            # A state that is sent again has the same stamp.
            steps = [step for step in steps if step > 0.0]
            if len(steps) > STATES // 2:
                return 1.0 / statistics.median(steps)
        return None
