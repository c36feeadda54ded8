"""Arms that are late, noisy or stopped: limits hold, and what they do is said."""

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from random_stacks import examples
from small_arms import planar_block

from tp_controller import InvalidValue, build_settings, read_parameter_file
from tp_controller.braking import held_speed
from tp_controller.errors import UnusableState
from tp_controller.robot import Limits, Response
from tp_sim.integrator import Integrator
from tp_sim.plant import Plant
from tp_sim.plant_settings import PlantSettings

CONFIG = Path(__file__).parents[2] / 'config'
RATE = 100.0
PERIOD = 1.0 / RATE
CHANGE = 4.0 * PERIOD
"""Change of velocity that the acceleration limit allows in a step [rad/s]."""

seeds = st.integers(0, 10_000)


def joint_stack(target=(50.0, 0.0), rate=RATE, **robot):
    """Two joints that are sent to a target in the ranges of ±60 rad."""
    limits = {
        'velocity': [2.0],
        'acceleration': [CHANGE * RATE],
        'position_min': [-60.0],
        'position_max': [60.0],
    }
    return build_settings(
        {
            'robot': planar_block(1.0, 1.0) | {'limits': limits} | robot,
            'rate': rate,
            'hierarchy': ['joints'],
            'tasks': {
                'joints': {
                    'type': 'joint',
                    'joints': ['joint_1', 'joint_2'],
                    'target': list(target),
                    'gain': [2.0],
                }
            },
        }
    ).stack


def run(stack, plant, steps):
    """True velocities (steps, n) of a plant that a stack moves, and what was said."""
    seen, said = [], set()
    for _ in range(steps):
        q, qd = plant.measured()
        try:
            command = stack.step(q, PERIOD, qd).command
        except UnusableState as error:
            command = error.command
        plant.step(command, PERIOD)
        seen.append(plant.qd)
        said.add(stack.arm.notice[:23])
    return np.array(seen), said


def plant_of(stack, **settings):
    limits = stack.robot.limits
    return Plant(Integrator(np.zeros(stack.robot.n), limits), PlantSettings(**settings))


def test_an_arm_that_was_blocked_starts_again_from_standstill():
    stack = joint_stack()
    plant = plant_of(stack)
    assert run(stack, plant, 100)[1] == {''}
    plant.blocked = True
    blocked, said = run(stack, plant, 200)
    assert np.all(blocked == 0.0)
    assert said == {'', 'joint_1 does not follow'}
    plant.blocked = False
    speeds = np.vstack([blocked, run(stack, plant, 300)[0]])
    assert np.abs(np.diff(speeds, axis=0)).max() <= CHANGE * (1.0 + 1e-9)
    assert speeds[-1, 0] == pytest.approx(2.0)
    assert stack.arm.following
    assert stack.arm.notice == ''


@given(seeds)
@examples(20)
def test_a_joint_that_carries_a_command_out_late_is_not_taken_as_blocked(seed):
    """Late commands act a period later; near standstill a joint then seems to turn back."""
    rng = np.random.default_rng(seed)
    stack = joint_stack(target=(0.0, 0.0))
    plant = plant_of(stack)
    sent = acting = np.zeros(2)
    for i in range(200):
        if i % 8 == 0:
            stack.tasks['joints'].target = rng.uniform(-0.2, 0.2, 2)
        late = bool(rng.random() < 0.4)
        stack.arm.late = PERIOD if late else 0.0
        plant.step(acting if late else sent, PERIOD)
        acting = sent
        q, qd = plant.measured()
        command = stack.step(q, PERIOD, qd).command.copy()
        assert np.abs(command - sent).max() <= CHANGE * (1.0 + 1e-9)
        sent = command


@given(seeds)
@examples(20)
def test_commands_that_come_late_for_a_while_are_waited_for(seed):
    """The last of them may have left in time, while the arm still carries out those before."""
    rng = np.random.default_rng(seed)
    stack = joint_stack(target=(0.0, 0.0))
    plant = plant_of(stack)
    commands, delay = [np.zeros(2)] * 12, 0
    for i in range(200):
        if i % 8 == 0:
            stack.tasks['joints'].target = rng.uniform(-0.2, 0.2, 2)
        # Late by some periods on the way there, and caught up again.
        delay = int(np.clip(delay + rng.integers(-1, 2), 0, 8))
        plant.step(commands[-1 - delay], PERIOD)
        in_time = i % 3 > 0 and rng.random() < 0.5
        stack.arm.late = PERIOD * (rng.uniform(0.0, 0.5) if in_time else rng.uniform(0.6, 2.0))
        q, qd = plant.measured()
        command = stack.step(q, PERIOD, qd).command.copy()
        assert np.abs(command - commands[-1]).max() <= CHANGE * (1.0 + 1e-9)
        commands.append(command)


def test_on_a_late_machine_a_blocked_joint_is_tried_once_until_it_moves():
    """It may be an arm that gets its commands late: but not for ever."""
    stack = joint_stack()
    plant = plant_of(stack)
    sent = []
    for i in range(500):
        plant.blocked = i < 400
        # Late now and then, as a busy machine is.
        stack.arm.late = 2.0 * PERIOD if i % 5 == 0 else 0.0
        q, qd = plant.measured()
        sent.append(stack.step(q, PERIOD, qd).command[0])
        plant.step(np.array([sent[-1], 0.0]), PERIOD)
    tried = round(0.5 / PERIOD)
    assert 2.0 * CHANGE < max(sent[:tried]) <= 4.0 * 0.1
    assert max(sent[tried:400]) <= CHANGE * (1.0 + 1e-9)
    assert np.diff(sent[399:]).max() <= CHANGE * (1.0 + 1e-9)
    assert sent[-1] == pytest.approx(2.0)


def test_a_joint_that_says_it_moves_is_not_blocked_if_the_time_is_known_badly():
    """Without stamps a sender that is late by a period and more looks like a joint that slows."""
    stack = joint_stack()
    plant = plant_of(stack)
    run(stack, plant, 200)
    q, qd = plant.measured()
    before = stack.step(q, PERIOD, qd).command.copy()
    plant.step(before, PERIOD)
    q, qd = plant.measured()
    after = stack.step(q, 2.2 * PERIOD, qd).command
    assert np.abs(after - before).max() <= CHANGE * (1.0 + 1e-9)


@pytest.mark.parametrize('pause', [12, 13, 14, 17, 25])
@pytest.mark.parametrize('response', [{}, {'noise': 1e-3}, {'delay': 1}, {'lag': 0.01}])
def test_an_arm_that_its_driver_stopped_in_a_pause_starts_again_from_standstill(response, pause):
    """A controller that is not scheduled sends nothing; drivers then stop the arm in time."""
    known = {key: value * (PERIOD if key == 'delay' else 1.0) for key, value in response.items()}
    stack = joint_stack(**{key: [value] for key, value in known.items()})
    limits = stack.robot.limits
    plant = Plant(Integrator(np.zeros(2), limits), PlantSettings(**response), 10 * PERIOD)
    run(stack, plant, 100)
    assert plant.qd[0] == pytest.approx(2.0)
    for _ in range(pause):
        plant.step(None, PERIOD)
    assert np.abs(plant.qd).max() < 0.5
    answers = []
    q, qd = plant.measured()
    # The first answer came too late: there is a second one from the same state.
    for _ in range(2):
        try:
            command = stack.step(q, (pause + 1) * PERIOD, qd).command
        except UnusableState as error:
            command = error.command
        answers.append(command.copy())
        if len(answers) == 1:
            stack.undo()
    assert np.array_equal(*answers)
    plant.step(command, PERIOD)
    speeds = np.abs(np.vstack([qd, plant.qd, run(stack, plant, 200)[0]])).max(axis=1)
    assert np.diff(speeds).max() <= CHANGE * (1.0 + 1e-9)
    assert speeds[-1] == pytest.approx(2.0)


def test_a_blocked_joint_is_held_though_its_driver_says_the_command_as_velocity():
    stack = joint_stack()
    q, command, largest = np.zeros(2), np.zeros(2), 0.0
    for _ in range(2000):
        try:
            command = stack.step(q, PERIOD, command).command.copy()
        except UnusableState as error:
            command = error.command.copy()
        largest = max(largest, float(np.abs(command).max()))
    assert largest <= CHANGE * (1.0 + 1e-9)


@pytest.mark.parametrize('speed', [0.9, 5.0, 1e6])
def test_a_first_velocity_that_is_not_true_moves_the_arm_for_one_step_inside_the_limit(speed):
    stack = joint_stack(target=(0.0, 0.0))
    q, command = np.zeros(2), np.zeros(2)
    speeds = []
    for _ in range(50):
        command = stack.step(q, PERIOD, np.array([speed, 0.0])).command
        q = q + PERIOD * command * (len(speeds) > 0)
        speeds.append(float(np.abs(command).max()))
    assert speeds[0] <= 2.0
    assert max(speeds[1:]) <= CHANGE * (1.0 + 1e-9)


def test_an_arm_that_moves_on_after_a_jump_goes_on_from_its_velocity():
    """Its states may have been held up while it moved."""
    stack = joint_stack()
    plant = plant_of(stack)
    run(stack, plant, 200)
    for _ in range(40):
        plant.step(plant.qd, PERIOD)
    q, qd = plant.measured()
    with pytest.raises(UnusableState, match='jumped') as caught:
        stack.step(q, PERIOD, qd)
    plant.step(caught.value.command, PERIOD)
    q, qd = plant.measured()
    after = stack.step(q, PERIOD, qd).command
    assert np.abs(after - caught.value.command).max() <= CHANGE * (1.0 + 1e-9)


@pytest.mark.parametrize('velocities', [True, False])
def test_a_reset_while_moving_is_said_and_answered_by_braking(velocities):
    stack = joint_stack()
    plant = plant_of(stack)
    run(stack, plant, 200)
    plant.reset()
    q, qd = plant.measured()
    assert not stack.braking
    with pytest.raises(UnusableState, match=r'joint_1 jumped by -\d') as caught:
        stack.step(q, PERIOD, qd if velocities else None)
    assert stack.braking
    if velocities:
        np.testing.assert_array_equal(caught.value.command, 0.0)
    else:
        assert caught.value.command[0] == pytest.approx(2.0 - CHANGE)
        plant.blocked = True
    plant.step(caught.value.command, PERIOD)
    plant.blocked = False
    speeds, _ = run(stack, plant, 200)
    assert np.abs(np.diff(speeds, axis=0, prepend=0.0)).max() <= CHANGE * (1.0 + 1e-9)
    assert speeds[-1, 0] == pytest.approx(2.0)


@pytest.mark.parametrize('position', [1e300, -1e9, 1.0])
def test_a_position_that_no_joint_can_have_come_to_is_refused_once(position):
    stack = joint_stack()
    plant = plant_of(stack)
    run(stack, plant, 200)
    q, _ = plant.measured()
    with pytest.raises(UnusableState, match='joint_2 jumped') as caught:
        stack.step(np.add(q, [0.0, position]), PERIOD)
    assert caught.value.command[0] == pytest.approx(2.0 - CHANGE)
    plant.step(caught.value.command, PERIOD)
    speeds, _ = run(stack, plant, 50)
    assert np.abs(np.diff(speeds, axis=0)).max() <= CHANGE * (1.0 + 1e-9)
    assert speeds[-1, 0] == pytest.approx(2.0)
    assert abs(speeds[:, 1]).max() < 1e-9


def test_a_first_position_that_no_joint_has_gets_a_zero_command():
    stack = joint_stack()
    with pytest.raises(UnusableState, match='no joint can be at') as caught:
        stack.step(np.array([0.0, 1e300]))
    np.testing.assert_array_equal(caught.value.command, 0.0)
    stack.step(np.zeros(2))


def test_an_arm_that_moves_at_the_start_goes_on_from_its_velocity():
    stack = joint_stack()
    command = stack.step(np.zeros(2), qd=np.array([1.0, -0.5])).command
    assert command[0] > 1.0
    assert np.abs(command - [1.0, -0.5]).max() <= CHANGE * (1.0 + 1e-9)


def test_late_cycles_make_the_arm_slower_and_the_period_itself_changes_no_bit():
    plain, timed, late = (joint_stack(target=(59.9, 0.0)) for _ in range(3))
    q, slow = np.array([59.0, 0.0]), np.array([59.0, 0.0])
    fast_way, slow_way = [], []
    for i in range(100):
        command = plain.step(q).command.copy()
        assert timed.step(q, elapsed=PERIOD * (1.0 + 1e-8)).command.tobytes() == command.tobytes()
        q = q + PERIOD * command
        fast_way.append(command[0])
        passed = 0.1 if i % 5 else PERIOD
        command = late.step(slow, elapsed=passed if i else None).command
        slow = slow + (0.1 if (i + 1) % 5 else PERIOD) * command
        slow_way.append(command[0])
        assert slow[0] <= 60.0
    assert max(slow_way) < max(fast_way)
    assert late.arm.step == 0.1
    for _ in range(500):
        late.step(slow)
    assert late.arm.step == PERIOD


def test_the_model_carries_commands_out_as_the_plant_does():
    stack = joint_stack(delay=[2 * PERIOD], lag=[0.03, 0.05])
    plant = plant_of(stack, delay=2, lag=[0.03, 0.05])
    for i in range(300):
        if i == 150:
            stack.tasks['joints'].target = [-3.0, 1.0]
        q, _ = plant.measured()
        plant.step(stack.step(q).command, PERIOD)
        np.testing.assert_allclose(stack.arm.p, q, atol=1e-9)
        assert np.abs(stack.arm.parted).max() < 1e-9


def test_at_rest_noise_does_not_reach_the_command():
    stack = joint_stack(target=(0.3, 0.2), noise=[1e-3])
    plant = plant_of(stack, noise=1e-3, seed=3)
    run(stack, plant, 600)
    commands = []
    for _ in range(1000):
        q, _ = plant.measured()
        commands.append(stack.step(q).command.copy())
        plant.step(commands[-1], PERIOD)
    changes = np.array(commands)[1:] * np.array(commands)[:-1] < 0.0
    assert np.count_nonzero(changes) < 10
    assert np.abs(plant.q - [0.3, 0.2]).max() < 1.2e-3


@given(seeds)
@examples(100)
def test_a_joint_that_may_hold_a_command_still_stops(seed):
    rng = np.random.default_rng(seed)
    dt, change = 10.0 ** rng.uniform([-3, -2], [-1, 0])
    distance = 10.0 ** rng.uniform(-3, 1)
    held = np.sort(rng.uniform(0.0, 0.1, rng.integers(1, 8)) * distance / dt)[::-1].copy()
    held *= rng.integers(0, 2)
    speed = held_speed(distance, change, dt, dt, held[:, None].copy(), 0, 1.0)
    opposite = held_speed(distance, change, dt, dt, -held[:, None], 0, -1.0)
    assert opposite == speed
    way, v = dt * float(np.maximum(held, speed).sum()), speed - change
    while v > 0.0:
        way, v = way + dt * v, v - change
    if dt * held.sum() <= distance:
        assert way <= distance * (1.0 + 1e-9)
        assert way >= distance * (1.0 - 1e-6) or speed == 0.0
    assert held_speed(distance, change, dt, dt, np.zeros((0, 1)), 0, -1.0) >= speed


def test_an_arm_that_is_not_ideal_needs_a_rate():
    with pytest.raises(InvalidValue, match='rate: got no value') as caught:
        build_settings(
            {
                'robot': planar_block(1.0) | {'lag': [0.01]},
                'hierarchy': ['x'],
                'tasks': {'x': {'type': 'joint', 'joints': ['joint_1']}},
            }
        )
    assert caught.value.accepts == 'a number above 0, for robot.delay, lag, noise or hold'


@pytest.mark.parametrize(
    ('given_values', 'key'),
    [
        ({'lag': [0.1, 0.2, 0.3]}, 'robot.lag'),
        ({'delay': [-0.1]}, 'robot.delay'),
        ({'noise': [math.nan]}, 'robot.noise'),
        ({'hold': -1.0}, 'robot.hold'),
    ],
)
def test_a_response_that_makes_no_sense_is_refused(given_values, key):
    with pytest.raises(InvalidValue) as caught:
        Response.of(2, **given_values)
    assert caught.value.key == key


@pytest.mark.parametrize(
    'response',
    [
        {'delay': 3},
        {'lag': 0.05},
        {'noise': 1e-3},
        {'command_loss': 0.5},
        {'state_loss': 0.5},
        {'delay': 2, 'lag': 0.03, 'noise': 1e-3, 'command_loss': 0.2},
    ],
)
def test_ranges_and_distances_hold_for_an_arm_as_it_is_declared(response):
    """A planar arm in its narrow place, sent where it cannot go; `stress` runs it for longer."""
    values = read_parameter_file(CONFIG / 'b3_pressed.yaml', 'tp_controller')
    period = 1.0 / values['rate']
    lost = 'command_loss' in response or 'state_loss' in response
    noise = response.get('noise', 0.0)
    values |= {
        'robot.delay': [response.get('delay', 0) * period],
        'robot.lag': [response.get('lag', 0.0)],
        'robot.noise': [noise],
        'robot.hold': 0.1 if lost else 0.0,
    }
    stack, true = (build_settings(values).stack for _ in range(2))
    tasks = [task for task in true.tasks.values() if task.set_based]
    limits = Limits(3, velocity=[1.5])
    plant = Plant(Integrator([0.0, 0.785, 0.785], limits), PlantSettings(**response), 0.1)
    rng, passed = np.random.default_rng(5), None
    before = np.zeros(3)
    for i in range(600):
        if i % 100 == 0:
            stack.tasks['ee_position'].target = rng.uniform(-1.8, 1.8, 2)
        command = None
        if not plant.state_lost():
            command = stack.step(plant.measured()[0], passed).command.copy()
            passed = 0.0
            assert np.abs(command - before).max() <= 10.0 * period * (1.0 + 1e-9)
            before = command
        plant.step(command, period)
        passed = (passed or 0.0) + period
        true.robot.update(plant.q)
        for task in tasks:
            task.measure()
            assert task.distance.min() >= -noise
        assert np.all(np.abs(plant.q) <= [3.0 + noise, 2.6 + noise, 2.6 + noise])


def test_nothing_passes_through_a_thin_rod_between_two_steps():
    rod = {
        'type': 'obstacle',
        'frame': 'link_2',
        'axes': 'xy',
        'center': [1.0, 1.0],
        'radius': 0.005,
        'activation': 0.02,
        'margin': 1e-4,
    }
    stack = build_settings(
        {
            'robot': planar_block(1.0, 1.0) | {'limits': {'velocity': [2.0]}},
            'rate': 20.0,
            'hierarchy': ['rod', 'joints'],
            'tasks': {
                'rod': rod,
                'joints': {
                    'type': 'joint',
                    'joints': ['joint_1', 'joint_2'],
                    'target': [1.2, math.pi / 2],
                    'gain': [5.0],
                },
            },
        }
    ).stack
    q = np.array([-1.2, math.pi / 2])
    for _ in range(100):
        command = stack.step(q).command
        for share in np.linspace(0.0, 1.0, 50):
            a, b = q + share * 0.05 * command
            tip = np.array([math.cos(a) + math.cos(a + b), math.sin(a) + math.sin(a + b)])
            assert np.linalg.norm(tip - 1.0) >= 0.005
        q = q + 0.05 * command
