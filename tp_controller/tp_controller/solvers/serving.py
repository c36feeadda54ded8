"""One level inside the bounds, compiled by numba: no allocation.

What it asks for is made small enough for the joints to brake and settled where it loses (`aim`),
and is then brought as far as the bounds allow (`serve`).
"""

from __future__ import annotations

import math

from tp_controller.compiled import inner, int64
from tp_controller.solvers.approach import LOWER_SHARE, SHARE, able_share
from tp_controller.solvers.codes import (
    BENDS,
    BENT,
    DONE,
    ERRORS,
    FAILED,
    LOSES,
    NOTHING,
    PLAIN,
    UNKNOWN,
)
from tp_controller.solvers.directions import invert, reduce
from tp_controller.solvers.settling import hasten, newton, settle
from tp_controller.solvers.workspace import NEEDED, SHARE_GOT

ALONG = 1e-9
"""A motion that moves a bound by less than this share of its size is along the bound."""
SHORT = 1e-8
"""A joint that the freedom moves by less than this share cannot be held by it."""
TINY = 1e-9
"""A level that gets a smaller share than this gets nothing: rounding does not decide on it."""

FIRST = 1
"""Index of the first level, below that of the joints."""


@inner
def coordinates(N, m, weight, x, out):  # type: ignore[no-untyped-def]
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
def aim(  # type: ignore[no-untyped-def]
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
        coordinates(N, m, weight, start, present)
        _fade(m, B, S, rank, rule, present, answers[0])
    found, mix = NOTHING, 0.0
    if settling != PLAIN:
        found, mix = settle(
            J, order, k, first, end, acts, errors, hessians, bends, settling == BENT, offset,
            N[:, :n], m, rank, B, U, S, rule, square, followed, count, work[11], work[12],
            work[10, 1], weights, work[10, 4, :n], work[13], work[14], work[15], lost, needed,
        )  # fmt: skip
        if found == UNKNOWN:
            return rank, found
    if slow:
        # Its gain term alone, from standstill.
        for j in range(m):
            answers[3, j] = answers[1, j]
        if found == LOSES:
            newton(
                k, m, rank, B, U, S, sides[1], still, square, work[14], work[15], mix,
                work[10, 4, :n], answers[3],
            )  # fmt: skip
            answers[2] = 0.0
        elif settling != PLAIN and lasting:
            result = hasten(
                J, first, end, hessians, bends, settling == BENT, offset, N[:, :n], m, rank, B, S,
                lost, count, work[11], work[12], work[10, 1], weights, work[10, 4, :n], work[13],
                work[14], work[15], needed, answers[3],
            )  # fmt: skip
            if result == UNKNOWN:
                return rank, result
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
    if found == LOSES:
        newton(
            k, m, rank, B, U, S, sides[0], present, square, work[14], work[15], mix,
            work[10, 4, :n], answers[0],
        )  # fmt: skip
    return rank, found


@inner
def serve(  # type: ignore[no-untyped-def]
    J, values, flags, k, first, end, square, rule, smallest, weight, level, full, freedom, low,
    high, firm_low, firm_high, bounded, change, dt, stops, settling, offset, known, hessians,
    followed, count, found, work, qd,
):  # fmt: skip
    """Bring a level as far as the bounds allow; ``work[6, 0]`` is its answer without them.

    It may use the ``freedom`` rows (n,) of the basis ``work[5]``. The share of its wish that it
    gets is then in ``work[SHARE_GOT]``.

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
            full, found = aim(
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
    work[SHARE_GOT][0] = max(share, 0.0)
    if some:
        for c in range(n):
            # Rounding may leave a component one unit in the last place outside.
            qd[c] = min(max(best[c], low[c]), high[c]) if bounded else best[c]
    return DONE, found, lasting
