"""Where commands under way take an arm that carries them out late, compiled by numba.

A command that was sent at a time ``t`` acts from ``t + delay`` to the next one's; the velocity
follows the acting command with a first-order lag. An arm that goes on with a command for up to
``hold`` more acts on any of those of the last ``hold``, in the order in which they were sent.

Commands are in a ring: ``times`` (m,) [s] and ``commands`` (m, n) [rad/s, m/s], the newest at
``head``. Before the oldest one all joints moved as that says.
"""

from __future__ import annotations

import math

from tp_controller.arm_state import V_HIGH, V_LOW, P, V, Z
from tp_controller.array_types import COLUMN, FIXED, ROWS
from tp_controller.compiled import boolean, float64, int64, njit, void

SLIVER = 1e-6
"""Times [steps] that differ by less are the same."""
SENT = (float64, COLUMN, ROWS, int64)
"""Types of ``now, times, commands, head``."""
ARM = (FIXED, FIXED, float64)
"""Types of ``delay, lag, hold``."""
REACH = (COLUMN, COLUMN, ROWS, ROWS)
"""Types of ``upper, lower, held_upper, held_lower``."""


@njit(
    void(float64, float64, COLUMN, ROWS, int64, FIXED, FIXED, float64, float64, ROWS), cache=True
)
def advance(now, passed, times, commands, head, delay, lag, hold, period, state):  # type: ignore[no-untyped-def]
    """Let the model of the arm go on by the time that has passed.

    Parameters
    ----------
    now, passed
        The time [s] after that, and how much has passed [s].
    times, commands, head
        The commands.
    delay, lag, hold
        What the arm is like: (n,), (n,) and one value [s].
    period
        Time [s] of one step.
    state
        The rows `P`, `V`, `V_HIGH`, `V_LOW` are changed.
    """
    m, n = commands.shape
    sliver = SLIVER * period
    for i in range(n):
        p, v = state[P, i], state[V, i]
        begin, end = now - passed - delay[i], now - delay[i]
        high, low = 0.0, 0.0
        for k in range(m):
            j = (head + 1 + k) % m
            after = times[(j + 1) % m] if j != head else math.inf
            if hold > 0.0 and after > begin - hold + sliver and times[j] < end - sliver:
                high, low = max(high, commands[j, i]), min(low, commands[j, i])
            start, stop = max(begin, times[j]), min(end, after)
            if stop - start <= sliver:
                continue
            u, span = commands[j, i], stop - start
            # Steps of equal length are the period itself, free of rounding.
            if abs(span - period) <= sliver:
                span = period
            if lag[i] > 0.0:
                left = u + (v - u) * math.exp(-span / lag[i])
                p += u * span + lag[i] * (v - left)
                v = left
            else:
                p += span * u
                v = u
        state[P, i], state[V, i] = p, v
        if hold > 0.0:
            left = math.exp(-passed / lag[i]) if lag[i] > 0.0 else 0.0
            state[V_HIGH, i] = high + (state[V_HIGH, i] - high) * left
            state[V_LOW, i] = low + (state[V_LOW, i] - low) * left
        else:
            state[V_HIGH, i] = state[V_LOW, i] = v


@njit(void(float64, COLUMN, ROWS, int64, FIXED, FIXED, float64, ROWS), cache=True)
def refer(now, times, commands, head, delay, lag, period, state):  # type: ignore[no-untyped-def]
    """Fill the row `Z`: where the arm gets to with what was sent, before the next command."""
    m, n = commands.shape
    sliver = SLIVER * period
    for i in range(n):
        z = state[P, i]
        if lag[i] > 0.0:
            z += lag[i] * state[V, i]
        if delay[i] > 0.0:
            for k in range(m):
                j = (head + 1 + k) % m
                after = times[(j + 1) % m] if j != head else now
                span = min(now, after) - max(now - delay[i], times[j])
                if span > sliver:
                    z += commands[j, i] * (period if abs(span - period) <= sliver else span)
        state[Z, i] = z


@njit(void(*SENT, *ARM, float64, float64, ROWS, *REACH), cache=True)
def farthest(  # type: ignore[no-untyped-def]
    now, times, commands, head, delay, lag, hold, period, step, state,
    upper, lower, held_upper, held_lower,
):  # fmt: skip
    """How far the arm may get with what was sent.

    Parameters
    ----------
    now, times, commands, head, delay, lag, hold, period, state
        As `advance`.
    step
        Time [s] of a step from now on. Steps that are late by no more than ``hold`` belong to
        that.
    upper, lower
        Results (n,): the highest and the lowest position that the joints may get to, the
        window of the next command not counted.
    held_upper, held_lower
        Results (h, n): the highest and the lowest velocity that the commands before the next
        one may still have in the step that it is meant for and the ``h - 1`` after.
    """
    m, n = commands.shape
    sliver = SLIVER * period
    for i in range(n):
        if hold == 0.0:
            upper[i] = lower[i] = state[Z, i]
            continue
        upper[i] = state[P, i] + lag[i] * max(state[V_HIGH, i], 0.0)
        lower[i] = state[P, i] + lag[i] * min(state[V_LOW, i], 0.0)
        steps = math.ceil(delay[i] / period - SLIVER)
        for s in range(-steps, held_upper.shape[0]):
            high, low = 0.0, 0.0
            for k in range(m):
                j = (head + 1 + k) % m
                after = times[(j + 1) % m] if j != head else now
                begun = times[j] < now + (s + 1) * period - sliver
                if begun and after > now + s * period - hold + sliver:
                    high, low = max(high, commands[j, i]), min(low, commands[j, i])
            if s < 0:
                upper[i] += period * high
                lower[i] += period * low
            else:
                held_upper[s, i], held_lower[s, i] = high, low


@njit(
    void(*SENT, *ARM, boolean, boolean, float64, float64, ROWS, *REACH),
    cache=True,
    prepared=True,
)
def expect(  # type: ignore[no-untyped-def]
    now, times, commands, head, delay, lag, hold, exact, ideal, period, step, state,
    upper, lower, held_upper, held_lower,
):  # fmt: skip
    """Fill the row `Z`, and for an arm that is not ideal how far it may get.

    Parameters
    ----------
    now, times, commands, head, delay, lag, hold, period, step, state
        As `farthest`.
    exact, ideal
        Whether the model is known to be where the arm is; whether the arm does exactly what it
        is commanded to.
    upper, lower, held_upper, held_lower
        Results, as those of `farthest`.
    """
    if exact:
        for i in range(upper.size):
            state[Z, i] = state[P, i]
    else:
        refer(now, times, commands, head, delay, lag, period, state)
    if not ideal:
        farthest(
            now, times, commands, head, delay, lag, hold, period, step, state, upper, lower,
            held_upper, held_lower,
        )  # fmt: skip
