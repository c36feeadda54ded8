"""The problem that DAQP gets from `lexicographic`, compiled by numba: no allocation.

Coordinates z are those of the freedom that is left, ``x + Nᵀ z`` with the basis N kept as rows,
as in `kernel`. Numba compiles a file again when that file itself changes: after a change of
`kernel` or of a function that `lexicographic_proof` takes from here, remove ``__pycache__``.
"""

from __future__ import annotations

import math

from tp_controller.array_types import COLUMN, CUBE, ROWS
from tp_controller.compiled import boolean, inner, int32, int64, njit
from tp_controller.solvers.directions import STILL

ENDLESS = 1e30
"""What DAQP takes for infinity."""
SHORT = 1e-9
"""A row of which the freedom moves less than this share is fixed."""
EQUAL = 1e-12
"""Squares of lengths that differ by less than this share count as equal."""

LOOSE = 1e-8
"""By how much bounds [rad/s, m/s, …] are loosened below levels that are settled."""

CHOICES = boolean[::1]
PLACES = int64[::1]


@inner
def seen(row, N, m, out):  # type: ignore[no-untyped-def]
    """Write a row (n,) in coordinates of the basis to ``out`` (m,); return its square there."""
    square = 0.0
    for j in range(m):
        entry = 0.0
        for c in range(row.size):
            entry += row[c] * N[j, c]
        out[j] = entry
        square += entry * entry
    return square


@inner
def along(row, x):  # type: ignore[no-untyped-def]
    """Product of a row (n,) and a velocity (n,)."""
    total = 0.0
    for c in range(x.size):
        total += row[c] * x[c]
    return total


@inner
def squared(row):  # type: ignore[no-untyped-def]
    """Square of the length of a row."""
    return along(row, row)


@inner
def _level_out(B, b, k, m):  # type: ignore[no-untyped-def]
    """Turn k rows (m,) of B and their right sides b until all rows have the same length.

    DAQP divides every row by its length. The sum of squares of equally long rows is then what
    it was but for a factor, and a turn does not change that of equalities at all.
    """
    total = 0.0
    for i in range(k):
        for c in range(m):
            total += B[i, c] * B[i, c]
    mean = total / k
    for i in range(k - 1):
        # The row to come out with the mean length is turned out of the shortest and the longest.
        low, high, least, most = i, i, math.inf, -1.0
        for j in range(i, k):
            square = 0.0
            for c in range(m):
                square += B[j, c] * B[j, c]
            if square < least:
                low, least = j, square
            if square > most:
                high, most = j, square
        if not most - mean > EQUAL * mean:
            return
        common = 0.0
        for c in range(m):
            common += B[low, c] * B[high, c]
        t = (math.sqrt(common * common + (most - mean) * (mean - least)) - common) / (most - mean)
        cosine = 1.0 / math.sqrt(1.0 + t * t)
        sine = t * cosine
        for c in range(m):
            p, q = B[low, c], B[high, c]
            B[low, c], B[high, c] = cosine * p + sine * q, cosine * q - sine * p
        b[low], b[high] = cosine * b[low] + sine * b[high], cosine * b[high] - sine * b[low]
        for c in range(m):
            B[i, c], B[low, c] = B[low, c], B[i, c]
        b[i], b[low] = b[low], b[i]


@inner
def _moves(square, row):  # type: ignore[no-untyped-def]
    """Whether the freedom moves a row, by its square there."""
    return square > STILL * STILL and square > SHORT * SHORT * squared(row)


@inner
def _filled(J, starts, N, m, level, spare):  # type: ignore[no-untyped-def]
    count = 0
    for r in range(starts[level], starts[level + 1]):
        if _moves(seen(J[r], N, m, spare), J[r]):
            count += 1
    return count


@inner
def _mixed(J, starts, one_sided, N, m, level, spare):  # type: ignore[no-untyped-def]
    """Whether a level has one-sided rows beside others of another kind or length.

    Turns would mix these up, so their violations become variables of their own.
    """
    some = False
    for r in range(starts[level], starts[level + 1]):
        some = some or one_sided[r]
    if not some or starts[level + 1] - starts[level] == 1:
        return False
    some = False
    count, least, most, both = 0, math.inf, 0.0, False
    for r in range(starts[level], starts[level + 1]):
        square = seen(J[r], N, m, spare)
        if _moves(square, J[r]):
            both = both or (count > 0 and one_sided[r] != some)
            some = some or one_sided[r]
            least, most = min(least, square), max(most, square)
            count += 1
    return some and count > 1 and (both or most - least > EQUAL * most)


@njit(
    int64(
        ROWS, COLUMN, PLACES, CHOICES, COLUMN, COLUMN, CUBE, PLACES,
        COLUMN, COLUMN, COLUMN, int32[::1],
    ),
    cache=True,
)  # fmt: skip
def arrange(  # type: ignore[no-untyped-def]
    J, velocity, starts, one_sided, lower, upper, work, state, A, least, most, breaks
):
    """Write the levels that are not settled as DAQP's hierarchical problem.

    Parameters
    ----------
    J, velocity, starts, one_sided, lower, upper
        The problem, see `lexicographic.LexicographicProblem`; the last level is that of the
        smallest norm.
    work, state
        What is settled, see `begin` and `settle`.
    A, least, most
        Rows one after the other, and the bounds of each; the result.
    breaks
        The end of the hard rows and of every level, of which there are ``state[3]``; a result.

    Returns
    -------
    int
        Number of rows; ``state[2]`` is the number of variables: z, and for levels that have
        one-sided rows of different lengths the violations.
    """
    n, m, first = lower.size, state[0], state[1]
    last = starts.size - 2
    N, B, b, x = work[0], work[2], work[4, 0], work[7, 0, :n]
    kept, order = work[9, 0], work[9, 1]
    stop = max(last, first + 1)
    variables = m
    for level in range(first, stop):
        if _mixed(J, starts, one_sided, N, m, level, b):
            variables += _filled(J, starts, N, m, level, b)
    state[2] = variables
    count = 0
    # Exact levels above may leave the rest no room at all, and rounding less than none.
    loose = LOOSE if first > 0 else 0.0
    for c in range(n):
        square = 0.0
        for j in range(m):
            square += N[j, c] * N[j, c]
        if square > SHORT * SHORT and (lower[c] > -math.inf or upper[c] < math.inf):
            at = count * variables
            for j in range(variables):
                A[at + j] = N[j, c] if j < m else 0.0
            least[count] = max(lower[c] - x[c] - loose, -ENDLESS)
            most[count] = min(upper[c] - x[c] + loose, ENDLESS)
            count += 1
    for r in range(starts[first]):
        if kept[r] != 0.0:
            square = seen(J[r], N, m, b)
            if square > SHORT * SHORT * squared(J[r]):
                at = count * variables
                for j in range(variables):
                    A[at + j] = b[j] if j < m else 0.0
                least[count] = velocity[r] - along(J[r], x) - loose
                most[count] = ENDLESS
                count += 1
    extra = m
    for level in range(first, stop):
        if _mixed(J, starts, one_sided, N, m, level, b):
            for r in range(starts[level], starts[level + 1]):
                square = seen(J[r], N, m, b)
                if _moves(square, J[r]):
                    at = count * variables
                    for j in range(variables):
                        A[at + j] = b[j] if j < m else 0.0
                    A[at + extra] = 1.0
                    least[count] = velocity[r] - along(J[r], x)
                    most[count] = ENDLESS if one_sided[r] else least[count]
                    extra += 1
                    count += 1
    breaks[0] = count
    ends = 1
    extra = m
    for level in range(first, stop):
        before = count
        if _mixed(J, starts, one_sided, N, m, level, b):
            for _ in range(_filled(J, starts, N, m, level, b)):
                at = count * variables
                for j in range(variables):
                    A[at + j] = 0.0
                A[at + extra] = 1.0
                least[count] = most[count] = 0.0
                extra += 1
                count += 1
        else:
            k = 0
            for r in range(starts[level], starts[level + 1]):
                square = seen(J[r], N, m, B[k])
                if _moves(square, J[r]):
                    b[k] = velocity[r] - along(J[r], x)
                    order[k] = r
                    k += 1
            if k > 1 and not one_sided[int(order[0])]:
                _level_out(B, b, k, m)
            for i in range(k):
                at = count * variables
                for j in range(variables):
                    A[at + j] = B[i, j] if j < m else 0.0
                least[count] = b[i]
                most[count] = ENDLESS if one_sided[int(order[i])] else b[i]
                count += 1
        if count > before:
            breaks[ends] = count
            ends += 1
    state[3] = ends
    return count
