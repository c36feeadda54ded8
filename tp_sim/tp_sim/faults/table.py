"""The cases of the fault table."""

from __future__ import annotations

from collections.abc import Callable

from tp_sim.faults import around
from tp_sim.faults.case import Case
from tp_sim.faults.disturbances import (
    SECOND,
    Change,
    Disturbance,
    alternating,
    corrupted,
    doubled,
    huge,
    infinite,
    late,
    late_at_random,
    lost,
    not_a_number,
    passed_on,
    renamed,
    reordered,
    repeated,
    running_backwards,
    silent,
    stamped,
    too_short,
    without_a_joint,
)
from tp_sim.faults.rig import Rig

Run = Callable[[Rig], None]
BRAKING = 'zero or braking while none comes'
IGNORED = 'no motion by an unusable one'
CLOCK = 1.5
"""Time [s] after which a clock that was set has to be followed, at the latest."""


def _disturbed(
    make: Callable[[], Disturbance],
    stamps: bool = True,
    moving: bool = True,
    forwarded: bool = False,
) -> Run:
    """Disturb joint states for 4 s while the arm moves; for the options see `Rig`."""

    def run(rig: Rig) -> None:
        rig.stamped = rig.stamped and stamps
        rig.forwarded = forwarded
        rig.disturb(make(), 4.0, moving)
        rig.recover()

    return run


def _stopping(seconds: float, times: int) -> Run:
    """Let no joint state pass for a time [s], again and again."""

    def run(rig: Rig) -> None:
        for _ in range(times):
            rig.next_goal()
            rig.client.spin_for(0.4)
            rig.relay.disturbance = silent
            rig.client.spin_for(seconds)
            rig.relay.disturbance = passed_on
        rig.recover()

    return run


def _corrupted(change: Change) -> Run:
    """Spoil one joint state in five for 2 s, then all of them for 0.5 s."""

    def run(rig: Rig) -> None:
        rig.disturb(corrupted(change, 0.2), 2.0)
        rig.next_goal()
        rig.client.spin_for(0.4)
        rig.relay.disturbance = corrupted(change)
        rig.client.spin_for(0.5)
        rig.relay.disturbance = passed_on
        rig.recover()

    return run


def _case(name: str, done: str, run: Run, allowed: str = '', recovery: float = 1.0) -> Case:
    return Case(name, done, run, allowed, recovery)


CASES: tuple[Case, ...] = (
    _case('none', 'nothing', _disturbed(lambda: passed_on)),
    _case('stop_50ms', 'joint states stop for 50 ms, 10 times', _stopping(0.05, 10)),
    _case('stop_500ms', 'joint states stop for 0.5 s, 3 times', _stopping(0.5, 3), BRAKING),
    _case('stop_5s', 'joint states stop for 5 s', _stopping(5.0, 1), BRAKING),
    _case('lost_10', '10 % of the joint states lost', _disturbed(lambda: lost(0.1))),
    _case('lost_50', '50 % of the joint states lost', _disturbed(lambda: lost(0.5))),
    _case(
        'late_20ms',
        'joint states 20 ms late',
        _disturbed(lambda: late(0.02), moving=False),
        'braking while they are later than 20 ms',
    ),
    _case(
        'late_100ms',
        'joint states 100 ms late',
        _disturbed(lambda: late(0.1), moving=False, forwarded=True),
        'braking for 1 s, then the new lag may count: a clock that was set back looks the same',
    ),
    _case(
        'late_random',
        'joint states late by 0 to 100 ms at random, so that many are overtaken',
        _disturbed(lambda: late_at_random(0.1)),
    ),
    _case('reordered', 'joint states in groups of 4, shuffled', _disturbed(lambda: reordered(4))),
    _case(
        'repeated',
        'one joint state again and again for 4 s, stamp and all',
        _disturbed(repeated, moving=False),
        'braking, then rest while it does',
    ),
    _case('doubled', 'each joint state again after 2 ms', _disturbed(lambda: doubled(0.002))),
    *(
        _case(
            name, f'a position {what}: of one joint state in five, of all for 0.5 s', run, IGNORED
        )
        for name, what, run in (
            ('nan', 'is NaN', _corrupted(not_a_number)),
            ('infinite', 'is infinite', _corrupted(infinite)),
            ('huge', 'is 1e300', _corrupted(huge)),
            ('wrong_length', 'is left out, its name is not', _corrupted(too_short)),
            ('missing_joint', 'and its name are left out', _corrupted(without_a_joint)),
            ('renamed_joint', 'belongs to another name', _corrupted(renamed)),
        )
    ),
    _case(
        'stamps_backwards',
        'stamps run backwards',
        _disturbed(running_backwards, stamps=False, moving=False),
        'rest while they do',
        CLOCK,
    ),
    _case(
        'stamps_set_back',
        'the clock of the stamps goes back by 10 s, and forward again',
        _disturbed(lambda: stamped(lambda stamp: stamp - 10 * SECOND)),
        '',
        CLOCK,
    ),
    _case(
        'stamps_future',
        'stamps from an hour ahead',
        _disturbed(lambda: stamped(lambda stamp: stamp + 3600 * SECOND)),
        '',
        CLOCK,
    ),
    _case(
        'stamps_zero',
        'stamps are zero',
        _disturbed(lambda: stamped(lambda stamp: 0), stamps=False),
        '',
        CLOCK,
    ),
    _case(
        'stamps_constant',
        'the stamp stays as it is',
        _disturbed(lambda: stamped(lambda stamp: 1234 * SECOND), stamps=False),
        '',
        CLOCK,
    ),
    _case(
        'stamps_mixed',
        'stamps that are right and zero in turn, 100 each',
        _disturbed(lambda: alternating(passed_on, stamped(lambda stamp: 0), 100), stamps=False),
        '',
        CLOCK,
    ),
    *around.CASES,
)
