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
REGULAR = 1e-6
"""Square of the damping of the multipliers."""
ORTHOGONAL = 1e-15
"""Rows whose cosine is below this count as orthogonal."""
NEARLY = 1e-8
"""Turns by less, of rows with smaller cosines, leave cosines of the size of this square."""
FAR_APART = 1e8
"""Cotangent of twice an angle beyond which the cosine of the angle is 1 in floating point."""
SWEEPS = 60
"""More than any matrix needs; Jacobi's method converges quadratically."""

NOTHING, LOSES, UNKNOWN, LEAVES = 0, 1, 2, 3
"""What `settle` found: every direction is served; the answer is changed where it is lost; second
derivatives are needed; the answer stays, but levels below may not make it worse."""


@inner
def orthogonalise(B, W, p, q, turns):  # type: ignore[no-untyped-def]
    """Turn the p rows (q,) of B until they are orthogonal; W (p, p) is the turn, if it ``turns``.

    One-sided Jacobi (Hestenes 1958): afterwards the rows are right singular vectors times
    singular values, and the rows of W the left singular vectors.
    """
    w = p if turns else 0
    for i in range(w):
        for j in range(w):
            W[i, j] = 1.0 if i == j else 0.0
    for _ in range(SWEEPS):
        turned = False
        for i in range(p - 1):
            for j in range(i + 1, p):
                ii = ij = jj = 0.0
                for c in range(q):
                    ii += B[i, c] * B[i, c]
                    ij += B[i, c] * B[j, c]
                    jj += B[j, c] * B[j, c]
                if not ij * ij > ORTHOGONAL * ii * (ORTHOGONAL * jj):
                    continue
                ratio = (jj - ii) / (2.0 * ij)
                size = abs(ratio)
                t, cosine = 0.5 / size if size > 0.0 else 1.0, 1.0
                if size < FAR_APART:
                    # Neither the tangent nor the cosine waits for the other.
                    root = math.sqrt(1.0 + ratio * ratio)
                    t, cosine = 1.0 / (size + root), math.sqrt(0.5 + 0.5 * (size / root))
                if ratio < 0.0:
                    t = -t
                sine = cosine * t
                if abs(sine) > NEARLY or ij * ij > NEARLY * ii * (NEARLY * jj):
                    turned = True
                for c in range(q):
                    a, b = B[i, c], B[j, c]
                    B[i, c], B[j, c] = cosine * a - sine * b, sine * a + cosine * b
                for c in range(w):
                    a, b = W[i, c], W[j, c]
                    W[i, c], W[j, c] = cosine * a - sine * b, sine * a + cosine * b
        if not turned:
            return


@inner
def keep(N, m, B, U, S, order, k, rank, count, taken, rows, lengths):  # type: ignore[no-untyped-def]
    """Note the directions that a level takes, for the multipliers of levels below.

    Parameters
    ----------
    N, m
        Basis (m, n) of the level's freedom.
    B, U, S, order, k, rank
        Singular vectors and values of the level, see `kernel._invert`.
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
def _add_multipliers(J, first, end, count, taken, rows, lengths, weights, pull):  # type: ignore[no-untyped-def]
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
def _curvature(weights, end, hessians, offset, N, m, raw, half, out):  # type: ignore[no-untyped-def]
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
def _closeness(s, near):  # type: ignore[no-untyped-def]
    """How close a singular value is to being lost: 1 up to ``near / 2``, nothing from there on."""
    return min(max(2.0 - 2.0 * s / near, 0.0), 1.0)


@inner
def _eigenvectors(A, W, m, turns):  # type: ignore[no-untyped-def]
    """Fill the rows of W (m, m) with the eigenvectors of a symmetric matrix A (m, m), if told to.

    Returns
    -------
    float
        The norm of A. The rows of A are then as long as the eigenvalues and this together.
    """
    norm = 0.0
    for a in range(m):
        for b in range(m):
            norm += A[a, b] * A[a, b]
    norm = math.sqrt(norm)
    for a in range(m):
        A[a, a] += norm
    orthogonalise(A, W, m, m, turns)
    return norm


@inner
def _largest(A, B, S, near, m, rank, raw, W):  # type: ignore[no-untyped-def]
    """Largest eigenvalue, or 0, of a curvature (m, m) without the regular directions of a level.

    What is left are the directions close to being lost and those that the level does not move.
    Near a singularity these turn into each other, by 1/s per radian; the largest curvature of all
    of them does not depend on that.
    """
    for a in range(m):
        for b in range(m):
            raw[a, b] = A[a, b]
    for i in range(rank):
        regular = 1.0 - _closeness(S[i], near)
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
    shift = _eigenvectors(raw, W, m, False)
    largest = 0.0
    for a in range(m):
        length = 0.0
        for b in range(m):
            length += raw[a, b] * raw[a, b]
        largest = max(largest, math.sqrt(length) - shift)
    return largest


@inner
def settle(  # type: ignore[no-untyped-def]
    J, order, k, first, end, acts, errors, hessians, bends, known, offset,
    N, m, rank, B, U, S, side, present, rule, square, followed,
    count, taken, rows, lengths, weights, pull, raw, A, W, lost, needed, answer,
):  # fmt: skip
    """Change a level's answer where it cannot get what it asks for.

    Parameters
    ----------
    J, order, k, first, end, acts
        Rows (K, n); the k of the level that joints can move; its first and last row; which act.
    errors, hessians, bends, known, offset
        Error (K - offset,) of the rows from ``offset`` on, the second derivatives
        (K - offset, n, n) of their variables, bounds (K - offset,) on those, and whether the
        second derivatives are filled in.
    N, m, rank, B, U, S
        Basis (m, n) of the freedom, and the level's directions, see `kernel._invert`.
    side, present, rule, square
        What the level asks for (k,) beyond the present velocity, the coordinates (m,) of that in
        the basis, the level's damping, and the square of its Jacobian's norm.
    followed
        Whether a level below could use freedom that is left.
    count, taken, rows, lengths
        Directions that levels above have taken, see `keep`.
    weights, pull, raw, A, W
        Space to work in.
    lost
        Result: the error (K,) that is lost, to `reserve`.
    needed
        Result (1,): 1 where second derivatives count, else left as it is.
    answer
        The level's answer (m,), to be changed.

    Returns
    -------
    int
        `NOTHING`, `LOSES`, `UNKNOWN` or `LEAVES`.
    """
    if first < offset or end - offset > errors.size:
        return NOTHING
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
        return NOTHING
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
        return NOTHING
    _add_multipliers(J, first, end, count, taken, rows, lengths, weights, pull)
    # If the bounds alone show that nothing is lost, second derivatives are not used even where
    # they are known: the answer must not depend on whether they are.
    bound = 0.0
    for r in range(offset, end):
        bound += abs(weights[r]) * bends[r - offset]
    if bound <= (FREE * mean if dropped or leaves else LOST * least * least):
        return NOTHING
    needed[0] = 1.0
    if not known:
        return UNKNOWN
    # How far each direction is lost: not at all up to a curvature of LOST s².
    _curvature(weights, end, hessians, offset, N, m, raw, W, A)
    edge = NEAR * math.sqrt(mean)
    largest, most = math.nan, 0.0
    for i in range(rank):
        closeness = _closeness(S[i], edge)
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
                largest = _largest(A, B, S, edge, m, rank, raw, W)
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
        return NOTHING
    if most == 0.0:
        return LEAVES
    for r in range(first, end):
        weights[r] = lost[r]
    _add_multipliers(J, first, end, count, taken, rows, lengths, weights, pull)
    _curvature(weights, end, hessians, offset, N, m, raw, W, A)
    # Newton's step, with the sizes of the second derivatives: it never climbs.
    for i in range(rank):
        near_zero = 1.0 - (S[i] / rule[1]) ** 2
        filtered = S[i] * S[i] + (rule[0] ** 2 * near_zero if near_zero > 0.0 else 0.0)
        for a in range(m):
            for b in range(m):
                A[a, b] += filtered * B[i, a] * B[i, b]
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
    orthogonalise(A, W, m, m, True)
    mix = min(1.0, 2.0 * most)
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
    return LOSES


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
    _add_multipliers(J, first, end, count, taken, rows, lengths, weights, pull)
    _curvature(weights, end, hessians, offset, N, m, raw, W, A)
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
    _add_multipliers(J, first, end, count, taken, rows, lengths, weights, pull)
    _curvature(weights, end, hessians, offset, N, m, raw, W, A)
    shift = _eigenvectors(A, W, m, True)
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
