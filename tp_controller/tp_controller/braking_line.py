"""Line along which an arm moves until it has braked, compiled by numba.

Parameters of the arm and its commands are those of `tp_controller.commands_under_way`.
"""

from __future__ import annotations

import math

from tp_controller.arm_state import V_HIGH, V_LOW, P, V, Z
from tp_controller.array_types import COLUMN, FIXED, ROWS
from tp_controller.commands_under_way import ARM, SENT, SLIVER
from tp_controller.compiled import boolean, float64, njit


@njit(
    boolean(
        *SENT, *ARM, float64, float64, FIXED, COLUMN, ROWS, FIXED, FIXED, *[COLUMN] * 4,
    ),
    cache=True,
)  # fmt: skip
def line(  # type: ignore[no-untyped-def]
    now, times, commands, head, delay, lag, hold, period, step, acceleration, command, state,
    position_min, position_max, start, way, tube, span,
):  # fmt: skip
    """Straight line along which the arm moves from now on until it has braked to rest.

    Whatever is carried out when, and how late, the arm stays within ``tube`` of a point of
    ``start + s way`` with s from 0 to 1. All joints brake together; a joint that has to stop
    before because its range ends does.

    Parameters
    ----------
    now, times, commands, head, delay, lag, hold, period, state
        As `advance`.
    step
        Time [s] of a step from now on.
    acceleration
        Limits (n,), in changes of velocity by ``step``.
    command
        Velocities (n,) of the next command.
    position_min, position_max
        Ranges (n,).
    start, way, tube
        Results (n,).
    span
        Spare array (n,).

    Returns
    -------
    bool
        Whether the arm moves at all.
    """
    m, n = commands.shape
    sliver = SLIVER * period
    late, soon, slow, lagging = 0.0, math.inf, 0.0, False
    for i in range(n):
        late, soon = max(late, delay[i]), min(soon, delay[i])
        slow = max(slow, delay[i] + lag[i])
        lagging = lagging or lag[i] > 0.0
    exact = hold == 0.0 and not lagging and late == soon
    # The direction: that of the command, or of what is still carried out if that is faster.
    fastest = 0.0
    for i in range(n):
        way[i] = command[i]
        fastest = max(fastest, abs(command[i]))
    if not exact:
        best, index = 10.0 * fastest, -1
        for k in range(m):
            j = (head + 1 + k) % m
            after = times[(j + 1) % m] if j != head else now
            if after > now - late - hold + sliver:
                size = 0.0
                for i in range(n):
                    size = max(size, abs(commands[j, i]))
                if size > best:
                    best, index = size, j
        size = 0.0
        for i in range(n):
            size = max(size, abs(state[V, i]) if lag[i] > 0.0 else 0.0)
        if size > best:
            best, index = size, m
        if index >= 0:
            for i in range(n):
                way[i] = state[V, i] if index == m else commands[index, i]
    square = 0.0
    for i in range(n):
        square += way[i] * way[i]
        tube[i] = 0.0
        start[i] = state[Z, i] if exact else state[P, i]
    if square == 0.0:
        return False
    # What the command itself does: a step, the time for which it may be held, and braking.
    slowest = 0.0
    for i in range(n):
        if command[i] != 0.0:
            slowest = max(slowest, math.ceil(abs(command[i]) / (acceleration[i] * step) - 1e-9))
    held = period * (1.0 + math.ceil(hold / period - SLIVER))
    future = max(step, held) + 0.5 * step * max(slowest - 1.0, 0.0)
    share = 0.0
    for i in range(n):
        share += command[i] * way[i]
    share /= square
    ahead, behind = max(share, 0.0) * future, max(-share, 0.0) * future
    for i in range(n):
        tube[i] += future * abs(command[i] - share * way[i])
        if not exact:
            tube[i] += (slow - delay[i] - lag[i]) * abs(command[i])
    if not exact:
        # What the lag keeps back.
        share = 0.0
        for i in range(n):
            share += lag[i] * state[V, i] * way[i]
        share /= square
        ahead, behind = ahead + max(share, 0.0), behind + max(-share, 0.0)
        for i in range(n):
            tube[i] += abs(lag[i] * state[V, i] - share * way[i])
            spread = max(state[V_HIGH, i] - state[V, i], state[V, i] - state[V_LOW, i])
            tube[i] += lag[i] * max(spread, 0.0)
        # Commands that are under way, or may still be held.
        steps = math.ceil((late + hold) / period - SLIVER)
        for s in range(steps):
            for i in range(n):
                span[i] = 0.0
            most, least = 0.0, 0.0
            for k in range(m):
                j = (head + 1 + k) % m
                after = times[(j + 1) % m] if j != head else now
                if after <= now + s * period - late - hold + sliver:
                    continue
                if hold == 0.0 and times[j] >= now + (s + 1) * period - soon - sliver:
                    continue
                share = 0.0
                for i in range(n):
                    share += commands[j, i] * way[i]
                share /= square
                most, least = max(most, share), min(least, share)
                for i in range(n):
                    span[i] = max(span[i], abs(commands[j, i] - share * way[i]))
            ahead, behind = ahead + period * most, behind - period * least
            for i in range(n):
                tube[i] += period * span[i]
    for i in range(n):
        start[i] -= behind * way[i]
        way[i] *= ahead + behind
        end = start[i] + way[i]
        over = max(end - max(position_max[i], start[i]), min(position_min[i], start[i]) - end)
        if over > 0.0:
            tube[i] += over
    return True
