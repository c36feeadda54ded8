"""The safety filter: distances and limits hold at every step, whatever is asked for."""

import math

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from random_stacks import arms, examples, numbers, planar_arms, states
from small_arms import planar_block

from tp_controller import InvalidValue, build_settings
from tp_controller.config import check_changes, controller_schema
from tp_controller.robot import Limits
from tp_sim.integrator import Integrator
from tp_sim.plant import Plant, PlantSettings

seeds = st.integers(0, 10_000)


def obstacle(frame, center, radius, **changes):
    return {'type': 'obstacle', 'frame': frame, 'center': center, 'radius': radius} | changes


def guarded(robot, limits, obstacles, rate=100.0, **solver):
    """Stack of obstacles above a position of the end that is drawn towards a moving target."""
    end = f'link_{len(robot["joints"])}'
    return build_settings(
        {
            'robot': robot | {'limits': limits},
            'rate': rate,
            'solver': {'damping': 0.05} | solver,
            'hierarchy': [*obstacles, 'end'],
            'tasks': obstacles
            | {'end': {'type': 'position', 'frame': end, 'gain': [5.0], 'target': [0.0] * 3}},
        }
    ).stack


@st.composite
def surrounded(draw):
    """A random arm, limits, obstacles round its middle and end, and where it starts."""
    robot = draw(arms(2, 6).filter(lambda block: 'prismatic' not in block['dh']['types']))
    n = len(robot['joints'])
    rng = np.random.default_rng(draw(seeds))
    q = rng.uniform(-1.0, 1.0, n)
    limits = {'velocity': [draw(numbers(0.5, 2))]}
    if draw(st.booleans()):
        limits['acceleration'] = [draw(numbers(2, 20))]
    if draw(st.booleans()):
        limits |= {'position_min': [-1.5], 'position_max': [1.5]}
    plain = build_settings(
        {
            'robot': robot,
            'hierarchy': ['x'],
            'tasks': {'x': {'type': 'joint', 'joints': [robot['joints'][0]]}},
        }
    ).stack.robot
    plain.update(q)
    obstacles = {}
    for i in range(3):
        frame = f'link_{rng.integers(max(1, n - 1), n + 1)}'
        way = rng.normal(size=3)
        radius, gap = rng.uniform(0.1, 0.5), rng.uniform(0.01, 0.3)
        center = plain.frame(frame).position + way / np.linalg.norm(way) * (radius + gap)
        obstacles[f'o_{i}'] = obstacle(frame, center.tolist(), float(radius))
    saturation = draw(st.sampled_from(['uniform', 'null_space']))
    return guarded(robot, limits, obstacles, saturation=saturation), q, rng


@given(surrounded())
@examples(40)
def test_no_distance_and_no_limit_is_ever_broken(case):
    stack, q, rng = case
    limits, tasks = stack.robot.limits, [t for t in stack.tasks.values() if t.set_based]
    before = np.zeros_like(q)
    for i in range(250):
        if i % 50 == 0:
            stack.tasks['end'].target = rng.normal(size=3)
        command = stack.step(q).command.copy()
        assert min(task.distance[0] for task in tasks) >= 0.0
        assert np.all(np.abs(command) <= limits.velocity)
        change = limits.acceleration * stack.safety_filter.period
        assert np.all(np.abs(command - before) <= change * (1.0 + 1e-9) + 1e-12)
        q, before = q + stack.safety_filter.period * command, command
        assert np.all(q >= limits.position_min)
        assert np.all(q <= limits.position_max)


# A step out of the obstacle, and then one that falls back by what it had won.
FALLS_BACK = planar_block(0.33, 0.2, 0.71, 0.9)
FALLS_BACK['dh']['base_pose'] = [0.0, 0.0, 0.0, 1.17, 0.0, -2.72]


@given(planar_arms(2, 5), seeds, st.booleans())
@example(FALLS_BACK, 1024, False)
@examples(30)
def test_an_arm_inside_an_obstacle_comes_out_and_never_goes_deeper(robot, seed, accelerates):
    n = len(robot['joints'])
    rng = np.random.default_rng(seed)
    q = rng.uniform(-1.0, 1.0, n)
    limits = {'velocity': [1.0]} | ({'acceleration': [5.0]} if accelerates else {})
    stack = guarded(robot, limits, {'o': obstacle(f'link_{n}', [100.0] * 3, 0.3)})
    stack.step(q)
    stack.rest()
    center = np.add(stack.robot.frame(f'link_{n}').position, [0.1, 0.05, 0.02])
    stack.tasks['o'].target = center
    stack.tasks['end'].target = center
    deepest = -math.inf
    for _ in range(300):
        command = stack.step(q).command
        assert np.abs(command).max() <= 1.0
        distance = float(stack.tasks['o'].distance[0])
        assert distance >= min(deepest, 0.0) - 1e-12
        deepest, q = distance, q + 0.01 * command
    assert deepest > -0.15


def test_an_obstacle_that_jumps_onto_a_moving_arm_makes_it_brake_and_leave():
    stack = guarded(
        planar_block(1.0, 1.0),
        {'velocity': [1.0], 'acceleration': [4.0]},
        {'o': obstacle('link_2', [9.0, 9.0, 0.0], 0.3)},
    )
    stack.tasks['end'].target = [-1.0, 1.0, 0.0]
    q, distance = np.array([0.0, 0.5]), []
    for i in range(600):
        if i == 50:
            tip = stack.robot.frame('link_2').position
            stack.tasks['o'].target = np.add(tip, [-0.05, 0.02, 0.0])
        q = q + 0.01 * stack.step(q).command
        distance.append(float(stack.tasks['o'].distance[0]))
        if i == 50:
            assert stack.safety_filter.stopped_by == ('o',)
            command = stack.safety_filter._before
            assert stack.safety_filter.active_limits(command)[-1] == 'o distance'
    assert min(distance) == min(distance[50:100])
    assert distance[-1] > 0.0


@pytest.mark.parametrize(
    'response',
    [{}, {'hold': 0.03}, {'delay': [0.02], 'lag': [0.03]}, {'noise': [1e-3], 'hold': 0.02}],
)
@pytest.mark.parametrize('moves', [True, False])
def test_a_late_arm_leaves_an_obstacle_that_jumps_onto_it_too(response, moves):
    stack = guarded(
        planar_block(1.0, 1.0) | response,
        {'velocity': [1.0], 'acceleration': [4.0]},
        {'o': obstacle('link_2', [9.0, 9.0, 0.0], 0.3)},
    )
    q = [0.0, 0.5]
    limits = Limits(2, velocity=[1.0])
    plant = PlantSettings(delay=2, lag=0.03) if 'lag' in response else PlantSettings()
    arm = Plant(Integrator(q, limits), plant, math.inf)
    stack.tasks['end'].target = [-1.0, 1.0, 0.0]
    stopped = 0
    for i in range(500):
        if i == 50 * moves:
            stack.robot.update(arm.measured()[0])
            tip = stack.robot.frame('link_2').position
            stack.tasks['o'].target = np.add(tip, [-0.05, 0.02, 0.0])
        arm.step(stack.step(arm.measured()[0], 0.01).command, 0.01)
        stopped += bool(stack.safety_filter.stopped_by)
    assert float(stack.tasks['o'].distance[0]) > 0.0
    # Braking from full speed is all that the filter has to do about it.
    assert stopped <= 25 + 5


def test_who_stopped_the_arm_is_forgotten_when_nobody_is_looked_at_any_more():
    stack = guarded(
        planar_block(1.0, 1.0),
        {'velocity': [1.0], 'acceleration': [4.0]},
        {'o': obstacle('link_2', [9.0, 9.0, 0.0], 0.3)},
    )
    stack.tasks['end'].target = [-1.0, 1.0, 0.0]
    q = np.array([0.0, 0.5])
    for _ in range(50):
        q = q + 0.01 * stack.step(q).command
    stack.tasks['o'].target = np.add(stack.robot.frame('link_2').position, [-0.05, 0.02, 0.0])
    stack.step(q)
    assert stack.safety_filter.stopped_by == ('o',)
    stack.hierarchy = ['end']
    stack.step(q)
    assert stack.safety_filter.stopped_by == ()


@given(planar_arms(1, 6), st.data())
@examples(30)
def test_without_limits_of_position_and_acceleration_a_rate_changes_no_bit(robot, data):
    n = len(robot['joints'])
    block = {
        'robot': robot | {'limits': {'velocity': [1.0]}},
        'hierarchy': ['end'],
        'tasks': {'end': {'type': 'position', 'frame': f'link_{n}', 'target': [0.3, 0.4, 0.0]}},
    }
    q = data.draw(states(n))
    plain, timed = build_settings(block).stack, build_settings(block | {'rate': 100.0}).stack
    for _ in range(3):
        assert plain.step(q).command.tobytes() == timed.step(q).command.tobytes()


def test_distances_below_a_task_that_always_acts_are_not_kept_at_its_cost():
    stack = guarded(planar_block(1.0, 1.0), {'velocity': [1.0]}, {})
    assert stack.safety_filter.kept == ()
    tasks = {'o': obstacle('link_2', [1.0, 1.0, 0.0], 0.5)}
    stack = guarded(planar_block(1.0, 1.0), {'velocity': [1.0]}, tasks)
    assert stack.safety_filter.kept == ('o',)
    stack.hierarchy = ['end', 'o']
    assert stack.safety_filter.kept == ()
    stack.hierarchy = ['o + end']
    assert stack.safety_filter.kept == ()


def test_limits_that_are_met_are_told_by_joint():
    robot = planar_block(1.0, 1.0, 1.0)
    limits = {
        'velocity': [1.0, 1.0, 2.0],
        'acceleration': [1e3, 1e3, 10.0],
        'position_max': [1.0],
        'position_min': [-1.0],
    }
    stack = build_settings(
        {
            'robot': robot | {'limits': limits},
            'rate': 100.0,
            'solver': {'damping': 0.0},
            'hierarchy': ['joints'],
            'tasks': {
                'joints': {'type': 'joint', 'joints': robot['joints'], 'target': [0.2, 3.0, 1.0]}
            },
        }
    ).stack
    command = stack.step(np.array([0.0, 1.0, 0.0])).command
    assert command[1] == pytest.approx(0.0, abs=1e-6)
    met = stack.safety_filter.active_limits(command)
    assert met == ['joint_2 position', 'joint_3 acceleration']


def test_an_acceleration_limit_without_a_rate_is_refused_at_start_and_while_running():
    block = {
        'robot': planar_block(1.0) | {'limits': {'acceleration': [1.0]}},
        'hierarchy': ['x'],
        'tasks': {'x': {'type': 'joint', 'joints': ['joint_1']}},
    }
    with pytest.raises(InvalidValue, match=r'for robot\.limits\.acceleration') as caught:
        build_settings(block)
    assert caught.value.key == 'rate'
    del block['robot']['limits']
    settings = build_settings(block)
    change = {'robot.limits.acceleration': [1.0]}
    with pytest.raises(InvalidValue, match='rate'):
        check_changes(settings, controller_schema(settings.values), change)


def test_an_acceleration_limit_that_allows_no_change_is_refused():
    limits = {'acceleration': [1e-300]}
    with pytest.raises(InvalidValue, match='at least 1e-07') as caught:
        guarded(planar_block(1.0), limits, {})
    assert caught.value.key == 'robot.limits.acceleration'


def test_a_slide_does_not_get_longer_while_set_based_tasks_rely_on_it():
    robot = planar_block(1.0, 1.0)
    robot['dh']['types'] = ['prismatic', 'revolute']
    limits = {'velocity': [1.0], 'position_min': [-0.5], 'position_max': [0.5]}
    tasks = {'o': obstacle('link_2', [9.0, 0.0, 0.0], 0.5)}
    settings = build_settings(
        {'robot': robot | {'limits': limits}, 'rate': 50.0, 'hierarchy': ['o'], 'tasks': tasks}
    )
    schema = controller_schema(settings.values)
    with pytest.raises(InvalidValue, match='a longer way for joint_1'):
        check_changes(settings, schema, {'robot.limits.position_max': [2.0, 0.5]})
    with pytest.raises(InvalidValue, match='a longer way') as caught:
        check_changes(settings, schema, {'robot.limits.position_min': [-0.6, -0.5]})
    assert caught.value.key == 'robot.limits.position_min'
    check_changes(settings, schema, {'robot.limits.position_max': [0.4, 3.0]})()


def test_a_step_that_is_taken_back_gives_the_same_command_again():
    stack = guarded(
        planar_block(1.0, 1.0),
        {'velocity': [1.0], 'acceleration': [4.0]},
        {'o': obstacle('link_2', [-1.0, 1.0, 0.0], 0.3)},
    )
    stack.tasks['end'].target = [-1.0, 1.0, 0.0]
    q = np.array([0.0, 0.5])
    for _ in range(200):
        command = stack.step(q).command.copy()
        for _ in range(2):
            stack.undo()
            assert stack.step(q).command.tobytes() == command.tobytes()
        q = q + 0.01 * command


def test_a_hand_that_slides_along_a_sphere_needs_few_looks_ahead():
    stack = guarded(
        planar_block(0.5, 0.4, 0.3),
        {'velocity': [3.0], 'acceleration': [4.0]},
        {'ball': obstacle('link_3', [0.8, 0.0, 0.0], 0.2)},
        rate=1000.0,
    )
    q, probes, distance = np.array([0.9, -0.4, -0.2]), [], []
    for i in range(6000):
        if i % 1500 == 0:
            stack.tasks['end'].target = [0.8, -0.18 if i % 3000 == 0 else 0.18, 0.0]
        q = q + stack.step(q).command / 1000.0
        probes.append(stack.safety_filter._ahead.probes)
        distance.append(float(stack.tasks['ball'].distance[0]))
    assert 0.0 < min(distance) < 0.02
    assert 0 < max(probes) <= 8
