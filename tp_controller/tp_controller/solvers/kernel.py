"""The recursion over levels inside bounds, compiled by numba: no allocation.

Everything here works in arrays that the caller made. Importing this module compiles it, or
loads what an earlier process compiled: no cycle ever waits for the compiler. Numba compiles a
file again when that file itself changes: after a change of a file that it imports, remove its
cache, as set-up does.
"""

from __future__ import annotations

import math

from tp_controller.array_types import COLUMN, CUBE, FIXED, ROWS
from tp_controller.compiled import boolean, float64, inner, int64, njit
from tp_controller.solvers.codes import (
    ALONE,
    BRIEF,
    DONE,
    FAILED,
    FEEDFORWARD,
    NOTHING,
    OUTSIDE,
    PLAIN,
    UNKNOWN,
)
from tp_controller.solvers.directions import STILL, gather, invert, reduce
from tp_controller.solvers.loss import keep
from tp_controller.solvers.serving import aim, coordinates, serve
from tp_controller.solvers.settling import reserve
from tp_controller.solvers.workspace import FREE, NEEDED, SHARE_GOT, SLOWED, VERDICTS

BROKEN = 1e-9
"""A bound that is missed by less than this, per length of its row, is not broken."""


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
                result, _, _ = serve(
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
        full, found = aim(
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
        result, found, lasting = serve(
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
        shares[level] = work[SHARE_GOT][0]
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
        coordinates(N, m, weight, qd, present)
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
            result, _, _ = serve(
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
    have, and may use what they leave; see `serve`. So a level that cannot get all of a change
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
