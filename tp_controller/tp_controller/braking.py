"""Joints that can stop in time, in discrete time; compiled by numba.

A joint moves at one velocity for a whole step and changes it between steps, by at most
``acceleration · dt``. A velocity is viable if the joint can still stop before the end of its
range from there; from a viable velocity a viable one can always be had in the next step, by
braking (in discrete time: Del Prete 2018; Robotics 2018, 7(3), 41).
"""

from __future__ import annotations

import math

import numpy as np

from tp_controller.array_types import COLUMN, FIXED, ROWS
from tp_controller.compiled import boolean, float64, inner, int64, njit, void

ROUNDING = 1e-9
"""Distance [rad, m] from the end of a range at which a joint stops."""
RETURN = 0.1
"""Share of its velocity limit at which a joint that is out of its range comes back."""


@njit(float64(float64, float64, float64), cache=True)
def viable_speed(distance, change, dt):  # type: ignore[no-untyped-def]
    """Largest speed towards an end at this distance [rad, m] from which a joint can stop.

    With k steps of braking the joint travels ``dt (k v - change k (k - 1) / 2)`` from a speed
    v, this step's way included; that is solved for v.

    Parameters
    ----------
    distance
        How far away the end is.
    change
        How much the speed can change from step to step; infinite without a limit.
    dt
        Time [s] of one step.
    """
    if distance <= 0.0:
        return 0.0
    if not math.isfinite(distance):
        return math.inf
    if not math.isfinite(change):
        return distance / dt
    unit = change * dt
    k = max(1.0, math.ceil(0.5 * (math.sqrt(1.0 + 8.0 * distance / unit) - 1.0)))
    return distance / (k * dt) + 0.5 * change * (k - 1.0)


@inner
def _return_speed(outside, speed, dt):  # type: ignore[no-untyped-def]
    wanted = RETURN * speed if math.isfinite(speed) else RETURN * outside / dt
    return min(wanted, outside / dt)


@njit(
    void(
        FIXED,
        COLUMN,
        FIXED,
        FIXED,
        FIXED,
        FIXED,
        float64,
        COLUMN,
        COLUMN,
        COLUMN,
        COLUMN,
    ),
    cache=True,
    prepared=True,
)
def bound(  # type: ignore[no-untyped-def]
    q, before, speed, position_min, position_max, acceleration, dt, range_lower, range_upper,
    soon_lower, soon_upper,
):  # fmt: skip
    """Fill the bounds (n,) on the velocities of the next step.

    Where they cannot all be kept, because a limit was changed or the state is not of this
    controller's making, the acceleration is kept and the joint brakes as hard as it can. A
    joint outside its range goes no further and comes back.

    Parameters
    ----------
    q, before
        Positions and the velocities of the step before (n,).
    speed, position_min, position_max, acceleration
        Limits (n,), infinite if there is none.
    dt
        Time [s] of one step; infinite if unknown: only the speed is bounded then.
    range_lower, range_upper
        Results: what the ranges allow, zero included.
    soon_lower, soon_upper
        Results: what all limits allow together.
    """
    for i in range(q.size):
        low, high = -math.inf, math.inf
        change = math.inf
        if math.isfinite(dt):
            change = acceleration[i] * dt
            below = q[i] - position_min[i] - ROUNDING
            above = position_max[i] - q[i] - ROUNDING
            high = viable_speed(above, change, dt)
            low = -viable_speed(below, change, dt)
            if above < -2.0 * ROUNDING:
                high = -_return_speed(-above, speed[i], dt)
            elif below < -2.0 * ROUNDING:
                low = _return_speed(-below, speed[i], dt)
        range_lower[i], range_upper[i] = min(low, 0.0), max(high, 0.0)
        low, high = max(low, -speed[i]), min(high, speed[i])
        if math.isfinite(change):
            slowest, fastest = before[i] - change, before[i] + change
            low, high = min(low, fastest), max(high, slowest)
            low, high = max(low, slowest), min(high, fastest)
        soon_lower[i], soon_upper[i] = min(low, high), max(low, high)


@njit(void(COLUMN, COLUMN, FIXED, float64, FIXED, FIXED, COLUMN), cache=True, prepared=True)
def approach(wish, before, acceleration, dt, lower, upper, out):  # type: ignore[no-untyped-def]
    """Go from the last velocities towards wished ones (n,) as far as this step allows.

    All joints go the same share of the way, so that motions which leave a task alone go on
    leaving it alone; then each is brought inside its own bounds.
    """
    share = 1.0
    for i in range(wish.size):
        change, gap = acceleration[i] * dt, abs(wish[i] - before[i])
        if gap > change:
            share = min(share, change / gap)
    for i in range(wish.size):
        value = wish[i] if share == 1.0 else before[i] + share * (wish[i] - before[i])
        out[i] = min(max(value, lower[i]), upper[i])


@njit(float64(float64, float64, float64, float64, ROWS, int64, float64), cache=True)
def held_speed(distance, change, dt, period, held, joint, sign):  # type: ignore[no-untyped-def]
    """As `viable_speed` where a command may be held for so many steps more.

    A joint that goes on with the fastest of the commands that it may be at, for as long as it
    may, and brakes then still stops. From such a speed such a one can be had one step later,
    whichever command the joint was at.

    Parameters
    ----------
    distance, change, dt
        As `viable_speed`.
    period
        Time [s] between commands that are not late; ``dt`` may be longer.
    held, joint, sign
        Velocities (h, n), of which joint, and the direction of the end, 1 or -1: the largest
        velocity towards the end among the commands before the next one that the joint may still
        be at in each of the next steps.
    """
    steps = held.shape[0]
    if steps == 0:
        return viable_speed(distance, change, dt)
    if distance <= 0.0:
        return 0.0
    if not math.isfinite(distance):
        return math.inf
    # Steps that are late are held for no longer than others.
    span = max(period, dt / steps)
    low, high = 0.0, distance / (span * steps)
    for trial in range(60):
        # The highest first: without faster commands before it is often the answer.
        speed = high if trial == 0 else 0.5 * (low + high)
        way, rest = 0.0, max(speed - change, 0.0)
        for s in range(steps):
            way += span * max(sign * held[s, joint], speed)
        if rest > 0.0:
            k = math.ceil(rest / change)
            way += dt * (k * rest - 0.5 * k * (k - 1.0) * change)
        if way > distance:
            high = speed
        elif trial == 0:
            return speed
        else:
            low = speed
    return low


@njit(
    void(
        COLUMN, COLUMN, FIXED, FIXED, FIXED, FIXED, float64, float64, FIXED, COLUMN, COLUMN, ROWS,
        ROWS, COLUMN, COLUMN, COLUMN, COLUMN,
    ),
    cache=True,
    prepared=True,
)  # fmt: skip
def bound_late(  # type: ignore[no-untyped-def]
    p, before, speed, position_min, position_max, acceleration, dt, period, noise, upper, lower,
    held_upper, held_lower, range_lower, range_upper, soon_lower, soon_upper,
):  # fmt: skip
    """As `bound` for joints that are late.

    Parameters
    ----------
    p
        Positions (n,) [rad, m] as far as they are known.
    noise
        By how much (n,) these may be wrong; a joint that is less than twice as far outside its
        range does not come back.
    upper, lower, held_upper, held_lower
        As `tp_controller.commands_under_way.farthest`; the last two may have no rows.
    before, speed, position_min, position_max, acceleration, dt, period
        As `bound` and `held_speed`.
    range_lower, range_upper, soon_lower, soon_upper
        Results, as those of `bound`.
    """
    for i in range(p.size):
        change = acceleration[i] * dt
        above = position_max[i] - upper[i] - ROUNDING
        below = lower[i] - position_min[i] - ROUNDING
        high = held_speed(above, change, dt, period, held_upper, i, 1.0)
        low = -held_speed(below, change, dt, period, held_lower, i, -1.0)
        out = p[i] - position_max[i] - 2.0 * noise[i] - ROUNDING
        if out > 0.0:
            high = -_return_speed(out, speed[i], dt)
        elif position_min[i] - p[i] - 2.0 * noise[i] - ROUNDING > 0.0:
            low = _return_speed(position_min[i] - p[i] - 2.0 * noise[i] - ROUNDING, speed[i], dt)
        range_lower[i], range_upper[i] = min(low, 0.0), max(high, 0.0)
        low, high = max(low, -speed[i]), min(high, speed[i])
        if math.isfinite(change):
            slowest, fastest = before[i] - change, before[i] + change
            low, high = min(low, fastest), max(high, slowest)
            low, high = max(low, slowest), min(high, fastest)
        soon_lower[i], soon_upper[i] = min(low, high), max(low, high)


@njit(float64(float64, float64), cache=True)
def _steps(v, change):  # type: ignore[no-untyped-def]
    """Steps to standstill; rounding does not make one more."""
    return math.ceil(abs(v) / change - ROUNDING) if v != 0.0 else 0.0


@njit(void(COLUMN, FIXED, float64, boolean, int64, COLUMN, COLUMN), cache=True)
def coast(v, acceleration, dt, together, steps, way, speed):  # type: ignore[no-untyped-def]
    """Brake: all joints together along a straight line, or each as hard as it can.

    Parameters
    ----------
    v
        Velocities (n,) of the step before.
    acceleration, dt
        Limits (n,) and the time [s] of one step.
    together
        Whether all joints stop at the same time.
    steps
        For how many steps; negative: to standstill.
    way, speed
        Results (n,): how far the joints get, and the velocities of the last step.
    """
    slowest = 0.0
    for i in range(v.size):
        slowest = max(slowest, _steps(v[i], acceleration[i] * dt))
    for i in range(v.size):
        change = acceleration[i] * dt
        needed = slowest if together else _steps(v[i], change)
        m = needed if steps < 0 else min(float(steps), needed)
        size, loss = abs(v[i]), change
        if together:
            loss = size / max(needed, 1.0)
        total, left = 0.0, size
        if m > 0.0:
            total = m * size - 0.5 * m * (m + 1.0) * loss
            left = size - m * loss
            # The last step of a joint that brakes as hard as it can may be a part of one.
            if left < 0.0:
                total -= left
        if m >= needed and steps != 0:
            left = 0.0
        way[i], speed[i] = math.copysign(dt * total, v[i]), math.copysign(left, v[i])


def steps_to_rest(v: np.ndarray, acceleration: np.ndarray, dt: float) -> int:
    """How many steps the slowest joint needs from velocities (n,) to standstill."""
    return int(np.ceil(np.max(np.abs(v) / (acceleration * dt) - ROUNDING, initial=0.0)))
