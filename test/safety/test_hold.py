"""Hold and resume: to rest inside the limits, and on from there."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from random_stacks import arms, examples, numbers, parameters, states

from tp_controller import build_settings, read_parameter_file
from tp_controller.config import check_changes, controller_schema
from tp_controller.explanation import explain_step
from tp_controller.oscillation import OscillationWatch
from tp_controller.parameters import flatten
from tp_controller.robot import Limits
from tp_controller.solvers import SOLVER_TYPES
from tp_sim.integrator import Integrator
from tp_sim.plant import Plant
from tp_sim.plant_settings import PlantSettings

CONFIG = Path(__file__).parents[2] / 'config'
RATE = 100.0
PERIOD = 1.0 / RATE
START = [0.0, 0.785, 0.785]
NEED_OBJECTIVE = ('extended_jacobian', 'projected_gradient')

seeds = st.integers(0, 10_000)


@st.composite
def moving_arms(draw, solvers=('recursive', 'hqp')):
    """Parameters of a random stack with limits, and where it starts."""
    values = draw(parameters(robots=arms(1, 6), max_levels=3))
    limits = {'velocity': [draw(numbers(0.5, 2))]}
    if draw(st.booleans()):
        limits['acceleration'] = [draw(numbers(2, 20))]
    values['robot']['limits'] = limits
    values['rate'] = RATE
    values['transition_time'] = 0.0
    values['solver']['type'] = draw(st.sampled_from(solvers))
    for task in values['tasks'].values():
        task['feedforward'] = [0.0] * len(task['feedforward'])
    return values, draw(states(len(values['robot']['joints'])))


class Run:
    """An ideal arm that a stack moves; every command is checked against the limits."""

    def __init__(self, values, q):
        self.stack = build_settings(values).stack
        self.q = np.array(q)
        self.before = np.zeros(self.stack.robot.n)

    def step(self, count=1):
        limits = self.stack.robot.limits
        for _ in range(count):
            command = self.stack.step(self.q).command
            assert np.all(np.abs(command) <= limits.velocity)
            allowed = limits.acceleration * self.stack.safety_filter.period
            assert np.all(np.abs(command - self.before) <= allowed * (1.0 + 1e-9) + 1e-12)
            self.q = self.q + self.stack.safety_filter.period * command
            self.before = command
        return self.before

    def braking_steps(self):
        """Steps after which every joint has come to rest at the latest."""
        limits = self.stack.robot.limits
        return 1 + int(np.ceil(limits.velocity / limits.acceleration * RATE).max())


@given(moving_arms(), st.integers(1, 60))
@examples(60)
def test_a_held_arm_comes_to_rest_inside_its_limits_and_stays(case, steps):
    run = Run(*case)
    run.step(steps)
    run.stack.hold()
    assert run.stack.held
    run.step(run.braking_steps())
    assert not run.before.any()
    assert not run.step().any()
    assert run.stack.at_rest
    place = run.q
    run.step(20)
    assert np.array_equal(run.q, place)


@given(moving_arms(), st.integers(1, 60))
@examples(60)
def test_present_values_become_targets_and_nothing_moves_until_a_goal_comes(case, steps):
    run = Run(*case)
    run.step(steps)
    run.stack.hold()
    run.step(run.braking_steps() + 1)
    run.stack.resume()
    assert not run.stack.held
    assert np.abs(run.step(5)).max() < 1e-9


@given(moving_arms(), st.integers(1, 40))
@examples(60)
def test_with_the_old_targets_the_arm_goes_on_as_one_that_starts_there(case, steps):
    run = Run(*case)
    run.step(steps)
    run.stack.hold()
    run.step(run.braking_steps() + 1)
    run.stack.resume(targets=True)
    other = Run(case[0], run.q)
    for _ in range(20):
        np.testing.assert_allclose(run.step(), other.step(), atol=1e-9)


@given(moving_arms(), st.integers(1, 40))
@examples(30)
def test_an_arm_that_has_not_come_to_rest_goes_on_from_the_velocity_that_it_has(case, steps):
    run = Run(*case)
    for targets in (True, False, True):
        run.step(steps)
        run.stack.hold()
        run.step(2)
        run.stack.resume(targets)
    run.step(steps)


@pytest.mark.parametrize('name', ['b3_pressed', 'b1_obstacles'])
@given(seeds)
@examples(10)
def test_distances_and_ranges_hold_while_the_arm_is_held_anywhere(name, seed):
    run = Run(read_parameter_file(CONFIG / f'{name}.yaml', 'tp_controller'), START)
    tasks = [task for task in run.stack.tasks.values() if task.set_based]
    rng = np.random.default_rng(seed)
    for _ in range(12):
        run.stack.tasks['ee_position'].target = rng.uniform(-1.8, 1.8, 2)
        for _ in range(rng.integers(5, 80)):
            run.step()
            assert min(task.distance.min() for task in tasks) >= 0.0
        run.stack.hold()
        for _ in range(20):
            # The braking trajectory that was found safe goes on.
            run.stack.hierarchy = run.stack.hierarchy
            run.step()
            assert min(task.distance.min() for task in tasks) >= 0.0
        assert not run.before.any()
        run.stack.resume(bool(rng.integers(2)))


@pytest.mark.parametrize('response', [{'delay': 3}, {'lag': 0.05}, {'delay': 2, 'lag': 0.03}])
def test_a_late_arm_comes_to_rest_too(response):
    values = read_parameter_file(CONFIG / 'b3_pressed.yaml', 'tp_controller')
    period = 1.0 / values['rate']
    values |= {
        'robot.delay': [response.get('delay', 0) * period],
        'robot.lag': [response.get('lag', 0.0)],
    }
    stack = build_settings(values).stack
    plant = Plant(Integrator(START, Limits(3, velocity=[1.5])), PlantSettings(**response), 0.1)
    stack.tasks['ee_position'].target = [1.1, -0.6]
    before, rested = np.zeros(3), None
    for i in range(200):
        if i == 30:
            assert np.abs(plant.qd).max() > 0.3
            stack.hold()
        command = stack.step(plant.measured()[0], period).command
        assert np.abs(command - before).max() <= 10.0 * period * (1.0 + 1e-9)
        before = command
        if i >= 30 and rested is None and stack.at_rest:
            rested = plant.q
        plant.step(command, period)
        assert rested is None or not command.any()
    assert plant.q == pytest.approx(rested, abs=2e-4)
    assert np.abs(plant.qd).max() < 1e-6
    stack.resume()
    assert np.abs(stack.step(plant.measured()[0], period).command).max() < 1e-3


@pytest.mark.parametrize('response', [{}, {'hold': 0.02}, {'delay': [0.03]}, {'noise': [1e-3]}])
@pytest.mark.parametrize('end', [1.0, -1.0])
def test_an_arm_outside_its_range_comes_back_by_its_tasks_and_rests_when_held(response, end):
    values = flatten(read_parameter_file(CONFIG / 'a4_position_joint.yaml', 'tp_controller'))
    values |= {f'robot.{key}': value for key, value in response.items()}
    limits = {'position_min': [-2.0], 'position_max': [2.0], 'acceleration': [10.0]}
    values |= {f'robot.limits.{key}': value for key, value in limits.items()}
    values |= {'hierarchy': ['joint_1_position'], 'tasks.joint_1_position.gain': [0.0]}
    run = Run(values, [end * 2.9, 0.5, 0.5])
    run.step(30)
    assert end * run.before[0] < -0.05
    run.stack.hold()
    run.step(run.braking_steps())
    assert not run.before.any()
    place = run.q
    run.step(20)
    assert np.array_equal(run.q, place)
    assert end * place[0] > 2.0
    run.stack.resume()
    run.step(30)
    assert end * run.before[0] < -0.05


@pytest.mark.parametrize('response', [{}, {'hold': 0.03}, {'delay': [0.03], 'lag': [0.03]}])
def test_a_joint_that_is_blocked_outside_its_range_is_braked(response):
    values = flatten(read_parameter_file(CONFIG / 'a4_position_joint.yaml', 'tp_controller'))
    values |= {f'robot.{key}': value for key, value in response.items()}
    limits = {'position_min': [-2.0], 'position_max': [2.0], 'acceleration': [10.0]}
    values |= {f'robot.limits.{key}': value for key, value in limits.items()}
    values |= {'hierarchy': ['joint_1_position'], 'tasks.joint_1_position.gain': [0.0]}
    stack = build_settings(values).stack
    period, rests = 1.0 / values['rate'], 0
    for _ in range(150):
        command = stack.step([2.5, 0.5, 0.5], period).command
        assert stack.braking is not stack.arm.following
        rests += stack.braking and not command.any()
    assert rests > 20


def two_tasks():
    values = read_parameter_file(CONFIG / 'a4_position_joint.yaml', 'tp_controller')
    run = Run(values, START)
    run.step(10)
    run.stack.hold()
    return run, *run.stack.tasks.values()


def test_a_goal_that_comes_during_the_hold_counts_for_its_task():
    run, position, joint = two_tasks()
    goal = position.target
    position.target = goal
    assert not run.step(3).any()
    assert position.target == pytest.approx(goal)
    run.stack.resume()
    run.step()
    assert position.target == pytest.approx(goal)
    assert joint.error == pytest.approx(0.0)
    assert np.abs(run.before).max() > 1e-3


def test_present_values_are_those_of_the_first_state_after_the_hold():
    run, position, _ = two_tasks()
    run.step(3)
    run.q = np.array([0.3, -0.4, 0.5])
    run.stack.rest()
    run.step(2)
    run.stack.resume()
    assert np.abs(run.step(5)).max() < 1e-9
    assert position.target == pytest.approx(position.current)


def test_a_first_value_that_is_taken_during_a_hold_is_no_goal():
    values = read_parameter_file(CONFIG / 'a4_position_joint.yaml', 'tp_controller')
    run = Run({'start': 'hold', **values}, START)
    run.stack.hold()
    assert not run.step(3).any()
    run.q = np.array([0.3, -0.4, 0.5])
    run.stack.rest()
    run.step()
    run.stack.resume()
    assert np.abs(run.step(5)).max() < 1e-9


def test_tasks_that_join_the_hierarchy_during_the_hold_take_their_values():
    run, position, joint = two_tasks()
    run.stack.hierarchy = [position.name]
    run.step()
    run.stack.hierarchy = [joint.name, position.name]
    run.step()
    run.stack.resume()
    assert np.abs(run.step(5)).max() < 1e-9


def test_what_is_held_is_told_by_its_errors_and_explains_nothing():
    run, position, _ = two_tasks()
    run.step()
    assert explain_step(run.stack) == ()
    result = run.stack.step(run.q).levels[0]
    np.testing.assert_allclose(result.requested, position.gain @ position.error, atol=1e-9)
    assert not result.achieved.any()
    run.stack.hold()
    run.stack.resume()
    run.stack.resume()
    assert not run.stack.held


@given(seeds)
@examples(15)
def test_whatever_is_asked_for_in_whatever_order_changes_stay_within_the_limit(seed):
    run = Run(read_parameter_file(CONFIG / 'b3_pressed.yaml', 'tp_controller'), START)
    stack, rng = run.stack, np.random.default_rng(seed)
    names = list(stack.tasks)
    for _ in range(60):
        wish = rng.integers(5)
        if wish == 0:
            stack.hold()
        elif wish == 1:
            stack.resume(bool(rng.integers(2)))
        elif wish == 2:
            stack.hierarchy = [name for name in names if rng.integers(2)]
        elif wish == 3:
            stack.tasks['ee_position'].target = rng.uniform(-1.8, 1.8, 2)
        else:
            stack.tasks['ee_position'].gain = rng.uniform(0.5, 10.0)
        run.step(rng.integers(1, 8))
        assert np.all(run.q >= stack.robot.limits.position_min)
        assert np.all(run.q <= stack.robot.limits.position_max)


# An empty hierarchy


@given(moving_arms(), st.integers(1, 60))
@examples(40)
def test_without_a_level_the_arm_comes_to_rest_and_goes_on_with_the_next(case, steps):
    run = Run(*case)
    run.step(steps)
    before = run.stack.hierarchy
    run.stack.hierarchy = []
    assert run.stack.hierarchy == ()
    run.step(run.braking_steps())
    assert not run.before.any()
    result = run.stack.step(run.q)
    assert (result.levels, result.scale) == ((), 1.0)
    assert explain_step(run.stack) == ()
    assert run.stack.systems() == []
    assert run.stack.solver.acting.shape == (0,)
    assert run.stack.at_rest
    run.stack.hierarchy = before
    assert not run.stack.resting
    other = Run(case[0], run.q)
    np.testing.assert_allclose(run.step(), other.step(), atol=1e-9)


@pytest.mark.parametrize('scheme', sorted(SOLVER_TYPES))
@pytest.mark.parametrize('empty', [[], ['']])
def test_every_scheme_can_start_without_a_level(scheme, empty):
    values = read_parameter_file(CONFIG / 'a4_position_joint.yaml', 'tp_controller')
    objective = {'solver.objective.type': 'joint_range'} if scheme in NEED_OBJECTIVE else {}
    ranges = {'robot.limits.position_min': [-3.0], 'robot.limits.position_max': [3.0]}
    values = flatten(values) | objective | ranges
    values |= {'solver.type': scheme, 'hierarchy': empty, 'transition_time': 0.0}
    run = Run(values, START)
    watch = OscillationWatch(run.stack)
    for hierarchy in (empty, ['ee_position'], empty):
        run.stack.hierarchy = hierarchy
        for _ in range(3):
            assert not watch.see(run.q, run.step(), run.stack.safety_filter.period)
        assert run.before.any() == (hierarchy is not empty)


def test_an_empty_hierarchy_is_a_change_like_others():
    values = read_parameter_file(CONFIG / 'b1_obstacles.yaml', 'tp_controller')
    settings = build_settings(values)
    schema = controller_schema(settings.values)
    warnings = check_changes(settings, schema, {'hierarchy': ['']})()
    assert 'obstacle_1 leaves the hierarchy' in warnings[0]
    assert settings.stack.hierarchy == ()
    check_changes(settings, schema, {'solver.damping': 0.3})()
    check_changes(settings, schema, {'hierarchy': ['obstacle_1']})()
    assert settings.stack.hierarchy == ('obstacle_1',)


def test_set_based_tasks_alone_move_an_arm_that_is_too_near():
    values = read_parameter_file(CONFIG / 'b1_obstacles.yaml', 'tp_controller')
    run = Run(values | {'hierarchy': ['obstacle_1']}, START)
    task = run.stack.tasks['obstacle_1']
    run.step(5)
    assert not run.before.any()
    x, y, _ = run.stack.robot.frame('link_3').position
    task.target = [x + 0.3, y]
    assert run.step().any()
    run.step(600)
    assert task.distance.min() >= 0.0


def test_a_new_hierarchy_leaves_the_braking_trajectory_as_it_is():
    runs = [
        Run(read_parameter_file(CONFIG / 'b3_pressed.yaml', 'tp_controller'), START)
        for _ in range(2)
    ]
    rng = np.random.default_rng(1)
    for _ in range(60):
        goal, steps = rng.uniform(-1.8, 1.8, 2), rng.integers(5, 80)
        for run in runs:
            run.stack.tasks['ee_position'].target = goal
            run.stack.tasks['ee_position'].gain = 5.0
            run.step(steps)
            run.stack.hold()
        # Where the joints cannot stop together each stops as hard as it can.
        for _ in range(20):
            runs[1].stack.hierarchy = runs[1].stack.hierarchy
            assert np.array_equal(runs[0].step(), runs[1].step())
        for run in runs:
            run.stack.resume(targets=True)
