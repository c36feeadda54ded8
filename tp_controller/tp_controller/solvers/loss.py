"""Second derivatives of what a level loses, compiled by numba: no allocation.

``M = -Σ wᵣ ∂²σᵣ/∂q²`` over the rows of a level, with what they lose as weights, and those of the
levels above, with multipliers as weights; see `settling`.
"""

from __future__ import annotations

import math

from tp_controller.compiled import inner
from tp_controller.solvers.jacobi import eigenvectors

REGULAR = 1e-6
"""Square of the damping of the multipliers."""


@inner
def keep(N, m, B, U, S, order, k, rank, count, taken, rows, lengths):  # type: ignore[no-untyped-def]
    """Note the directions that a level takes, for the multipliers of levels below.

    Parameters
    ----------
    N, m
        Basis (m, n) of the level's freedom.
    B, U, S, order, k, rank
        Singular vectors and values of the level, see `directions.invert`.
    count
        How many directions levels above have taken.
    taken, rows, lengths
        Results: joint velocities (D, n), rows' shares (D, K) and singular values (D,).

    Returns
    -------
    int
        How many directions are taken now.
    """
    for i in range(rank):
        d = count + i
        for c in range(N.shape[1]):
            entry = 0.0
            for j in range(m):
                entry += B[i, j] * N[j, c]
            taken[d, c] = entry
        rows[d, :] = 0.0
        for r in range(k):
            rows[d, int(order[r])] = U[i, r]
        lengths[d] = S[i]
    return count + rank


@inner
def add_multipliers(J, first, end, count, taken, rows, lengths, weights, pull):  # type: ignore[no-untyped-def]
    """Fill the weights (K,) of rows above ``first`` that balance those of a level.

    The pull ``Jᵀ w`` of the level's rows is taken back along every direction that levels above
    have taken, the last one first: rows of a level do not move what lower levels have taken.
    """
    n = pull.size
    weights[:first] = 0.0
    for c in range(n):
        pull[c] = 0.0
        for r in range(first, end):
            pull[c] += weights[r] * J[r, c]
    for d in range(count - 1, -1, -1):
        along = 0.0
        for c in range(n):
            along += taken[d, c] * pull[c]
        along *= lengths[d] / (lengths[d] * lengths[d] + REGULAR)
        if along == 0.0:
            continue
        for r in range(end):
            share = along * rows[d, r]
            if share != 0.0:
                weights[r] -= share
                for c in range(n):
                    pull[c] -= share * J[r, c]


@inner
def curvature(weights, end, hessians, offset, N, m, raw, half, out):  # type: ignore[no-untyped-def]
    """Fill ``-Σ wᵣ ∂²σᵣ/∂q²`` (m, m) in coordinates of the m rows (n,) of a basis.

    The matrices ``raw`` (n, n) and ``half`` (m, n) are space to work in.
    """
    n = N.shape[1]
    for i in range(n):
        for j in range(i + 1):
            raw[i, j] = 0.0
    for r in range(offset, end):
        weight = weights[r]
        if weight != 0.0:
            for i in range(n):
                for j in range(i + 1):
                    raw[i, j] -= weight * hessians[r - offset, i, j]
    for i in range(n):
        for j in range(i):
            raw[j, i] = raw[i, j]
    for a in range(m):
        for i in range(n):
            half[a, i] = 0.0
        for j in range(n):
            share = N[a, j]
            if share != 0.0:
                for i in range(n):
                    half[a, i] += share * raw[j, i]
    for a in range(m):
        for b in range(a + 1):
            total = 0.0
            for i in range(n):
                total += half[a, i] * N[b, i]
            out[a, b] = out[b, a] = total


@inner
def how_close(s, near):  # type: ignore[no-untyped-def]
    """How close a singular value is to being lost: 1 up to ``near / 2``, nothing from there on."""
    return min(max(2.0 - 2.0 * s / near, 0.0), 1.0)


@inner
def largest_eigenvalue(A, B, S, near, m, rank, raw, W):  # type: ignore[no-untyped-def]
    """Largest eigenvalue, or 0, of a curvature (m, m) without the regular directions of a level.

    What is left are the directions close to being lost and those that the level does not move.
    Near a singularity these turn into each other, by 1/s per radian; the largest curvature of all
    of them does not depend on that.
    """
    for a in range(m):
        for b in range(m):
            raw[a, b] = A[a, b]
    for i in range(rank):
        regular = 1.0 - how_close(S[i], near)
        if regular == 0.0:
            continue
        for b in range(m):
            along = 0.0
            for a in range(m):
                along += B[i, a] * raw[a, b]
            for a in range(m):
                raw[a, b] -= regular * along * B[i, a]
        for a in range(m):
            along = 0.0
            for b in range(m):
                along += B[i, b] * raw[a, b]
            for b in range(m):
                raw[a, b] -= regular * along * B[i, b]
    shift = eigenvectors(raw, W, m, False)
    largest = 0.0
    for a in range(m):
        length = 0.0
        for b in range(m):
            length += raw[a, b] * raw[a, b]
        largest = max(largest, math.sqrt(length) - shift)
    return largest
