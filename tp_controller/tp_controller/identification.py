r"""Delay and lag of a joint, found from its commands and positions.

Velocities that were sent act ``delay`` later, and the joint follows what acts with a first-order
lag τ:

.. math:: \tau \dot v(t) = u(t - \mathrm{delay}) - v(t), \qquad \dot q = g v

With :math:`U` the integral of the commands and :math:`x` what a joint with this lag makes of them,

.. math:: q(t) = q_0 + g \left( U(t - \mathrm{delay}) - \tau x(t - \mathrm{delay}) \right)
          + c\, e^{-t / \tau}

where the last term is what is left of an unknown velocity at the beginning. For a given delay and
lag that is linear in :math:`q_0`, :math:`g` and :math:`c` (variable projection, Golub and Pereyra
1973); delay and lag are searched on a grid, and from its best point by a simplex.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tp_controller.array_types import COLUMN, FIXED
from tp_controller.compiled import float64, njit, void

Vector = NDArray[np.float64]

RIDGE = 1e-12
"""Keeps the normal equations solvable where a column is zero."""
LAGS = 10
"""Lags of the first grid, beside zero."""
DESCENTS, STEPS = 2, 60
"""Descents from the best point of the grid, and from where that ended; steps of each at most."""
CLOSE = 1e-7
"""Time [s] up to which delay and lag are searched."""
LEAST_STATES = 20
"""States that a fit needs at least, beside those before the first command can act."""


class Fit(NamedTuple):
    """What a joint makes of its commands."""

    delay: float
    """Time [s] from the state that a command answers to when it acts."""
    lag: float
    """Time constant [s]."""
    gain: float
    """Measured velocity by commanded velocity, 1 for a joint that does what it is told."""
    residual: float
    """Largest difference [rad, m] between a measured position and the fit."""
    rms: float
    """Root of the mean square of these differences [rad, m]."""
    motion: float
    """Root mean square of the measured positions about their mean [rad, m]."""

    @property
    def explains(self) -> bool:
        """Whether delay and lag explain the motion: nine tenths of it, as amplitudes go."""
        return self.rms <= 0.1 * self.motion


@njit(void(FIXED, FIXED, FIXED, float64, FIXED, float64, COLUMN, COLUMN), cache=True)
def misfit(times, commands, positions, lag, delays, begin, x, out):  # type: ignore[no-untyped-def]
    """Write what is left of the positions for each delay to ``out``.

    Parameters
    ----------
    times, commands, positions
        Of each state (m,): when it was, the velocity that answered it, and the position.
    lag
        Time constant [s].
    delays
        Delays [s] (k,).
    begin
        Time [s] of the first position that counts.
    x
        Room for m values.
    out
        Per delay (k + 4,) the sum of squares; then q₀, g and c of the last delay, and the largest
        difference.
    """
    m = times.size
    x[0] = commands[0]
    for i in range(1, m):
        if lag > 0.0:
            left = math.exp(-(times[i] - times[i - 1]) / lag)
            x[i] = commands[i - 1] + (x[i - 1] - commands[i - 1]) * left
        else:
            x[i] = commands[i - 1]
    first = 0
    while first < m and times[first] < begin:
        first += 1
    k = delays.size
    for d in range(k):
        # Normal equations of the columns 1, s(t) - s(begin), exp; positions from the first one.
        a00 = a01 = a02 = a11 = a12 = a22 = b0 = b1 = b2 = yy = 0.0
        g = c = q0 = largest = 0.0
        for turn in range(2):
            j, U, s0 = 0, 0.0, 0.0
            for i in range(first, m):
                t = times[i] - delays[d]
                while j < m - 1 and times[j + 1] <= t:
                    U += commands[j] * (times[j + 1] - times[j])
                    j += 1
                since = t - times[j]
                v = commands[j]
                if lag > 0.0:
                    v += (x[j] - commands[j]) * math.exp(-max(since, 0.0) / lag)
                s = U + commands[j] * since - lag * v
                if i == first:
                    s0 = s
                s -= s0
                e = math.exp(-(times[i] - begin) / lag) if lag > 0.0 else 0.0
                y = positions[i] - positions[first]
                if turn == 0:
                    a00 += 1.0
                    a01 += s
                    a02 += e
                    a11 += s * s
                    a12 += s * e
                    a22 += e * e
                    b0 += y
                    b1 += s * y
                    b2 += e * y
                    yy += y * y
                else:
                    largest = max(largest, abs(y - q0 - g * s - c * e))
            if turn == 1:
                break
            # Cholesky of the three columns, each with its own ridge.
            l00 = math.sqrt(a00 * (1.0 + RIDGE))
            l10, l20 = a01 / l00, a02 / l00
            l11 = math.sqrt(max(a11 - l10 * l10, 0.0) + RIDGE * (1e-12 + a11))
            l21 = (a12 - l20 * l10) / l11
            l22 = math.sqrt(max(a22 - l20 * l20 - l21 * l21, 0.0) + RIDGE * (1e-3 + a22))
            z0 = b0 / l00
            z1 = (b1 - l10 * z0) / l11
            z2 = (b2 - l20 * z0 - l21 * z1) / l22
            out[d] = max(yy - z0 * z0 - z1 * z1 - z2 * z2, 0.0)
            c = z2 / l22
            g = (z1 - l21 * c) / l11
            q0 = (z0 - l10 * g - l20 * c) / l00
            if d < k - 1:
                break
    out[k], out[k + 1], out[k + 2], out[k + 3] = q0, g, c, largest


def search(
    times: Vector, commands: Vector, positions: Vector, longest_delay: float, longest_lag: float
) -> Iterator[Fit | None]:
    """Fit delay and lag in pieces of some ten microseconds.

    Parameters
    ----------
    times, commands, positions
        Of each state (m,): when it was [s], rising, the velocity that answered it [rad/s, m/s],
        and the measured position [rad, m].
    longest_delay, longest_lag
        What is searched [s]. Positions of the first ``longest_delay`` are not fitted, as
        commands from before them may still act then.

    Yields
    ------
    Fit or None
        None after each piece, then the fit.
    """
    m = times.size
    period = (times[-1] - times[0]) / max(m - 1, 1)
    begin = times[0] + longest_delay
    x = np.zeros(m)
    count = max(2, round(2.0 * longest_delay / period) + 1)
    delays = np.linspace(0.0, longest_delay, count)
    lags = np.concatenate(
        [[0.0], np.geomspace(0.25 * min(period, longest_lag), longest_lag, LAGS)]
    )
    best = (math.inf, 0.0, 0.0)
    out = np.zeros(count + 4)
    for lag in lags:
        misfit(times, commands, positions, lag, delays, begin, x, out)
        k = int(np.argmin(out[:count]))
        if out[k] < best[0]:
            best = (float(out[k]), float(delays[k]), float(lag))
        yield None
    one = np.zeros(1)

    def value(point: Vector) -> float:
        """Misfit at a delay and lag; both sides of zero are the same."""
        if abs(point[0]) > longest_delay or abs(point[1]) > longest_lag:
            return math.inf
        one[0] = abs(point[0])
        misfit(times, commands, positions, abs(point[1]), one, begin, x, out)
        return float(out[0])

    for _ in range(DESCENTS):
        size = np.array([delays[1], max(0.5 * best[2], lags[1])])
        for lowest, point in _descend(value, np.array(best[1:]), size):
            if lowest < best[0]:
                best = (lowest, abs(float(point[0])), abs(float(point[1])))
            yield None
    misfit(times, commands, positions, best[2], np.array([best[1]]), begin, x, out)
    fitted = positions[times >= begin]
    yield Fit(
        best[1],
        best[2],
        float(out[2]),
        float(out[4]),
        math.sqrt(best[0] / max(fitted.size, 1)),
        float(fitted.std()) if fitted.size else 0.0,
    )


def _descend(
    value: Callable[[Vector], float], start: Vector, size: Vector
) -> Iterator[tuple[float, Vector]]:
    """Yield the lowest value so far and where it is, of two variables (Nelder and Mead 1965)."""
    points = [start, start + size * [1.0, 0.0], start + size * [0.0, 1.0]]
    values = [value(point) for point in points]
    for _ in range(STEPS):
        order = np.argsort(values)
        points, values = [points[i] for i in order], [values[i] for i in order]
        yield values[0], points[0]
        if np.all(np.abs(points[2] - points[0]) + np.abs(points[1] - points[0]) < CLOSE):
            return
        middle = 0.5 * (points[0] + points[1])
        trial = 2.0 * middle - points[2]
        found = value(trial)
        if found < values[0]:
            farther = 3.0 * middle - 2.0 * points[2]
            reached = value(farther)
            if reached < found:
                trial, found = farther, reached
        elif found >= values[1]:
            nearer = 0.5 * (middle + (trial if found < values[2] else points[2]))
            reached = value(nearer)
            if reached < min(found, values[2]):
                trial, found = nearer, reached
            else:
                points[1:] = [0.5 * (points[0] + point) for point in points[1:]]
                values[1:] = [value(point) for point in points[1:]]
                continue
        points[2], values[2] = trial, found


def fit_response(
    times: Vector,
    commands: Vector,
    positions: Vector,
    longest_delay: float = 0.2,
    longest_lag: float = 0.5,
) -> Fit:
    """Fit delay and lag of a joint; parameters as `search`.

    Raises
    ------
    ValueError
        If there are too few states, or times that do not rise.
    """
    times, commands, positions = (
        np.ascontiguousarray(values, dtype=float) for values in (times, commands, positions)
    )
    if np.count_nonzero(times >= times[0] + longest_delay) < LEAST_STATES:
        raise ValueError(f'a fit needs {LEAST_STATES} states after the longest delay')
    if not np.all(np.diff(times) > 0.0):
        raise ValueError('times have to rise')
    *_, found = search(times - times[0], commands, positions, longest_delay, longest_lag)
    assert found is not None
    return found
