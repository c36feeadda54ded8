"""Going on to a measured position of the arm, and judging it, compiled by numba.

Parameters of the arm and its commands are those of `tp_controller.commands_under_way`.
"""

from __future__ import annotations

import math

from tp_controller.arm_state import FASTEST, PARTED, V_HIGH, V_LOW, P, Q, V, Z
from tp_controller.array_types import COLUMN, FIXED, ROWS
from tp_controller.commands_under_way import ARM, REACH, advance, expect
from tp_controller.compiled import boolean, float64, int64, njit, void

ROUNDING = 1e-9
"""Movement [rad, m] of a step that may be rounding."""


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
        *[float64] * 3,
        boolean,
        *[float64] * 2,
        COLUMN,
        ROWS,
        COLUMN,
    ),
    cache=True,
)
def correct(  # type: ignore[no-untyped-def]
    q, passed, command, noise, memory, parted, allowed, ideal, period, slower, before, state,
    result,
):  # fmt: skip
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
    int64(
        COLUMN, float64, int64, float64, FIXED, COLUMN, float64, COLUMN, ROWS, FIXED, FIXED, FIXED,
        float64, boolean, boolean, float64, FIXED, ROWS, COLUMN, *REACH,
    ),
    cache=True,
    prepared=True,
)  # fmt: skip
def follow(  # type: ignore[no-untyped-def]
    q, now, head, step, limit, before, passed, times, commands, delay, lag, noise, hold, ideal,
    exact, period, tolerances, state, result, upper, lower, held_upper, held_lower,
):  # fmt: skip
    """Go on to a measured position (n,): `advance`, `judge`, `correct` and `expect`.

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


@njit(
    int64(
        COLUMN, float64, int64, float64, FIXED, COLUMN, boolean, COLUMN, COLUMN, ROWS, *ARM,
        boolean, boolean, float64, float64, ROWS, *REACH,
    ),
    cache=True,
    prepared=True,
)  # fmt: skip
def begin(  # type: ignore[no-untyped-def]
    q, now, head, step, limit, before, moves, qd, times, commands, delay, lag, hold, ideal, exact,
    period, highest, state, upper, lower, held_upper, held_lower,
):  # fmt: skip
    """Begin at a measured position (n,).

    Parameters
    ----------
    q, now, head, step, limit, times, commands, delay, lag, hold, ideal, exact, period, state
        As `follow`.
    moves, qd
        Whether the measured velocities (n,) count. If they are finite the arm was commanded to
        move so all the time, no joint faster than its limit.
    highest
        Position [rad, m] that no joint exceeds.
    before
        Result (n,): the velocities, where they count.
    upper, lower, held_upper, held_lower
        Results, as those of `farthest`.

    Returns
    -------
    int
        0 if no joint can be at such a position, and nothing was done then; 1 otherwise.
    """
    known = moves
    for i in range(q.size):
        if not abs(q[i]) <= highest:
            return 0
        known = known and math.isfinite(qd[i])
    for i in range(q.size):
        state[Z, i] = state[P, i] = state[Q, i] = q[i]
        if known:
            # A joint that says more than it can do does not say the truth.
            speed = min(max(qd[i], -limit[i]), limit[i])
            before[i] = state[V, i] = state[V_HIGH, i] = state[V_LOW, i] = speed
            for k in range(commands.shape[0]):
                commands[k, i] = speed
    expect(
        now, times, commands, head, delay, lag, hold, exact, ideal, period, step, state, upper,
        lower, held_upper, held_lower,
    )  # fmt: skip
    return 1
