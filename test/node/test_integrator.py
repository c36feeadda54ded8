"""The simulated joints."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from tp_controller.errors import InvalidValue
from tp_controller.robot import Limits
from tp_sim.integrator import Integrator

speeds = arrays(float, 3, elements=st.floats(-10.0, 10.0))


def test_positions_are_the_sum_of_the_commanded_steps():
    joints = Integrator([0.1, -0.2, 0.3], Limits(3))
    qd = np.array([1.0, -2.0, 0.5])
    for _ in range(10):
        joints.step(qd, 0.01)
    assert joints.q == pytest.approx([0.2, -0.4, 0.35])
    assert np.array_equal(joints.qd, qd)


@given(st.lists(speeds, min_size=1, max_size=30))
def test_joints_never_leave_their_limits(commands):
    limits = Limits(3, velocity=[1.0, 2.0, 0.5], position_min=[-0.2], position_max=[0.1, 0.2, 0.3])
    joints = Integrator([0.0, 0.0, 0.0], limits)
    for qd in commands:
        before = joints.q
        joints.step(qd, 0.1)
        assert np.all(joints.q >= limits.position_min)
        assert np.all(joints.q <= limits.position_max)
        assert np.all(np.abs(joints.qd) <= limits.velocity * (1.0 + 1e-12))
        assert joints.q == pytest.approx(before + 0.1 * joints.qd)


def test_a_joint_stopped_by_its_limit_reports_no_speed():
    joints = Integrator([0.1], Limits(1, position_max=[0.1], position_min=[-1.0]))
    joints.step(np.array([1.0]), 0.01)
    assert joints.q == [0.1]
    assert joints.qd == [0.0]


def test_reset_returns_to_the_initial_positions_at_rest():
    joints = Integrator([0.1, 0.2], Limits(2))
    joints.step(np.array([1.0, 1.0]), 1.0)
    joints.reset()
    assert np.array_equal(joints.q, [0.1, 0.2])
    assert np.array_equal(joints.qd, [0.0, 0.0])


@pytest.mark.parametrize('q', [[2.0], [np.nan], [0.0, 0.0]])
def test_reset_to_impossible_positions_changes_nothing(q):
    joints = Integrator([0.5], Limits(1, position_min=[-1.0], position_max=[1.0]))
    with pytest.raises(InvalidValue):
        joints.reset(q)
    assert joints.q == [0.5]


def test_positions_handed_out_are_copies():
    joints = Integrator([0.5], Limits(1))
    joints.q[0] = 9.0
    assert joints.q == [0.5]
