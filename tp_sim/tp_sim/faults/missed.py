"""Why a joint state got no command. Knows neither ROS nor the nodes."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from itertools import chain
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tp_sim.faults.record import Pause, paused

Vector = NDArray[np.float64]

MACHINE = 'the machine did not run the nodes'
SIMULATOR = 'the simulator was late, the next joint state came at once'
OVERRUN = 'the command before was late'
WORK = 'the controller did other work'
UNEXPLAINED = 'not explained'
SHARE = 0.25
"""Share of a period that explains a missed command."""


class Times(NamedTuple):
    """When joint states and commands were sent, in order.

    Attributes
    ----------
    stamps, sent
        Stamp [ns] and time of sending [s] of each joint state (m,).
    answers, answered
        Stamp [ns] of the joint state that each command answers, and when that was sent [s] (k,).
    noted
        When the listener took each command and looked at the following [s] (k,).
    waited
        Time [s] that the threads of both nodes had spent waiting for a processor by then (k,).
    longest
        Longest time [s] that one of these threads waited, of the waits that ended since the look
        before (k,): Linux counts a wait when it ends.
    ran
        Time [s] that the controller's threads had run by then (k,).
    """

    stamps: NDArray[np.int64]
    sent: Vector
    answers: NDArray[np.int64]
    answered: Vector
    noted: Vector
    waited: Vector
    longest: Vector
    ran: Vector


def ages(times: Times) -> tuple[Vector, Vector]:
    """Times [s] of commands (k,) that answer a joint state, and how old that was then [s]."""
    places = np.searchsorted(times.stamps, times.answers)
    places = np.minimum(places, times.stamps.size - 1)
    known = times.stamps[places] == times.answers
    return times.answered[known], (times.answered - times.sent[places])[known]


def missed(times: Times, period: float, pauses: Sequence[Pause]) -> Counter[str]:
    """Count joint states without a command by cause, but for the last one.

    The first cause that fits counts: the machine did not run the timer process or a thread of the
    nodes for a quarter of a period or more; the next joint state came sooner than half a period
    after it; the command before was sent later than a period after its joint state; the
    controller ran for more than a period between the commands around it.

    Parameters
    ----------
    times
        All joint states and commands.
    period
        Time [s] between joint states.
    pauses
        When the machine did not run a bare timer process, in order.
    """
    found: Counter[str] = Counter()
    answered = np.isin(times.stamps, times.answers)
    # One after the other: a busy machine has hundreds of thousands of them in an hour.
    pauses = _joined(pauses, _waits(times, SHARE * period))
    begins, ends = np.array([(pause.begin, pause.end) for pause in pauses]).reshape(-1, 2).T
    for k in np.flatnonzero(~answered[:-1]):
        begin, end = times.sent[k] - period, times.sent[k + 1] + period
        first, last = np.searchsorted(ends, begin, 'right'), np.searchsorted(begins, end)
        found[_cause(times, int(k), begin, end, period, pauses[first:last])] += 1
    return found


def _waits(times: Times, least: float) -> list[Pause]:
    """Times in which a thread of the nodes waited for a processor for long enough [s]."""
    return [
        Pause(times.noted[k] - times.longest[k], times.noted[k])
        for k in np.flatnonzero(times.longest > least)
    ]


def _joined(*pauses: Sequence[Pause]) -> list[Pause]:
    """All times that any of the pauses covers, in order and apart."""
    found: list[Pause] = []
    for pause in sorted(chain.from_iterable(pauses)):
        if found and pause.begin <= found[-1].end:
            found[-1] = Pause(found[-1].begin, max(found[-1].end, pause.end))
        else:
            found.append(pause)
    return found


def _cause(
    times: Times, k: int, begin: float, end: float, period: float, near: Sequence[Pause]
) -> str:
    first, last = np.searchsorted(times.noted, (begin, end))
    first, last = max(int(first) - 1, 0), min(int(last), times.noted.size - 1)
    waited = times.waited[last] - times.waited[first] if last > first else 0.0
    if max(paused(near, begin, end), waited) > SHARE * period:
        return MACHINE
    if times.sent[k + 1] - times.sent[k] < 0.5 * period:
        return SIMULATOR
    before = int(np.searchsorted(times.answers, times.stamps[k])) - 1
    if before >= 0:
        place = int(np.searchsorted(times.stamps, times.answers[before]))
        if times.answered[before] - times.sent[place] > period:
            return OVERRUN
    if last > first and times.ran[last] - times.ran[first] > period:
        return WORK
    return UNEXPLAINED
