"""Joints that stop in time: bounds of position, velocity and acceleration that go together."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from random_stacks import examples

from tp_controller.braking import ROUNDING, approach, bound, coast, steps_to_rest, viable_speed
from tp_controller.prepared import Prepared

seeds = st.integers(0, 10_000)


def stopping_way(v, change, dt):
    """How far a joint gets from speed v, this step included, step by step."""
    way = 0.0
    while v > 1e-15:
        way += v * dt
        v -= change
    return way


@given(seeds)
@examples(200)
def test_from_the_viable_speed_a_joint_stops_exactly_at_the_end(seed):
    rng = np.random.default_rng(seed)
    distance, change, dt = 10.0 ** rng.uniform([-6, -3, -3], [1, 1, -1])
    v = viable_speed(distance, change, dt)
    assert stopping_way(v, change, dt) == pytest.approx(distance, rel=1e-9)
    assert viable_speed(-distance, change, dt) == 0.0
    assert viable_speed(distance, math.inf, dt) == distance / dt
    assert viable_speed(math.inf, change, dt) == math.inf


class Joints:
    """Random joints under random commands, bounded step by step."""

    def __init__(self, seed, limited=True):
        self.rng = rng = np.random.default_rng(seed)
        self.n = n = int(rng.integers(1, 5))
        self.dt = float(10.0 ** rng.uniform(-3, -1))
        self.speed = rng.uniform(0.2, 3.0, n)
        self.low, self.high = -rng.uniform(0.01, 2.0, n), rng.uniform(0.01, 2.0, n)
        self.acceleration = 10.0 ** rng.uniform(-1, 2, n)
        if not limited:
            self.acceleration[:] = np.inf
        self.q, self.qd = np.zeros(n), np.zeros(n)
        self.bounds = np.zeros((4, n))

    def step(self, wish):
        limits = (self.speed, self.low, self.high, self.acceleration)
        Prepared(bound, self.q, self.qd, *limits, self.dt, *self.bounds).run()
        before, self.qd = self.qd, np.zeros(self.n)
        given = self.acceleration, self.dt, *self.bounds[2:]
        Prepared(approach, wish, before, *given, self.qd).run()
        self.q = self.q + self.dt * self.qd
        return before

    def wishes(self, count):
        wish = np.zeros(self.n)
        for _ in range(count):
            if self.rng.uniform() < 0.1:
                wish = self.rng.uniform(-2.0, 2.0, self.n) * self.speed
            yield wish.copy()


@given(seeds, st.booleans())
@examples(100)
def test_whatever_is_wished_every_limit_holds_at_every_step(seed, limited):
    joints = Joints(seed, limited)
    for wish in joints.wishes(300):
        before = joints.step(wish)
        assert np.all(joints.q >= joints.low)
        assert np.all(joints.q <= joints.high)
        assert np.all(np.abs(joints.qd) <= joints.speed)
        change = joints.acceleration * joints.dt
        assert np.all(np.abs(joints.qd - before) <= change * (1.0 + 1e-9) + 1e-12)
        lower, upper, soon_lower, soon_upper = joints.bounds
        assert np.all(lower <= 0.0)
        assert np.all(upper >= 0.0)
        assert np.all(soon_lower <= soon_upper)


@given(seeds)
@examples(60)
def test_a_joint_that_is_pressed_against_an_end_comes_to_rest_there(seed):
    joints = Joints(seed)
    steps = int(20.0 / joints.dt * np.max(joints.high / joints.speed))
    for _ in range(min(steps, 20_000)):
        joints.step(joints.speed)
    if steps <= 20_000:
        np.testing.assert_allclose(joints.q, joints.high, atol=2e-3)
        assert np.all(joints.q <= joints.high)


@given(seeds, st.booleans())
@examples(60)
def test_a_joint_outside_comes_back_slowly_and_goes_no_deeper(seed, limited):
    joints = Joints(seed, limited)
    joints.q = joints.high + joints.rng.uniform(0.01, 0.3, joints.n)
    outside = joints.q - joints.high
    for wish in joints.wishes(200):
        joints.step(wish)
        now = joints.q - joints.high
        assert np.all(now <= np.maximum(outside, ROUNDING))
        outside = now
    assert np.all(joints.q < joints.high + 0.3)


@given(seeds)
@examples(60)
def test_all_joints_go_the_same_share_of_the_way(seed):
    """So what leaves a task alone goes on leaving it alone while the joints speed up."""
    joints = Joints(seed)
    before, wish = joints.rng.normal(size=(2, joints.n))
    out, endless = np.zeros(joints.n), np.full(joints.n, np.inf)
    given = joints.acceleration, joints.dt, -endless, endless
    Prepared(approach, wish, before, *given, out).run()
    shares = (out - before) / (wish - before)
    np.testing.assert_allclose(shares, shares[0], rtol=1e-6)
    most = np.min(joints.acceleration * joints.dt / np.abs(wish - before))
    assert shares[0] == pytest.approx(min(1.0, most), rel=1e-6)


@given(seeds, st.integers(0, 30), st.booleans())
@examples(150)
def test_braking_is_the_sum_of_its_steps(seed, steps, together):
    joints = Joints(seed)
    v = joints.rng.normal(size=joints.n)
    way, speed = np.zeros((2, joints.n))
    coast(v, joints.acceleration, joints.dt, together, steps, way, speed)
    size, total = np.abs(v), np.zeros(joints.n)
    change = joints.acceleration * joints.dt
    last = steps_to_rest(v, joints.acceleration, joints.dt)
    if together:
        change = size / last
        assert np.all(change <= joints.acceleration * joints.dt * (1.0 + 1e-6))
    for _ in range(steps):
        size = np.maximum(size - change, 0.0)
        total += joints.dt * size
    np.testing.assert_allclose(way, np.sign(v) * total, atol=1e-9)
    np.testing.assert_allclose(speed, np.sign(v) * size, atol=1e-9)
    rest = np.zeros(joints.n)
    coast(v, joints.acceleration, joints.dt, together, -1, rest, speed)
    coast(v, joints.acceleration, joints.dt, together, last, way, speed)
    np.testing.assert_allclose(way, rest, atol=1e-9)
    np.testing.assert_array_equal(np.abs(speed), 0.0)


def test_a_limit_that_is_lowered_below_the_speed_is_reached_by_braking():
    lower, upper, soon_lower, soon_upper = bounds = np.zeros((4, 1))
    one, endless = np.ones(1), np.full(1, np.inf)
    limits = one, -endless, endless, 5.0 * one
    Prepared(bound, np.zeros(1), 2.0 * one, *limits, 0.1, *bounds).run()
    np.testing.assert_allclose([soon_lower, soon_upper], 1.5)
    np.testing.assert_array_equal([lower, upper], [[-np.inf], [np.inf]])
