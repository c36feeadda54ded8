"""Small motions of one joint at a time from which delay, lag and noise are measured."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from tp_controller.errors import InvalidValue, TaskPriorityError
from tp_controller.identification import Fit
from tp_controller.robot import Limits

Vector = NDArray[np.float64]

PULSES = ((1.0, 1), (2.0, 2), (4.0, 3))
"""Frequencies [Hz] of the motions there and back, and how many of each."""
SHARE = 0.5
"""Share of the limits of speed and acceleration that is used."""
BEFORE, AFTER = 0.3, 0.6
"""Time [s] at rest before and after; the first is longer than the longest delay that is fitted."""
LONGEST_DELAY, LONGEST_LAG = 0.25, 0.5
"""Longest delay and lag [s] that can be measured."""
ROOM = 1.5
"""So many times the amplitude has to be free in the joint's range."""
SAFETY = 1.2
"""So many times the noise that was seen is told, as it was seen for a short time only."""


class Refused(TaskPriorityError):
    """The measurement cannot begin."""


class Ended(TaskPriorityError):
    """The measurement was ended before it was done."""


def pulses(amplitude: float, speed: float, acceleration: float, period: float) -> Vector:
    """Velocities (m,) of a joint that goes there and back some times, ever faster.

    Each way is ``amplitude (1 - cos(2 π f t)) / 2``, smaller where the limits want that. The
    velocities of all steps add up to zero.

    Parameters
    ----------
    amplitude
        How far the joint goes [rad, m]; negative for the other way.
    speed, acceleration
        Its limits [rad/s, rad/s² or m/s, m/s²], infinite without one.
    period
        Time [s] of one step.
    """
    found = [np.zeros(math.ceil(BEFORE / period))]
    for frequency, count in PULSES:
        steps = max(round(count / frequency / period), 8 * count)
        f = count / (steps * period)
        most = min(
            SHARE * speed / (math.pi * f), SHARE * acceleration / (2.0 * (math.pi * f) ** 2)
        )
        height = math.copysign(min(abs(amplitude), most), amplitude)
        way = 0.5 * height * (1.0 - np.cos(2.0 * math.pi * f * period * np.arange(steps + 1)))
        found.append(np.diff(way) / period)
    found.append(np.zeros(math.ceil(AFTER / period)))
    return np.concatenate(found)


def directions(joints: Sequence[str], q: Vector, limits: Limits, amplitude: float) -> Vector:
    """Amplitudes (n,) [rad, m] with the sign of the way on which each joint has more room.

    Raises
    ------
    InvalidValue
        If a joint has too little room, or a velocity limit of zero.
    """
    above, below = limits.position_max - q, q - limits.position_min
    for i, joint in enumerate(joints):
        if max(above[i], below[i]) < ROOM * amplitude or min(above[i], below[i]) < 0.0:
            raise InvalidValue(
                'amplitude',
                f'{amplitude:g} with {joint} at {q[i]:.4g}',
                f'amplitudes of which {ROOM:g} times are free in its range, '
                f'{limits.position_min[i]:g} to {limits.position_max[i]:g}',
            )
    return np.where(above >= below, amplitude, -amplitude)


def braked(command: Vector, acceleration: Vector, period: float) -> Vector:
    """Next command (n,) of running down to rest inside the limits of acceleration."""
    change = np.where(np.isfinite(acceleration), acceleration * period, np.abs(command))
    return np.sign(command) * np.maximum(np.abs(command) - change, 0.0)


def block(fits: Sequence[Fit], noise: Vector) -> str:
    """Lines for the parameter file: the block ``robot`` of joints as they were measured.

    Parameters
    ----------
    fits
        Per joint.
    noise
        Amplitudes (n,) [rad, m] seen at rest.
    """
    rows = {
        'delay': [round(fit.delay, 4) for fit in fits],
        'lag': [round(fit.lag, 4) for fit in fits],
        'noise': [_up(SAFETY * float(value)) for value in noise],
    }
    lines = ['robot:']
    for key, values in rows.items():
        lines.append(f'  {key}: [{", ".join(_number(value) for value in values)}]')
    return '\n'.join(lines)


def _number(value: float) -> str:
    """A number that YAML and ROS read as one with a decimal point."""
    text = np.format_float_positional(value, trim='0')
    return str(text)


def _up(value: float) -> float:
    """Rounded up to two digits; rounding alone is no noise."""
    if value < 1e-9:
        return 0.0
    digits = 1 - math.floor(math.log10(value))
    return round(math.ceil(value * 10.0**digits - 1e-9) / 10.0**digits, digits)
