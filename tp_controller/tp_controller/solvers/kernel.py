"""The recursion over levels inside velocity limits, compiled by numba: no allocation.

Everything here works in arrays that the caller made. Bases and singular vectors are kept as
rows, so that every inner loop runs over neighbouring numbers. Importing this module compiles
it, or loads what an earlier process compiled: no cycle ever waits for the compiler. All of it
is in one file, because a change of another one would not make numba compile it again.
"""

from __future__ import annotations

import math

import numpy as np
from numba import boolean, float64, int64, njit, types

from tp_controller.solvers.settling import (
    LOSES,
    NOTHING,
    UNKNOWN,
    keep,
    orthogonalise,
    reserve,
    settle,
)

STILL = 1e-13
"""A row of a Jacobian that is shorter [m/rad, -] is rounding: no joint moves it."""
SHORT = 1e-8
"""A joint that the freedom moves by less than this share cannot be held by it."""

PLAIN, SIMPLE, BENT = 0, 1, 2
"""Whether levels are settled: not at all, without second derivatives as long as it is certain
that they would change nothing, and with them."""
FAILED, DONE = 0, 1
"""What `resolve` returns, beside `UNKNOWN`."""

ROWS = float64[:, ::1]
CUBE = float64[:, :, ::1]
COLUMN = float64[::1]
FIXED = types.Array(float64, 1, 'C', readonly=True)


@njit(cache=True)
def _reduce(N, spare, V, x, rank, m, n):  # type: ignore[no-untyped-def]
    """Take directions out of a basis: its m rows (n,) become m - rank.

    The directions are the ``rank`` orthonormal rows (m,) of V, in coordinates of the basis;
    their orthonormal complement comes from Householder reflections.
    """
    for i in range(rank):
        norm = 0.0
        for c in range(i, m):
            norm += V[i, c] * V[i, c]
        norm = math.sqrt(norm)
        V[i, i] += norm if V[i, i] >= 0.0 else -norm
        length = 0.0
        for c in range(i, m):
            length += V[i, c] * V[i, c]
        length = math.sqrt(length)
        for c in range(i, m):
            V[i, c] /= length
        for j in range(i + 1, rank):
            _reflect(V[j], V[i], i, m)
    for row in range(rank, m):
        for c in range(m):
            x[c] = 1.0 if c == row else 0.0
        for i in range(rank - 1, -1, -1):
            _reflect(x, V[i], i, m)
        for c in range(n):
            entry = 0.0
            for j in range(m):
                entry += x[j] * N[j, c]
            spare[row - rank, c] = entry
    for row in range(m - rank):
        for c in range(n):
            N[row, c] = spare[row, c]


@njit(cache=True)
def _reflect(x, normal, first, m):  # type: ignore[no-untyped-def]
    """Reflect a vector at the plane with a unit normal whose first entries are zero."""
    along = 0.0
    for c in range(first, m):
        along += normal[c] * x[c]
    for c in range(first, m):
        x[c] -= 2.0 * along * normal[c]


@njit(cache=True)
def _gather(J, velocity, acts, first, k, qd, order, residual):  # type: ignore[no-untyped-def]
    """List a level's rows that act and joints can move, and what is left of their velocities.

    A row of zeros asks for nothing, and without it not even the order of sums changes. A
    level of nothing but rounding would ask for speeds without bound.

    Returns
    -------
    int, float
        How many there are, and the square of their Frobenius norm.
    """
    square = 0.0
    filled = 0
    for i in range(first, first + k):
        if not acts[i]:
            continue
        gap, length = velocity[i], 0.0
        for c in range(qd.size):
            length += J[i, c] * J[i, c]
            gap -= J[i, c] * qd[c]
        square += length
        if length > STILL * STILL:
            residual[filled] = gap
            order[filled] = i
            filled += 1
    return filled, square


@njit(cache=True)
def _invert(J, order, k, N, m, rule, smallest, sides, answers, count, B, W, U, S):  # type: ignore[no-untyped-def]
    """Answer right sides by a filtered inverse of ``J N``, in coordinates of the basis N.

    Parameters
    ----------
    J, order, k
        Rows (K, n), and which k of them count.
    N, m
        The m rows (n,) of the basis.
    rule
        λ and ε: a direction of singular value s is damped by ``λ² max(0, 1 - (s/ε)²)``.
    smallest
        Singular values up to this one count for nothing.
    sides, answers, count
        ``count`` right sides (k,), and room for their answers (m,), one per row.
    B, W
        Space to work in. The first rows (m,) of B are then orthonormal: the directions that
        the level has taken.
    U, S
        Results: for each of these directions the rows' shares (k,), of unit length, and the
        singular value.

    Returns
    -------
    int
        The rank.
    """
    n = N.shape[1]
    # The rows of B are those of J N, or its columns where those are fewer.
    tall = k > m
    p, q = (m, k) if tall else (k, m)
    for i in range(k):
        row = int(order[i])
        for j in range(m):
            entry = 0.0
            for c in range(n):
                entry += J[row, c] * N[j, c]
            if tall:
                B[j, i] = entry
            else:
                B[i, j] = entry
    orthogonalise(B, W, p, q)
    for side in range(count):
        for c in range(m):
            answers[side, c] = 0.0
    rank = 0
    for i in range(p):
        s = 0.0
        for c in range(q):
            s += B[i, c] * B[i, c]
        s = math.sqrt(s)
        # Directions outside the rank stay out: damping near 0 would amplify rounding.
        if not s > smallest:
            continue
        near = 1.0 - (s / rule[1]) ** 2
        filtered = s * s + (rule[0] ** 2 * near if near > 0.0 else 0.0)
        left, right = (B, W) if tall else (W, B)
        for side in range(count):
            along = 0.0
            for c in range(k):
                along += left[i, c] * sides[side, c]
            for c in range(m):
                answers[side, c] += along / filtered * right[i, c]
        for c in range(k):
            U[rank, c] = B[i, c] / s if tall else W[i, c]
        for c in range(m):
            B[rank, c] = W[i, c] if tall else B[i, c] / s
        S[rank] = s
        rank += 1
    return rank


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
    int64(
        ROWS,
        COLUMN,
        boolean[::1],
        int64[::1],
        ROWS,
        ROWS,
        float64,
        FIXED,
        float64[:, :, ::1],
        COLUMN,
        int64,
        int64,
        COLUMN,
        CUBE,
        COLUMN,
        COLUMN,
    ),
    cache=True,
)
def resolve(  # type: ignore[no-untyped-def]
    J, velocity, acts, starts, rules, basis, tolerance, limit, work, shares,
    settling, offset, errors, hessians, bends, qd,
):  # fmt: skip
    """Resolve levels one after the other so that no joint ever exceeds its limit.

    Each level starts from the velocity of those above it, which is inside the limits, and
    may use what they leave. Where its step leads out, the joint that meets its limit first
    is held there and the others make up for it; this goes on until the level has what it
    asks for, or the joints that are left cannot move all of it. Then it gets the largest
    share that was found (Flacco, De Luca and Khatib 2015). Levels above are never touched.

    Parameters
    ----------
    J
        Rows of all levels (K, n), highest first.
    velocity
        Desired task velocity (K,).
    acts
        Which of the rows count (K,).
    starts
        First row of every level, then K (levels + 1,).
    rules
        λ and ε of every level (levels, 2), see `_invert`.
    basis
        Rows (n, n) that span the joint velocities, orthonormal in the metric to minimise.
    tolerance
        Singular values below this times ‖J‖ (Frobenius) count for nothing.
    limit
        Largest speed of every joint (n,); infinite if there is none.
    work
        Space to work in, see `workspace`.
    shares
        Share (levels,) of what is left to each level that it gets, from 0 to 1; a result.
    settling
        `PLAIN`: the published laws alone. Else levels that cannot get what they ask for are
        settled, see `settling`: `BENT` with second derivatives that are known, `SIMPLE` without.
    offset, errors, hessians, bends
        First row that has an error, and for the rows from there on their errors (E,), the
        second derivatives (E, n, n) of their variables, and bounds (E,) on those.
    qd
        Joint velocity (n,), the result.

    Returns
    -------
    int
        `DONE`, `FAILED` if a Jacobian or the result is not finite, or `UNKNOWN` if second
        derivatives are needed.
    """
    n = qd.size
    qd[:] = 0.0
    shares[:] = 1.0
    N, spare, B, W, Z = work[0], work[1], work[2], work[3], work[5]
    sides, answers, order = work[4, 0:2], work[6, 0:2], work[4, 2]
    base, start, way = work[7, 0, :n], work[7, 1, :n], work[7, 2, :n]
    best, held = work[8, 0, :n], work[8, 1, :n]
    U, S = work[9], work[10, 0]
    taken, rows, lengths = work[11], work[12], work[10, 1]
    raw, A, turn = work[13], work[14], work[15]
    weights, lost, pull = work[10, 2, : velocity.size], work[10, 3, : velocity.size], work[10, 4]
    N[:n, :n] = basis
    m = n
    count, levels = 0, starts.size - 1
    for level in range(levels):
        first, end = starts[level], starts[level + 1]
        k, square = _gather(J, velocity, acts, first, end - first, qd, order, sides[0])
        if not square < math.inf:
            return FAILED
        smallest = tolerance * math.sqrt(square)
        full = _invert(
            J, order, k, N[:, :n], m, rules[level], smallest, sides, answers, 1, B, W, U, S
        )
        found = NOTHING
        if settling != PLAIN:
            found = settle(
                J, order, k, first, end, acts, errors, hessians, bends, settling == BENT, offset,
                N[:, :n], m, full, B, U, S, sides[0], rules[level], square, level + 1 < levels,
                count, taken, rows, lengths, weights, pull[:n], raw, A, turn, lost, answers[0],
            )  # fmt: skip
            if found == UNKNOWN:
                return UNKNOWN
            above = count
            count = keep(N[:, :n], m, B, U, S, order, k, full, count, taken, rows, lengths)
        if full == 0 and found == NOTHING:
            continue
        for c in range(n):
            base[c] = start[c] = qd[c]
            held[c] = way[c] = 0.0
            for j in range(m):
                Z[j, c] = N[j, c]
                way[c] += answers[0, j] * N[j, c]
            # Comparisons with limits would say nothing about what is not finite.
            if not math.isfinite(way[c]):
                return FAILED
        freedom = m
        if full < m:
            _reduce(N, spare, B, answers[1], full, m, n)
        m -= full
        if found != NOTHING and m > 0:
            m = reserve(
                J, first, end, square, hessians, offset, lost, above, taken, rows, lengths,
                weights, pull[:n], raw, A, turn, N[:, :n], m,
            )  # fmt: skip
        share = -1.0
        while True:
            low, high, critical = _interval(start, way, limit, held)
            reached = min(1.0, high)
            if max(low, 0.0) <= reached and reached > share:
                share = reached
                for c in range(n):
                    best[c] = start[c] + share * way[c]
            # A level that loses is scaled: holding joints would change what it loses.
            if critical < 0 or share >= 1.0 or found == LOSES:
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
            _reduce(Z, spare, B, answers[1], 1, freedom, n)
            freedom -= 1
            # The level's own velocity has changed with that, and has to be taken back.
            for i in range(k):
                moved = 0.0
                for c in range(n):
                    moved += J[int(order[i]), c] * (base[c] - qd[c])
                sides[1, i] = moved
            rank = _invert(
                J, order, k, Z[:, :n], freedom, rules[level], smallest, sides, answers, 2, B, W, U, S
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
    return DONE if finite else FAILED


@njit(float64(COLUMN, FIXED), cache=True)
def shorten(qd, limit):  # type: ignore[no-untyped-def]
    """Scale a joint velocity (n,) in place until no component exceeds its limit (n,).

    The whole vector is scaled, so its direction is kept.

    Returns
    -------
    float
        The factor in (0, 1] that was applied.
    """
    excess = 1.0
    for i in range(qd.size):
        excess = max(excess, abs(qd[i]) / limit[i])
    if excess > 1.0:
        for i in range(qd.size):
            # Rounding may leave a component one unit in the last place outside.
            qd[i] = min(max(qd[i] / excess, -limit[i]), limit[i])
    return 1.0 / excess


@njit(float64(COLUMN, FIXED, FIXED), cache=True)
def outside(qd, lower, upper):  # type: ignore[no-untyped-def]
    """By how much the component that is farthest outside its bounds (n,) is; else at most 0."""
    farthest = -math.inf
    for i in range(qd.size):
        farthest = max(farthest, qd[i] - upper[i], lower[i] - qd[i])
    return farthest


def workspace(rows: int, n: int) -> np.ndarray:
    """Space for up to ``rows`` rows in all and n joints."""
    size = max(rows, n, 5)
    return np.zeros((16, size, size))
