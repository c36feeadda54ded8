"""What distances can do until an arm has braked, compiled by numba.

How much a distance changes is bounded by the reach (k, n) of the joints: the bound on its
derivative.
"""

from __future__ import annotations

from tp_controller.array_types import COLUMN, FIXED, ROWS
from tp_controller.braking import coast
from tp_controller.compiled import boolean, float64, int64, njit, void


@njit(
    void(COLUMN, COLUMN, COLUMN, float64, COLUMN, COLUMN),
    cache=True,
    prepared=True,
)
def require(lowest, distance, clear, leeway, required, leeways):  # type: ignore[no-untyped-def]
    """Find what distances (k,) must not fall below.

    Parameters
    ----------
    lowest, distance
        The lowest distances (k,) on the way that was found last, and the present ones.
    clear
        Distances (k,) that are always enough.
    leeway
        By how much [m, rad] a distance that is not enough may be lower between two samples.
    required, leeways
        Results (k,): what is required, and the leeway of each.
    """
    for row in range(distance.size):
        required[row] = min(lowest[row], distance[row], clear[row])
        leeways[row] = leeway if distance[row] < clear[row] else 0.0


@njit(
    int64(
        COLUMN, COLUMN, FIXED, FIXED, FIXED, float64, boolean, COLUMN, COLUMN, COLUMN, ROWS,
        COLUMN, COLUMN, boolean[::1], COLUMN,
    ),
    cache=True,
    prepared=True,
)  # fmt: skip
def doubts(  # type: ignore[no-untyped-def]
    q, command, position_min, position_max, acceleration, dt, together, distance, required, clear,
    reach, rest, spare, doubtful, found,
):  # fmt: skip
    """Find distances that could become too small until the arm has stopped.

    Parameters
    ----------
    q, command
        Configuration and the velocities (n,) of the step.
    position_min, position_max, acceleration, dt, together
        As `tp_controller.braking.bound` and ``coast``.
    distance, required, clear
        Distances (k,), what each must not fall below, and what is always enough.
    reach
        Bound (k, n) on their derivative.
    rest, spare, doubtful, found
        Results: how far the joints get in braking (n,), nothing (n,), which distances could
        become too small (k,), and the present ones (k,) up to what is enough.

    Returns
    -------
    int
        How many these are; -1 if braking together leads a joint out of its range.
    """
    coast(command, acceleration, dt, together, -1, rest, spare)
    if together:
        for i in range(q.size):
            end = q[i] + dt * command[i] + rest[i]
            if rest[i] != 0.0 and not position_min[i] <= end <= position_max[i]:
                return -1
    count = 0
    for row in range(distance.size):
        way = 0.0
        for i in range(q.size):
            # No joint turns back while it brakes: the lengths of the ways add up.
            way += reach[row, i] * (dt * abs(command[i]) + abs(rest[i]))
        found[row] = min(distance[row], clear[row])
        doubtful[row] = distance[row] - required[row] < way
        if doubtful[row]:
            count += 1
    return count


@njit(int64(COLUMN, COLUMN, COLUMN, COLUMN, ROWS, boolean[::1]), cache=True)
def line_doubts(way, tube, distance, required, reach, doubtful):  # type: ignore[no-untyped-def]
    """Find distances (k,) that could become too small along a line, and how many they are."""
    count = 0
    for row in range(distance.size):
        length = 0.0
        for i in range(way.size):
            length += reach[row, i] * (abs(way[i]) + 2.0 * tube[i])
        doubtful[row] = distance[row] - required[row] < length
        count += doubtful[row]
    return count


@njit(void(COLUMN, ROWS, COLUMN, COLUMN), cache=True)
def lengths(way, reach, most, bend):  # type: ignore[no-untyped-def]
    """Bounds on what distances (k,) do while velocities of constant direction act.

    Parameters
    ----------
    way, reach
        How far each velocity leads (n,), and the bound (k, n) on the derivative of the distances.
    most
        Result (k,): no distance changes by more.
    bend
        Result (k,): no point of a link is farther from the straight line between its places,
        in any one direction. The second derivative by joints i and j is no larger than the
        reach of either.
    """
    for row in range(most.size):
        first, second = 0.0, 0.0
        for i in range(way.size):
            move = abs(way[i])
            first += reach[row, i] * move
            for j in range(way.size):
                second += min(reach[row, i], reach[row, j]) * move * abs(way[j])
        most[row], bend[row] = first, 0.125 * second
