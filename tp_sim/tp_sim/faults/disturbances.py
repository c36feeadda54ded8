"""What may happen to a joint state on its way: lost, late, twice, changed.

A disturbance takes each joint state in turn and says what is sent in its place. Values of
``share`` are probabilities; what is drawn comes from a fixed seed, so that a case repeats.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import NamedTuple

import numpy as np
from sensor_msgs.msg import JointState

from tp_sim.faults.record import Motion

SEED = 7
SECOND = 1_000_000_000


class Delivery(NamedTuple):
    """What is sent to the controller."""

    msg: JointState
    delay: float = 0.0
    """Time [s] until then."""
    usable: bool = True
    """Whether a controller may move the arm by it."""
    origin: Motion | None = None
    """What the arm did, whatever the message says."""
    taken: float = 0.0
    """Time [s] at which the relay took it from its queue."""


Disturbance = Callable[[Delivery], Iterable[Delivery]]
Change = Callable[[JointState], None]
"""Changes a joint state in place."""


def passed_on(state: Delivery) -> Iterable[Delivery]:
    """Send it as it is."""
    return (state,)


def silent(state: Delivery) -> Iterable[Delivery]:
    """Send nothing."""
    return ()


def lost(share: float) -> Disturbance:
    """Lose a share of them."""
    rng = np.random.default_rng(SEED)
    return lambda state: () if rng.random() < share else (state,)


def late(delay: float) -> Disturbance:
    """Send each after a time [s]."""
    return lambda state: (state._replace(delay=delay),)


def late_at_random(longest: float) -> Disturbance:
    """Send each after a time [s] of its own; some overtake others."""
    rng = np.random.default_rng(SEED)
    return lambda state: (state._replace(delay=longest * rng.random()),)


def doubled(gap: float) -> Disturbance:
    """Send each twice, the second time after a gap [s]."""
    return lambda state: (state, state._replace(delay=gap))


def repeated() -> Disturbance:
    """Send the first one again and again in place of the others."""
    first: list[Delivery] = []

    def disturb(state: Delivery) -> Iterable[Delivery]:
        if not first:
            first.append(state)
        return first

    return disturb


def reordered(group: int) -> Disturbance:
    """Collect groups of them and send each group in a random order."""
    rng = np.random.default_rng(SEED)
    waiting: list[Delivery] = []

    def disturb(state: Delivery) -> Iterable[Delivery]:
        waiting.append(state)
        if len(waiting) < group:
            return ()
        order = rng.permutation(group)
        deliveries = [waiting[i] for i in order]
        waiting.clear()
        return deliveries

    return disturb


def corrupted(change: Change, share: float = 1.0) -> Disturbance:
    """Change a share of them so that they are unusable."""
    rng = np.random.default_rng(SEED)

    def disturb(state: Delivery) -> Iterable[Delivery]:
        spoiled = rng.random() < share
        if spoiled:
            change(state.msg)
        return (state._replace(usable=not spoiled),)

    return disturb


def stamped(stamp: Callable[[int], int]) -> Disturbance:
    """Replace stamps [ns] by a function of the true ones."""

    def disturb(state: Delivery) -> Iterable[Delivery]:
        time = state.msg.header.stamp
        new = stamp(time.sec * SECOND + time.nanosec)
        time.sec, time.nanosec = divmod(new, SECOND)
        return (state,)

    return disturb


def running_backwards() -> Disturbance:
    """Let the clock of the stamps run backwards from the first one on."""
    first: list[int] = []

    def stamp(true: int) -> int:
        if not first:
            first.append(true)
        return 2 * first[0] - true

    return stamped(stamp)


def with_value(value: float) -> Change:
    """Set the second position to a value."""

    def change(msg: JointState) -> None:
        msg.position[1] = value

    return change


not_a_number = with_value(math.nan)
infinite = with_value(math.inf)
huge = with_value(1e300)


def too_short(msg: JointState) -> None:
    """Leave out a position."""
    del msg.position[1]


def without_a_joint(msg: JointState) -> None:
    """Leave out a joint."""
    del msg.name[1], msg.position[1], msg.velocity[1]


def renamed(msg: JointState) -> None:
    """Give a joint another name."""
    msg.name[1] = 'elbow'


def alternating(one: Disturbance, other: Disturbance, count: int) -> Disturbance:
    """Do the one for so many joint states, then the other for as many, and so on."""
    seen = 0

    def disturb(state: Delivery) -> Iterable[Delivery]:
        nonlocal seen
        seen += 1
        return one(state) if (seen - 1) // count % 2 == 0 else other(state)

    return disturb
