"""The proof of DAQP's answers for `lexicographic`, compiled by numba: no allocation."""

from __future__ import annotations

import math

import numpy as np

from tp_controller.array_types import COLUMN, CUBE, ROWS
from tp_controller.compiled import boolean, float64, inner, njit
from tp_controller.solvers.directions import STILL, invert, reduce
from tp_controller.solvers.lexicographic_arrange import (
    CHOICES,
    PLACES,
    SHORT,
    along,
    seen,
    squared,
)

ACTIVE = 1e-6
"""A constraint this near to its bound [rad/s, m/s, …] may be what stops a level."""
FEASIBLE = 1e-8
"""By how much rounding may leave a bound [rad/s, m/s, …]."""
INDEPENDENT = 1e-10
"""Unit rows that leave a smaller square than this depend on each other."""

UNDAMPED = np.array([0.0, math.inf])


@njit(boolean(ROWS, COLUMN, ROWS, CUBE, PLACES, PLACES, PLACES), cache=True)
def begin(J, velocity, basis, work, state, joints, rows):  # type: ignore[no-untyped-def]
    """Settle nothing yet: x = 0 and all of the freedom; return whether the rows are finite.

    The parameters are those of `settle`; the basis (n, n) is orthonormal in the metric.
    """
    n = joints.size
    for c in range(n):
        work[7, 0, c] = 0.0
        joints[c] = -1
        for j in range(n):
            work[0, j, c] = basis[j, c]
    state[0], state[1] = n, 0
    finite = True
    for r in range(velocity.size):
        work[9, 0, r] = 0.0
        rows[r] = -1
        finite = finite and math.isfinite(velocity[r])
        for c in range(n):
            finite = finite and math.isfinite(J[r, c])
    return finite


@inner
def _solve(G, h, k):  # type: ignore[no-untyped-def]
    """Solve G h = h (k,) for a positive matrix of unit diagonal; return whether it is one."""
    for i in range(k):
        for j in range(i):
            G[i, i] -= G[i, j] * G[i, j]
        if not G[i, i] > INDEPENDENT:
            return False
        G[i, i] = math.sqrt(G[i, i])
        for r in range(i + 1, k):
            for j in range(i):
                G[r, i] -= G[r, j] * G[i, j]
            G[r, i] /= G[i, i]
    for i in range(k):
        for j in range(i):
            h[i] -= G[i, j] * h[j]
        h[i] /= G[i, i]
    for i in range(k - 1, -1, -1):
        for j in range(i + 1, k):
            h[i] -= G[j, i] * h[j]
        h[i] /= G[i, i]
    return True


@inner
def _cone(C, count, m, g, weights, G, h, free):  # type: ignore[no-untyped-def]
    """Non-negative weights of unit rows C (count, m) whose sum is nearest to g (m,).

    Lawson and Hanson (1974); rows that depend on those in use do not come in.

    Returns
    -------
    float
        The length that is left of g, which is overwritten with what is left.
    """
    for i in range(count):
        weights[i] = 0.0
        free[i] = 0.0
    size = math.sqrt(squared(g))
    used = 0
    for _ in range(3 * count + 3):
        best, chosen = 1e-10 * size, -1
        for i in range(count):
            if free[i] == 0.0:
                along = 0.0
                for c in range(m):
                    along += C[i, c] * g[c]
                if along > best:
                    best, chosen = along, i
        if chosen < 0:
            break
        free[chosen] = 1.0
        used += 1
        while True:
            # Equations of the rows in use for the change of their weights.
            place = 0
            for i in range(count):
                if free[i] != 1.0:
                    continue
                h[place] = 0.0
                for c in range(m):
                    h[place] += C[i, c] * g[c]
                other = 0
                for j in range(count):
                    if free[j] == 1.0:
                        G[place, other] = 0.0
                        for c in range(m):
                            G[place, other] += C[i, c] * C[j, c]
                        other += 1
                place += 1
            if not _solve(G, h, used):
                # The row that came last depends on the others.
                free[chosen] = 2.0
                used -= 1
                weights[chosen] = 0.0
                break
            share, place = 1.0, 0
            for i in range(count):
                if free[i] == 1.0:
                    if weights[i] + h[place] < 0.0:
                        share = min(share, weights[i] / -h[place])
                    place += 1
            place, dropped = 0, 0
            for i in range(count):
                if free[i] == 1.0:
                    change = share * h[place]
                    if share < 1.0 and weights[i] + change <= 1e-14 * size:
                        change = -weights[i]
                        free[i] = 0.0
                        dropped += 1
                    weights[i] += change
                    for c in range(m):
                        g[c] -= change * C[i, c]
                    place += 1
            used -= dropped
            if share >= 1.0 or used == 0 or dropped == 0:
                break
    return math.sqrt(squared(g))


@inner
def _step(J, order, k, right, smallest, x, N, m, answers, B, W, U, S):  # type: ignore[no-untyped-def]
    """Add the least squares of rows to x, take them out of the basis; return its new size."""
    n = x.size
    rule = UNDAMPED
    rank = invert(J, order, k, N[:, :n], m, rule, smallest, right, answers, 1, B, W, U, S)
    for c in range(n):
        for j in range(m):
            x[c] += answers[0, j] * N[j, c]
    if 0 < rank < m:
        reduce(N, B, rank, m, n)
    return m - rank


@njit(
    boolean(
        ROWS, COLUMN, PLACES, CHOICES, COLUMN, COLUMN, COLUMN, float64, float64,
        CUBE, PLACES, PLACES, PLACES, COLUMN,
    ),
    cache=True,
)  # fmt: skip
def settle(  # type: ignore[no-untyped-def]
    J, velocity, starts, one_sided, lower, upper, z, tolerance, proof,
    work, state, joints, rows, out,
):  # fmt: skip
    """Prove a guess level by level and solve the levels that are proven exactly.

    Within the constraints of the levels above, a level is at its optimum if the pull of its
    violations, ``g = Jᵀ (velocity - J x)`` in the freedom that is left, is a sum of outward
    normals of constraints that are met with equality, with weights of at least 0. Those with
    weights above 0 hold at every optimum of the level, and so are equalities from there on, as
    are the level's equalities and the rows that it has to violate. What remains is a recursion
    of least squares, as exact as rounding lets it be.

    Parameters
    ----------
    J, velocity, starts, one_sided, lower, upper
        The problem, as for `arrange`.
    z
        The guess (variables,), relative to what is settled.
    tolerance
        Singular values below this times ‖J‖ (Frobenius) count for nothing.
    proof
        Share of ‖J‖² times the largest velocity up to which a pull counts for nothing.
    work, state
        What is settled: x, the basis N, how many rows it has, the first level that is not.
    joints, rows
        First level that each joint's bound (n,) or one-sided row (K + n,) stopped, or -1.
    out
        The guess (n,), or where every level is proven the exact answer; a result.

    Returns
    -------
    bool
        Whether every level is proven.
    """
    n, last = lower.size, starts.size - 2
    N, B, W = work[0], work[2], work[3]
    right, answers, order = work[4, 0:1], work[6, 0:2], work[9, 1]
    x, g, weights, free, h = work[7, 0, :n], work[7, 1], work[7, 2], work[8, 0], work[8, 1]
    kept, C, G, normals = work[9, 0], work[5], work[10], work[11]
    which, sign = work[9, 2], work[8, 2]
    U, S = work[12], work[13, 0]
    m = state[0]
    largest = 1.0
    for c in range(n):
        out[c] = x[c]
        for j in range(m):
            out[c] += N[j, c] * z[j]
        largest = max(largest, abs(out[c]))
        if not (out[c] > lower[c] - ACTIVE and out[c] < upper[c] + ACTIVE):
            return False
    for r in range(starts[state[1]]):
        if kept[r] != 0.0 and along(J[r], out) < velocity[r] - ACTIVE * largest:
            return False
    for level in range(state[1], last + 1):
        state[1] = level
        if m == 0:
            break
        # Rows that count: equalities, and one-sided ones that are violated.
        k, square = 0, 0.0
        for c in range(n):
            g[c] = 0.0
        for r in range(starts[level], starts[level + 1]):
            length = squared(J[r])
            square += length
            if not length > STILL * STILL:
                continue
            gap = velocity[r] - along(J[r], out)
            if one_sided[r] and gap <= ACTIVE * largest:
                continue
            order[k] = r
            k += 1
            for c in range(n):
                h[c] = J[r, c]
            seen(h[:n], N, m, B[0])
            for j in range(m):
                g[j] += gap * B[0, j]
        if k > 0:
            stopped = 0
            enough = proof * square * largest
            if math.sqrt(squared(g[:m])) > enough:
                count = 0
                for c in range(n):
                    length = 0.0
                    for j in range(m):
                        length += N[j, c] * N[j, c]
                    length = math.sqrt(length)
                    if not length > SHORT:
                        continue
                    for side in (-1.0, 1.0):
                        bound = lower[c] if side < 0.0 else upper[c]
                        if abs(out[c] - bound) <= ACTIVE:
                            for j in range(m):
                                C[count, j] = side * N[j, c] / length
                            which[count], sign[count] = c, side
                            count += 1
                for r in range(starts[level]):
                    if kept[r] == 0.0 or count == C.shape[0]:
                        continue
                    if abs(velocity[r] - along(J[r], out)) > ACTIVE * largest:
                        continue
                    length = math.sqrt(seen(J[r], N, m, C[count]))
                    if length * length > SHORT * SHORT * squared(J[r]):
                        for j in range(m):
                            C[count, j] /= -length
                        which[count], sign[count] = n + r, 0.0
                        count += 1
                if _cone(C, count, m, g[:m], weights, G, h, free) > enough:
                    return False
                for i in range(count):
                    if weights[i] > enough:
                        what = int(which[i])
                        if what < n:
                            joints[what] = level
                            bound = lower[what] if sign[i] < 0.0 else upper[what]
                            for c in range(n):
                                normals[stopped, c] = 1.0 if c == what else 0.0
                            right[0, stopped] = bound - x[what]
                        else:
                            rows[what - n] = level
                            for c in range(n):
                                normals[stopped, c] = J[what - n, c]
                            right[0, stopped] = velocity[what - n] - along(J[what - n], x)
                        weights[stopped] = float(stopped)
                        stopped += 1
            if stopped > 0:
                length = 0.0
                for i in range(stopped):
                    length += squared(normals[i, :n])
                smallest = tolerance * math.sqrt(length)
                m = _step(normals, weights, stopped, right, smallest, x, N, m, answers, B, W, U, S)
            if m > 0:
                for i in range(k):
                    r = int(order[i])
                    right[0, i] = velocity[r] - along(J[r], x)
                smallest = tolerance * math.sqrt(square)
                m = _step(J, order, k, right, smallest, x, N, m, answers, B, W, U, S)
            state[0] = m
        for r in range(starts[level], starts[level + 1]):
            if one_sided[r] and velocity[r] - along(J[r], out) <= ACTIVE * largest:
                kept[r] = 1.0
    state[1] = last + 1
    for c in range(n):
        if not (x[c] >= lower[c] - FEASIBLE and x[c] <= upper[c] + FEASIBLE):
            return False
    for r in range(starts[last]):
        if kept[r] != 0.0 and along(J[r], x) < velocity[r] - FEASIBLE * largest:
            return False
    for c in range(n):
        # Rounding may leave a component one unit in the last place outside.
        out[c] = min(max(x[c], lower[c]), upper[c])
    return True
