"""Commands under way to a base: the order in which they act counts for its pose."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tp_controller.robot.motions import FREE
from tp_controller.robot.space import Space

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]


def wound(
    space: Space,
    q: Vector,
    now: float,
    times: Vector,
    commands: Matrix,
    head: int,
    delay: Vector,
) -> Vector:
    """Configuration (nq,) to which the commands under way lead, one after the other.

    Parameters
    ----------
    space
        Configuration space of the robot.
    q
        Configuration (nq,) [rad, m] at which the first of them acts.
    now, times, commands, head, delay
        Time [s], the ring of commands and the delays (n,) [s], see
        `tp_controller.commands_under_way`.
    """
    m = times.size
    for k in range(m):
        j = (head + 1 + k) % m
        after = times[(j + 1) % m] if j != head else now
        span = np.maximum(min(now, after) - np.maximum(now - delay, times[j]), 0.0)
        if span.any():
            q = space.integrate(q, span * commands[j])
    return q


def widen(space: Space, way: Vector, tube: Vector) -> None:
    """Widen the tube (n,) around a way (n,) by what the order of velocities changes of a pose.

    Two twists a and b lead to places that differ, in one order and in the other, by their
    commutator: by up to ``|v_a| |w_b| + |w_a| |v_b|``, and in space also by ``2 |w_a| |w_b|`` in
    angle. What is along the way commutes with it, so that one of the two is in the tube.
    """
    for block in space.blocks:
        turns = block.kept >= block.positions
        own = np.arange(block.v.start, block.v.stop)
        linear, angular = own[~turns], own[turns]
        off, turned = np.linalg.norm(tube[linear]), np.linalg.norm(tube[angular])
        v, w = np.linalg.norm(way[linear]) + off, np.linalg.norm(way[angular]) + turned
        tube[linear] += v * turned + w * off
        if block.size == FREE:
            tube[angular] += 2.0 * w * turned
