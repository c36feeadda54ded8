"""The second pass of the hierarchical QP, compiled by numba: no allocation.

It calls `kernel.resolve`; after a change there numba has to be told to compile it again, by
removing its cache.
"""

from __future__ import annotations

import math

from tp_controller.array_types import COLUMN, CUBE, FIXED, ROWS
from tp_controller.compiled import boolean, float64, int64, njit, void
from tp_controller.solvers.codes import DONE, UNKNOWN
from tp_controller.solvers.kernel import recur

ROUNDING = 1e-9
"""A joint that is nearer [rad/s, m/s] to its bound is at it."""
FAILS, BENT = -1, -2
"""What `ask_again` returns if a level is not finite, and if second derivatives are needed."""
NOTHING, ONE, SEVERAL = 0, 1, 2
"""What `ask_again` found: nothing stopped a level; one recursion answers all; several do."""


@njit(
    int64(
        ROWS, ROWS, boolean[:, ::1], int64[::1], ROWS, CUBE, float64, ROWS, COLUMN, CUBE, COLUMN,
        int64[::1], int64, ROWS, CUBE, boolean[::1], int64[::1], int64[::1], FIXED, FIXED, COLUMN,
        COLUMN,
    ),
    cache=True,
)  # fmt: skip
def ask_again(  # type: ignore[no-untyped-def]
    J, values, flags, starts, rules, metric, tolerance, endless, still, work, shares,
    stops, settling, known, hessians, equal, stopped_rows, stopped_joints, range_lower,
    range_upper, asked, qd,
):  # fmt: skip
    """Fill what levels ask for together with what stopped them.

    Parameters
    ----------
    J, values
        Rows (n + K, n) of the n joints, as a level above all others, and of the levels; what they
        ask for, and room for what `recur` makes of that (3, n + K).
    flags, starts, rules, metric, tolerance, work, shares, stops, settling, known, hessians
        As `kernel.resolve`; which rows act is filled in here.
    endless, still
        Bounds (2, n) that are none, and zeros (n,).
    equal
        Which of the other rows always act (K,).
    stopped_rows, stopped_joints
        First level that each row (K,) and joint (n,) stopped, negative if none; joints that are
        not at the ends of their ranges are taken out.
    range_lower, range_upper
        Between what the ranges let the joints move (n,).
    asked
        What the rows ask for (K,); those that always act are a result.
    qd
        Answer of the first pass (n,), and then the recursion's last one.

    Returns
    -------
    int
        `NOTHING`, `ONE` or `SEVERAL`; `FAILS` or `BENT`.
    """
    n, k, wish = qd.size, asked.size, values[0]
    stopped = False
    for i in range(n):
        # Other limits come in anew with the second pass.
        if range_lower[i] + ROUNDING < qd[i] < range_upper[i] - ROUNDING:
            stopped_joints[i] = -1
        stopped = stopped or stopped_joints[i] >= 0
        wish[i] = qd[i]
    for i in range(k):
        stopped = stopped or stopped_rows[i] >= 0
    found = NOTHING
    last = -1
    for level in range(starts.size - 2):
        first, end = starts[level + 1] - n, starts[level + 2] - n
        always = False
        for row in range(first, end):
            always = always or equal[row]
        if not (stopped and always):
            continue
        # Something new comes in only where a level was stopped.
        new = found == NOTHING
        for i in range(n):
            new = new or last < stopped_joints[i] <= level
        for i in range(k):
            new = new or last < stopped_rows[i] <= level
        if new:
            for i in range(n):
                flags[0, i] = 0 <= stopped_joints[i] <= level
            for i in range(k):
                flags[0, n + i] = equal[i] or 0 <= stopped_rows[i] <= level
            done = recur(
                J, values, flags, starts, rules, metric, tolerance, boolean(False),
                boolean(False), endless[0], endless[1], endless[0], endless[1], work, shares,
                stops, settling, n, known, hessians, still, endless[1], math.inf, qd,
            )  # fmt: skip
            if done != DONE:
                return BENT if done == UNKNOWN else FAILS
            found = ONE if found == NOTHING else SEVERAL
            last = level
        for row in range(first, end):
            if equal[row]:
                asked[row] = 0.0
                for c in range(n):
                    asked[row] += J[n + row, c] * qd[c]
    return found


@njit(
    void(
        int64[::1], int64[::1], int64[::1], int64[::1], COLUMN, COLUMN, COLUMN, COLUMN, COLUMN,
        float64,
    ),
    cache=True,
)  # fmt: skip
def merge(  # type: ignore[no-untyped-def]
    rows, joints, was_rows, was_joints, moved, velocity, qd, lower, upper, binding
):
    """Add what stopped the first pass and still binds to what stopped the second."""
    for i in range(rows.size):
        if rows[i] < 0 and moved[i] <= velocity[i] + binding:
            rows[i] = was_rows[i]
    for i in range(joints.size):
        if joints[i] < 0 and not lower[i] + ROUNDING < qd[i] < upper[i] - ROUNDING:
            joints[i] = was_joints[i]


@njit(void(COLUMN, COLUMN, boolean[::1], int64[::1], COLUMN), cache=True)
def note_shares(asked, moved, equal, starts, shares):  # type: ignore[no-untyped-def]
    """Fill the share (levels,) of what the equal rows (K,) of each level ask for that they get.

    From 0 to 1; a level that asks for nothing keeps what it has.
    """
    for level in range(shares.size):
        size = along = 0.0
        for r in range(starts[level], starts[level + 1]):
            if equal[r]:
                size += asked[r] * asked[r]
                along += asked[r] * moved[r]
        if size > 0.0:
            shares[level] = min(max(along / size, 0.0), 1.0)
