"""How fast a path is followed where limits or damping hold its task up."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]

STILL = 1e-6
"""Speed [m/s, rad/s] of a path that rests, which cannot be slowed down."""
SLOWEST = 0.02
"""Least share of the speed of a path that is asked for,"""
MORE, LESS = 1.05, 0.9
"""and by how much it changes from step to step;"""
ACROSS = 0.03
"""less as soon as this share of the speed is missed across the path."""
EXTRA = 0.1
"""Share of a feedforward that is asked for in addition at most."""


class Pace(NamedTuple):
    """How fast the time of a path runs, as shares of its speed."""

    got: float
    """What the last step got."""
    asked: float
    """What to ask for in the next one."""


def pace(asked: float, feedforward: Vector, wanted: Vector, achieved: Vector) -> Pace:
    """Slow a path down to what its task gets, so that it stays on it.

    The time of the path runs as fast as the command moves along it. A level at its limits gives up
    direction, too, when it is asked for more than it can do; so hardly more is asked for than it
    got, and less while it misses something across the path, or has to come back to it.

    Parameters
    ----------
    asked
        Share of the speed that was asked for.
    feedforward
        Task velocity (k,) of the path at full speed.
    wanted
        Task velocity (k,) that was asked for with it: ``gain error + asked feedforward``.
    achieved
        That of the command (k,).
    """
    full = float(np.linalg.norm(feedforward))
    if full <= STILL:
        return Pace(1.0, 1.0)
    along = feedforward / full
    # An arm that is ahead of its path moves less, as it wants to: the path goes on.
    got = min(asked, max(0.0, asked - float((wanted - achieved) @ along) / full))
    change = LESS if _across(wanted - achieved, along) > ACROSS * asked * full else MORE
    back = _across(wanted, along) / full
    # What is missing by so little is held back by damping, which asking for less would not help.
    base = asked if got >= (1.0 - EXTRA) * asked else got
    return Pace(got, max(SLOWEST, min(1.0, change * base, 1.0 - back)))


def _across(velocity: Vector, along: Vector) -> float:
    return float(np.linalg.norm(velocity - (velocity @ along) * along))


def made_up(feedforward: Vector, requested: Vector, achieved: Vector) -> Vector:
    """What to ask for beside the feedforward (k,), to make up for what damping holds back.

    A damped inverse gives ``s² / (s² + damping²)`` of what a level asks for along a direction with
    the singular value s: an error of that share of the speed, divided by the gain, would remain.
    What was missing in the last step is asked for in addition in the next one, up to `EXTRA` of
    the feedforward's norm: where more is missing the cause is another, or damping is needed.

    Parameters
    ----------
    feedforward
        Task velocity (k,) of the path.
    requested, achieved
        Of the last step (k,), with what was asked for in addition then.
    """
    # Less than was wanted, and what was asked for in addition then, add up to this.
    missing = requested - achieved
    size, most = float(np.linalg.norm(missing)), EXTRA * float(np.linalg.norm(feedforward))
    return missing if size <= most else missing * (most / size)
