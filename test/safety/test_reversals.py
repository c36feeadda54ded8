"""Which signals count as oscillating, and which do not."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from random_stacks import examples

from tp_controller.reversals import FEW, GAP, LASTING, LEAST, N, Reversals

rates = st.sampled_from([50.0, 60.0, 125.0, 200.0, 500.0, 1000.0])
scales = st.floats(0.01, 100.0)


def watch(values, rate, scale=1.0):
    """Whether the signal oscillates, at every step; and the watch at the end."""
    watched = Reversals(1)
    found = [watched.see(np.array([x]), np.array([scale]), 1.0 / rate) == 0 for x in values]
    return np.array(found), watched


def seconds(rate, time):
    return np.arange(round(rate * time)) / rate


@given(rates, scales, st.floats(2.0 * LEAST, 1.0), st.integers(1, 8), st.floats(-0.5, 0.5))
@examples(100)
def test_chatter_is_found_wherever_it_swings(rate, scale, amplitude, cycles, offset):
    """Also where the signal keeps its sign, if it is quick."""
    steps = np.arange(round(rate * 3.0))
    fast = cycles < FEW
    around = offset if fast and amplitude > abs(offset) * 0.2 else 0.0
    signal = scale * (around + amplitude * (-1.0) ** (steps // cycles))
    found, watched = watch(signal, rate, scale)
    assert found[-1]
    assert watched.rate(0) == pytest.approx(rate / cycles, rel=0.2)
    assert watched.amplitude[0] == pytest.approx(amplitude, rel=1e-6)


@given(rates, st.floats(1.0, 8.0), st.floats(2.0 * LEAST, 1.0), st.floats(0.0, 6.0))
@examples(100)
def test_a_limit_cycle_is_found_and_forgotten_when_it_ends(rate, frequency, amplitude, phase):
    t = seconds(rate, N / frequency + LASTING + 1.0)
    signal = amplitude * np.sin(2.0 * np.pi * frequency * t + phase)
    found, _ = watch(np.concatenate([signal, np.zeros(round(rate * 2.0 * GAP))]), rate)
    assert found[t.size - 1]
    assert not found[-1]
    assert not found[: round(rate * LASTING)].any()


@given(rates, st.floats(0.0, 0.9 * LEAST), st.integers(0, 2**32 - 1))
@examples(100)
def test_what_is_too_small_is_not_mentioned(rate, amplitude, seed):
    noise = np.random.default_rng(seed).uniform(-amplitude, amplitude, round(rate * 2.0))
    assert not watch(noise, rate)[0].any()


@given(rates, st.floats(10.0 * LEAST, 1.0), st.integers(0, 2**32 - 1))
@examples(50)
def test_noise_is_found(rate, amplitude, seed):
    noise = np.random.default_rng(seed).uniform(-amplitude, amplitude, round(rate * 4.0))
    assert np.mean(watch(noise, rate)[0][round(rate) :]) > 0.8


@given(rates, st.floats(0.1, 10.0), st.floats(0.1, 0.3), st.floats(-1.0, 1.0))
@examples(100)
def test_what_rings_down_is_not_an_oscillation(rate, frequency, damping, start):
    t = seconds(rate, 4.0)
    ringing = np.exp(-2.0 * np.pi * frequency * damping * t)
    signal = start * ringing * np.cos(2.0 * np.pi * frequency * t)
    assert not watch(signal, rate)[0].any()


@given(rates, st.lists(st.tuples(st.floats(-1.0, 1.0), st.floats(1.0, 3.0)), max_size=6))
@examples(100)
def test_motions_from_goal_to_goal_are_none(rate, goals):
    """Each an exponential approach."""
    t = seconds(rate, 1.0)
    signal = [v * np.exp(-gain * t) for v, gain in goals] or [np.zeros(3)]
    assert not watch(np.concatenate(signal), rate)[0].any()


def test_a_burst_that_ends_soon_is_none():
    signal = np.concatenate([0.5 * (-1.0) ** np.arange(80), np.zeros(400)])
    assert not watch(signal, 200.0)[0].any()


@pytest.mark.parametrize('scale', [0.0, np.inf])
def test_signals_without_a_scale_never_oscillate(scale):
    assert not watch((-1.0) ** np.arange(1000), 200.0, scale)[0].any()


def test_the_one_that_swings_most_is_told_among_others():
    watched, t = Reversals(3), seconds(100.0, 3.0)
    for x in t:
        values = np.sin(2.0 * np.pi * 4.0 * x) * np.array([0.1, 1.0, 0.0])
        watched.see(values, np.array([0.2, 10.0, 1.0]), 0.01)
    assert watched.worst == 0
    assert watched.found.tolist() == [True, True, False]
    watched.restart()
    assert watched.worst == -1
