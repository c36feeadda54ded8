"""Distances at which the rows of set-based tasks come in and go out, safe ones by default."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tp_controller.errors import NO_VALUE, InvalidValue, listed, shown
from tp_controller.parameters import NUMBER, TEXT, Parameter
from tp_controller.robot import Limits, Response

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]

SMOOTH, HYSTERESIS = SWITCHINGS = ('smooth', 'hysteresis')

THRESHOLDS: Mapping[str, Parameter] = {
    'switching': Parameter(
        TEXT,
        'How rows come in: as a bound on the speed of approach, without a step in the command, '
        'or with hysteresis',
        default=SMOOTH,
        choices=SWITCHINGS,
    ),
    'activation': Parameter(
        NUMBER,
        'Distance [m or rad] from the boundary at which the task comes in; left out, a safe one '
        'by rate and robot.limits',
        above=0.0,
    ),
    'release': Parameter(
        NUMBER,
        'Distance [m or rad] at which it goes out again, with hysteresis only; one and a half '
        'times activation when left out',
        above=0.0,
    ),
    'margin': Parameter(
        NUMBER,
        'Distance [m or rad] that is kept, with smooth switching only; left out, an upper bound '
        'of the second-order error of the distance in one step',
        above=0.0,
    ),
}

MARGIN = 1e-4
"""Least margin [m, rad] that is taken when none is given."""
STEPS = 4.0
"""With smooth switching the speed of approach falls with this time constant [steps] or more."""

BRAKING = 2.0
"""So many times as long as joints need to stop: the others may need their limits too."""
LATE = 1.5
"""And at least so many times the delay, lag and hold of the arm longer than it takes to brake."""


class Switching(NamedTuple):
    """How the rows of a set-based task come in and go out."""

    type: str = SMOOTH
    """``smooth`` or ``hysteresis``."""
    activation: float | None = None
    """Distance [m, rad] from the boundary at which they come in; a safe one when left out."""
    release: float | None = None
    """With hysteresis, the distance at which they go out; 1.5 times the activation when left
    out."""
    margin: float | None = None
    """With smooth switching, the distance that is kept; what the bend of the way can take in
    one step when left out."""

    @classmethod
    def of(cls, values: Mapping[str, Any]) -> Switching:
        """Switching of a task's checked values."""
        return cls(*(values[key] for key in THRESHOLDS))


class Thresholds(NamedTuple):
    """Distances [m, rad] of a set-based task that follow from the robot's limits."""

    activation: float
    release: float
    margin: float
    needed: float
    """Least activation with which the boundary is kept."""
    travel: float
    """Farthest that a distance can change in a step."""
    time: float = 1.0
    """Time constant τ [s] of smooth switching."""
    edge: Vector | None = None
    """How near each row comes in with smooth switching (k,)."""


def safe_thresholds(
    switching: Switching,
    reach: Matrix,
    limits: Limits,
    response: Response,
    period: float,
    bends: bool,
) -> Thresholds:
    """Thresholds with which a task keeps its set on a robot with these limits.

    Parameters
    ----------
    switching
        What is given of them.
    reach
        Bound (k, n) on the derivative of the distances by the joints, at any configuration.
    limits, response
        What the robot's joints may do, and what the arm makes of commands.
    period
        Time [s] of one step; infinite if unknown.
    bends
        Whether the distance is a curved function of the joints.

    Raises
    ------
    InvalidValue
        If the release is not farther than the activation or the activation not farther than
        the margin, a threshold belongs to the other kind of switching, or what a safe
        threshold follows from is missing.
    """
    if switching.type not in SWITCHINGS:
        accepts = f'one of {listed(SWITCHINGS)}'
        raise InvalidValue('switching', shown(switching.type), accepts)
    moves = reach > 0.0
    velocity = limits.velocity
    # A joint that does not move a row does not count, however fast it is.
    speed = np.where(moves, reach * np.where(moves, velocity, 0.0), 0.0).sum(axis=1)
    fastest = float(speed.max())
    travel = fastest * period
    if switching.type == HYSTERESIS:
        return _with_hysteresis(switching, travel)
    if switching.release is not None:
        raise InvalidValue(
            'release', shown(switching.release), 'no value, or switching hysteresis'
        )
    if not math.isfinite(travel):
        raise InvalidValue(
            'activation',
            'smooth switching without rate or robot.limits.velocity',
            'both of them, or switching hysteresis with an activation',
        )
    margin = switching.margin
    if margin is None:
        # The second derivative by joints i and j is no larger than the reach of either.
        turning = float(velocity[moves.any(axis=0)].sum()) * period
        margin = MARGIN + (0.5 * travel * turning if bends else 0.0)
        # What the safety filter keeps for noise.
        noise = response.noise * (2.0 if response.hold else 1.0)
        margin += float((reach @ noise).max())
    # What is commanded now the arm may still do for a while.
    braking, late = _braking_time(reach, limits), response.late
    slow = max(STEPS * period, BRAKING * braking)
    if late:
        slow = max(slow, STEPS * period + LATE * late + 0.5 * braking)
    needed = margin + fastest * slow
    if not margin > 0.0:
        raise InvalidValue('margin', shown(margin), 'a number above 0')
    # Rows that no joint can move never come in; their thresholds only have to make sense.
    safe = max(needed, 2.0 * margin)
    activation = safe if switching.activation is None else switching.activation
    if not activation > margin:
        raise InvalidValue('activation', shown(activation), f'more than the margin, {margin:g}')
    time = (activation - margin) / fastest if fastest > 0.0 else 1.0
    edge = margin + speed * time
    return Thresholds(activation, activation, margin, needed, travel, time, edge)


def _with_hysteresis(switching: Switching, travel: float) -> Thresholds:
    if switching.margin is not None:
        raise InvalidValue('margin', shown(switching.margin), 'no value, or switching smooth')
    activation, release = switching.activation, switching.release
    if activation is None:
        if not math.isfinite(travel):
            raise InvalidValue(
                'activation',
                NO_VALUE,
                'a number above 0 (or give rate and robot.limits.velocity)',
            )
        # One step from beyond it does not cross the boundary; the rest is for the bend of
        # the way in the step after, when the row has come in.
        activation = 1.25 * travel
    if release is None:
        release = 1.5 * activation
    if not release > activation > 0.0:
        raise InvalidValue('release', shown(release), f'more than the activation, {activation:g}')
    needed = travel if math.isfinite(travel) else 0.0
    return Thresholds(activation, release, 0.0, needed, travel)


def _braking_time(reach: Matrix, limits: Limits) -> float:
    """Longest time [s] that a joint which moves a row needs to stop."""
    moves = (reach > 0.0).any(axis=0) & np.isfinite(limits.acceleration)
    return float(np.max(limits.velocity[moves] / limits.acceleration[moves], initial=0.0))
