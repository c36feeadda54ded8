"""Goals that cannot be had end in rest, compiled by numba: no allocation.

Where a level cannot get what it asks for, its first-order model says nothing of the directions
that it has lost: they come back as soon as the arm moves, and a command that uses them or leaves
them to lower levels reverses at every step. The curvature of what is lost tells how they come
back. With the error that is lost, e, the cost ``½ ‖error‖²`` of a level has the second derivative
``Jᵀ J + M``, ``M = -Σ eᵣ ∂²σᵣ/∂q²``, inside the levels above: their rows count in M with
multipliers (Lagrange) in place of errors. A level that loses takes a step of Newton's method, and
the directions in which M is positive are not left to levels below. Newton's method in place of
Gauss's for levels that conflict: Pfeiffer, Escande and Kheddar, "Singularity resolution in
equality and inequality constrained hierarchical task-space control by adaptive nonlinear least
squares", IEEE RA-L 3 (2018).

Nothing is added where every level gets what it asks for: M is that of the lost error alone, and
a direction with the singular value s counts as lost only where s is small beside the rows and the
curvature is above ``4 s²``: that along it, or far from the target the largest one among it and all
directions that are free or as close to being lost, as these turn into each other on the way.
"""

from __future__ import annotations

import math

from tp_controller.compiled import inner
from tp_controller.solvers.codes import LEAVES, LOSES, NOTHING, UNKNOWN
from tp_controller.solvers.jacobi import eigenvectors, orthogonalise
from tp_controller.solvers.loss import add_multipliers, curvature, how_close, largest_eigenvalue

LOST = 4.0
"""A direction is lost where the curvature is above so many times s²."""
TURNED = 0.5
"""Way [rad] to the target from which on a direction turns before the level gets there."""
NEAR = 0.3
"""Only directions with s below this share of the rows' mean length can be lost."""
FLAT = 1e-3
"""Least second derivative, as a share of the rows' mean square, that a Newton step divides by."""
IDLE = 1e-5
"""A step that lessens the lost square by a smaller share than this is not worth a motion."""
SLOW = 0.1
"""A curvature below this share of s² makes no level slow."""
LONGEST = 10.0
"""By how much a step is lengthened at most where a level loses less along it."""
FREE = 1e-5
"""From this curvature on, as a share of the rows' mean square, lower levels get no freedom."""
SHORT = 1e-6
"""Least mean square of rows [m², -]: shorter ones count as this long."""


@inner
def settle(  # type: ignore[no-untyped-def]
    J, order, k, first, end, acts, errors, hessians, bends, known, offset,
    N, m, rank, B, U, S, rule, square, followed,
    count, taken, rows, lengths, weights, pull, raw, A, W, lost, needed,
):  # fmt: skip
    """Find out whether a level cannot get what it asks for; `newton` then changes its answer.

    Parameters
    ----------
    J, order, k, first, end, acts
        Rows (K, n); the k of the level that joints can move; its first and last row; which act.
    errors, hessians, bends, known, offset
        Error (K - offset,) of the rows from ``offset`` on, the second derivatives
        (K - offset, n, n) of their variables, bounds (K - offset,) on those, and whether the
        second derivatives are filled in.
    N, m, rank, B, U, S
        Basis (m, n) of the freedom, and the level's directions, see `directions.invert`.
    rule, square
        The level's damping, and the square of its Jacobian's norm.
    followed
        Whether a level below could use freedom that is left.
    count, taken, rows, lengths
        Directions that levels above have taken, see `keep`.
    weights, pull, raw
        Space to work in.
    A, W
        Results where it loses, for `newton`: the rows of A (m, m) are as long as the second
        derivatives of what it loses, those of W are their directions.
    lost
        Result: the error (K,) that is lost, to `reserve`.
    needed
        Result (1,): 1 where second derivatives count, else left as it is.

    Returns
    -------
    int, float
        `NOTHING`, `LOSES`, `UNKNOWN` or `LEAVES`; how far its answer is `newton`'s, from 0 to 1.
    """
    if first < offset or end - offset > errors.size:
        return NOTHING, 0.0
    mean = max(square / max(k, 1), SHORT)
    size = 0.0
    weights[:] = 0.0
    lost[:] = 0.0
    for r in range(first, end):
        if acts[r]:
            weights[r] = errors[r - offset]
            lost[r] = weights[r]
            size = max(size, abs(weights[r]))
    if size == 0.0:
        return NOTHING, 0.0
    # What is left of the error outside all directions that the level can move.
    for i in range(rank):
        along = 0.0
        for r in range(k):
            along += U[i, r] * weights[int(order[r])]
        for r in range(k):
            lost[int(order[r])] -= along * U[i, r]
    outside = 0.0
    for r in range(first, end):
        outside = max(outside, abs(lost[r]))
    if outside <= 1e-12 * size:
        outside = 0.0
        lost[first:end] = 0.0
    least = math.inf
    for i in range(rank):
        least = min(least, S[i])
    dropped = rank < min(k, m)
    near = dropped or least < NEAR * math.sqrt(mean)
    leaves = followed and m > rank and outside > 0.0
    if not (near or leaves):
        return NOTHING, 0.0
    add_multipliers(J, first, end, count, taken, rows, lengths, weights, pull)
    # If the bounds alone show that nothing is lost, second derivatives are not used even where
    # they are known: the answer must not depend on whether they are.
    bound = 0.0
    for r in range(offset, end):
        bound += abs(weights[r]) * bends[r - offset]
    if bound <= (FREE * mean if dropped or leaves else LOST * least * least):
        return NOTHING, 0.0
    needed[0] = 1.0
    if not known:
        return UNKNOWN, 0.0
    # How far each direction is lost: not at all up to a curvature of LOST s².
    curvature(weights, end, hessians, offset, N, m, raw, W, A)
    edge = NEAR * math.sqrt(mean)
    largest, most = math.nan, 0.0
    for i in range(rank):
        closeness = how_close(S[i], edge)
        if closeness == 0.0:
            continue
        along = bend = 0.0
        for r in range(k):
            along += U[i, r] * errors[int(order[r]) - offset]
        for a in range(m):
            for b in range(m):
                bend += B[i, a] * A[a, b] * B[i, b]
        # Far from its target the direction will have turned before it gets there.
        turned = min(max(abs(along) / (TURNED * S[i]) - 1.0, 0.0), 1.0) if S[i] > 0.0 else 1.0
        if turned > 0.0:
            if math.isnan(largest):
                largest = largest_eigenvalue(A, B, S, edge, m, rank, raw, W)
            bend += turned * (largest - bend)
        bend = closeness * bend - LOST * S[i] * S[i]
        if bend <= 0.0:
            continue
        share = bend / (S[i] * S[i] + bend)
        most = max(most, share)
        for r in range(k):
            lost[int(order[r])] += share * along * U[i, r]
    if dropped and outside > 0.0:
        most = 1.0
    found = outside
    for r in range(first, end):
        found = max(found, abs(lost[r]))
    if found == 0.0:
        return NOTHING, 0.0
    if most == 0.0:
        return LEAVES, 0.0
    for r in range(first, end):
        weights[r] = lost[r]
    add_multipliers(J, first, end, count, taken, rows, lengths, weights, pull)
    curvature(weights, end, hessians, offset, N, m, raw, W, A)
    # Newton's step, with the sizes of the second derivatives: it never climbs.
    for i in range(rank):
        near_zero = 1.0 - (S[i] / rule[1]) ** 2
        filtered = S[i] * S[i] + (rule[0] ** 2 * near_zero if near_zero > 0.0 else 0.0)
        for a in range(m):
            for b in range(m):
                A[a, b] += filtered * B[i, a] * B[i, b]
    orthogonalise(A, W, m, m, True)
    return LOSES, min(1.0, 2.0 * most)


@inner
def newton(  # type: ignore[no-untyped-def]
    k, m, rank, B, U, S, side, present, square, A, W, mix, pull, answer,
):  # fmt: skip
    """Change the answer (m,) of a level that loses into a step of Newton's method.

    Parameters
    ----------
    k, m, rank, B, U, S, square, A, W, mix
        As `settle` has them, and what it found.
    side, present
        What the level asks for (k,) beyond the present velocity, and the coordinates (m,) of that
        in the basis.
    pull
        Space to work in.
    answer
        The level's answer, to be changed.
    """
    mean = max(square / max(k, 1), SHORT)
    asked = 0.0
    for r in range(k):
        asked += side[r] * side[r]
    for a in range(m):
        pull[a] = 0.0
    for i in range(rank):
        along, moving = 0.0, 0.0
        for r in range(k):
            along += U[i, r] * side[r]
        for a in range(m):
            moving += B[i, a] * present[a]
        # The step takes the place of the present velocity: what that has is asked for anew.
        asked -= along * along
        along += S[i] * moving
        asked += along * along
        for a in range(m):
            pull[a] += S[i] * along * B[i, a]
    for a in range(m):
        answer[a] = (1.0 - mix) * answer[a] - mix * present[a]
    for i in range(m):
        slope, along = 0.0, 0.0
        for a in range(m):
            slope += A[i, a] * A[i, a]
            along += W[i, a] * pull[a]
        slope = max(math.sqrt(slope), FLAT * mean)
        gain = along * along / slope
        step = mix * along / slope * max(0.0, 1.0 - IDLE * asked / gain) if gain > 0.0 else 0.0
        for a in range(m):
            answer[a] += step * W[i, a]


@inner
def hasten(  # type: ignore[no-untyped-def]
    J, first, end, hessians, bends, known, offset, N, m, rank, B, S, lost, count, taken, rows,
    lengths, weights, pull, raw, A, W, needed, answer,
):  # fmt: skip
    """Lengthen a level's answer (m,) along directions that it has and in which it loses less.

    Where a level loses, and moves regular directions of its own, Gauss's step takes the way to the
    optimum for too short where the curvature of what is lost is negative, as that of a large
    rotation is: the level would come to rest at a fraction of its gain.

    Returns
    -------
    int
        `NOTHING`, or `UNKNOWN`.
    """
    if first < offset or end - offset > bends.size or rank == 0:
        return NOTHING
    own, least = 0.0, math.inf
    for r in range(first, end):
        own += abs(lost[r]) * bends[r - offset]
    for i in range(rank):
        least = min(least, S[i])
    if own <= SLOW * least * least:
        return NOTHING
    needed[0] = 1.0
    if not known:
        return UNKNOWN
    weights[:] = 0.0
    for r in range(first, end):
        weights[r] = lost[r]
    add_multipliers(J, first, end, count, taken, rows, lengths, weights, pull)
    curvature(weights, end, hessians, offset, N, m, raw, W, A)
    for i in range(rank):
        bend = along = 0.0
        for a in range(m):
            along += B[i, a] * answer[a]
            for b in range(m):
                bend += B[i, a] * A[a, b] * B[i, b]
        bend *= min(1.0, own / (SLOW * least * least) - 1.0)
        if bend >= 0.0:
            continue
        longer = min(S[i] * S[i] / max(S[i] * S[i] + bend, FLAT * S[i] * S[i]), LONGEST) - 1.0
        for a in range(m):
            answer[a] += longer * along * B[i, a]
    return NOTHING


@inner
def reserve(  # type: ignore[no-untyped-def]
    J, first, end, k, square, hessians, offset, lost, count, taken, rows, lengths,
    weights, pull, raw, A, W, N, m,
):  # fmt: skip
    """Take out of a basis (m, n) what would make a level lose more; return what is left of m.

    Directions in which the curvature of the lost error is positive go to nobody; near zero they
    are given to levels below in part, as rows that are shorter.
    """
    mean = max(square / max(k, 1), SHORT)
    n = N.shape[1]
    for r in range(weights.size):
        weights[r] = lost[r]
    add_multipliers(J, first, end, count, taken, rows, lengths, weights, pull)
    curvature(weights, end, hessians, offset, N, m, raw, W, A)
    shift = eigenvectors(A, W, m, True)
    if shift <= 1e-14 * mean:
        return m
    left = 0
    for i in range(m):
        slope = 0.0
        for a in range(m):
            slope += A[i, a] * A[i, a]
        free = 1.0 - max(math.sqrt(slope) - shift, 0.0) / (FREE * mean)
        if free <= 0.0:
            continue
        for c in range(n):
            entry = 0.0
            for a in range(m):
                entry += W[i, a] * N[a, c]
            raw[left, c] = free * entry
        left += 1
    for a in range(left):
        for c in range(n):
            N[a, c] = raw[a, c]
    return left
