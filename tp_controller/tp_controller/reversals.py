"""Signals that reverse again and again, compiled by numba.

A turning point of a signal is an extreme from which it has come back by more than a threshold
(a zigzag, as in rainflow counting). It counts as a reversal where the signal changed its sign
since the turning point before, or where that was only a few cycles ago: signals that are asked
for have no such turning points in plenty.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from tp_controller.array_types import COLUMN, FIXED, ROWS
from tp_controller.compiled import boolean, float64, int64, njit, void

Vector = NDArray[np.float64]

LEAST = 1e-3
"""Amplitude, as a share of a signal's scale, that is worth mentioning."""
SHARE = 0.2
"""A turning point comes back by at least this share of the larger extreme."""
FEW = 4.5
"""Cycles within which turning points count whatever their signs."""
GAP = 0.8
"""Longest time [s] between two reversals of one row of them."""
SWITCH_GAP = 2.0
"""Longest time [s] between two changes of a row that comes in and goes out again and again."""
PAUSE = 10.0
"""Times the mean time between the last N reversals after which there should be another one."""
N = 8
"""Reversals in a row that are an oscillation, if they do not fade."""
LASTING = 0.6
"""Least time [s] that they have to last."""
FADING = 0.5
"""The second half of them has to swing by at least this share of the first half."""

DIRECTION, EXTREME, TURNED, TURNED_AT, COUNT, BEGAN = range(6)
"""Rows of the state: +1 rising, -1 falling, 0 unknown; the extreme since the last turning point;
value and time of that; reversals in a row; when the first of them was."""
STATES = 6


@njit(
    int64(FIXED, FIXED, float64, float64, ROWS, ROWS, ROWS, boolean[::1], COLUMN),
    cache=True,
)
def follow(values, scale, now, dt, state, times, swings, found, amplitude):  # type: ignore[no-untyped-def]
    """Take the next values of all signals.

    Parameters
    ----------
    values
        The signals (m,).
    scale
        What they are measured by (m,); one with an infinite or zero scale never oscillates.
    now, dt
        Time [s], and how much has passed since the last values.
    state
        What is known of each signal (6, m).
    times, swings
        Times [s] and heights of the last reversals (m, N), by their number modulo N.
    found, amplitude
        Which signals oscillate (m,), and the amplitude of the last reversals (m,), as a share of
        the scale; results.

    Returns
    -------
    int
        The one that oscillates most, by its amplitude; -1 if none does.
    """
    worst, most = -1, 0.0
    for i in range(values.size):
        found[i] = False
        if not (0.0 < scale[i] < math.inf):
            state[DIRECTION, i] = state[COUNT, i] = 0.0
            continue
        x, least = values[i], LEAST * scale[i]
        direction, extreme = state[DIRECTION, i], state[EXTREME, i]
        if direction == 0.0:
            # Where it comes from is not known: the first step decides.
            if state[TURNED_AT, i] == 0.0:
                state[TURNED, i] = state[EXTREME, i] = x
                state[TURNED_AT, i] = now
            elif abs(x - state[TURNED, i]) > least:
                state[DIRECTION, i] = 1.0 if x > state[TURNED, i] else -1.0
                state[EXTREME, i] = x
            continue
        if direction * (x - extreme) >= 0.0:
            state[EXTREME, i] = x
        elif abs(x - extreme) > 2.0 * least + SHARE * max(abs(x), abs(extreme)):
            turned, before = state[TURNED, i], state[TURNED_AT, i]
            swing = abs(extreme - turned)
            crossed = extreme * turned < 0.0 and min(abs(extreme), abs(turned)) >= least
            if crossed or now - before <= FEW * dt:
                k = int(state[COUNT, i])
                if k == 0:
                    state[BEGAN, i] = now
                times[i, k % N], swings[i, k % N] = now, swing
                state[COUNT, i] = k + 1.0
            state[DIRECTION, i], state[EXTREME, i] = -direction, x
            state[TURNED, i], state[TURNED_AT, i] = extreme, now
        k = int(state[COUNT, i])
        if k == 0:
            continue
        allowed = GAP
        if k >= N:
            mean = (times[i, (k - 1) % N] - times[i, k % N]) / (N - 1)
            allowed = min(GAP, PAUSE * max(mean, dt))
        if now - times[i, (k - 1) % N] > allowed:
            state[COUNT, i] = 0.0
            continue
        if k < N or now - state[BEGAN, i] < LASTING:
            continue
        first, last = 0.0, 0.0
        for j in range(N // 2):
            first = max(first, swings[i, (k + j) % N])
            last = max(last, swings[i, (k + N // 2 + j) % N])
        amplitude[i] = 0.5 * last / scale[i]
        if last >= FADING * first:
            found[i] = True
            if amplitude[i] > most:
                worst, most = i, amplitude[i]
    return worst


@njit(void(ROWS, FIXED, boolean[::1], boolean[::1], COLUMN), cache=True)
def scale_rows(J, speed, acting, one_sided, out):  # type: ignore[no-untyped-def]
    """Write how fast the joints can move each row to ``out`` (k,); infinite for one-sided ones.

    Parameters
    ----------
    J
        Jacobian (k, n).
    speed
        Scales of the joints (n,).
    acting, one_sided
        Which rows act, and which are bounds (k,). Rows of others act while they are not zero;
        that is written to ``acting``.
    out
        The scales.
    """
    rows, n = J.shape
    for i in range(rows):
        if one_sided[i]:
            out[i] = math.inf
            continue
        total = 0.0
        for j in range(n):
            total += abs(J[i, j]) * speed[j]
        out[i] = total
        acting[i] = total > 0.0


@njit(void(boolean[::1], float64, boolean[::1], ROWS, COLUMN), cache=True)
def switch(acting, now, before, times, count):  # type: ignore[no-untyped-def]
    """Count how often rows come in and go out.

    Parameters
    ----------
    acting
        Whether each row acts (m,).
    now
        Time [s].
    before
        The same in the last cycle; changed.
    times
        Times [s] of the last changes (m, N), by their number modulo N.
    count
        Changes in a row (m,); changed.

    """
    for i in range(acting.size):
        k = int(count[i])
        if acting[i] != before[i]:
            before[i] = acting[i]
            times[i, k % N] = now
            k += 1
        if k == 0:
            continue
        if now - times[i, (k - 1) % N] > SWITCH_GAP:
            k = 0
        count[i] = k


class Reversals:
    """Signals, taken once per cycle, and which of them oscillate.

    Parameters
    ----------
    m
        Number of signals.

    Attributes
    ----------
    found
        Which signals oscillate (m,): they reversed `N` times in a row, with no more than `GAP`
        in between, for at least `LASTING`, and without fading.
    amplitude
        Their amplitudes (m,) of late, as shares of their scales.
    worst
        The one with the largest amplitude; -1 if none oscillates.
    """

    def __init__(self, m: int) -> None:
        self.found = np.zeros(m, dtype=bool)
        self.amplitude = np.zeros(m)
        self.worst = -1
        self._state = np.zeros((STATES, m))
        self._times, self._swings = np.zeros((2, m, N))
        self._now = 0.0

    def restart(self) -> None:
        """Forget all signals."""
        self._state[:] = 0.0
        self.found[:] = False
        self.worst = -1

    def see(self, values: Vector, scale: Vector, dt: float) -> int:
        """Take the next values.

        Parameters
        ----------
        values
            The signals (m,), finite.
        scale
            What they are measured by (m,), such as limits; one whose scale is zero or infinite
            does not oscillate.
        dt
            Time [s] since the last values.

        Returns
        -------
        int
            `worst`.
        """
        self._now += dt
        self.worst = follow(
            values,
            scale,
            self._now,
            dt,
            self._state,
            self._times,
            self._swings,
            self.found,
            self.amplitude,
        )
        return self.worst

    def count(self, i: int) -> int:
        """Reversals of a signal in a row."""
        return int(self._state[COUNT, i])

    def span(self, i: int) -> float:
        """Time [s] of the last `N` reversals of a signal that reversed so often."""
        k = self.count(i)
        return float(self._times[i, (k - 1) % N] - self._times[i, k % N])

    def rate(self, i: int) -> float:
        """Reversals per second [Hz] of a signal, over the last `N`; 0 if it had fewer."""
        if self.count(i) < N:
            return 0.0
        span = self.span(i)
        return (N - 1) / span if span > 0.0 else 0.0
