import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from plain_levels import random_levels, resolve
from random_stacks import arms, examples, numbers, parameters, planar_arms, states, tasks
from references import away_from_rank_changes, recursion

from tp_controller import InvalidValue, build_settings
from tp_controller.solvers import Inverse, RecursiveSolver


@st.composite
def stacks_in_a_state(draw, robots, damping):
    block = draw(parameters(robots=robots, dampings=damping))
    q = draw(states(len(block['robot']['joints'])))
    return build_settings(block).stack, q


def equations(stack):
    """Levels of the last step from the settings of their tasks."""
    levels = []
    for names in stack.hierarchy:
        members = [stack.tasks[name] for name in names.split(' + ')]
        velocity = [task.gain @ task.error + task.feedforward for task in members]
        levels.append((np.vstack([task.J for task in members]), np.concatenate(velocity)))
    return levels


def assert_same_command(command, expected):
    size = max(1.0, float(np.abs(expected).max()))
    assert np.abs(command - expected).max() <= 1e-9 * size


def assert_follows_the_recursion(stack, q, damping):
    stack.settle = False
    command = stack.step(q).command
    expected, shares = recursion(equations(stack), damping)
    assume(away_from_rank_changes(shares))
    assert_same_command(command, expected)


@given(stacks_in_a_state(arms(), st.just(0.0)))
@examples(100)
def test_without_damping_the_command_is_that_of_explicit_projectors(case):
    assert_follows_the_recursion(*case, 0.0)


@given(stacks_in_a_state(arms(max_joints=1) | planar_arms(), st.just(0.0)))
@examples(100)
def test_without_damping_tasks_out_of_reach_of_the_joints_are_left_out(case):
    """Planar and single-joint arms with tasks in space: the rank is short exactly."""
    assert_follows_the_recursion(*case, 0.0)


@given(stacks_in_a_state(arms() | planar_arms(), numbers(0.01, 2)))
@examples(100)
def test_with_damping_the_command_is_that_of_damped_least_squares(case):
    stack, _ = case
    assert_follows_the_recursion(*case, stack.solver.damping)


@st.composite
def repeated_tasks(draw):
    """Two levels with the same task, the lower one towards another target."""
    robot = draw(arms())
    block = draw(tasks(robot))
    lower = block | {'target': [value + draw(numbers(0.1, 1)) for value in block['target']]}
    names = {'first': block, 'second': lower, 'third': draw(tasks(robot))}
    q = draw(states(len(robot['joints'])))
    return {'robot': robot, 'hierarchy': list(names), 'tasks': names}, q


@given(repeated_tasks(), st.sampled_from([0.0, 1e-12, 1e-10, 1e-9, 1e-8, 1e-6, 0.1]))
@examples(100)
def test_a_task_repeated_on_a_lower_level_changes_nothing(case, damping):
    """Nothing is left for it to move; also where the damping is close to rounding."""
    block, q = case
    block['solver'] = {'damping': damping}
    stack = build_settings(block).stack
    stack.settle = False
    command = stack.step(q).command.copy()
    J, velocity = equations(stack)[0]
    _, shares = recursion([(J, velocity), *equations(stack)[2:]], 0.0)
    assume(away_from_rank_changes(shares))
    stack.hierarchy = ['first', 'third']
    assert_same_command(command, stack.step(q).command)


def solved(levels, damping=0.0):
    return resolve(RecursiveSolver(levels[0][0].shape[1], Inverse(damping=damping)), levels)


@pytest.mark.parametrize('damping', [0.0, 0.1])
@pytest.mark.parametrize('rows', [[1], [2, 2], [3, 1, 2], [4, 4], [1, 1, 1, 1, 1, 1, 1], [9]])
@pytest.mark.parametrize('seed', range(3))
def test_any_matrices_are_resolved_by_the_recursion(rows, damping, seed):
    levels = random_levels(seed, 6, rows)
    assert_same_command(solved(levels, damping), recursion(levels, damping)[0])


def test_one_level_that_is_out_of_reach_is_met_in_the_least_squares_sense():
    levels = random_levels(1, 3, [5])
    expected = np.linalg.lstsq(*levels[0], rcond=None)[0]
    np.testing.assert_allclose(solved(levels), expected, atol=1e-12)


def test_one_level_within_reach_takes_the_shortest_joint_velocity():
    J, velocity = random_levels(2, 5, [3])[0]
    qd = solved([(J, velocity)])
    np.testing.assert_allclose(J @ qd, velocity, atol=1e-12)
    np.testing.assert_allclose(qd, J.T @ np.linalg.solve(J @ J.T, velocity), atol=1e-12)


def test_a_lower_level_makes_up_for_all_levels_above_it():
    """Its residual counts the whole velocity so far, not only the last level's share."""
    levels = random_levels(3, 6, [2, 2, 2])
    qd = solved(levels)
    for J, velocity in levels:
        np.testing.assert_allclose(J @ qd, velocity, atol=1e-9)


def test_a_level_without_any_influence_leaves_the_others_alone():
    upper, lower = random_levels(4, 4, [2, 2])
    nothing = (np.zeros((3, 4)), np.ones(3))
    for damping in (0.0, 0.1):
        expected = solved([upper, lower], damping)
        for levels in ([nothing, upper, lower], [upper, nothing, lower], [upper, lower, nothing]):
            np.testing.assert_allclose(solved(levels, damping), expected, atol=1e-12)


def test_the_rank_does_not_depend_on_the_unit_of_a_level():
    levels = random_levels(5, 5, [2, 2])
    expected = solved(levels)
    for factor in (1e-9, 1e9):
        scaled = [(factor * J, factor * velocity) for J, velocity in levels]
        np.testing.assert_allclose(solved(scaled), expected, atol=1e-9)


@pytest.mark.parametrize('share', [1e-3, 1e-5, 1e-7])
def test_a_direction_that_is_hard_to_reach_still_belongs_to_its_level(share):
    level = (np.diag([1.0, share]), np.array([0.5, share]))
    lower = (np.array([[0.0, 1.0]]), np.array([-3.0]))
    np.testing.assert_allclose(solved([level, lower]), [0.5, 1.0], rtol=1e-9)


@pytest.mark.parametrize('share', [0.0, 1e-10, 1e-14])
def test_a_direction_out_of_reach_is_left_to_the_lower_levels(share):
    level = (np.diag([1.0, share]), np.array([0.5, 1.0]))
    lower = (np.array([[0.0, 1.0]]), np.array([-3.0]))
    np.testing.assert_allclose(solved([level, lower]), [0.5, -3.0], rtol=1e-9)


def test_solving_leaves_its_input_alone():
    levels = random_levels(6, 4, [2, 3])
    before = [(J.copy(), velocity.copy()) for J, velocity in levels]
    solved(levels, 0.1)
    for level, copies in zip(levels, before, strict=True):
        np.testing.assert_array_equal(level[0], copies[0])
        np.testing.assert_array_equal(level[1], copies[1])


@pytest.mark.parametrize('damping', [-0.1, float('nan'), float('inf')])
def test_a_damping_that_is_negative_or_not_finite_is_refused(damping):
    solver = RecursiveSolver(3, Inverse(damping=0.2))
    with pytest.raises(InvalidValue, match='at least 0') as caught:
        solver.damping = damping
    assert caught.value.key == 'solver.damping'
    assert solver.damping == 0.2


@pytest.mark.parametrize('damping', [0.0, 0.1])
def test_a_level_of_nothing_but_rounding_asks_for_nothing(damping):
    """Such as the height of a planar arm on a tilted base."""
    upper, lower = random_levels(8, 4, [2, 2])
    noise = (1e-16 * random_levels(9, 4, [2])[0][0], np.ones(2))
    expected = solved([upper, lower], damping)
    for levels in ([noise, upper, lower], [upper, noise, lower]):
        np.testing.assert_allclose(solved(levels, damping), expected, atol=1e-12)


@pytest.mark.parametrize('bad', [np.nan, np.inf])
@pytest.mark.parametrize('saturation', ['uniform', 'null_space'])
@pytest.mark.parametrize('place', [0, 1])
def test_a_level_that_is_not_finite_is_refused_and_not_left_out(place, saturation, bad):
    for part in (0, 1):
        levels = random_levels(10, 4, [2, 2])
        levels[place][part].flat[1] = bad
        with pytest.raises(np.linalg.LinAlgError):
            resolve(RecursiveSolver(4, saturation=saturation), levels, 1.0)
