"""The shipped stacks of real arms: they load, and reach goals."""

from pathlib import Path

import numpy as np
import pytest

from tp_controller import build_settings, read_parameter_file
from tp_controller.robot import Limits

CONFIG = Path(__file__).resolve().parents[2] / 'config'
ARMS = ('panda', 'ur5', 'kinova')
GOALS = 20
SHARE = 0.9
"""Of the positions; of 200 draws benchmarks/reach.py reaches 97 % or more."""

each_arm = pytest.mark.parametrize('arm', ARMS)


def read(name, hierarchy=None):
    """Stack, first configuration and step [s] of a parameter file."""
    path = CONFIG / f'{name}.yaml'
    simulator = read_parameter_file(path, 'tp_sim')
    parameters = read_parameter_file(path, 'tp_controller')
    changes = {'hierarchy': hierarchy} if hierarchy else {}
    stack = build_settings(parameters | changes).stack
    return stack, np.array(simulator['initial_positions']), 1.0 / simulator['rate']


def pursue(stack, tasks, q, dt, seconds, tolerance):
    """Whether tasks come near their targets in time, and the configuration (n,) then."""
    limits = stack.robot.limits
    for _ in range(round(seconds / dt)):
        command = stack.step(q).command
        assert np.all(np.abs(command) <= limits.velocity)
        if all(np.linalg.norm(task.error) < tolerance for task in tasks):
            return True, q
        q = q + dt * command
        assert np.all((limits.position_min <= q) & (q <= limits.position_max))
    return False, q


def draws(robot):
    """Random starts and goals (GOALS, 2, n) [rad] inside the joints' ranges."""
    lower = np.where(np.isinf(robot.limits.position_min), -np.pi, robot.limits.position_min)
    upper = np.where(np.isinf(robot.limits.position_max), np.pi, robot.limits.position_max)
    return np.random.default_rng(11).uniform(lower, upper, (GOALS, 2, robot.n))


def position_stack(arm):
    """Position over the posture, of an arm's file."""
    position, _, posture = read(arm)[0].hierarchy
    stack, _, dt = read(arm, [position, posture])
    return stack, stack.tasks[position], stack.tasks[posture], dt


def aim_at(stack, task, q):
    """Make the place of the task's frame at a configuration (n,) its target."""
    stack.robot.update(q)
    frame = stack.robot.frame(task.frame_name)
    task.target = task.target_from_pose(frame.position, frame.rotation)


@pytest.mark.parametrize('name', [*ARMS, *(f'{arm}_pose' for arm in ARMS)])
def test_every_demo_goal_is_reached_in_its_time_away_from_the_ends_of_the_ranges(name):
    demo = read_parameter_file(CONFIG / f'{name}.yaml', 'tp_demo')
    stack, q, dt = read(name)
    limits = stack.robot.limits
    for goals in demo['goals']:
        tasks = []
        for goal in goals.split(';'):
            task, *values = goal.split()
            stack.tasks[task].target = [float(value) for value in values]
            tasks.append(stack.tasks[task])
        reached, q = pursue(stack, tasks, q, dt, demo['seconds_per_goal'], demo['tolerance'])
        assert reached
        assert np.all((limits.position_min < q) & (q < limits.position_max))


@each_arm
def test_posture_and_start_are_inside_the_ranges_and_away_from_singularities(arm):
    stack, start, _ = read(arm)
    limits = stack.robot.limits
    position, orientation, posture = (stack.tasks[name] for name in stack.hierarchy)
    for q in (start, posture.target):
        assert np.all((limits.position_min < q) & (q < limits.position_max))
        stack.step(q)
        J = np.vstack([position.J, orientation.J])
        assert np.linalg.svd(J, compute_uv=False)[-1] > stack.solver.inverse.region


@each_arm
def test_random_positions_are_reached_from_random_starts_without_ends_of_the_ranges(arm):
    stack, position, _, dt = position_stack(arm)
    count = 0
    goals = draws(stack.robot)
    stack.robot.limits = Limits(stack.robot.n, velocity=stack.robot.limits.velocity)
    for start, goal in goals:
        aim_at(stack, position, goal)
        reached, _ = pursue(stack, [position], start, dt, 10.0, 1e-3)
        count += reached
    assert count >= SHARE * GOALS


@each_arm
def test_random_positions_are_reached_from_the_posture_inside_the_ranges(arm):
    stack, position, posture, dt = position_stack(arm)
    count = 0
    for _, goal in draws(stack.robot):
        aim_at(stack, position, goal)
        reached, _ = pursue(stack, [position], posture.target, dt, 10.0, 1e-3)
        count += reached
    assert count >= SHARE * GOALS
