"""What the relay records: joint states that it sent, commands that came, pauses of the machine."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple


class Sent(NamedTuple):
    """A joint state that was sent to the controller."""

    stamp: int
    """Its stamp as sent [ns]."""
    time: float
    """Time [s] at which it was sent."""
    taken: float
    """Time [s] at which the relay got what it says: what the relay holds back grows old."""
    usable: bool
    """Whether a controller may move the arm by it."""
    velocity: tuple[float, ...]
    """Joint velocities [rad/s, m/s] of the arm then."""


class Command(NamedTuple):
    """A command of the controller."""

    stamp: int
    """Its stamp [ns]; 0 if such commands have none."""
    time: float
    """Time [s] at which it was sent."""
    velocity: tuple[float, ...]
    """Joint velocities [rad/s, m/s]."""


class Motion(NamedTuple):
    """What the arm does, as the simulator says."""

    time: float
    """Time [s] at which the simulator sent it."""
    position: tuple[float, ...]
    """Joint positions [rad, m]."""
    velocity: tuple[float, ...]
    """Joint velocities [rad/s, m/s]."""


class Pause(NamedTuple):
    """Time in which the machine did not run a process that was ready."""

    begin: float
    """When it should have run [s]."""
    end: float
    """When it did [s]."""


def paused(pauses: Sequence[Pause], begin: float, end: float) -> float:
    """Time [s] of an interval in which the machine paused."""
    return sum(max(0.0, min(end, p.end) - max(begin, p.begin)) for p in pauses)


def longest(pauses: Sequence[Pause]) -> float:
    """Longest pause [s]; 0 without one."""
    return max((pause.end - pause.begin for pause in pauses), default=0.0)
