"""Delay and lag of joints, from commands and positions."""

import numpy as np
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st
from random_stacks import examples

from tp_controller.errors import InvalidValue
from tp_controller.identification import Fit, fit_response
from tp_controller.measuring import block, braked, directions, pulses
from tp_controller.robot import Limits
from tp_sim.integrator import Integrator
from tp_sim.plant import Plant
from tp_sim.plant_settings import PlantSettings

periods = st.sampled_from([0.004, 0.01, 1.0 / 60.0, 0.02])
limits = st.floats(0.05, 10.0) | st.just(np.inf)


def respond(commands, period, seed=0, **settings):
    """Positions that answer the commands, each before the next one."""
    arm = Plant(Integrator([0.3], Limits(1)), PlantSettings(seed=seed, **settings))
    positions = []
    for command in commands:
        positions.append(arm.measured()[0][0])
        arm.step(np.array([command]), period)
    return np.array(positions)


def times(commands, period):
    return 1e5 + period * np.arange(commands.size)


@given(
    periods,
    st.integers(0, 6),
    st.floats(0.0, 0.15),
    st.floats(0.5, 1.5),
    st.floats(-0.05, 0.05).filter(lambda way: abs(way) > 0.005),
)
@examples(30)
def test_delay_and_lag_are_those_of_the_arm(period, delay, lag, scale, way):
    commands = pulses(way, 2.0, 15.0, period)
    fit = fit_response(
        times(commands, period),
        commands,
        respond(commands, period, delay=delay, lag=lag, scale=scale),
        0.25,
        0.5,
    )
    assert fit.delay + fit.lag == pytest.approx(delay * period + lag, abs=2e-3)
    # A lag of less than a period looks like a part of the delay.
    assert fit.delay == pytest.approx(delay * period, abs=max(4e-3, min(lag, period) + 1e-3))
    assert fit.gain == pytest.approx(scale, rel=0.01)
    assert fit.residual < 1e-3 * abs(way) + 1e-5
    assert fit.explains


@given(periods, st.integers(0, 4), st.floats(0.0, 0.06), st.integers(0, 2**31))
@examples(20)
def test_noise_costs_some_milliseconds(period, delay, lag, seed):
    commands = pulses(0.02, 2.0, 15.0, period)
    measured = respond(commands, period, seed, delay=delay, lag=lag, noise=1e-4)
    fit = fit_response(times(commands, period), commands, measured, 0.25, 0.5)
    assert fit.delay + fit.lag == pytest.approx(delay * period + lag, abs=1.5e-3)
    assert fit.delay == pytest.approx(delay * period, abs=6e-3)
    assert fit.residual == pytest.approx(1e-4, rel=0.3)


def test_states_that_were_missed_do_not_matter():
    period = 0.01
    commands = pulses(0.02, 2.0, 15.0, period)
    kept = np.random.default_rng(1).random(commands.size) > 0.3
    kept[0] = True
    held = commands[np.maximum.accumulate(np.where(kept, np.arange(commands.size), 0))]
    measured = respond(held, period, delay=2, lag=0.03)
    fit = fit_response(times(held, period)[kept], held[kept], measured[kept], 0.25, 0.5)
    assert (fit.delay, fit.lag) == pytest.approx((0.02, 0.03), abs=1e-3)


def test_a_joint_that_stands_still_is_not_explained():
    commands = pulses(0.02, 2.0, 15.0, 0.01)
    noise = np.random.default_rng(0).uniform(-1e-4, 1e-4, commands.size)
    assert not fit_response(times(commands, 0.01), commands, noise).explains


def test_what_cannot_be_fitted_is_refused():
    few = np.arange(15.0)
    with pytest.raises(ValueError, match='needs 20 states'):
        fit_response(few, few, few)
    with pytest.raises(ValueError, match='rise'):
        fit_response(np.arange(500.0) // 2.0, np.zeros(500), np.zeros(500))


@given(periods, limits, limits, st.floats(-0.5, 0.5))
@examples(100)
def test_the_motion_stays_within_its_limits_and_comes_back(period, speed, acceleration, way):
    velocities = pulses(way, speed, acceleration, period)
    positions = period * np.cumsum(velocities)
    assert positions[-1] == pytest.approx(0.0, abs=1e-12)
    assert np.abs(positions).max() <= abs(way) + 1e-12
    assert np.all(positions * way >= -1e-12)
    assert np.abs(velocities).max() <= speed
    assert np.abs(np.diff(velocities, prepend=0.0, append=0.0)).max() <= acceleration * period


def test_each_joint_goes_where_it_has_room():
    limits = Limits(3, position_min=[-1.0], position_max=[1.0])
    found = directions(('a', 'b', 'c'), np.array([0.0, 0.99, -0.99]), limits, 0.02)
    assert found.tolist() == [0.02, -0.02, 0.02]
    with pytest.raises(InvalidValue, match=r'b at 1\.1'):
        directions(('a', 'b', 'c'), np.array([0.0, 1.1, 0.0]), limits, 0.02)


def test_braking_runs_down_inside_the_limits():
    command = np.array([1.0, -0.05, 0.3])
    once = braked(command, np.array([2.0, 2.0, np.inf]), 0.1)
    assert once == pytest.approx([0.8, 0.0, 0.0])


def test_the_block_is_one_of_a_parameter_file():
    fits = [
        Fit(0.03333, 0.03, 1.0, 1e-4, 1e-5, 1e-2),
        Fit(0.0, 1e-6, 1.0, 1e-4, 1e-5, 1e-2),
    ]
    found = yaml.safe_load(block(fits, np.array([9.9e-5, 0.0])))
    assert found == {
        'robot': {'delay': [0.0333, 0.0], 'lag': [0.03, 0.0], 'noise': [0.00012, 0.0]}
    }
