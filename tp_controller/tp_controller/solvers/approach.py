"""Speed at which levels approach their targets, compiled by numba: no allocation.

A level asks for the velocity K e, which is too fast near the target where the joints cannot brake
with that gain. So what it asks for is made smaller, all of it by the same factor, until every
joint could stop at the end of its way to the target, as far as that is known from the Jacobian.
"""

from __future__ import annotations

import math

import numpy as np
from numba import boolean, float64, int64, njit, void

from tp_controller.braking import viable_speed
from tp_controller.solvers.directions import gather, invert, reduce

SHARE, LOWER_SHARE = 0.6, 0.4
"""Share of the acceleration limits that braking at a target may need, in the first level and in
those below. The rest is for ways that bend, and for what levels above need of the same joints."""

ROWS = float64[:, ::1]
COLUMN = float64[::1]


@njit(
    void(
        ROWS,
        COLUMN,
        COLUMN,
        COLUMN,
        boolean[::1],
        int64[::1],
        ROWS,
        ROWS,
        float64,
        COLUMN,
        float64,
        float64[:, :, ::1],
    ),
    cache=True,
)
def slow_down(  # type: ignore[no-untyped-def]
    J, velocity, feedforward, errors, acts, starts, rules, basis, tolerance, change, dt, work
):
    """Make the gain term of every level small enough for the joints to brake in time.

    Parameters
    ----------
    J
        Rows (K, n) of all levels, highest first.
    velocity
        Desired task velocity (K,); its gain term is made smaller.
    feedforward
        The part (K,) of it that stays.
    errors
        Errors (K,) of the rows.
    acts
        Which rows are to have their velocity (K,).
    starts, rules, basis, tolerance
        As `kernel.resolve`.
    change
        By how much the velocity of each joint may change (n,) from step to step.
    dt
        Time [s] of one step.
    work
        Space to work in, see `workspace`.
    """
    n, levels = basis.shape[0], starts.size - 1
    N, spare, B, W, U = work[0], work[1], work[2], work[3], work[4]
    sides, answers, S = work[5, 0:2], work[6, 0:3], work[7, 0]
    order, still = work[7, 1], work[7, 2, :n]
    for c in range(n):
        still[c] = 0.0
        for j in range(n):
            N[j, c] = basis[j, c]
    m = n
    for level in range(levels):
        first, end = starts[level], starts[level + 1]
        k, square = gather(J, velocity, acts, first, end - first, still, order, sides[0])
        if k == 0 or not square < math.inf:
            continue
        asked = size = 0.0
        for i in range(k):
            r = int(order[i])
            sides[0, i] = velocity[r] - feedforward[r]
            sides[1, i] = errors[r]
            asked += sides[0, i] ** 2
            size += sides[1, i] ** 2
        smallest = tolerance * math.sqrt(square)
        rank = invert(
            J, order, k, N[:, :n], m, rules[level], smallest, sides, answers, 2, B, W, U, S
        )
        if asked > 0.0 and size > 0.0:
            gain = math.sqrt(asked / size)
            share = SHARE if level == 0 else LOWER_SHARE
            factor = 1.0
            for c in range(n):
                speed = way = 0.0
                for j in range(m):
                    speed += answers[0, j] * N[j, c]
                    way += answers[1, j] * N[j, c]
                speed = abs(speed)
                # Where rows with different gains meet in a joint, its way alone says too little.
                way = max(abs(way), speed / gain)
                able = viable_speed(way, share * change[c], dt)
                if speed > able:
                    factor = min(factor, able / speed)
            if factor < 1.0:
                for i in range(k):
                    velocity[int(order[i])] -= (1.0 - factor) * sides[0, i]
        if level + 1 < levels and rank > 0:
            if rank == m:
                return
            reduce(N, spare, B, answers[2], rank, m, n)
            m -= rank


def workspace(rows: int, n: int) -> np.ndarray:
    """Space for up to ``rows`` rows in all and n joints."""
    size = max(rows, n, 3) + n + 1
    return np.zeros((8, size, size))
