"""One step of Levenberg and Marquardt inside ranges, compiled by numba."""

from __future__ import annotations

import math

from tp_controller.array_types import COLUMN, ROWS
from tp_controller.compiled import boolean, float64, inner, njit

LEAST = 1e-10
"""Least damping λ."""
FLAT = 1e-14
"""A pivot of the normal equations up to this one moves nothing."""


@inner
def solve_free(A, b, free, L, way):  # type: ignore[no-untyped-def]
    """Solve ``A way = b`` for joints that are free, by Cholesky; the others do not move."""
    n = b.size
    for j in range(n):
        way[j] = 0.0
        if not free[j]:
            continue
        for i in range(j, n):
            if not free[i]:
                continue
            total = A[i, j]
            for k in range(j):
                if free[k]:
                    total -= L[i, k] * L[j, k]
            if i == j:
                L[j, j] = math.sqrt(max(total, FLAT))
            else:
                L[i, j] = total / L[j, j]
    for i in range(n):
        if free[i]:
            total = b[i]
            for k in range(i):
                if free[k]:
                    total -= L[i, k] * way[k]
            way[i] = total / L[i, i]
    for i in range(n - 1, -1, -1):
        if free[i]:
            total = way[i]
            for k in range(i + 1, n):
                if free[k]:
                    total -= L[k, i] * way[k]
            way[i] = total / L[i, i]


@njit(
    float64(
        ROWS, COLUMN, COLUMN, COLUMN, COLUMN, float64, boolean[::1], ROWS, ROWS, COLUMN, COLUMN
    ),
    cache=True,
)
def step(J, error, x, low, high, longest, free, A, L, g, way):  # type: ignore[no-untyped-def]
    """Fill the way (n,) of one step that makes errors smaller, inside ranges.

    It is ``way = (Jᵀ J + λ I)⁻¹ Jᵀ error`` with ``λ = ½ ‖error‖²`` (Sugihara 2011), over the
    joints that are not held at an end of their range. A joint is held if it is there and the
    step leads beyond; what is left of the step beyond an end is cut off.

    Parameters
    ----------
    J, error
        Jacobian (k, n) and errors (k,).
    x, low, high
        Positions and ends of the ranges (n,) [rad, m].
    longest
        Largest change [rad, m] of a joint.
    free, A, L, g
        Scratch arrays (n,), (n, n), (n, n), (n,).
    way
        Result (n,).

    Returns
    -------
    float
        Square of the norm of the errors.
    """
    k, n = J.shape
    square = 0.0
    for i in range(k):
        square += error[i] * error[i]
    for a in range(n):
        free[a] = True
        for b in range(a + 1):
            total = 0.0
            for i in range(k):
                total += J[i, a] * J[i, b]
            A[a, b] = A[b, a] = total
        A[a, a] += 0.5 * square + LEAST
    for a in range(n):
        total = 0.0
        for i in range(k):
            total += J[i, a] * error[i]
        g[a] = total
    for _ in range(n):
        solve_free(A, g, free, L, way)
        held = False
        for a in range(n):
            if free[a] and (
                (x[a] <= low[a] and way[a] < 0.0) or (x[a] >= high[a] and way[a] > 0.0)
            ):
                free[a] = False
                held = True
        if not held:
            break
    size = 0.0
    for a in range(n):
        size = max(size, abs(way[a]))
    share = longest / size if size > longest else 1.0
    for a in range(n):
        way[a] = min(max(x[a] + share * way[a], low[a]), high[a]) - x[a]
    return square
