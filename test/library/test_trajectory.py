"""Paths in time: what goes through points, with velocities that are its derivatives."""

import numpy as np
import pinocchio as pin
import pytest

from tp_controller.errors import InvalidValue
from tp_controller.interpolation import RotationPath, VectorPath, check_times
from tp_controller.pace import pace

RANDOM = np.random.default_rng(4)
TIMES = np.cumsum(RANDOM.uniform(0.2, 0.6, 100))


def derivative(path, time, step=1e-6):
    """Of values by a central difference."""
    return (path.at(time + step)[0] - path.at(time - step)[0]) / (2.0 * step)


def turning(path, time, step=1e-6):
    """Angular velocity by a central difference."""
    before, after = path.at(time - step)[0], path.at(time + step)[0]
    return path.at(time)[0] @ pin.log3(before.T @ after) / (2.0 * step)


def smooth(times):
    """Values, velocities and accelerations of a motion that is known everywhere."""
    t = times[:, None] * np.array([1.0, 0.7]) + np.array([0.0, 0.3])
    w = np.array([1.0, 0.7])
    return np.sin(t), w * np.cos(t), -w * w * np.sin(t)


@pytest.mark.parametrize('given', [1, 2, 3])
def test_a_path_goes_through_its_points_with_the_velocities_given(given):
    path = VectorPath(TIMES, *smooth(TIMES)[:given])
    for i in range(len(TIMES) - 1):
        value, rate = path.at(TIMES[i])
        assert value == pytest.approx(path.values[i], abs=1e-12)
        if given > 1:
            assert rate == pytest.approx(smooth(TIMES)[1][i], abs=1e-12)
    for time in RANDOM.uniform(TIMES[0], TIMES[-1], 50):
        assert path.at(time)[1] == pytest.approx(derivative(path, time), abs=1e-6)


def test_more_derivatives_come_nearer_to_the_motion_behind_the_points():
    inner = RANDOM.uniform(TIMES[5], TIMES[-6], 200)
    pairs = list(zip(inner, smooth(inner)[0], strict=True))
    errors = []
    for given in (2, 3):
        path = VectorPath(TIMES, *smooth(TIMES)[:given])
        errors.append(max(np.abs(path.at(t)[0] - x).max() for t, x in pairs))
    assert errors[1] < 0.05 * errors[0] < 0.05 * 1e-3


def test_a_spline_has_continuous_accelerations_and_is_that_of_all_points_at_once():
    values = RANDOM.normal(size=(100, 2))
    start = np.array([0.3, -0.2])
    path = VectorPath(TIMES, values, start=start)
    h = np.diff(TIMES)
    A, b = np.eye(100), np.zeros((100, 2))
    b[0] = start
    for i in range(1, 99):
        A[i, i - 1 : i + 2] = 1 / h[i - 1], 2 / h[i - 1] + 2 / h[i], 1 / h[i]
        b[i] = 3 * ((values[i] - values[i - 1]) / h[i - 1] ** 2)
        b[i] += 3 * ((values[i + 1] - values[i]) / h[i] ** 2)
    rates = np.linalg.solve(A, b)
    for i in range(99):
        assert path.at(TIMES[i])[1] == pytest.approx(rates[i], abs=1e-10)


def test_before_and_after_its_points_a_path_rests():
    path = VectorPath(TIMES, *smooth(TIMES)[:2])
    for time, end in ((0.0, 0), (TIMES[-1], -1), (99.0, -1)):
        value, rate = path.at(time)
        assert value == pytest.approx(path.values[end])
        assert not rate.any()


@pytest.mark.parametrize('given', [1, 2, 3])
def test_rotations_go_through_their_points_with_angular_velocities(given):
    times = TIMES[:12]
    axes = RANDOM.normal(size=(12, 3))
    rotations = np.stack([pin.exp3(axis) for axis in axes])
    columns = [rotations, *RANDOM.normal(size=(2, 12, 3))][:given]
    path = RotationPath(times, *columns)
    for i in range(11):
        R, w = path.at(times[i])
        assert np.abs(R - rotations[i]).max() < 1e-9
        if given > 1:
            assert w == pytest.approx(columns[1][i], abs=1e-9)
        before = path.at(times[i + 1] - 1e-9)[0]
        assert before == pytest.approx(rotations[i + 1], abs=1e-6)
    for time in RANDOM.uniform(times[0], times[-1], 30):
        assert path.at(time)[1] == pytest.approx(turning(path, time), abs=1e-5)
    if given == 3:
        for i in (3, 6):
            for side in (-1e-6, 1e-6):
                change = (path.at(times[i] + 2 * side)[1] - path.at(times[i] + side)[1]) / side
                assert change == pytest.approx(columns[2][i], abs=0.02)


def test_a_turn_at_constant_speed_is_interpolated_exactly():
    times = np.arange(5.0)
    w = np.array([0.1, -0.5, 0.4])
    rotations = np.stack([pin.exp3(w * t) for t in times])
    path = RotationPath(times, rotations, np.tile(w, (5, 1)))
    R, rate = path.at(2.3)
    assert np.abs(R - pin.exp3(2.3 * w)).max() < 1e-12
    assert rate == pytest.approx(w, abs=1e-12)


@pytest.mark.parametrize(
    ('times', 'problem'),
    [
        ([0.0, 1.0, 1.0], 'got 1 s for point 3, after 1 s; accepts times that increase'),
        ([-1.0, 1.0], 'accepts times of at least 0'),
    ],
)
def test_times_that_do_not_increase_are_refused(times, problem):
    with pytest.raises(InvalidValue, match=problem):
        check_times(np.array(times))


def test_a_path_runs_as_fast_as_its_task_moves_along_it():
    along = np.array([0.0, 2.0])
    assert pace(1.0, along, along, along) == (1.0, 1.0)
    assert pace(1.0, along, along, 0.5 * along) == pytest.approx((0.5, 0.525))
    assert pace(0.5, along, 0.5 * along, 0.5 * along) == pytest.approx((0.5, 0.525))
    assert pace(1.0, along, along, -along).got == 0.0
    assert pace(1.0, np.zeros(2), np.ones(2), np.ones(2)) == (1.0, 1.0)


def test_a_path_is_slowed_down_by_what_is_missed_across_it_or_has_to_be_made_good():
    along = np.array([0.0, 2.0])
    assert pace(0.5, along, 0.5 * along, np.array([0.3, 1.0])).asked == pytest.approx(0.45)
    away = np.array([1.6, 0.0])
    assert pace(0.5, along, 0.5 * along + away, 0.5 * along + away).asked == pytest.approx(0.2)
