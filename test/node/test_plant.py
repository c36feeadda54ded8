"""Joints that are not ideal."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from tp_controller import read_parameter_file
from tp_controller.errors import InvalidValue
from tp_controller.robot import Limits
from tp_sim.integrator import Integrator
from tp_sim.plant import Plant
from tp_sim.plant_settings import PlantSettings
from tp_sim.rigid_body import RigidBodies
from tp_sim.settings import build_simulator_settings

DT = 0.01
speeds = arrays(float, 3, elements=st.floats(-5.0, 5.0))
LIMITS = {'velocity': [1.0, 2.0, 3.0], 'position_min': [-0.2], 'position_max': [0.1, 0.2, 0.3]}


def plant(timeout=None, limits=None, **settings):
    joints = Integrator([0.0] * 3, Limits(3, **(limits or {})))
    return Plant(joints, PlantSettings(**settings), timeout)


def run(arm, commands):
    trace = []
    for command in commands:
        arm.step(command, DT)
        trace.append((arm.q, arm.qd, *arm.measured()))
    return np.array(trace)


@given(st.lists(speeds, min_size=1, max_size=30))
def test_an_ideal_plant_is_the_integrator_bit_by_bit(commands):
    joints = Integrator([0.0] * 3, Limits(3, **LIMITS))
    found = run(plant(limits=LIMITS), commands)
    for command, (q, qd, q_measured, qd_measured) in zip(commands, found, strict=True):
        joints.step(command, DT)
        assert np.array_equal(q, joints.q)
        assert np.array_equal(qd, joints.qd)
        assert np.array_equal(q_measured, joints.q)
        assert np.array_equal(qd_measured, joints.qd)


@given(st.lists(speeds, min_size=1, max_size=20), st.integers(0, 5))
def test_a_command_acts_so_many_steps_late(commands, delay):
    prompt = run(plant(limits=LIMITS), [np.zeros(3)] * delay + commands)
    late = run(plant(limits=LIMITS, delay=delay), commands + [np.zeros(3)] * delay)
    assert np.array_equal(late, prompt)


@given(speeds, st.floats(1e-4, 1.0), st.integers(1, 50))
def test_the_lag_is_that_of_the_closed_form(speed, lag, steps):
    found = run(plant(lag=lag), [speed] * steps)
    t = DT * np.arange(1, steps + 1)[:, None]
    assert found[:, 0] == pytest.approx(speed * (t + lag * np.expm1(-t / lag)), abs=1e-12)
    assert found[:, 1] == pytest.approx(-speed * np.expm1(-t / lag), abs=1e-12)


def test_every_joint_may_have_a_lag_of_its_own_and_none():
    mixed = run(plant(lag=[0.0, 0.05, 0.2]), [np.ones(3)] * 10)
    for i, lag in enumerate((0.0, 0.05, 0.2)):
        assert np.array_equal(mixed[:, :, i], run(plant(lag=lag), [np.ones(3)] * 10)[:, :, i])


@given(st.lists(speeds, min_size=1, max_size=30), st.floats(0.0, 0.5), st.integers(0, 3))
def test_no_plant_leaves_its_limits(commands, lag, delay):
    found = run(plant(limits=LIMITS, lag=lag, delay=delay), commands)
    limits = Limits(3, **LIMITS)
    assert np.all(found[:, 0] >= limits.position_min)
    assert np.all(found[:, 0] <= limits.position_max)
    assert np.all(np.abs(found[:, 1]) <= limits.velocity)


def test_a_joint_that_its_stop_has_halted_starts_from_standstill():
    arm = plant(limits=LIMITS, lag=0.05)
    found = run(arm, [np.ones(3)] * 60)
    assert np.array_equal(found[-1], [[0.1, 0.2, 0.3], [0.0] * 3] * 2)
    arm.step(-np.ones(3), DT)
    assert arm.qd == pytest.approx(np.expm1(-DT / 0.05) * np.ones(3))


@pytest.mark.parametrize('quantum', [0.0, 2e-3])
def test_measurements_are_wrong_by_no_more_than_they_may(quantum):
    settings = {'noise': [1e-3, 0.0, 2e-3], 'quantum': quantum, 'scale': 1.01}
    found = run(plant(**settings), [np.array([0.3, -0.2, 0.1])] * 2000)
    wrong = np.abs(found[:, 2] - 1.01 * found[:, 0])
    assert np.all(wrong <= np.array(settings['noise']) + 0.5 * quantum + 1e-12)
    assert wrong[:, 2].max() > 0.99 * 2e-3
    assert np.array_equal(found[:, 3], 1.01 * found[:, 1])
    if quantum:
        whole = found[:, 2] / quantum
        assert whole == pytest.approx(np.round(whole), abs=1e-9)
    else:
        assert np.array_equal(found[:, 2, 1], 1.01 * found[:, 0, 1])


def test_a_measurement_stays_the_same_until_the_next_step():
    arm = plant(noise=1e-3)
    first = arm.measured()[0]
    assert np.array_equal(first, arm.measured()[0])
    arm.step(np.zeros(3), DT)
    assert not np.array_equal(first, arm.measured()[0])


def test_the_same_seed_gives_the_same_run_and_another_one_another():
    def trace(seed):
        arm = plant(noise=1e-3, command_loss=0.5, state_loss=0.3, seed=seed)
        commands = np.random.default_rng(0).uniform(-1.0, 1.0, (200, 3))
        lost = []
        for command in commands:
            arm.step(command, DT)
            lost.append([*arm.measured()[0], arm.state_lost()])
        return np.array(lost)

    assert np.array_equal(trace(1), trace(1))
    assert not np.array_equal(trace(1), trace(2))


def test_a_lost_command_leaves_the_last_one_in_force():
    arm = plant(command_loss=0.5, seed=3)
    commands = np.arange(1.0, 401.0)[:, None] * np.ones(3)
    acted = run(arm, commands)[:, 1, 0]
    kept = acted == commands[:, 0]
    assert 150 < np.count_nonzero(kept) < 250
    last = 0.0
    for speed, sent, arrived in zip(acted, commands[:, 0], kept, strict=True):
        last = sent if arrived else last
        assert speed == last


def test_states_are_lost_as_often_as_they_should_be():
    arm = plant(state_loss=0.3)
    assert not arm.state_lost()
    lost = 0
    for _ in range(2000):
        arm.step(np.zeros(3), DT)
        lost += arm.state_lost()
    assert 0.25 < lost / 2000 < 0.35


def test_without_a_command_the_joints_stop_after_the_timeout_counted_in_steps():
    arm = plant(timeout=3 * DT, delay=1)
    found = run(arm, [np.ones(3)] + [None] * 9)
    assert found[:, 1, 0].tolist() == [0.0, 1.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0]


def test_a_blocked_arm_stands_still_until_it_is_released():
    arm = plant(lag=0.02)
    run(arm, [np.ones(3)] * 10)
    before, arm.blocked = arm.q, True
    held = run(arm, [np.ones(3)] * 5)
    assert np.array_equal(held[:, 0], [before] * 5)
    assert not held[:, 1].any()
    arm.blocked = False
    assert run(arm, [np.ones(3)])[0, 1] == pytest.approx(-np.expm1(-DT / 0.02) * np.ones(3))


def test_reset_forgets_speed_and_commands_under_way():
    arm = plant(lag=0.1, delay=2)
    run(arm, [np.ones(3)] * 5)
    arm.reset([0.5, 0.0, 0.0])
    assert np.array_equal(arm.q, [0.5, 0.0, 0.0])
    assert not arm.qd.any()
    found = run(arm, [None] * 5)
    assert np.array_equal(found[:, 0], [[0.5, 0.0, 0.0]] * 5)


def test_settings_change_while_it_runs():
    arm = plant(delay=3)
    run(arm, [np.ones(3)] * 2)
    arm.configure(PlantSettings(delay=1))
    assert run(arm, [2.0 * np.ones(3)] * 2)[:, 1, 0].tolist() == [1.0, 2.0]
    arm.configure(PlantSettings(delay=2))
    commands = [3.0 * np.ones(3), 4.0 * np.ones(3), 5.0 * np.ones(3)]
    assert run(arm, commands)[:, 1, 0].tolist() == [2.0, 2.0, 3.0]


@pytest.mark.parametrize(
    ('key', 'value'),
    [
        ('delay', -1),
        ('delay', 0.5),
        ('delay', 10**6),
        ('seed', -1),
        ('lag', -0.1),
        ('lag', [0.1, 0.2]),
        ('noise', np.inf),
        ('scale', 0.0),
        ('quantum', np.nan),
        ('command_loss', 1.1),
        ('state_loss', np.nan),
    ],
)
def test_settings_that_no_arm_has_are_refused(key, value):
    arm = plant(delay=1)
    with pytest.raises(InvalidValue) as caught:
        arm.configure(PlantSettings(**{key: value}))
    assert caught.value.key == f'plant.{key}'
    assert arm.settings == PlantSettings(delay=1)


@pytest.mark.parametrize(
    ('given', 'key'),
    [
        ({'plant.delay': 0.5}, 'plant.delay'),
        ({'plant.state_loss': 1.5}, 'plant.state_loss'),
        ({'plant.state_loss': 1.0, 'lockstep': True}, 'plant.state_loss'),
        ({'plant.silent': True, 'lockstep': True}, 'plant.silent'),
        ({'plant.bandwidth': 50.0}, 'plant.bandwidth'),
        ({'plant.type': 'rigid'}, 'plant.type'),
        ({'plant.type': 'rigid_body'}, 'plant.type'),
        ({'plant.lag': [0.1, 0.1]}, 'plant.lag'),
    ],
)
def test_parameters_that_make_no_arm_are_refused(config, given, key):
    values = read_parameter_file(config / 'a4_position_joint.yaml', 'tp_sim')
    with pytest.raises(InvalidValue) as caught:
        build_simulator_settings(values | given)
    assert caught.value.key == key


def test_the_plant_of_the_parameters(config):
    values = read_parameter_file(config / 'panda.yaml', 'tp_sim')
    given = {'plant.type': 'rigid_body', 'plant.delay': 2, 'plant.noise': 1e-3}
    arm = build_simulator_settings(values | given).plant
    assert isinstance(arm.joints, RigidBodies)
    assert (arm.settings.delay, arm.settings.noise) == (2, (1e-3,))
    ideal = build_simulator_settings(values)
    assert ideal.plant.joints is ideal.integrator
