"""Distances and their derivatives from what coal found, compiled by numba: no allocation.

Importing this module compiles it, or loads what an earlier process compiled.
"""

from tp_controller.array_types import COLUMN, FIXED, FIXED_ROWS, ROWS
from tp_controller.compiled import boolean, int64, njit, void

DISTANCE, NORMAL, POINT = 0, 1, 4
"""Columns of a result: the distance [m], the direction from the first shape to the second, the
nearest point of the first one, and that of the second."""
WIDTH = 10

FAILED = 1e300
"""A distance [m] of this size is what failed iterations leave."""


@njit([int64(FIXED, ROWS, ROWS, COLUMN, COLUMN, COLUMN, int64[::1])], cache=True)
def lower_bounds(q, anchor, reach, known, threshold, lower, near):  # type: ignore[no-untyped-def]
    """Fill lower bounds (p,) from distances known elsewhere, and list those below thresholds.

    Parameters
    ----------
    q
        Present configuration (nq,) [rad, m].
    anchor, known
        Configurations (p, nq) and the distances (p,) [m] there.
    reach
        Bounds (p, nq) on the change of the distances per change of each coordinate.
    threshold
        Thresholds (p,) [m].
    lower
        The bounds, to be filled.
    near
        Result: indices (p,) of those that are below their thresholds.

    Returns
    -------
    int
        How many these are.
    """
    count = 0
    for i in range(len(known)):
        bound = known[i]
        for j in range(len(q)):
            way = abs(q[j] - anchor[i, j])
            if way > 0.0:
                bound -= reach[i, j] * way
        lower[i] = bound
        if bound < threshold[i]:
            near[count] = i
            count += 1
    return count


@njit([void(COLUMN, int64[::1], COLUMN)], cache=True)
def least(values, starts, out):  # type: ignore[no-untyped-def]
    """Fill the least (k,) of the values (p,) from each start (k,) on to the next."""
    for row in range(starts.size):
        end = starts[row + 1] if row + 1 < starts.size else values.size
        smallest = values[starts[row]]
        for i in range(starts[row] + 1, end):
            smallest = min(smallest, values[i])
        out[row] = smallest


@njit([int64(FIXED_ROWS, FIXED, int64[::1], int64, COLUMN, COLUMN, ROWS)], cache=True)
def take(results, q, near, count, known, lower, anchor):  # type: ignore[no-untyped-def]
    """Take over the distances of some pairs that were computed at a configuration.

    Parameters
    ----------
    results
        Results (p, `WIDTH`) of all pairs.
    q
        The configuration (nq,) [rad, m].
    near, count
        Which pairs were computed, the first ``count``. Afterwards those that failed come first.
    known, lower, anchor
        Distances (p,), bounds (p,) and configurations (p, nq), to be filled.

    Returns
    -------
    int
        How many failed; what was known of them stays.
    """
    failed = 0
    for i in range(count):
        pair = near[i]
        distance = results[pair, DISTANCE]
        if not abs(distance) < FAILED:
            near[failed] = pair
            failed += 1
            continue
        known[pair] = lower[pair] = distance
        for j in range(q.size):
            anchor[pair, j] = q[j]
    return failed


@njit(
    int64(
        FIXED_ROWS, FIXED_ROWS, COLUMN, int64[::1], FIXED, FIXED, ROWS, ROWS, ROWS, boolean,
        int64[::1], ROWS,
    ),
    cache=True,
)  # fmt: skip
def slopes(  # type: ignore[no-untyped-def]
    results, ways, lower, starts, distance, threshold, sides, twists, S, coupled, near, slope
):
    """Fill the derivatives (k, n) of the distances that are below their thresholds, else zero.

    That of a pair is ``nᵀ (J_a - J_b)`` with the unit normal n from the second shape to the first
    and the Jacobians of the nearest points.

    Parameters
    ----------
    results, ways
        Results (p, `WIDTH`), and what takes the place of results that are missing (p, 6): a
        direction from the first shape to the second, zero where unknown, and a point.
    lower, starts
        Distances (p,) of the pairs, and the first pair (k,) of every row.
    distance, threshold
        Distances (k,) and thresholds (k,) of the rows.
    sides
        For the model's joints whether they move the first shape of a row (1), the second (-1) or
        both (0), (k, m).
    twists, S, coupled
        Twists (m, 6) of the model's joints, and their speeds per speed of the controlled ones
        (m, n) if these are not the same.
    near
        Result: pairs without a normal.
    slope
        Result (k, n).

    Returns
    -------
    int
        How many have none.
    """
    missing = 0
    for row in range(starts.size):
        for c in range(slope.shape[1]):
            slope[row, c] = 0.0
        if not distance[row] < threshold[row]:
            continue
        end = starts[row + 1] if row + 1 < starts.size else lower.size
        pair = starts[row]
        for i in range(pair + 1, end):
            if lower[i] < lower[pair]:
                pair = i
        x, y, z = results[pair, NORMAL], results[pair, NORMAL + 1], results[pair, NORMAL + 2]
        a, b, c = results[pair, POINT], results[pair, POINT + 1], results[pair, POINT + 2]
        failed = not abs(results[pair, DISTANCE]) < FAILED
        if failed or not 0.5 < x * x + y * y + z * z < 2.0:
            x, y, z = ways[pair, 0], ways[pair, 1], ways[pair, 2]
            if x == y == z == 0.0:
                near[missing] = pair
                missing += 1
                continue
        if failed:
            # Nothing of what failed iterations leave can be used.
            a, b, c = ways[pair, 3], ways[pair, 4], ways[pair, 5]
        i, j, k = b * z - c * y, c * x - a * z, a * y - b * x
        for m in range(twists.shape[0]):
            side = sides[row, m]
            if side == 0.0:
                continue
            rate = x * twists[m, 0] + y * twists[m, 1] + z * twists[m, 2]
            rate += i * twists[m, 3] + j * twists[m, 4] + k * twists[m, 5]
            if not coupled:
                slope[row, m] = -side * rate
                continue
            for d in range(slope.shape[1]):
                slope[row, d] -= side * rate * S[m, d]
    return missing
