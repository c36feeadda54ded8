"""Where an arm is that carries commands out late, compiled by numba.

A command that was sent at a time ``t`` acts from ``t + delay`` to the next one's; the velocity
follows the acting command with a first-order lag. An arm that goes on with a command for up to
``hold`` more acts on any of those of the last ``hold``, in the order in which they were sent.

Commands are in a ring: ``times`` (m,) [s] and ``commands`` (m, n) [rad/s, m/s], the newest at
``head``. Before the oldest one all joints moved as that says.
"""

from __future__ import annotations

import math

from tp_controller.array_types import COLUMN, FIXED, ROWS
from tp_controller.compiled import boolean, float64, int64, njit, void

SLIVER = 1e-6
"""Times [steps] that differ by less are the same."""

ROUNDING = 1e-9
"""Movement [rad, m] of a step that may be rounding."""

Z, P, V, V_HIGH, V_LOW, PARTED, FASTEST, Q, CANDIDATE = range(9)
"""Rows of the state: reference configuration, model of the arm's position and velocity, bounds
on its velocity, by how much it has parted from the model of late, a falling maximum of the
commanded speed, the last position that was measured, and one that nobody believes yet."""
STATES = 9


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


@njit(
    void(
        float64,
        COLUMN,
        ROWS,
        int64,
        FIXED,
        FIXED,
        float64,
        float64,
        float64,
        ROWS,
        COLUMN,
        COLUMN,
        ROWS,
        ROWS,
    ),
    cache=True,
)
def farthest(  # type: ignore[no-untyped-def]
    now,
    times,
    commands,
    head,
    delay,
    lag,
    hold,
    period,
    step,
    state,
    upper,
    lower,
    held_upper,
    held_lower,
):
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
    boolean(
        float64,
        COLUMN,
        ROWS,
        int64,
        FIXED,
        FIXED,
        float64,
        float64,
        float64,
        FIXED,
        COLUMN,
        ROWS,
        FIXED,
        FIXED,
        COLUMN,
        COLUMN,
        COLUMN,
        COLUMN,
    ),
    cache=True,
)
def line(  # type: ignore[no-untyped-def]
    now,
    times,
    commands,
    head,
    delay,
    lag,
    hold,
    period,
    step,
    acceleration,
    command,
    state,
    position_min,
    position_max,
    start,
    way,
    tube,
    span,
):
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


@njit(int64(COLUMN, COLUMN, COLUMN, COLUMN, float64[:, ::1], boolean[::1]), cache=True)
def line_doubts(way, tube, distance, required, reach, doubtful):  # type: ignore[no-untyped-def]
    """Find distances (k,) that could become too small along a line, and how many they are."""
    count = 0
    for row in range(distance.size):
        length = 0.0
        for i in range(way.size):
            length += reach[row, i] * (abs(way[i]) + 2.0 * tube[i])
        doubtful[row] = distance[row] - required[row] < length
        count += doubtful[row]
    return count


@njit(void(COLUMN, float64[:, ::1], COLUMN, COLUMN), cache=True)
def lengths(way, reach, most, bend):  # type: ignore[no-untyped-def]
    """Bounds on what distances (k,) do while velocities of constant direction act.

    Parameters
    ----------
    way, reach
        How far each velocity leads (n,), and the bound (k, n) on the derivative of the distances.
    most
        Result (k,): no distance changes by more.
    bend
        Result (k,): no point of a link is farther from the straight line between its places,
        in any one direction. The second derivative by joints i and j is no larger than the
        reach of either.
    """
    for row in range(most.size):
        first, second = 0.0, 0.0
        for i in range(way.size):
            move = abs(way[i])
            first += reach[row, i] * move
            for j in range(way.size):
                second += min(reach[row, i], reach[row, j]) * move * abs(way[j])
        most[row], bend[row] = first, 0.125 * second


@njit(
    void(COLUMN, float64, COLUMN, FIXED, FIXED, float64, float64, float64, float64, ROWS, COLUMN),
    cache=True,
)
def judge(q, passed, command, limit, noise, period, times, least, farthest, state, result):  # type: ignore[no-untyped-def]
    """Find the joint whose measured position is the least credible.

    Parameters
    ----------
    q
        Measured positions (n,).
    passed
        Time [s] since the state before.
    command
        Velocities (n,) that the arm was last sent.
    limit, noise
        Velocity limits and amplitudes of the noise (n,).
    period
        Time [s] of one step.
    times, least, farthest
        A joint does not get so many times as far as its limit lets it and ``least`` more, and
        never to ``farthest``.
    state
        The row `P` is read.
    result
        Results: the joint's index, and by how much it is too far [rad, m]; not above zero if
        all are credible.
    """
    result[0], result[1] = 0.0, -math.inf
    for i in range(q.size):
        gap = abs(q[i] - state[P, i])
        over = gap - times * limit[i] * max(passed, period) - least - 2.0 * noise[i]
        if not abs(q[i]) <= farthest:
            over = math.inf
        if over > result[1]:
            result[0], result[1] = float(i), over


@njit(
    void(
        COLUMN,
        float64,
        COLUMN,
        FIXED,
        float64,
        float64,
        float64,
        boolean,
        float64,
        float64,
        COLUMN,
        ROWS,
        COLUMN,
    ),
    cache=True,
)
def correct(  # type: ignore[no-untyped-def]
    q,
    passed,
    command,
    noise,
    memory,
    parted,
    allowed,
    ideal,
    period,
    slower,
    before,
    state,
    result,
):
    """Bring the model to within the noise of a measured position, and see how far that is.

    Parameters
    ----------
    q, passed, command, noise, period
        As `judge`.
    memory
        Time [s] over which corrections are added up.
    parted, allowed
        A joint may have parted by ``parted`` [rad, m], twice its noise, and what it moves in
        ``allowed`` [s].
    ideal
        Whether the arm does exactly what it was commanded to.
    slower
        Share of the command below which a joint of an ideal arm is taken as it moves.
    before
        Velocities (n,) that the next command may differ from by what acceleration allows;
        changed for joints that do not move as commanded.
    state
        The rows `P`, `PARTED`, `FASTEST` and `Q` are changed.
    result
        Results: the index of the joint that has parted most, and its share of what is allowed.
    """
    result[0], result[1] = 0.0, 0.0
    left = math.exp(-passed / memory)
    for i in range(q.size):
        p = state[P, i]
        new = min(max(p, q[i] - noise[i]), q[i] + noise[i])
        state[PARTED, i] = left * state[PARTED, i] + new - p
        state[P, i] = new
        state[FASTEST, i] = max(left * state[FASTEST, i], abs(command[i]))
        share = abs(state[PARTED, i]) / (parted + 2.0 * noise[i] + allowed * state[FASTEST, i])
        if share > result[1]:
            result[0], result[1] = float(i), share
        if ideal and passed > 0.5 * period:
            moved = (q[i] - state[Q, i]) / passed
            gap = abs(moved - before[i]) - slower * abs(before[i])
            if gap * passed > ROUNDING:
                if moved * before[i] <= 0.0:
                    before[i] = 0.0
                elif abs(moved) < abs(before[i]):
                    before[i] = moved
        state[Q, i] = q[i]


@njit(
    void(
        float64,
        COLUMN,
        ROWS,
        int64,
        FIXED,
        FIXED,
        float64,
        boolean,
        boolean,
        float64,
        float64,
        ROWS,
        COLUMN,
        COLUMN,
        ROWS,
        ROWS,
    ),
    cache=True,
)
def expect(  # type: ignore[no-untyped-def]
    now,
    times,
    commands,
    head,
    delay,
    lag,
    hold,
    exact,
    ideal,
    period,
    step,
    state,
    upper,
    lower,
    held_upper,
    held_lower,
):
    """Fill the row `Z`, and for an arm that is not ideal how far it may get; as `follow`."""
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


@njit(
    int64(
        COLUMN,
        float64,
        float64,
        COLUMN,
        ROWS,
        int64,
        FIXED,
        FIXED,
        FIXED,
        FIXED,
        float64,
        boolean,
        boolean,
        float64,
        float64,
        FIXED,
        COLUMN,
        ROWS,
        COLUMN,
        COLUMN,
        COLUMN,
        ROWS,
        ROWS,
    ),
    cache=True,
    prepared=True,
)
def follow(  # type: ignore[no-untyped-def]
    q,
    now,
    passed,
    times,
    commands,
    head,
    limit,
    delay,
    lag,
    noise,
    hold,
    ideal,
    exact,
    period,
    step,
    tolerances,
    before,
    state,
    result,
    upper,
    lower,
    held_upper,
    held_lower,
):
    """Go on to a measured position (n,): `advance`, `judge`, `correct`, `refer` and `farthest`.

    Parameters
    ----------
    q, limit, noise, before, result
        As `judge` and `correct`.
    now, passed, times, commands, head, delay, lag, hold, period, step, state
        As `advance` and `farthest`.
    ideal, exact
        Whether the arm does exactly what it is commanded to; whether its model is known to be
        where the arm is.
    tolerances
        ``times``, ``least`` and ``farthest`` of `judge`, then ``memory``, ``parted``,
        ``allowed`` and ``slower`` of `correct` (7,).
    upper, lower, held_upper, held_lower
        Results, as those of `farthest`.

    Returns
    -------
    int
        0 if the position cannot be believed, and nothing but the first step was done then; 1
        otherwise.
    """
    command = commands[head]
    if ideal:
        for i in range(q.size):
            state[P, i] += passed * command[i]
    else:
        advance(now, passed, times, commands, head, delay, lag, hold, period, state)
    judge(
        q, passed, command, limit, noise, period, tolerances[0], tolerances[1], tolerances[2],
        state, result,
    )  # fmt: skip
    if result[1] > 0.0:
        return 0
    correct(
        q, passed, command, noise, tolerances[3], tolerances[4], tolerances[5], ideal, period,
        tolerances[6], before, state, result,
    )  # fmt: skip
    expect(
        now, times, commands, head, delay, lag, hold, exact, ideal, period, step, state, upper,
        lower, held_upper, held_lower,
    )  # fmt: skip
    return 1
