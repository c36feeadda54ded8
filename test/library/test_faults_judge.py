"""The judge of the fault table finds what is wrong; disturbances do what they say."""

import math

import numpy as np
import pytest
from sensor_msgs.msg import JointState

from tp_controller.errors import InvalidValue
from tp_sim.faults import disturbances
from tp_sim.faults.case import Case, Outcome
from tp_sim.faults.disturbances import Delivery
from tp_sim.faults.judge import Allowed, Findings, judge
from tp_sim.faults.missed import (
    MACHINE,
    OVERRUN,
    SIMULATOR,
    UNEXPLAINED,
    WORK,
    Times,
    ages,
    missed,
)
from tp_sim.faults.record import Command, Pause, Sent
from tp_sim.faults.report import page_table, write_section

T = 0.01
ALLOWED = Allowed(np.array([1.0, 2.0]), np.array([4.0, 8.0]), T, oldest=0.1, hold=0.2)
STEP = 0.04
"""Change of the first joint's velocity that a step allows."""


def conversation(speeds, unusable=()):
    """Joint states and the commands that answer them 1 ms later."""
    sent, commands = [], []
    for i, speed in enumerate(speeds):
        before = speeds[i - 1] if i else 0.0
        sent.append(Sent(i + 1, T * i, T * i, i not in unusable, (before, 0.0)))
        commands.append(Command(i + 1, T * i + 0.001, (speed, 0.0)))
    return sent, commands


RAMP = [STEP * min(i, 25) for i in range(60)]


def wrong(sent, commands, **options):
    return judge(sent, commands, ALLOWED, **options).wrong


def test_commands_that_keep_all_limits_are_allowed():
    sent, commands = conversation(RAMP)
    found = judge(sent, commands, ALLOWED)
    assert found.wrong == []
    assert found.speed == pytest.approx(1.0)
    assert found.change == pytest.approx(1.0)
    assert found.age == pytest.approx(0.001)
    assert found.gap == pytest.approx(T)


@pytest.mark.parametrize(
    ('velocity', 'said'),
    [
        ((1.01, 0.0), 'command 50 is 1.01 of the velocity limit'),
        ((0.9, 0.0), 'command 50 changes by 2.5 of the limit'),
        ((math.nan, 0.0), 'command 50 is [nan, 0.0]'),
        ((1.0,), 'command 50 is [1.0]'),
    ],
)
def test_a_command_beyond_a_limit_is_found(velocity, said):
    sent, commands = conversation(RAMP)
    commands[50] = commands[50]._replace(velocity=velocity)
    assert any(said in text for text in wrong(sent, commands))


@pytest.mark.parametrize('stamped', [True, False])
def test_motion_by_old_data_is_found_and_a_pause_of_the_machine_excuses_it(stamped):
    sent, commands = conversation(RAMP)
    late = commands[-1]._replace(time=commands[-1].time + 0.15)
    if not stamped:
        commands = [command._replace(stamp=0) for command in commands]
        late = late._replace(stamp=0)
    commands[-1] = late
    assert 'data 151 ms old' in ' '.join(wrong(sent, commands, stamped=stamped))
    pause = Pause(late.time - 0.1, late.time)
    assert wrong(sent, commands, stamped=stamped, pauses=[pause]) == []


def test_data_is_as_old_as_what_was_held_back_unless_a_new_lag_may_count():
    sent, commands = conversation(RAMP)
    sent = [state._replace(taken=state.time - 0.15) for state in sent]
    assert 'data 151 ms old' in ' '.join(wrong(sent, commands))
    assert wrong(sent, commands, forwarded=True) == []


def test_a_copy_that_is_sent_later_does_not_make_the_data_younger():
    sent, commands = conversation(RAMP)
    late = commands[-1]._replace(time=commands[-1].time + 0.15)
    copy = sent[-1]._replace(time=late.time - 0.01)
    assert 'data 151 ms old' in ' '.join(wrong([*sent, copy], [*commands[:-1], late]))


def test_a_command_before_its_joint_state_is_found():
    sent, commands = conversation(RAMP)
    commands[-1] = commands[-1]._replace(time=sent[-1].time - 0.005)
    assert 'sent after it' in ' '.join(wrong(sent, commands))


def test_of_several_controllers_only_speed_and_data_are_judged():
    sent, commands = conversation([*RAMP, STEP])
    assert wrong(sent, commands, mixed=True) == []
    commands[-1] = commands[-1]._replace(velocity=(1.01, 0.0))
    assert 'limit' in ' '.join(wrong(sent, commands, mixed=True))


def test_braking_needs_no_joint_state_but_has_to_brake():
    sent, commands = conversation(RAMP)
    end = commands[-1].time
    braking = [Command(0, end + T * i, (1.0 - STEP * i, 0.0)) for i in range(1, 26)]
    assert wrong(sent, commands + braking) == []
    steady = [Command(0, end + T * i, (1.0, 0.0)) for i in range(1, 3)]
    assert wrong(sent, commands + steady) == [
        'command 60 moves the arm and answers no joint state; '
        'command 61 moves the arm and answers no joint state'
    ]


def test_motion_by_an_unusable_joint_state_is_found():
    assert 'unusable' in ' '.join(wrong(*conversation(RAMP, unusable=(40,))))
    braked = RAMP[:40] + [1.0 - STEP * i for i in range(1, 5)]
    assert wrong(*conversation(braked, unusable=(40, 41, 42, 43))) == []


def test_an_arm_without_commands_rests_and_starts_from_there():
    sent, commands = conversation([*RAMP, 1.0])
    pause = 0.5
    then = sent[-1].time + pause
    state = sent[-1]._replace(time=then, taken=then, velocity=(0.0, 0.0))
    late = commands[-1]._replace(time=commands[-1].time + pause)
    assert 'changes' in ' '.join(wrong([*sent[:-1], state], [*commands[:-1], late]))
    slow = late._replace(velocity=(STEP, 0.0))
    assert wrong([*sent[:-1], state], [*commands[:-1], slow]) == []


def test_a_joint_that_was_blocked_may_start_from_standstill():
    sent, commands = conversation([*RAMP, STEP])
    assert 'changes' in ' '.join(wrong(sent, commands))
    sent[-1] = sent[-1]._replace(velocity=(0.0, 0.0))
    assert wrong(sent, commands) == []


@pytest.mark.parametrize(('excess', 'allowed'), [(0.005, True), (0.02, False)])
def test_the_velocity_of_a_joint_that_does_something_else_is_known_less_exactly(excess, allowed):
    sent, commands = conversation(RAMP)
    sent[40] = sent[40]._replace(velocity=(0.5, 0.0))
    commands[40] = commands[40]._replace(velocity=(0.5 - (1.0 + excess) * STEP, 0.0))
    found = judge(sent[:41], commands[:41], ALLOWED).wrong
    assert found == ([] if allowed else ['command 40 changes by 1.01 of the limit'])


def passed(disturbance, count=40):
    """Numbers of the joint states that come out, with delays, and what is unusable."""
    out = []
    for i in range(count):
        msg = JointState(name=['a', 'b'], position=[float(i), 0.5], velocity=[0.0, 0.0])
        msg.header.stamp.sec = i + 100
        out += disturbance(Delivery(msg))
    return out


def test_disturbances_do_what_they_say_and_repeat():
    assert len(passed(disturbances.silent)) == 0
    assert len(passed(disturbances.doubled(0.002))) == 80
    kept = [d.msg.position[0] for d in passed(disturbances.lost(0.5))]
    assert kept == [d.msg.position[0] for d in passed(disturbances.lost(0.5))]
    assert 10 < len(kept) < 30
    assert all(d.delay == 0.1 for d in passed(disturbances.late(0.1)))
    shuffled = [d.msg.position[0] for d in passed(disturbances.reordered(4))]
    assert sorted(shuffled) == list(range(40)) != shuffled
    stamps = [d.msg.header.stamp.sec for d in passed(disturbances.running_backwards())]
    assert stamps == [100 - i for i in range(40)]


@pytest.mark.parametrize(
    'change',
    [
        disturbances.not_a_number,
        disturbances.infinite,
        disturbances.huge,
        disturbances.too_short,
        disturbances.without_a_joint,
        disturbances.renamed,
    ],
)
def test_spoiled_joint_states_are_known_as_such(change):
    for delivery in passed(disturbances.corrupted(change, 0.5)):
        msg = delivery.msg
        as_it_was = msg.name == ['a', 'b'] and list(msg.position[1:]) == [0.5]
        assert delivery.usable == as_it_was


def times(sent, answered, waited=None, ran=None, longest=None):
    """Joint states sent at times [ms], and (number, time) of commands."""
    numbers, when = zip(*answered, strict=True)
    return Times(
        np.arange(len(sent)),
        1e-3 * np.array(sent, dtype=float),
        np.array(numbers),
        1e-3 * np.array(when),
        1e-3 * np.array(when),
        np.zeros(len(when)) if waited is None else np.array(waited),
        np.zeros(len(when)) if longest is None else np.array(longest),
        np.zeros(len(when)) if ran is None else np.array(ran),
    )


@pytest.mark.parametrize(
    ('given', 'pauses', 'cause'),
    [
        (times([0, 2, 4, 6], [(0, 0.5), (2, 4.5), (3, 6.5)]), [], UNEXPLAINED),
        (times([0, 2, 2.4, 4], [(0, 0.5), (2, 2.8), (3, 4.5)]), [], SIMULATOR),
        (times([0, 2, 4, 6], [(0, 4.1), (2, 4.5), (3, 6.5)]), [], OVERRUN),
        (times([0, 2, 4, 6], [(0, 0.5), (2, 4.5), (3, 6.5)]), [Pause(0.003, 0.004)], MACHINE),
        (times([0, 2, 4, 6], [(0, 0.5), (2, 4.5), (3, 6.5)], [0, 0.001, 0.001]), [], MACHINE),
        (times([0, 2, 4, 6], [(0, 0.5), (2, 4.5), (3, 6.5)], None, [0, 0.003, 0.004]), [], WORK),
    ],
)
def test_a_missed_command_has_its_cause(given, pauses, cause):
    assert missed(given, 0.002, pauses) == {cause: 1}
    assert ages(given)[1].max() <= 0.0041


@pytest.mark.parametrize(('waited', 'cause'), [(0.0065, MACHINE), (0.003, UNEXPLAINED)])
def test_a_wait_counts_for_the_time_before_its_end(waited, cause):
    given = times(range(0, 14, 2), [(0, 0.5), (5, 10.5), (6, 12.5)], longest=[0, waited, 0])
    # The first of four is 8.5 ms old when the wait ends, and within a period of its begin.
    found = missed(given, 0.002, [])
    assert sum(found.values()) == 4
    assert found[cause] >= 1
    assert (found[UNEXPLAINED] > 0) == (cause == UNEXPLAINED)


def outcome(name, wrong=()):
    case = Case(name, f'what {name} does', lambda rig: None)
    return Outcome(case, Findings(1, 1.0, wrong=list(wrong)))


def test_lines_of_cases_that_were_not_run_stay_on_the_page():
    before = page_table([outcome('a'), outcome('b', ['too fast']), outcome('c', ['too old'])])
    assert '1 of 3 passed' in before
    after = page_table([outcome('b')], before)
    assert [line.split('`')[1] for line in after.splitlines() if line[:3] == '| `'] == list('abc')
    assert '2 of 3 passed' in after
    assert '- `c`: too old' in after
    assert 'too fast' not in after


def test_a_page_gets_its_section_anew(tmp_path):
    page = tmp_path / 'page.md'
    page.write_text('a\n<!-- begin: x -->\nold\n<!-- end: x -->\nb\n')
    for _ in range(2):
        write_section(page, 'x', 'new')
        assert page.read_text() == 'a\n<!-- begin: x -->\n\nnew\n\n<!-- end: x -->\nb\n'
    with pytest.raises(InvalidValue, match='begin: y'):
        write_section(page, 'y', 'new')
