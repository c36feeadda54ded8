"""Errors that come within tolerance, stay away, or take their time."""

import math

import numpy as np
import pytest

from tp_controller.errors import InvalidValue
from tp_controller.progress import Progress, Verdict

PERIOD = 0.01


def watched(progress, errors, moving=lambda t: True, seconds=30.0):
    """Verdict and time of errors that are functions of time."""
    for step in range(round(seconds / PERIOD)):
        t = step * PERIOD
        verdict = progress.see(PERIOD if step else 0.0, np.array(errors(t)), moving(t))
        if verdict is not None:
            return verdict, progress.time
    return None, progress.time


def test_reached_means_within_tolerance_for_a_moment():
    verdict, time = watched(Progress([0.01]), lambda t: [math.exp(-t)])
    assert verdict is Verdict.REACHED
    assert time == pytest.approx(-math.log(0.01) + 0.1, abs=2 * PERIOD)


def test_all_tasks_have_to_be_within_tolerance_at_once():
    progress = Progress([0.01, 0.1])
    verdict, time = watched(progress, lambda t: [math.exp(-4.0 * t), 0.2 - 0.05 * t])
    assert verdict is Verdict.REACHED
    assert time == pytest.approx(2.1, abs=2 * PERIOD)


def test_passing_through_is_not_reaching():
    verdict, _ = watched(Progress([0.01]), lambda t: [abs(1.0 - t)], seconds=2.0)
    assert verdict is None


def test_at_rest_away_from_the_goal_is_stuck_after_a_second():
    verdict, time = watched(
        Progress([0.01]), lambda t: [max(0.5, 1.0 - t)], moving=lambda t: t < 0.5
    )
    assert verdict is Verdict.STUCK
    assert time == pytest.approx(1.5, abs=0.02)


def test_an_error_that_creeps_to_its_end_is_stuck_soon():
    verdict, time = watched(
        Progress([0.01]), lambda t: [0.5 + 0.5 * math.exp(-t)], moving=lambda t: t < 5.0
    )
    assert verdict is Verdict.STUCK
    assert time < 8.0


def test_a_slow_approach_is_not_stuck():
    verdict, _ = watched(Progress([0.01]), lambda t: [1.0 - 0.01 * t], moving=lambda t: False)
    assert verdict is None


def test_an_arm_that_moves_without_progress_is_stuck_after_ten_seconds():
    verdict, time = watched(Progress([0.01]), lambda t: [0.5 + 0.1 * math.sin(9.0 * t)])
    assert verdict is Verdict.STUCK
    assert time == pytest.approx(10.5, abs=0.5)


def test_a_task_that_goes_on_converging_inside_its_tolerance_is_no_progress():
    errors = lambda t: [math.exp(-t), 0.5]  # noqa: E731
    verdict, time = watched(Progress([0.01, 0.01]), errors, moving=lambda t: t < 5.0)
    assert verdict is Verdict.STUCK
    assert time < 6.5


def test_a_time_limit_ends_it():
    verdict, time = watched(Progress([0.01], 2.0), lambda t: [1.0])
    assert verdict is Verdict.TIMED_OUT
    assert time == pytest.approx(2.0, abs=2 * PERIOD)


@pytest.mark.parametrize('speed', [0.05, 10.0])
def test_the_time_left_is_foreseen_at_the_limits_and_free(speed):
    """A task of gain 2 with a limit of its speed."""
    errors = [1.0]
    while errors[-1] > 0.01:
        errors.append(errors[-1] - PERIOD * min(speed, 2.0 * errors[-1]))
    progress = Progress([0.01])
    for step, error in enumerate(errors):
        progress.see(PERIOD, np.array([error]), True)
        if step == len(errors) // 3:
            left = PERIOD * (len(errors) - step)
            assert progress.time_left(np.array([2.0])) == pytest.approx(left, rel=0.15)
    assert progress.time_left(np.array([2.0])) == 0.0


def test_no_end_is_foreseen_of_an_error_that_stays():
    progress = Progress([0.01])
    watched(progress, lambda t: [0.5], seconds=0.5)
    assert progress.time_left(np.array([1.0])) == math.inf


@pytest.mark.parametrize(
    ('tolerances', 'limit', 'key'),
    [([0.0], 1.0, 'tolerance'), ([math.nan], 1.0, 'tolerance'), ([0.1], -1.0, 'time_limit')],
)
def test_what_cannot_be_is_refused(tolerances, limit, key):
    with pytest.raises(InvalidValue, match=key):
        Progress(tolerances, limit)
