"""How often the controller answers, and how old its commands are."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from tp_interfaces.msg import ControllerState
from tp_sim.harness.record import stamp_ns


class Timing(NamedTuple):
    """Rate and ages over some time."""

    rate: float
    """Cycles per second of the joint states' stamps [Hz]."""
    age: float
    """Median of the ages of the commands [s]; NaN if there were none."""
    late_age: float
    """Age [s] that one command in a hundred exceeds; NaN if there were none."""
    period: float
    """Median time [s] between joint states that were answered."""

    @property
    def text(self) -> str:
        """The same in words."""
        found = f'{self.rate:.4g} Hz'
        if math.isfinite(self.age):
            ages = f'{1e3 * self.age:.2g} ms, 99 % {1e3 * self.late_age:.2g} ms'
            found += f'; age of the commands: median {ages}'
        return found

    @property
    def late(self) -> bool:
        """Whether more than one command in a hundred is older than a period."""
        return self.late_age > self.period


class Stopwatch:
    """Collects what `Timing` is made of."""

    def __init__(self) -> None:
        self._cycles: list[int] = []
        self._stamps: list[int] = []
        self._ages: list[float] = []

    def follow(self, state: ControllerState) -> None:
        """Take a state into account, if it is about a further cycle."""
        if state.status != ControllerState.RUNNING or state.cycles in self._cycles[-1:]:
            return
        self._cycles.append(state.cycles)
        self._stamps.append(stamp_ns(state))
        self._ages.append(state.command_age)

    def __len__(self) -> int:
        return len(self._cycles)

    def timing(self, begin: int = 0) -> Timing:
        """Timing from the ``begin``-th state on that was followed."""
        cycles = np.diff(self._cycles[begin:])
        time = 1e-9 * np.diff(self._stamps[begin:])
        if not cycles.sum() or not time.sum() > 0.0:
            return Timing(math.nan, math.nan, math.nan, math.nan)
        ages = np.array(self._ages[begin:])
        return Timing(
            float(cycles.sum() / time.sum()),
            float(np.median(ages)),
            float(np.percentile(ages, 99)),
            float(np.median(time / np.maximum(cycles, 1))),
        )
