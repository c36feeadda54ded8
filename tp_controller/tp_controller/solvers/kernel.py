"""The recursion over levels inside bounds, compiled by numba: no allocation.

Everything here works in arrays that the caller made. Importing this module compiles it, or
loads what an earlier process compiled: no cycle ever waits for the compiler. Numba compiles a
file again when that file itself changes: after a change of a file that it imports, remove its
cache, as set-up does.
"""

from __future__ import annotations

import math

import numpy as np

from tp_controller.array_types import COLUMN, CUBE, FIXED, ROWS
from tp_controller.compiled import boolean, float64, inner, int64, njit
from tp_controller.solvers.approach import LOWER_SHARE, SHARE, able_share
from tp_controller.solvers.directions import STILL, gather, invert, reduce
from tp_controller.solvers.settling import (
    LEAVES,
    LOSES,
    NOTHING,
    UNKNOWN,
    hasten,
    keep,
    reserve,
    settle,
)

ALONG = 1e-9
"""A motion that moves a bound by less than this share of its size is along the bound."""
SHORT = 1e-8
"""A joint that the freedom moves by less than this share cannot be held by it."""

TINY = 1e-9
"""A level that gets a smaller share than this gets nothing: rounding does not decide on it."""

BROKEN = 1e-9
"""A bound that is missed by less than this, per length of its row, is not broken."""

PLAIN, SIMPLE, BENT = 0, 1, 2
"""Whether levels are settled: not at all, without second derivatives as long as it is certain
that they would change nothing, and with them."""
FIRST = 1
"""Index of the first level, below that of the joints."""
FAILED, DONE = 0, 1
"""What `resolve` returns, beside `UNKNOWN`."""
OUTSIDE = 4
"""What `recur` returns without bounds, where the answer of a level and those above breaks one."""
BRIEF, WHOLE, ALONE = 0, 1, 2
"""What is wanted without bounds: nothing where an answer breaks one; the answer of all levels
nevertheless; that answer alone."""

ERRORS, FEEDFORWARD, BENDS = range(3)
"""Rows of what is known of levels, see `Curvature.rows`."""

VERDICTS = (10, 9)
"""Row of the workspace that tells what `settle` found in every level, for reasons that last."""
NEEDED = (10, 10)
"""Row of the workspace whose first value tells whether second derivatives counted."""
FREE, SLOWED = (8, 3), (8, 4)
"""Rows of the workspace with the answer without bounds, and the rows' velocities of it."""


@inner
def _coordinates(N, m, weight, x, out):  # type: ignore[no-untyped-def]
    """Fill the coordinates (m,) of what a velocity x (n,) has in a basis (m, n)."""
    n = x.size
    for j in range(m):
        out[j] = 0.0
    for c in range(n):
        part = 0.0
        for d in range(n):
            part += weight[c, d] * x[d]
        if part != 0.0:
            for j in range(m):
                out[j] += N[j, c] * part


@inner
def _fade(m, B, S, rank, rule, present, answer):  # type: ignore[no-untyped-def]
    """Damp what the present velocity already has of the directions of a level.

    The answer (m,) to what is left of the level's wish then leads to the same velocity as the
    answer from standstill. The present velocity has the coordinates ``present`` (m,).
    """
    if rule[0] == 0.0:
        return
    for i in range(rank):
        near = 1.0 - (S[i] / rule[1]) ** 2
        if near <= 0.0:
            continue
        damping = rule[0] ** 2 * near
        along = 0.0
        for j in range(m):
            along += B[i, j] * present[j]
        for j in range(m):
            answer[j] -= damping / (S[i] * S[i] + damping) * along * B[i, j]


@inner
def _stopper(J, start, way, low, high, sided, end, floor, held):  # type: ignore[no-untyped-def]
    """Shares s for which ``start + s way`` (n,) keeps all bounds that are not held.

    Bounds are those of the joints and the least rates ``floor`` of one-sided rows before ``end``;
    joints are rows of J, too.

    Returns
    -------
    float, float, int
        The least and the largest share, and the row of J that sets the largest, -1 if none does.
    """
    least, most, critical = -math.inf, math.inf, -1
    n = start.size
    size = 0.0
    for c in range(n):
        size += way[c] * way[c]
    # What moves a bound by less is rounding: nothing free moves it.
    size = ALONG * math.sqrt(size)
    for c in range(n):
        if held[c] != 0.0 or abs(way[c]) <= size:
            continue
        ahead = ((high[c] if way[c] > 0.0 else low[c]) - start[c]) / way[c]
        behind = ((low[c] if way[c] > 0.0 else high[c]) - start[c]) / way[c]
        least = max(least, behind)
        if ahead < most:
            # Rounding does not choose among bounds that are met already: the first one counts.
            if critical < 0 or most > TINY:
                critical = c
            most = ahead
    for r in range(n, end):
        if not sided[r] or held[r] != 0.0:
            continue
        rate = room = length = 0.0
        for c in range(n):
            rate += J[r, c] * way[c]
            room += J[r, c] * start[c]
            length += J[r, c] * J[r, c]
        if abs(rate) <= size * math.sqrt(length):
            continue
        ahead = (floor[r] - room) / rate
        if rate > 0.0:
            least = max(least, ahead)
        elif ahead < most:
            if critical < 0 or most > TINY:
                critical = r
            most = ahead
    return least, most, critical


@inner
def _aim(  # type: ignore[no-untyped-def]
    J, values, acts, k, first, end, square, rule, smallest, weight, level, N, m, bounded, change,
    dt, settling, offset, known, hessians, followed, lasting, count, start, work,
):  # fmt: skip
    """Fill ``work[6, 0]`` with a level's answer in a basis N (m, n), beyond what it has already.

    The velocity ``start`` (n,) is there already. What the level asks for is made small enough
    for the joints to brake at its target, see `approach`, and is then in ``values[2]``. A level
    that loses is settled; if what stops it is ``lasting``, no limit of acceleration, it is also
    hastened.

    Returns
    -------
    int, int
        The rank, and what `settle` found.
    """
    n = start.size
    asked, feedforward, velocity = values[0], values[1], values[2]
    errors, bends = known[ERRORS], known[BENDS]
    B, W, U, S = work[2], work[3], work[9], work[10, 0]
    sides, answers, order = work[4, 0:3], work[6, 0:5], work[4, 3]
    present, still = work[7, 3], work[7, 5]
    weights, lost = work[10, 2, : velocity.size], work[10, 3, : velocity.size]
    needed = work[NEEDED]
    wishes = far = 0.0
    for i in range(k):
        r = int(order[i])
        velocity[r] = sides[0, i] = asked[r]
        for c in range(n):
            sides[0, i] -= J[r, c] * start[c]
        sides[1, i] = asked[r] - feedforward[r]
        sides[2, i] = errors[r - offset] if 0 <= r - offset < errors.size else 0.0
        wishes += sides[1, i] ** 2
        far += sides[2, i] ** 2
    slow = dt < math.inf and wishes > 0.0 and far > 0.0
    rank = invert(
        J, order, k, N[:, :n], m, rule, smallest, sides, answers, 3 if slow else 1, B, W, U, S
    )
    present[:m] = 0.0
    if bounded:
        _coordinates(N, m, weight, start, present)
        _fade(m, B, S, rank, rule, present, answers[0])
    found = LOSES
    if slow:
        # Its gain term alone, from standstill.
        for j in range(m):
            answers[3, j] = answers[1, j]
        found = NOTHING
        if settling != PLAIN:
            found = settle(
                J, order, k, first, end, acts, errors, hessians, bends, settling == BENT, offset,
                N[:, :n], m, rank, B, U, S, sides[1], still, rule, square, followed, count,
                work[11], work[12], work[10, 1], weights, work[10, 4, :n], work[13], work[14],
                work[15], lost, needed, answers[3],
            )  # fmt: skip
            if lasting and found in (NOTHING, LEAVES):
                result = hasten(
                    J, first, end, hessians, bends, settling == BENT, offset, N[:, :n], m, rank, B,
                    S, lost, count, work[11], work[12], work[10, 1], weights, work[10, 4, :n],
                    work[13], work[14], work[15], needed, answers[3],
                )  # fmt: skip
                if result == UNKNOWN:
                    return rank, result
            if found == UNKNOWN:
                return rank, found
        if found == LOSES:
            answers[2] = 0.0
        share = SHARE if level <= FIRST else LOWER_SHARE
        gain = math.sqrt(wishes / far)
        excess = 1.0 - able_share(N, m, answers[3], answers[2], gain, share, change, dt)
        if excess > 0.0:
            for i in range(k):
                sides[0, i] -= excess * sides[1, i]
                velocity[int(order[i])] -= excess * sides[1, i]
        gain_term = answers[1] if found == LOSES else answers[3]
        for j in range(m):
            answers[0, j] += (1.0 - excess) * gain_term[j] - answers[1, j]
    if settling == PLAIN:
        return rank, NOTHING
    if found == LOSES:
        found = settle(
            J, order, k, first, end, acts, errors, hessians, bends, settling == BENT, offset,
            N[:, :n], m, rank, B, U, S, sides[0], present, rule, square, followed, count,
            work[11], work[12], work[10, 1], weights, work[10, 4, :n], work[13], work[14],
            work[15], lost, needed, answers[0],
        )  # fmt: skip
    return rank, found


@inner
def _serve(  # type: ignore[no-untyped-def]
    J, values, flags, k, first, end, square, rule, smallest, weight, level, full, freedom, low,
    high, firm_low, firm_high, bounded, change, dt, stops, settling, offset, known, hessians,
    followed, count, found, work, qd,
):  # fmt: skip
    """Bring a level as far as the bounds allow; ``work[6, 0]`` is its answer without them.

    It may use the ``freedom`` rows (n,) of the basis ``work[5]``. The share of its wish that it
    gets is then in ``work[10, 7, 0]``.

    Where the way to the answer meets a velocity or acceleration limit, that joint is held and
    the others make up for it; this goes on until the level has what it asks for, or the joints
    that are left cannot move all of it. Then it gets the largest share that was found (Flacco,
    De Luca and Khatib 2015). Where it meets the end of a range or a one-sided row, which will
    not go away, the level slides along it: what it asks for is answered anew by what is left.

    Returns
    -------
    int, int, int
        `DONE`, `FAILED` or `UNKNOWN`; what `settle` found last; and what it found apart from
        joints that are held at limits of speed and acceleration, which pass.
    """
    n = qd.size
    velocity, acts, sided = values[2], flags[0], flags[1]
    B, W, Z = work[2], work[3], work[5]
    sides, answers, order, floor = work[4, 0:3], work[6, 0:5], work[4, 3], work[10, 5]
    base, start, way = work[7, 0, :n], work[7, 1, :n], work[7, 2, :n]
    best, origin, held = work[8, 0, :n], work[8, 1, :n], work[8, 2]
    U, S = work[9], work[10, 0]
    taken, rows, lengths = work[11], work[12], work[10, 1]
    coordinates = work[10, 6]
    held[: velocity.size] = 0.0
    lasting = found
    for c in range(n):
        base[c] = start[c] = origin[c] = best[c] = qd[c]
        way[c] = 0.0
        for j in range(freedom):
            way[c] += answers[0, j] * Z[j, c]
        # Comparisons with limits would say nothing about what is not finite.
        if not math.isfinite(way[c]):
            return FAILED, found, found
    share, some = -1.0, False
    for _ in range(4 * n + velocity.size):
        if not bounded:
            share, some = 1.0, True
            for c in range(n):
                best[c] = start[c] + way[c]
            break
        least, most, critical = _stopper(J, start, way, low, high, sided, end, floor, held)
        reached = min(1.0, most)
        if max(least, 0.0) <= reached and reached > share:
            share, some = reached, True
            for c in range(n):
                best[c] = start[c] + share * way[c]
        if critical < 0 or share >= 1.0 or freedom == 0:
            break
        length = 0.0
        for j in range(freedom):
            part = 0.0
            for c in range(n):
                part += Z[j, c] * J[critical, c]
            coordinates[j] = part
            length += part * part
        size = 0.0
        for c in range(n):
            size += J[critical, c] * J[critical, c]
        if length < SHORT * SHORT * size:
            break
        firm = critical >= n
        if not firm:
            firm = (
                high[critical] >= firm_high[critical]
                if way[critical] > 0.0
                else (low[critical] <= firm_low[critical])
            )
        ranged = firm
        # A level that would get nothing slides along limits of speed and acceleration, too.
        firm = firm or share <= TINY
        if not firm and (freedom == 1 or found == LOSES):
            # A level that loses is scaled: holding joints would change what it loses.
            break
        if firm:
            for c in range(n):
                origin[c] = start[c] + max(min(most, 1.0), 0.0) * way[c]
                base[c] = start[c] = origin[c]
            if ranged and stops[critical] < 0:
                stops[critical] = level
        else:
            bound = high[critical] if way[critical] > 0.0 else low[critical]
            gap = bound - base[critical]
            for c in range(n):
                part = 0.0
                for j in range(freedom):
                    part += coordinates[j] * Z[j, c]
                start[c] = base[c] + gap / length * part
            for c in range(n):
                base[c] = start[c]
        held[critical] = 1.0
        d = count
        while d < lengths.size - 1 and lengths[d] != 0.0:
            d += 1
        root = math.sqrt(length)
        for j in range(freedom):
            B[0, j] = coordinates[j] / root
        for c in range(n):
            part = 0.0
            for j in range(freedom):
                part += B[0, j] * Z[j, c]
            taken[d, c] = part
        rows[d, :] = 0.0
        rows[d, critical] = 1.0
        lengths[d], lengths[d + 1] = root, 0.0
        reduce(Z, B, int64(1), freedom, n)
        freedom -= 1
        if firm and freedom == 0:
            share = 1.0
            break
        if firm:
            full, found = _aim(
                J, values, acts, k, first, end, square, rule, smallest, weight, level, Z, freedom,
                bounded, change, dt, settling, offset, known, hessians, followed, ranged, d + 1,
                base, work,
            )  # fmt: skip
            if found == UNKNOWN:
                return UNKNOWN, found, found
            if ranged:
                lasting = found
            share = -1.0
        else:
            for i in range(k):
                r = int(order[i])
                sides[0, i] = velocity[r]
                sides[1, i] = 0.0
                for c in range(n):
                    sides[0, i] -= J[r, c] * origin[c]
                    sides[1, i] += J[r, c] * (base[c] - origin[c])
            rank = invert(
                J, order, k, Z[:, :n], freedom, rule, smallest, sides, answers, int64(2), B, W, U,
                S,
            )  # fmt: skip
            if rank < full:
                break
        for c in range(n):
            way[c] = 0.0
            for j in range(freedom):
                way[c] += answers[0, j] * Z[j, c]
                if not firm:
                    start[c] -= answers[1, j] * Z[j, c]
    work[10, 7, 0] = max(share, 0.0)
    if some:
        for c in range(n):
            # Rounding may leave a component one unit in the last place outside.
            qd[c] = min(max(best[c], low[c]), high[c]) if bounded else best[c]
    return DONE, found, lasting


@inner
def recur(  # type: ignore[no-untyped-def]
    J, values, flags, starts, rules, metric, tolerance, bounded, brief, low, high, firm_low,
    firm_high, work, shares, stops, settling, offset, known, hessians, before, change, dt, qd,
):  # fmt: skip
    """Resolve levels one after the other, inside the bounds or without any; see `resolve`.

    Parameters
    ----------
    J, values, flags
        Jacobian (K, n) of all rows: those of the n joints, which are the unit matrix, then those
        of all levels; what each asks for, the part of it that is no gain term, and the result,
        see `resolve` (3, K); whether it is to have its velocity, and whether that is a bound
        (2, K).
    bounded, brief
        Whether there are bounds; whether it is over where an answer without them breaks one.
    offset
        First row that has an error: n.
    starts, rules, metric, tolerance, low, high, firm_low, firm_high, work, shares, stops, \
    settling, known, hessians, before, change, dt, qd
        As `resolve`.
    """
    n = qd.size
    outside = False
    shares[:] = 1.0
    stops[:] = -1
    asked, velocity, acts, sided = values[0], values[2], flags[0], flags[1]
    basis, weight = metric[0], metric[1]
    N, B, W, Z = work[0], work[2], work[3], work[5]
    sides, answers, order = work[4, 0:3], work[6, 0:5], work[4, 3]
    U, S = work[9], work[10, 0]
    taken, rows, lengths = work[11], work[12], work[10, 1]
    raw, A, turn = work[13], work[14], work[15]
    weights, lost = work[10, 2, : velocity.size], work[10, 3, : velocity.size]
    pull, floor, present = work[10, 4, :n], work[10, 5], work[7, 3]
    own_taken, own_rows, own_lengths = work[16], work[17], work[10, 8]
    verdicts = work[VERDICTS]
    verdicts[: starts.size] = NOTHING
    work[NEEDED] = 0.0
    for r in range(asked.size):
        velocity[r] = asked[r]
    for c in range(n):
        qd[c] = min(max(before[c], low[c]), high[c]) if bounded else 0.0
        for j in range(n):
            N[j, c] = basis[j, c]
    m = n
    # Typed constants: numba compiles a function anew for every other literal one.
    count, levels = int64(0), starts.size - 1
    for level in range(levels):
        first, end = starts[level], starts[level + 1]
        rule = rules[level]
        if bounded:
            # Rows that are broken may not get worse while they are mended.
            _least_rates(J, velocity, sided, first, end, qd, floor)
            k, square = _broken(J, velocity, sided, first, end, qd, order, sides[0], stops, level)
            if k > 0 and m > 0:
                smallest = tolerance * math.sqrt(square)
                full = invert(
                    J, order, k, N[:, :n], m, rule, smallest, sides, answers, int64(1), B, W, U, S
                )
                lengths[count] = 0.0
                for j in range(m):
                    for c in range(n):
                        Z[j, c] = N[j, c]
                result, _, _ = _serve(
                    J, values, flags, k, first, end, square, rule, smallest, weight, level, full,
                    m, low, high, firm_low, firm_high, bounded, change, math.inf, stops,
                    int64(PLAIN), offset, known, hessians, boolean(False), count, int64(NOTHING),
                    work, qd,
                )  # fmt: skip
                if result != DONE:
                    return result
            _least_rates(J, velocity, sided, first, end, qd, floor)
        k, square = gather(J, velocity, acts, first, end - first, qd, order, sides[0])
        if not square < math.inf:
            return FAILED
        # Joints that are to have no velocity of their own are a level that asks for nothing.
        if m == 0 or (k == 0 and first < offset):
            continue
        smallest = tolerance * math.sqrt(square)
        full, found = _aim(
            J, values, acts, k, first, end, square, rule, smallest, weight, level, N, m, bounded,
            change, dt, settling, offset, known, hessians, level + 1 < levels, boolean(True),
            count, qd, work,
        )  # fmt: skip
        if found == UNKNOWN:
            return UNKNOWN
        if settling != PLAIN:
            keep(N[:, :n], m, B, U, S, order, k, full, 0, own_taken, own_rows, own_lengths)
        if full == 0 and found == NOTHING:
            continue
        for j in range(m):
            for c in range(n):
                Z[j, c] = N[j, c]
        freedom = m
        if full < m:
            reduce(N, B, full, m, n)
        m -= full
        # Directions that are held in this level stand after those of levels above, for a while.
        lengths[count] = 0.0
        result, found, lasting = _serve(
            J, values, flags, k, first, end, square, rule, smallest, weight, level, full, freedom,
            low, high, firm_low, firm_high, bounded, change, dt, stops, settling, offset, known,
            hessians, level + 1 < levels, count, found, work, qd,
        )  # fmt: skip
        if result != DONE:
            return result
        # Levels below may lead back inside; what this one gets may not depend on that.
        if not (bounded or outside) and not _keeps(J, velocity, low, high, sided, end, qd):
            if brief:
                return OUTSIDE
            outside = True
        verdicts[level] = lasting
        shares[level] = work[10, 7, 0]
        if found != NOTHING and m > 0:
            held = count
            while lengths[held] != 0.0:
                held += 1
            m = reserve(
                J, first, end, k, square, hessians, offset, lost, held, taken, rows, lengths,
                weights, pull, raw, A, turn, N[:, :n], m,
            )  # fmt: skip
        if settling != PLAIN:
            for i in range(full):
                for c in range(n):
                    taken[count, c] = own_taken[i, c]
                for r in range(asked.size):
                    rows[count, r] = own_rows[i, r]
                lengths[count] = own_lengths[i]
                count += 1
        if m == 0 and not bounded:
            break
    if bounded and m > 0:
        _coordinates(N, m, weight, qd, present)
        square = 0.0
        for j in range(m):
            answers[0, j] = -present[j]
            square += present[j] ** 2
            for c in range(n):
                Z[j, c] = N[j, c]
        if square > 0.0:
            for c in range(n):
                order[c] = c
            lengths[count] = 0.0
            result, _, _ = _serve(
                J, values, flags, n, int64(0), asked.size, float(n), rules[0], 0.0, weight,
                int64(-1), m, m, low, high, firm_low, firm_high, bounded, change, math.inf, stops,
                int64(PLAIN), offset, known, hessians, boolean(False), count, int64(NOTHING), work,
                qd,
            )  # fmt: skip
            if result != DONE:
                return result
    for c in range(n):
        if not math.isfinite(qd[c]):
            return FAILED
    return OUTSIDE if outside else DONE


@inner
def _least_rates(J, velocity, sided, first, end, qd, floor):  # type: ignore[no-untyped-def]
    """Fill the least rates (K,) of a level's one-sided rows: what they have if that is less."""
    for r in range(first, end):
        if sided[r]:
            rate = 0.0
            for c in range(qd.size):
                rate += J[r, c] * qd[c]
            floor[r] = min(velocity[r], rate)


@inner
def _broken(J, velocity, sided, first, end, qd, order, residual, stops, level):  # type: ignore[no-untyped-def]
    """List a level's one-sided rows that are broken; their number and squared norm."""
    k, square = 0, 0.0
    for r in range(first, end):
        if not sided[r]:
            continue
        gap, length = velocity[r], 0.0
        for c in range(qd.size):
            length += J[r, c] * J[r, c]
            gap -= J[r, c] * qd[c]
        if length > STILL * STILL and gap > BROKEN * math.sqrt(length):
            order[k] = r
            residual[k] = gap
            square += length
            stops[r] = level
            k += 1
    return k, square


@inner
def _keeps(J, velocity, low, high, sided, end, qd):  # type: ignore[no-untyped-def]
    """Whether a velocity (n,) keeps all bounds and the least rates of rows before ``end``."""
    n = qd.size
    for c in range(n):
        if not low[c] <= qd[c] <= high[c]:
            return False
    for r in range(n, end):
        if sided[r]:
            rate, length = 0.0, 0.0
            for c in range(n):
                rate += J[r, c] * qd[c]
                length += J[r, c] * J[r, c]
            if length > 0.0 and velocity[r] - rate > BROKEN * math.sqrt(length):
                return False
    return True


@njit(
    int64(
        ROWS, COLUMN, ROWS, CUBE, int64, int64, ROWS, ROWS, boolean[:, ::1], int64[::1], ROWS,
        CUBE, float64, FIXED, FIXED, FIXED, FIXED, COLUMN, COLUMN, float64, CUBE, COLUMN,
        int64[::1], COLUMN,
    ),
    cache=True,
    prepared=True,
)  # fmt: skip
def resolve(  # type: ignore[no-untyped-def]
    J, velocity, known, hessians, settling, wanted, rows, values, flags, starts, rules, metric,
    tolerance, low, high, firm_low, firm_high, before, change, dt, work, shares, stops, qd,
):  # fmt: skip
    """Resolve levels one after the other inside the bounds.

    First without bounds: where that answer keeps them all, level by level, it is the one. Else
    each level starts from the velocity of those above it, the first from that which the joints
    have, and may use what they leave; see `_serve`. So a level that cannot get all of a change
    keeps to the way from what it has to what it asks for, whatever lower levels did before.
    What no level uses is brought to rest. Levels above are never touched. Least rates of one-
    sided rows are bounds for their own level and those below.

    Parameters
    ----------
    J
        Rows of all levels (k, n), highest first.
    velocity
        Desired task velocity (k,), of one-sided rows the least one; result: the same with gain
        terms that are small enough for the joints to brake at the targets.
    known
        Error, feedforward and a bound on the second derivative (3, E) of each of the first rows;
        what others ask for is no gain term.
    hessians
        The second derivatives (E, n, n) of their variables.
    settling
        `PLAIN`: the published laws alone. Else levels that cannot get what they ask for are
        settled, see `settling`: `BENT` with second derivatives that are known, `SIMPLE` without.
    wanted
        `BRIEF`, `WHOLE` or `ALONE`; other than `BRIEF`, the answer without bounds is in the rows
        `FREE` and `SLOWED` of the workspace.
    rows, values
        Space for the rows of the joints, which are the unit matrix, and those of J (n + k, n),
        and for what they ask for (3, n + k).
    flags
        Which of these are to have their velocity, no one-sided ones; which are one-sided
        (2, n + k).
    starts
        First row of every level, that of the joints included, then n + k (levels + 1,).
    rules
        λ and ε of every level (levels, 2), see `invert`.
    metric
        Rows (n, n) that span the joint velocities, orthonormal in the metric to minimise, and
        that metric: (2, n, n).
    tolerance
        Singular values below this times ‖J‖ (Frobenius) count for nothing.
    low, high
        Bounds (n,) of the joints' velocities; infinite if there is none.
    firm_low, firm_high
        Bounds (n,) by the ends of the joints' ranges: along these a level slides.
    before
        Velocity (n,) that the joints have; zero for those whose velocity may change at once.
    change, dt
        By how much the velocity of each joint may change (n,) from step to step, and the time
        [s] of one; without limits of acceleration the time is infinite.
    work
        Space to work in, see `workspace`.
    shares
        Share (levels,) of what is left to each level that it gets, from 0 to 1; a result.
    stops
        First level that each joint's range or one-sided row (n + k,) stopped, -1 if none; a
        result.
    qd
        Joint velocity (n,), the result.

    Returns
    -------
    int
        `DONE`, `FAILED` if a Jacobian or the result is not finite, or `UNKNOWN` if second
        derivatives are needed.
    """
    n, k, e = qd.size, J.shape[0], known.shape[1]
    asked, feedforward, slowed = values[0], values[1], values[2]
    for r in range(k):
        asked[n + r] = velocity[r]
        feedforward[n + r] = known[FEEDFORWARD, r] if r < e else velocity[r]
        for c in range(n):
            rows[n + r, c] = J[r, c]
    free = work[FREE][:n]
    bounded = boolean(False)
    for _ in range(2):
        result = recur(
            rows, values, flags, starts, rules, metric, tolerance, bounded, wanted == BRIEF, low,
            high, firm_low, firm_high, work, shares, stops, settling, n, known, hessians, before,
            change, dt, qd if bounded else free,
        )  # fmt: skip
        if bounded or result in (UNKNOWN, FAILED):
            break
        if wanted != BRIEF:
            for r in range(k):
                work[SLOWED][r] = slowed[n + r]
        keeps = result == DONE
        if keeps:
            keeps = _keeps(rows, slowed, low, high, flags[1], n + k, free)
        if keeps or wanted == ALONE:
            for c in range(n):
                qd[c] = free[c]
            result = DONE
            break
        bounded = boolean(True)
    if result == DONE:
        for r in range(k):
            velocity[r] = slowed[n + r]
    return result


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
    size = max(rows, n, 10) + n + 1
    return np.zeros((18, size, size))
