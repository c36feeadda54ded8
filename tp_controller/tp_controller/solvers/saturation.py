"""The recursion inside a box of joint velocities, compiled by numba."""

from __future__ import annotations

import math

from numba import boolean, float64, int64, njit

from tp_controller.solvers.kernel import COLUMN, FIXED, ROWS, gather, invert, reduce_basis

SHORT = 1e-8
"""A joint that the freedom moves by less than this share cannot be held by it."""


@njit(cache=True)
def _interval(start, way, limit, held):  # type: ignore[no-untyped-def]
    """Shares s for which ``start + s way`` (n,) is inside the limits; held joints do not count.

    Returns
    -------
    float, float, int
        The least and the largest share, and the joint that sets the largest, -1 if none does.
    """
    low, high, critical = -math.inf, math.inf, -1
    for c in range(start.size):
        if held[c] != 0.0 or way[c] == 0.0:
            continue
        ahead = (math.copysign(limit[c], way[c]) - start[c]) / way[c]
        behind = (math.copysign(limit[c], -way[c]) - start[c]) / way[c]
        low = max(low, behind)
        if ahead < high:
            high, critical = ahead, c
    return low, high, critical


@njit(
    boolean(
        ROWS,
        COLUMN,
        int64[::1],
        ROWS,
        ROWS,
        float64,
        FIXED,
        float64[:, :, ::1],
        COLUMN,
        COLUMN,
    ),
    cache=True,
)
def resolve_within(J, velocity, starts, rules, basis, tolerance, limit, work, shares, qd):  # type: ignore[no-untyped-def]
    """Resolve levels one after the other so that no joint ever exceeds its limit.

    Each level starts from the velocity of those above it, which is inside the limits, and
    may use what they leave. Where its step leads out, the joint that meets its limit first
    is held there and the others make up for it; this goes on until the level has what it
    asks for, or the joints that are left cannot move all of it. Then it gets the largest
    share that was found (Flacco, De Luca and Khatib 2015). Levels above are never touched.

    Parameters
    ----------
    J, velocity, starts, rules, basis, tolerance
        As for `resolve`.
    limit
        Largest speed of every joint (n,); infinite if there is none.
    work
        Space to work in, see `workspace`.
    shares
        Share (levels,) of what is left to each level that it gets, from 0 to 1; a result.
    qd
        Joint velocity (n,), the result.

    Returns
    -------
    bool
        False if a Jacobian or the result is not finite.
    """
    n = qd.size
    qd[:] = 0.0
    shares[:] = 1.0
    N, spare, B, W, Z = work[0], work[1], work[2], work[3], work[5]
    sides, answers, order = work[4, 0:2], work[6, 0:2], work[4, 2]
    base, start, way = work[7, 0, :n], work[7, 1, :n], work[7, 2, :n]
    best, held = work[8, 0, :n], work[8, 1, :n]
    N[:n, :n] = basis
    m = n
    for level in range(starts.size - 1):
        first, k = starts[level], starts[level + 1] - starts[level]
        k, square = gather(J, velocity, first, k, qd, order, sides[0])
        if not square < math.inf:
            return False
        smallest = tolerance * math.sqrt(square)
        full = invert(J, order, k, N[:, :n], m, rules[level], smallest, sides, answers, 1, B, W)
        if full == 0:
            continue
        for c in range(n):
            base[c] = start[c] = qd[c]
            held[c] = way[c] = 0.0
            for j in range(m):
                Z[j, c] = N[j, c]
                way[c] += answers[0, j] * N[j, c]
        freedom = m
        if full < m:
            reduce_basis(N, spare, B, answers[1], full, m, n)
        m -= full
        share = -1.0
        while True:
            low, high, critical = _interval(start, way, limit, held)
            reached = min(1.0, high)
            if max(low, 0.0) <= reached and reached > share:
                share = reached
                for c in range(n):
                    best[c] = start[c] + share * way[c]
            if critical < 0 or share >= 1.0:
                break
            length = 0.0
            for j in range(freedom):
                length += Z[j, critical] * Z[j, critical]
            if freedom == 1 or length < SHORT * SHORT:
                break
            # Hold the joint at its limit, by the shortest change of what is free.
            gap = math.copysign(limit[critical], way[critical]) - base[critical]
            for c in range(n):
                change = 0.0
                for j in range(freedom):
                    change += Z[j, critical] * Z[j, c]
                start[c] = base[c] + gap / length * change
            for c in range(n):
                base[c] = start[c]
            held[critical] = 1.0
            for j in range(freedom):
                B[0, j] = Z[j, critical] / math.sqrt(length)
            reduce_basis(Z, spare, B, answers[1], 1, freedom, n)
            freedom -= 1
            # The level's own velocity has changed with that, and has to be taken back.
            for i in range(k):
                moved = 0.0
                for c in range(n):
                    moved += J[int(order[i]), c] * (base[c] - qd[c])
                sides[1, i] = moved
            rank = invert(
                J, order, k, Z[:, :n], freedom, rules[level], smallest, sides, answers, 2, B, W
            )
            if rank < full:
                break
            for c in range(n):
                way[c] = 0.0
                for j in range(freedom):
                    way[c] += answers[0, j] * Z[j, c]
                    start[c] -= answers[1, j] * Z[j, c]
        shares[level] = max(share, 0.0)
        if share >= 0.0:
            for c in range(n):
                # Rounding may leave a component one unit in the last place outside.
                qd[c] = min(max(best[c], -limit[c]), limit[c])
        if m == 0:
            break
    finite = True
    for c in range(n):
        finite = finite and math.isfinite(qd[c])
    return finite
