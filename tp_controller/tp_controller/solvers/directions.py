"""Directions of a level in the freedom that it has, compiled by numba: no allocation.

Bases and singular vectors are kept as rows, so that every inner loop runs over neighbouring
numbers. Numba compiles a file again when that file itself changes: after a change here remove
the caches of those who call it, as set-up does.
"""

from __future__ import annotations

import math

from tp_controller.compiled import inner
from tp_controller.solvers.jacobi import orthogonalise

STILL = 1e-13
"""A row of a Jacobian that is shorter [m/rad, -] is rounding: no joint moves it."""


@inner
def reduce(N, V, rank, m, n):  # type: ignore[no-untyped-def]
    """Take directions out of a basis: its m rows (n,) become m - rank.

    The directions are the ``rank`` orthonormal rows (m,) of V, in coordinates of the basis.
    Householder reflections turn the basis until they are its first rows; these are left out.
    """
    if rank == m:
        return
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
            along = 0.0
            for c in range(i, m):
                along += V[i, c] * V[j, c]
            for c in range(i, m):
                V[j, c] -= 2.0 * along * V[i, c]
        for c in range(n):
            along = 0.0
            for row in range(i, m):
                along += V[i, row] * N[row, c]
            for row in range(i + 1, m):
                N[row, c] -= 2.0 * along * V[i, row]
    for row in range(rank, m):
        for c in range(n):
            N[row - rank, c] = N[row, c]


@inner
def gather(J, velocity, acts, first, k, qd, order, residual):  # type: ignore[no-untyped-def]
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


@inner
def invert(J, order, k, N, m, rule, smallest, sides, answers, count, B, W, U, S):  # type: ignore[no-untyped-def]
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
    orthogonalise(B, W, p, q, True)
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
