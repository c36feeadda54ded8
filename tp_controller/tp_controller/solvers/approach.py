"""Speed at which levels approach their targets, compiled by numba: no allocation.

A level asks for the velocity K e, which is too fast near the target where the joints cannot brake
with that gain. So what it asks for is made smaller, all of it by the same factor, until every
joint could stop at the end of its way to the target, as far as that is known from the Jacobian,
or, for a level that loses, from the second derivatives.
"""

from __future__ import annotations

from tp_controller.braking import viable_speed
from tp_controller.compiled import inner

SHARE, LOWER_SHARE = 0.6, 0.4
"""Share of the acceleration limits that braking at a target may need, in the first level and in
those below. The rest is for ways that bend, and for what levels above need of the same joints."""


@inner
def able_share(N, m, speeds, ways, gain, share, change, dt):  # type: ignore[no-untyped-def]
    """How much of its gain term a level may ask for, from 0 to 1.

    Parameters
    ----------
    N, m
        Basis (m, n) of the level's freedom.
    speeds, ways
        Coordinates (m,) of the velocity that answers the gain term, and of the way to the
        target; zero if that is not known.
    gain
        Mean gain [1/s] of the level.
    share
        Share of the acceleration limits that braking may need.
    change
        By how much the velocity of each joint may change (n,) from step to step.
    dt
        Time [s] of one step.
    """
    factor = 1.0
    for c in range(change.size):
        speed = way = 0.0
        for j in range(m):
            speed += speeds[j] * N[j, c]
            way += ways[j] * N[j, c]
        speed = abs(speed)
        # Where rows with different gains meet in a joint, its way alone says too little.
        able = viable_speed(max(abs(way), speed / gain), share * change[c], dt)
        if speed > able:
            factor = min(factor, able / speed)
    return factor
