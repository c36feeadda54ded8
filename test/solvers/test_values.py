"""The step as values: states, rows of tasks and problems, without a trace in what made them."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from random_stacks import (
    arms,
    examples,
    numbers,
    parameters,
    planar_arms,
    positive_vectors,
    states,
)
from value_cases import HIERARCHIES, PERIOD, every_task, near_edges, spatial

from tp_controller import (
    InvalidValue,
    Inverse,
    PositionTask,
    PostureTask,
    Robot,
    SafetyFilter,
    Stack,
    UnusableState,
    build_settings,
    solve,
    solver_of,
)
from tp_controller.robot import Response

seeds = st.integers(0, 2**32 - 1)
KINDS = tuple(every_task(spatial()))
PINV, SMALL, NEAR = Inverse('pinv'), Inverse('dls', 0.05), Inverse('adaptive', 0.1, 0.1)


@given(seeds)
@examples(20)
def test_a_state_has_the_frames_of_its_configuration_whatever_the_robot_does(seed):
    rng = np.random.default_rng(seed)
    robot = spatial()
    q, other = rng.uniform(-2.0, 2.0, (2, 6))
    robot.update(q)
    expected = [
        (robot.frame(name).position.copy(), robot.frame(name).rotation.copy())
        for name in robot.frames
    ]
    jacobians = [robot.frame(name).jacobian.copy() for name in robot.frames]
    robot.update(other)
    state = robot.state(q)
    np.testing.assert_array_equal(robot.q, other)
    robot.update(-q)
    given_q, q = q, q.copy()
    given_q[:] = 0.0
    np.testing.assert_array_equal(state.q, q)
    assert state.frames == robot.frames
    for name, (position, rotation), jacobian in zip(
        robot.frames, expected, jacobians, strict=True
    ):
        np.testing.assert_array_equal(state.position(name), position)
        np.testing.assert_array_equal(state.rotation(name), rotation)
        np.testing.assert_array_equal(state.jacobian(name), jacobian)
        assert (state.position(name).shape, state.rotation(name).shape) == ((3,), (3, 3))
        assert state.jacobian(name).shape == (6, robot.n)


def test_arrays_of_a_state_cannot_be_written_to():
    state = spatial().state(np.zeros(6))
    for array in (state.q, state.position('link_3'), state.jacobian('link_3')):
        with pytest.raises(ValueError, match='read-only'):
            array[:] = 0.0


@pytest.mark.parametrize('q', [[0.0] * 5, [np.nan] * 6, ['a'] * 6])
def test_what_is_no_configuration_is_refused(q):
    with pytest.raises(InvalidValue) as error:
        spatial().state(q)
    assert error.value.key == 'q'


def test_frames_and_robots_that_do_not_belong_to_a_state_are_refused():
    robot, other = spatial(), spatial()
    with pytest.raises(InvalidValue, match='link_9'):
        robot.state(np.zeros(6)).position('link_9')
    task = PositionTask('tip', robot, 'link_6')
    with pytest.raises(InvalidValue, match='state of another robot'):
        task.rows(other.state(np.zeros(6)))
    with pytest.raises(InvalidValue, match='state of another robot'):
        Stack(robot, [task]).problem(other.state(np.zeros(6)))


@given(seeds, st.sampled_from(['planar', 'differential', 'floating']))
@examples(15)
def test_states_of_mobile_robots_have_their_configuration(seed, base):
    rng = np.random.default_rng(seed)
    robot = Robot.from_dh([0.4, 0.3], base=base)
    q = robot.integrate(robot.neutral, rng.uniform(-1.0, 1.0, robot.n))
    state = robot.state(q)
    robot.update(q)
    np.testing.assert_array_equal(state.jacobian('link_2'), robot.frame('link_2').jacobian)
    assert state.jacobian('link_2').shape == (6, robot.n)


def arrays_of(task):
    """All numbers that a task and what it is made of holds."""
    found = [task.target, task.feedforward, task.gain]
    for owner in task.memory:
        for value in vars(owner).values():
            # What coal keeps of its last call is computed anew before it is used.
            if isinstance(value, np.ndarray) and value.flags.writeable:
                found.append(value.copy())
    return found


@pytest.mark.parametrize('kind', KINDS)
def test_rows_are_those_of_an_update_there_and_leave_no_trace(kind):
    rng = np.random.default_rng(5)
    robot = spatial()
    tasks, twins = every_task(robot), every_task(spatial())
    task, twin = tasks[kind], twins[kind]
    for _ in range(20):
        here, there = near_edges(rng), near_edges(rng)
        for one in (task, twin):
            one.robot.update(here)
            if one.target_size and one.target is None:
                one.hold()
            one.update()
        before = arrays_of(task)
        level = task.rows(robot.state(there))
        np.testing.assert_array_equal(robot.q, here)
        for one, other in zip(before, arrays_of(task), strict=True):
            np.testing.assert_array_equal(one, other)
        velocity = np.zeros(task.k)
        if kind == 'jumpy':
            twin.on[:] = task.on
        twin.robot.update(there)
        twin.update()
        twin.desired_velocity(velocity)
        J, asked = (level.C, level.least) if task.one_sided else (level.J, level.velocity)
        np.testing.assert_array_equal(J, twin.J)
        np.testing.assert_array_equal(asked, velocity)
        assert level.tasks == (kind,)
        assert level.row_names == tuple(f'{kind} {name}' for name in task.components)
        assert (level.inverse, level.weight) == (task.inverse, task.weight)


@pytest.mark.parametrize('kind', ['tip', 'gap', 'posture'])
def test_a_task_without_a_target_asks_for_rest_at_the_state_and_has_none_afterwards(kind):
    robot = spatial()
    task = every_task(robot)[kind]
    task.forget_target()
    robot.update(np.full(6, 0.3))
    level = task.rows(robot.state(np.full(6, -0.4)))
    np.testing.assert_allclose(level.velocity, 0.0, atol=1e-12)
    assert task.target is None
    # The next target counts, also in arrays that compiled code keeps.
    task.hold()
    task.update()
    np.testing.assert_allclose(task.error, 0.0, atol=1e-12)


def test_contacts_that_a_state_shows_are_found_anew_by_the_first_step():
    robot = spatial()
    task = every_task(robot)['wall']
    bent = robot.state(np.zeros(6))
    task.target = bent.position('link_6').tolist()
    task.rows(bent)
    assert task.take_notices() == []
    task.update()
    assert task.take_notices()


def stack_of(seed, hierarchy, scheme, inverse, acceleration, settle=False):
    rng = np.random.default_rng(seed)
    robot = spatial(acceleration=acceleration)
    tasks = every_task(robot)
    tasks['tip'].target = rng.uniform(-0.8, 0.8, 3)
    tasks['posture'].target = rng.uniform(-1.0, 1.0, 6)
    tasks['gap'].target, tasks['elbow'].target = [0.6], [0.5, -0.5]
    tasks['elbow'].feedforward = rng.uniform(-1.0, 1.0, 2)
    names = {name for level in hierarchy for name in level.split(' + ')}
    stack = Stack(
        robot,
        [tasks[hierarchy[0].split(' + ')[0]]],
        solver_of(scheme, robot.n, inverse=inverse),
        1.0 / PERIOD,
        [task for name, task in tasks.items() if name in names],
        settle,
    )
    stack.hierarchy = hierarchy
    return stack, rng


@given(
    seeds,
    st.sampled_from(HIERARCHIES),
    st.sampled_from(['recursive', 'hqp']),
    st.sampled_from([PINV, SMALL, NEAR]),
    st.sampled_from([None, 20.0]),
)
@examples(150)
def test_a_stack_answers_its_problem(seed, hierarchy, scheme, inverse, acceleration):
    stack, rng = stack_of(seed, hierarchy, scheme, inverse, acceleration)
    q = near_edges(rng)
    for _ in range(4):
        problem = stack.problem(q)
        answer = solve(problem, **stack.solver.settings)
        command = stack.step(q).command
        size = max(1.0, float(np.abs(answer.velocity).max()))
        np.testing.assert_allclose(answer.velocity, stack.answer, atol=1e-7 * size)
        assert answer.scale == pytest.approx(stack.solver.shares.min(), abs=1e-6) or (
            scheme == 'hqp'
        )
        q = q + PERIOD * command


@st.composite
def random_stacks(draw, scheme):
    """A stack of a random arm with a random hierarchy, joint limits on top, and a state."""
    robots = arms(min_joints=2, max_joints=7) | planar_arms(min_joints=2)
    block = draw(parameters(robots=robots, dampings=st.just(0.0) | numbers(0.05, 1)))
    n = len(block['robot']['joints'])
    limits = {'velocity': draw(positive_vectors(n, 0.05, 2))}
    if draw(st.booleans()):
        limits['acceleration'] = draw(positive_vectors(n, 1, 20))
    block['robot'] = block['robot'] | {'limits': limits}
    ends = {'type': 'joint_limits', 'min': [-3.0], 'max': [3.0]}
    block |= {
        'rate': 100.0,
        'hierarchy': ['ends', *block['hierarchy']],
        'tasks': block['tasks'] | {'ends': ends},
        'solver': block['solver'] | {'type': scheme, 'settle': False},
    }
    return build_settings(block).stack, draw(states(n))


@pytest.mark.parametrize('scheme', ['recursive', 'hqp'])
@given(st.data())
@examples(80)
def test_stacks_of_random_arms_answer_their_problems(scheme, data):
    stack, q = data.draw(random_stacks(scheme))
    for _ in range(2):
        answer = solve(stack.problem(q), **stack.solver.settings).velocity
        command = stack.step(q).command
        size = max(1.0, float(np.abs(answer).max()))
        np.testing.assert_allclose(answer, stack.answer, atol=1e-7 * size)
        q = q + 0.01 * command


@given(seeds, st.sampled_from(HIERARCHIES), st.sampled_from(['recursive', 'hqp']))
@examples(60)
def test_a_problem_leaves_no_trace_in_the_steps_of_its_stack(seed, hierarchy, scheme):
    stacks = [stack_of(seed, hierarchy, scheme, SMALL, 20.0, True)[0] for _ in range(2)]
    rng = np.random.default_rng(seed)
    q = near_edges(rng)
    for i in range(4):
        for _ in range(i):
            stacks[0].problem(near_edges(rng))
        stacks[0].problem(stacks[0].robot.state(q))
        steps = [stack.step(q) for stack in stacks]
        np.testing.assert_array_equal(steps[0].command, steps[1].command)
        for one, other in zip(steps[0].levels, steps[1].levels, strict=True):
            np.testing.assert_array_equal(one.requested, other.requested)
        q = q + PERIOD * steps[0].command


@given(seeds, st.sampled_from(['weighted', 'augmented']))
@examples(30)
def test_tasks_of_one_level_keep_their_weights_in_a_problem(seed, scheme):
    stack, rng = stack_of(seed, ['tip + ball + elbow', 'posture'], scheme, SMALL, None)
    for task in stack.tasks.values():
        task.weight = rng.uniform(0.5, 3.0)
    stack.prepare_solver()
    q = near_edges(rng)
    answer = solve(stack.problem(q), **stack.solver.settings).velocity
    stack.step(q)
    np.testing.assert_allclose(answer, stack.answer, atol=1e-7)


def test_a_late_arm_is_asked_where_it_gets_to_and_goes_on_as_before():
    robots = [spatial(acceleration=20.0) for _ in range(2)]
    for robot in robots:
        robot.response = Response.of(6, delay=0.02, lag=0.01)
    stacks = [
        Stack(
            robot,
            [every_task(robot)['ends'], PostureTask('posture', robot, target=[1.0] * 6)],
            rate=1.0 / PERIOD,
            settle=False,
        )
        for robot in robots
    ]
    q, speed = np.zeros(6), np.zeros(6)
    for _ in range(30):
        problem = stacks[0].problem(q, PERIOD, speed)
        steps = [stack.step(q, PERIOD, speed) for stack in stacks]
        np.testing.assert_array_equal(steps[0].command, steps[1].command)
        answer = solve(problem, **stacks[0].solver.settings)
        np.testing.assert_allclose(answer.velocity, stacks[0].answer, atol=1e-8)
        speed = steps[0].command
        q = q + PERIOD * speed


def test_a_state_that_no_joint_can_have_makes_no_problem_and_no_trace():
    stack, _ = stack_of(1, HIERARCHIES[1], 'recursive', SMALL, 20.0)
    q = np.zeros(6)
    stack.step(q)
    with pytest.raises(UnusableState):
        stack.problem(q + 1e7, PERIOD)
    with pytest.raises(InvalidValue):
        stack.problem(np.full(6, np.nan))
    assert stack.step(q, PERIOD).command.any()


@given(seeds, st.sampled_from(HIERARCHIES))
@examples(30)
def test_piece_by_piece_the_command_is_that_of_the_stack(seed, hierarchy):
    pieces, whole = (stack_of(seed, hierarchy, 'recursive', SMALL, 20.0)[0] for _ in range(2))
    q = near_edges(np.random.default_rng(seed))
    for _ in range(5):
        wish = solve(pieces.problem(q), **pieces.solver.settings).velocity
        command = pieces.safety_filter.step(wish, q)
        np.testing.assert_allclose(command, whole.step(q).command, atol=1e-6)
        q = q + PERIOD * command


@given(seeds)
@examples(20)
def test_the_safety_filter_alone_keeps_all_limits_of_any_wish(seed):
    rng = np.random.default_rng(seed)
    robot = spatial(acceleration=20.0)
    safe = SafetyFilter(robot, PERIOD)
    safe.watch([every_task(robot)['ball']])
    q, before = np.zeros(6), np.zeros(6)
    for _ in range(100):
        command = safe.step(rng.uniform(-9.0, 9.0, 6), q, PERIOD)
        assert np.all(np.abs(command) <= 1.5 + 1e-9)
        assert np.all(np.abs(command - before) <= 20.0 * PERIOD + 1e-9)
        q, before = q + PERIOD * command, command
        assert np.all(np.abs(q) <= 2.6)
        state = robot.state(q)
        assert np.linalg.norm(state.position('link_6') - [0.5, 0.2, 0.4]) >= 0.2 - 1e-9


def test_the_safety_filter_refuses_what_is_no_wish_and_no_state():
    safe = SafetyFilter(spatial(), PERIOD)
    with pytest.raises(InvalidValue, match=r'shape \(5,\)'):
        safe.step(np.zeros(5), np.zeros(6))
    with pytest.raises(UnusableState):
        safe.step(np.zeros(6), np.full(6, np.inf))
