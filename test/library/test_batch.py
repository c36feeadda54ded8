"""Batches: what is drawn, run and measured, in this process."""

import math

import numpy as np
import pytest

from tp_controller import InvalidValue, build_settings, read_parameter_file
from tp_controller.batch import close_loop, draw_run, plan_batch
from tp_controller.batch.draws import Draws
from tp_controller.batch.engine import run_part
from tp_controller.batch.loop import Trace
from tp_controller.batch.measures import limit_use, most_reversals, time_to_reach
from tp_controller.distances import least_distance
from tp_controller.robot import Limits, Robot
from tp_controller.robot.draws import random_configuration
from tp_controller.tasks import SetBasedTask

SECONDS = 0.5


def plan(config, name='b3_pressed', **given):
    values = read_parameter_file(config / f'{name}.yaml', 'tp_controller')
    return plan_batch(values, **({'seconds': SECONDS, 'runs': 4, 'seed': 3} | given))


@pytest.mark.parametrize(
    ('name', 'scheme'),
    [
        ('b3_pressed', 'recursive'),
        ('b3_pressed', 'hqp'),
        ('panda', 'recursive'),
        ('panda', 'hqp'),
        ('panda_table', 'recursive'),
        ('mobile_planar', 'recursive'),
    ],
)
def test_a_run_is_bit_identical_to_plain_steps(config, name, scheme):
    batch = plan(config, name, schemes=[scheme], gain=(0.5, 2.0), seconds=0.1)
    row = run_part(batch, scheme, 0, 4)[3]
    values = read_parameter_file(config / f'{name}.yaml', 'tp_controller')
    stack = build_settings(values | {'solver.type': scheme}).stack
    goal = np.array(row['goal'])
    for goal_name in batch.goals:
        task = stack.tasks[goal_name]
        task.target, goal = goal[: task.target_size], goal[task.target_size :]
        task.gain = (row['gain'] * task.gain).ravel().tolist()
    dt, q = batch.period, np.array(row['start'])
    commands = []
    for _ in range(batch.steps):
        commands.append(stack.step(q, dt).command.copy())
        q = stack.robot.integrate(q, dt * commands[-1])
    limits = stack.robot.limits
    assert row['velocity_use'] == np.max(np.abs(commands) / limits.velocity)
    for task_name in batch.errors:
        error = stack.tasks[task_name].error
        assert row[f'error_{task_name}'] == np.sqrt(np.sum(error * error))
    again, draw = draw_run(batch, scheme, 3)
    trace = close_loop(again, draw.start, batch.steps, batch.errors)
    np.testing.assert_array_equal(trace.commands, commands)
    last = stack.robot.integrate(trace.q[-1], dt * trace.commands[-1])
    np.testing.assert_array_equal(last, q)


def test_a_run_does_not_depend_on_the_runs_before_it(config):
    batch = plan(config)
    scheme = batch.schemes[0]
    alone = [run_part(batch, scheme, i, i + 1)[0] for i in reversed(range(4))]
    assert run_part(batch, scheme, 0, 4) == alone[::-1]


def test_draws_depend_on_seed_and_number_and_not_on_the_scheme(config):
    batch = plan(config, schemes=['recursive', 'hqp'], gain=(0.5, 2.0))
    first, second = (run_part(batch, scheme, 0, 3) for scheme in batch.schemes)
    for key in ('start', 'goal', 'gain'):
        assert [row[key] for row in first] == [row[key] for row in second]
        assert first[0][key] != first[1][key]
    other = run_part(plan(config, seed=4, gain=(0.5, 2.0)), 'recursive', 0, 1)[0]
    assert other['start'] != first[0]['start']


def test_random_starts_and_goals_keep_ranges_and_distances(config):
    batch = plan(config)
    settings = batch.settings(batch.schemes[0])
    draws, robot = Draws(batch, settings), settings.stack.robot
    bounds = [task for task in settings.stack.tasks.values() if isinstance(task, SetBasedTask)]
    for run in range(20):
        draw = draws.draw(run)
        robot.update(draw.start)
        for task in bounds:
            distances = np.zeros(task.k)
            task.probe(distances)
            assert distances.min() > 0.0
    low, high = robot.limits.position_min, robot.limits.position_max
    assert np.all((low <= draw.start) & (draw.start <= high))


def test_a_joint_without_ends_starts_within_half_a_turn():
    rng = np.random.default_rng(0)
    robot = Robot.from_dh([1.0, 1.0])
    drawn = np.array([random_configuration(robot, rng) for _ in range(500)])
    assert np.all(np.abs(drawn) <= math.pi)
    assert drawn.min() < -3.0 < 3.0 < drawn.max()


def test_goals_come_from_one_configuration_and_the_posture_stays(config):
    batch = plan(config, 'panda')
    assert batch.goals == ('hand_position', 'hand_orientation')
    assert batch.errors == ('hand_position', 'hand_orientation', 'posture')
    stack, draw = draw_run(batch, 'recursive', 0)
    assert set(draw.goals) == set(batch.goals)
    assert stack.tasks['posture'].target[3] == -1.571


def test_the_start_may_be_given(config):
    start = (0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785)
    batch = plan(config, 'panda', start=start, seconds=0.02, runs=2)
    assert [row['start'] for row in run_part(batch, 'recursive', 0, 2)] == [list(start)] * 2


def test_time_to_reach_is_when_the_error_stays_small():
    errors = np.array([0.5, 0.01, 0.3, 0.02, 0.01])
    assert time_to_reach(errors, 0.1, 0.5) == 1.5
    assert time_to_reach(errors, 0.5, 0.5) == 0.0
    assert time_to_reach(errors[:3], 0.1, 0.5) is None
    assert time_to_reach(np.array([np.nan, np.nan]), 0.1, 0.5) is None


def test_worst_use_of_each_limit():
    robot = Robot.from_dh([1.0, 1.0])
    robot.limits = Limits(2, [2.0], [-1.0, -3.0], [1.0, 1.0], [10.0])
    q = np.array([[0.0, 0.0], [0.1, -2.0]])
    commands = np.array([[0.5, 0.0], [-0.5, 1.0]])
    nothing = np.zeros(2, dtype=bool)
    trace = Trace(q, commands, {}, nothing, nothing)
    use = limit_use(trace, robot, 0.1)
    assert use == pytest.approx(
        {'velocity_use': 0.5, 'range_use': 0.5, 'acceleration_use': 1.0}, abs=1e-12
    )
    assert set(limit_use(trace, Robot.from_dh([1.0, 1.0]), 0.1).values()) == {None}


def test_reversals_are_counted_per_joint_and_small_speeds_have_no_sign():
    course = np.array([1.0, -1.0, 1e-4, -1.0, 0.0, 1.0, 1.0, -1.0])
    commands = np.column_stack([course, np.abs(course), np.zeros(8)])
    assert most_reversals(commands, np.array([1.0, 1.0, np.inf])) == 3


@pytest.mark.parametrize('block', [1, 7, 256])
def test_the_least_distance_of_a_path_is_that_of_all_its_configurations(
    config, block, monkeypatch
):
    monkeypatch.setattr('tp_controller.distances.BLOCK', block)
    batch = plan(config)
    stack, _ = draw_run(batch, 'recursive', 0)
    robot = stack.robot
    tasks = [task for task in stack.tasks.values() if isinstance(task, SetBasedTask)]
    rng = np.random.default_rng(0)
    path = np.cumsum(rng.normal(scale=0.02, size=(300, robot.n)), axis=0)
    found = least_distance(robot, tasks, path)
    expected = math.inf
    for q in path:
        robot.update(q)
        for task in tasks:
            distances = np.zeros(task.k)
            task.probe(distances)
            expected = min(expected, distances.min())
    assert found == expected
    assert least_distance(robot, (), path) == math.inf


@pytest.mark.parametrize(
    ('given', 'key', 'accepts'),
    [
        ({'runs': 0}, 'runs', 'a whole number of at least 1'),
        ({'runs': 1.5}, 'runs', 'a whole number of at least 1'),
        ({'seed': -1}, 'seed', 'a whole number of at least 0'),
        ({'seconds': 0.0}, 'seconds', 'a finite number above 0'),
        ({'seconds': 1e-6}, 'seconds', 'times from 0.0166667, one step, to 166667'),
        ({'seconds': 1e9}, 'seconds', 'times from 0.0166667, one step, to 166667'),
        ({'tolerance': math.nan}, 'tolerance', 'a finite number above 0'),
        ({'schemes': ['fast']}, 'schemes', 'some of recursive'),
        ({'schemes': ['hqp', 'hqp']}, 'schemes', 'every scheme once'),
        ({'goals': ['obstacle_1']}, 'goals', 'some of ee_position'),
        ({'gain': (2.0, 1.0)}, 'gain', 'two numbers above 0'),
        ({'gain': (1.0, 1e4)}, 'gain', 'gains below'),
        ({'start': [0.0]}, 'start', '3 values, one per joint'),
        ({'start': [9.0, 0.0, 0.0]}, 'start', 'inside robot.limits.position'),
    ],
)
def test_arguments_that_cannot_be_used_are_refused(config, given, key, accepts):
    with pytest.raises(InvalidValue) as caught:
        plan(config, **given)
    assert caught.value.key == key
    assert accepts in caught.value.accepts


@pytest.mark.parametrize(
    ('change', 'key'),
    [
        ({'rate': None}, 'rate'),
        ({'robot.delay': [0.05]}, 'robot.delay, lag, noise or hold'),
        ({'solver.type': 'projected_gradient'}, 'solver.objective.type'),
    ],
)
def test_parameters_that_cannot_be_used_are_refused(config, change, key):
    values = read_parameter_file(config / 'a1_position.yaml', 'tp_controller')
    with pytest.raises(InvalidValue) as caught:
        plan_batch(values | change)
    assert caught.value.key.endswith(key)
