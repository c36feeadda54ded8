"""What is left of a distance after a move, compiled by numba.

Importing this module compiles it, or loads what an earlier process compiled.
"""

from numba import boolean, njit

from tp_controller.array_types import COLUMN, FIXED, ROWS


@njit([boolean(FIXED, ROWS, ROWS, COLUMN, COLUMN, COLUMN)], cache=True)
def lower_bounds(q, anchor, reach, known, threshold, lower):  # type: ignore[no-untyped-def]
    """Fill lower bounds (p,) from distances known elsewhere; whether any is below its threshold.

    Parameters
    ----------
    q
        Present configuration (n,) [rad, m].
    anchor, known
        Configurations (p, n) and the distances (p,) [m] there.
    reach
        Bounds (p, n) on the derivatives of the distances.
    threshold
        Thresholds (p,) [m].
    lower
        The bounds, to be filled.
    """
    near = False
    for i in range(len(known)):
        bound = known[i]
        for j in range(len(q)):
            way = abs(q[j] - anchor[i, j])
            if way > 0.0:
                bound -= reach[i, j] * way
        lower[i] = bound
        near |= bound < threshold[i]
    return near
