"""Age, order and resends of joint states; late cycles; warnings that are throttled."""

import math
from array import array

import pytest
from builtin_interfaces.msg import Time

from tp_controller.ros.feedforward import FeedforwardOverrides
from tp_controller.ros.joint_states import JointStateValues, RateCheck
from tp_controller.ros.lag import Lag
from tp_controller.ros.state_watch import StateWatch
from tp_controller.ros.warnings import Warnings

LIMIT = 0.1
PERIOD = 0.01


def state(stamp, q=0.0):
    """Joint state with a stamp [s] and a position."""
    sec, nanosec = divmod(round(stamp * 1e9), 1_000_000_000)
    return JointStateValues(
        Time(sec=sec, nanosec=nanosec), ['a'], array('d', [q]), array('d', [0.0])
    )


class Feed:
    """Gives states to a watch as a sender would."""

    def __init__(self):
        self.watch = StateWatch(LIMIT, PERIOD)
        self.now = 50.0

    def give(self, stamp, q=0.0, after=PERIOD, sent=None, idle=0.0):
        self.now += after
        info = {} if sent is None else {'source_timestamp': round(sent * 1e9)}
        return self.watch.arrive(state(stamp, q), info, self.now, idle)

    def answer(self, *args, **fields):
        arrival = self.give(*args, **fields)
        again = self.watch.is_resend(arrival)
        elapsed = 0.0 if again else self.watch.elapsed(arrival)
        if not again:
            self.watch.answered(arrival)
        return again, elapsed


def test_states_that_waited_are_old_by_the_time_of_their_sending():
    feed = Feed()
    for i in range(200):
        assert feed.give(0.0, sent=1000.0 + PERIOD * i).age < 1e-6
    waited = [feed.give(0.0, after=0.0 if i else 1.0, sent=1002.0 + PERIOD * i) for i in range(99)]
    assert [a.age for a in waited] == pytest.approx(
        [0.99 - PERIOD * i for i in range(99)], abs=1e-6
    )


def test_a_first_state_that_waited_is_old_until_the_clock_has_shown_that_it_is_behind():
    """A process that starts may get one first that was sent a second ago."""
    feed = Feed()
    feed.watch = StateWatch(LIMIT, PERIOD, wall=-1000.0)
    assert feed.give(0.0, sent=1000.0 + feed.now + PERIOD - 1.25).age == pytest.approx(1.25)
    assert feed.give(0.0, sent=1000.0 + feed.now + PERIOD - 0.001).age < 1e-6
    behind = Feed()
    behind.watch = StateWatch(LIMIT, PERIOD, wall=-1000.0)
    ages = [behind.give(0.0, sent=995.0 + behind.now + PERIOD).age for _ in range(120)]
    assert ages[:90] == pytest.approx([5.0] * 90)
    assert max(ages[-10:]) < 1e-6
    assert 'is behind, or was set back, by 5 s' in behind.watch.note()


def test_clocks_that_differ_by_less_than_the_limit_make_no_state_old():
    feed = Feed()
    feed.watch = StateWatch(LIMIT, PERIOD, wall=-1000.0)
    assert feed.give(0.0, sent=1000.0 + feed.now + PERIOD - 0.08).age == 0.0
    assert feed.give(0.0, sent=1000.0 + feed.now + PERIOD + 0.02).age == 0.0


def test_without_any_clock_a_state_may_be_as_old_as_the_last_look():
    assert Feed().give(0.0, idle=0.7).age == 0.7
    assert Feed().give(5.0, idle=0.7).age == 0.7, 'stamps count once they are known to run along'


def test_a_stamp_tells_the_age_once_it_runs_like_the_steady_clock():
    feed = Feed()
    for i in range(500):
        feed.give(7.0 + PERIOD * i)
    assert feed.give(7.0 + PERIOD * 500, after=0.5).age == pytest.approx(0.49)


def test_stamps_of_a_simulation_say_nothing_about_the_age():
    feed = Feed()
    for i in range(2000):
        feed.give(7.0 + PERIOD * i, after=0.4 * PERIOD)
    assert feed.give(27.0, after=3.0, sent=1.0).age == 0.0


def test_a_clock_that_was_set_back_is_noticed_and_used_again():
    lag = Lag(LIMIT)
    ages = [lag.age(1000.0 + PERIOD * i, PERIOD * i) for i in range(300)]
    assert max(ages) < 1e-9
    found = []
    for i in range(300, 600):
        age = lag.age(900.0 + PERIOD * i, PERIOD * i)
        found.append(lag.set_back)
        if age > LIMIT:
            assert i < 300 + 1.1 / PERIOD
    assert sum(found) == pytest.approx(100.0)
    assert lag.age(900.0 + 6.0, 6.0) < 1e-9


def test_the_age_is_right_after_a_clock_was_set_forward():
    lag = Lag(LIMIT)
    for i in range(300):
        lag.age(1000.0 + PERIOD * i, PERIOD * i)
    assert lag.age(2000.0 + 3.0, 3.0) == 0.0


def test_states_that_were_overtaken_are_dropped_and_counted():
    feed = Feed()
    kept = [feed.give(stamp, after=0.001) is not None for stamp in (1.0, 1.2, 1.1, 1.3, 1.05)]
    assert kept == [True, True, False, True, False]
    assert feed.watch.overtaken == 2


def test_a_late_bundle_of_old_states_is_no_clock_that_was_set_back():
    feed = Feed()
    feed.give(9.0)
    assert all(feed.give(1.0 + PERIOD * i, after=1e-5) is None for i in range(50))


def test_stamps_that_go_back_and_stay_there_are_taken_and_told():
    feed = Feed()
    for i in range(100):
        feed.answer(100.0 + PERIOD * i, q=float(i))
    dropped = [feed.give(40.0 + PERIOD * i) for i in range(4)]
    assert dropped == [None] * 4
    again, elapsed = feed.answer(40.0 + PERIOD * 4)
    assert not again
    assert elapsed == pytest.approx(5 * PERIOD), 'by the steady clock'
    assert 'went back by 61 s' in feed.watch.note()
    assert feed.watch.note() == ''
    assert feed.answer(40.0 + PERIOD * 5)[1] == pytest.approx(PERIOD)


def test_the_same_stamp_and_content_is_a_resend_and_the_same_stamp_alone_is_not():
    feed = Feed()
    assert feed.answer(1.0, 0.5) == (False, math.inf)
    assert feed.answer(1.0, 0.5) == (True, 0.0)
    again, elapsed = feed.answer(1.0, 0.6)
    assert not again
    assert elapsed == pytest.approx(2 * PERIOD)


@pytest.mark.parametrize('stamp', [0.0, 3.0])
def test_stamps_that_stay_while_the_arm_moves_say_nothing(stamp):
    feed = Feed()
    for i in range(10):
        feed.answer(stamp, 0.1 * i)
    for _ in range(10):
        again, elapsed = feed.answer(stamp, 0.9)
        assert not again, 'an arm at rest sends the same state again and again'
        assert elapsed == pytest.approx(PERIOD)
    assert feed.answer(stamp, 0.9, after=0.2 * PERIOD)[0], 'too soon for a new state'


def test_a_stamp_that_stands_does_not_tell_how_its_clock_runs():
    feed = Feed()
    for i in range(500):
        feed.answer(100.0 + PERIOD * i, float(i))
    last = 100.0 + PERIOD * 499
    assert feed.watch.real_time
    for _ in range(300):
        assert feed.answer(last, 499.0) == (True, 0.0)
    assert feed.watch.real_time


def test_states_that_were_never_answered_count_for_a_stamp_that_stands():
    feed = Feed()
    for i in range(500):
        feed.answer(100.0 + PERIOD * i, float(i))
    last = 100.0 + PERIOD * 499
    ages = [feed.give(last, 500.0 + i, after=0.06, sent=50.0 + 0.06 * i).age for i in range(6)]
    assert ages[1] > LIMIT
    assert max(ages[3:]) < 1e-6


def test_one_late_state_does_not_keep_a_clock_that_is_behind_from_being_known():
    lag = Lag(LIMIT, expected=0.0)
    ages = [lag.age(PERIOD * i - (0.35 if i == 20 else 0.2), PERIOD * i) for i in range(300)]
    assert ages[100] > LIMIT
    assert max(ages[130:]) < 1e-9


def test_elapsed_follows_the_time_of_a_simulation_and_not_a_clock_that_jumps():
    feed = Feed()
    feed.answer(1.0)
    assert feed.answer(1.5, 1.0)[1] == pytest.approx(0.5), 'faster than real time'
    feed = Feed()
    for i in range(500):
        feed.answer(1.0 + PERIOD * i, float(i))
    assert feed.answer(100.0, 0.1)[1] == pytest.approx(PERIOD)
    feed = Feed()
    feed.answer(1.0)
    assert feed.answer(3601.0, 1.0)[1] == pytest.approx(PERIOD), 'a leap before any clock is known'


def test_states_that_the_middleware_dropped_are_counted():
    watch = StateWatch(LIMIT, PERIOD)
    watch.single_publisher = True
    for number in (1, 2, 5, 6, 16):
        info = {'publication_sequence_number': number}
        watch.arrive(state(number), info, 0.01 * number, 0.0)
    assert (watch.lost, watch.received) == (11, 16)


def test_the_rate_is_that_of_all_states_not_of_those_answered():
    check = RateCheck(100.0)
    problems = [check.see(4 * i, 0.04 * i) for i in range(100)]
    assert not any(problems)
    problems = [check.see(400 + i, 4.0 + 0.02 * i) for i in range(300)]
    assert any('come at 50 Hz, rate is 100' in problem for problem in problems if problem)


def test_a_feedforward_ends_with_the_time_that_passes():
    class Task:
        feedforward = 1.0

    task = Task()
    overrides = FeedforwardOverrides(0.5, lambda _: 0.0)
    overrides.begin(task)
    overrides.advance(math.inf)
    for _ in range(50):
        overrides.advance(0.01)
    assert task.feedforward == 1.0
    overrides.advance(0.01)
    assert task.feedforward == 0.0


class Told:
    """Warnings with a clock of its own, flushed every second."""

    def __init__(self):
        self.now, self.lines = 0.0, []
        self.warnings = Warnings(
            lambda line: self.lines.append(f'! {line}'), self.lines.append, lambda: self.now
        )

    def wait(self, seconds):
        for _ in range(seconds):
            self.now += 1.0
            self.warnings.flush()


def test_a_warning_that_goes_on_is_logged_when_it_begins_and_when_it_is_over():
    told = Told()
    for number in range(100):
        told.warnings.warn('late', f'{number} ms')
        told.now += 0.1
        told.warnings.flush()
    assert told.lines == ['! 0 ms']
    assert told.warnings.message == '99 ms'
    told.wait(20)
    assert told.lines == ['! 0 ms', 'over, 100 times in 9.9 s: 99 ms']
    assert told.warnings.message == ''


def test_a_single_event_has_one_line_and_others_about_it_are_told_together():
    told = Told()
    told.warnings.warn('goal', 'no frame map')
    told.wait(20)
    assert told.lines == ['! no frame map']
    for reason in ('not finite', 'no frame world'):
        told.warnings.warn('goal', reason)
        told.wait(1)
    told.wait(20)
    assert told.lines[1:] == ['! not finite', 'over, 2 times in 1 s: no frame world']


def test_a_lasting_warning_holds_until_it_is_cleared():
    told = Told()
    told.warnings.warn('stale', 'no joint state', lasting=True)
    told.wait(60)
    assert told.warnings.message == 'no joint state'
    assert told.warnings.clear('stale')
    assert not told.warnings.clear('stale')
    told.wait(20)
    assert told.lines == ['! no joint state', 'over after 60 s: no joint state']
    told.warnings.warn('stale', 'no joint state', lasting=True)
    told.warnings.clear('stale', 'running')
    assert told.lines[2:] == ['! no joint state', 'running']


@pytest.mark.parametrize('ends', [True, False])
def test_what_comes_and_goes_quickly_does_not_fill_the_log(ends):
    told = Told()
    for _ in range(40):
        told.warnings.warn('stale', 'no joint state', lasting=True)
        told.now += 0.05
        told.warnings.clear('stale', 'running')
        told.now += 0.05
    if not ends:
        told.warnings.warn('stale', 'no joint state', lasting=True)
    told.wait(30)
    last = 'over, 39 times in 3.8 s: no joint state' if ends else '! no joint state (40 times in'
    assert told.lines[:2] == ['! no joint state', 'running']
    assert told.lines[2].startswith(last)
    assert len(told.lines) == 3
