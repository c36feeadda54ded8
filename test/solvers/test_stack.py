import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from random_stacks import AXES, arms, examples, gains, nonzero_vectors, parameters, states, vectors
from small_arms import planar_block, wrist_block

from tp_controller import InvalidValue, build_settings


@st.composite
def stacks_in_a_state(draw):
    block = draw(parameters())
    return block, draw(states(len(block['robot']['joints'])))


def planar_stack(hierarchy=('tip', 'first'), **tip):
    """Stack of a planar arm with an idle task called spare."""
    block = {
        'robot': planar_block(0.75, 0.5, 0.5),
        'hierarchy': list(hierarchy),
        'tasks': {
            'tip': {'type': 'position', 'frame': 'link_3', 'axes': 'xy'} | tip,
            'first': {'type': 'joint', 'joints': ['joint_1']},
            'spare': {'type': 'orientation', 'frame': 'link_3', 'axes': 'z'},
        },
    }
    return build_settings(block).stack


def level_jacobian(stack, level):
    return np.vstack([stack.tasks[name].J for name in level.tasks])


@given(stacks_in_a_state())
@examples(80)
def test_requested_is_gain_times_error_plus_feedforward_and_achieved_is_j_times_command(case):
    block, q = case
    stack = build_settings(block).stack
    result = stack.step(q)
    for level in result.levels:
        tasks = [stack.tasks[name] for name in level.tasks]
        requested = [task.gain @ task.error + task.feedforward for task in tasks]
        np.testing.assert_allclose(level.requested, np.concatenate(requested), atol=1e-12)
        achieved = level_jacobian(stack, level) @ result.command
        size = max(1.0, float(np.abs(achieved).max()))
        np.testing.assert_allclose(level.achieved, achieved, atol=1e-12 * size)


@given(stacks_in_a_state())
@examples(40)
def test_the_velocities_of_a_task_are_its_rows_of_its_level(case):
    block, q = case
    stack = build_settings(block).stack
    result = stack.step(q)
    for i, level in enumerate(result.levels):
        parts = [stack.velocities_of(name) for name in level.tasks]
        assert [stack.level_of(name) for name in level.tasks] == [i] * len(level.tasks)
        assert [len(part[0]) for part in parts] == [stack.tasks[name].k for name in level.tasks]
        np.testing.assert_array_equal(np.concatenate([p[0] for p in parts]), level.requested)
        np.testing.assert_array_equal(np.concatenate([p[1] for p in parts]), level.achieved)


@given(stacks_in_a_state())
@examples(60)
def test_idle_tasks_do_not_influence_the_command(case):
    block, q = case
    listed = [name for level in block['hierarchy'] for name in level.split(' + ')]
    alone = block | {'tasks': {name: block['tasks'][name] for name in listed}}
    assert len(alone['tasks']) < len(block['tasks'])
    np.testing.assert_array_equal(
        build_settings(block).stack.step(q).command, build_settings(alone).stack.step(q).command
    )


@given(stacks_in_a_state())
@examples(40)
def test_a_step_depends_on_nothing_but_the_configuration(case):
    block, q = case
    used = build_settings(block).stack
    for other in (q + 1.0, -q):
        used.step(other)
    np.testing.assert_array_equal(
        used.step(q).command, build_settings(block).stack.step(q).command
    )


@st.composite
def poses_and_their_parts(draw):
    """A pose task, and the same as a position and an orientation task on one level."""
    robot = draw(arms(min_joints=2))
    frame = f'link_{draw(st.integers(1, len(robot["joints"])))}'
    position_axes, orientation_axes = draw(st.sampled_from(AXES)), draw(st.sampled_from(AXES))
    m, k = len(position_axes), len(position_axes) + len(orientation_axes)
    point = draw(vectors(m, 2))
    turn = draw(vectors(1, 3) if k - m == 1 else nonzero_vectors(4))
    upper = draw(gains(m).filter(lambda values: len(values) == m * m))
    lower = draw(gains(k - m).filter(lambda values: len(values) == (k - m) ** 2))
    feedforward = draw(vectors(k, 1))
    K = np.zeros((k, k))
    K[:m, :m], K[m:, m:] = np.reshape(upper, (m, m)), np.reshape(lower, (k - m, k - m))
    pose = {
        'type': 'pose',
        'frame': frame,
        'position_axes': position_axes,
        'orientation_axes': orientation_axes,
        'target': point + turn,
        'gain': K.ravel().tolist(),
        'feedforward': feedforward,
    }
    parts = {
        'position': {
            'type': 'position',
            'frame': frame,
            'axes': position_axes,
            'target': point,
            'gain': upper,
            'feedforward': feedforward[:m],
        },
        'orientation': {
            'type': 'orientation',
            'frame': frame,
            'axes': orientation_axes,
            'target': turn,
            'gain': lower,
            'feedforward': feedforward[m:],
        },
    }
    return robot, pose, parts, draw(states(len(robot['joints'])))


@given(poses_and_their_parts())
@examples(60)
def test_two_tasks_on_one_level_are_one_stacked_task(case):
    robot, pose, parts, q = case
    one = {'robot': robot, 'hierarchy': ['pose'], 'tasks': {'pose': pose}}
    two = {'robot': robot, 'hierarchy': ['position + orientation'], 'tasks': parts}
    stacked, joined = (build_settings(block).stack.step(q) for block in (one, two))
    size = max(1.0, float(np.abs(stacked.command).max()))
    assert joined.levels[0].tasks == ('position', 'orientation')
    np.testing.assert_allclose(joined.command, stacked.command, atol=1e-10 * size)
    for name in ('requested', 'achieved'):
        np.testing.assert_allclose(
            getattr(joined.levels[0], name), getattr(stacked.levels[0], name), atol=1e-10 * size
        )


def test_tasks_without_a_target_hold_the_first_configuration():
    stack = planar_stack()
    q = np.array([0.1, 0.6, 0.3])
    result = stack.step(q)
    np.testing.assert_allclose(result.command, np.zeros(3), atol=1e-12)
    for task in stack.tasks.values():
        np.testing.assert_allclose(task.target, task.current, atol=1e-12)
    targets = [task.target for task in stack.tasks.values()]
    stack.step(q + 0.2)
    for task, target in zip(stack.tasks.values(), targets, strict=True):
        np.testing.assert_array_equal(task.target, target)


def test_a_target_given_before_the_first_step_is_kept():
    stack = planar_stack(target=[1.0, 0.5])
    stack.step(np.zeros(3))
    np.testing.assert_array_equal(stack.tasks['tip'].target, [1.0, 0.5])


def arrays_of(result):
    levels = [(level.requested, level.achieved) for level in result.levels]
    return [result.command, *(array for level in levels for array in level)]


def test_the_arrays_of_a_step_are_the_callers_own():
    stack = planar_stack()
    result = stack.step(np.array([0.1, 0.6, 0.3]))
    kept = [array.copy() for array in arrays_of(result)]
    for array, before in zip(arrays_of(stack.step(np.array([1.0, -0.6, 0.3]))), kept, strict=True):
        assert not np.array_equal(array, before)
    for array, before in zip(arrays_of(result), kept, strict=True):
        np.testing.assert_array_equal(array, before)
        array[:] = 7.0
    for array, before in zip(arrays_of(stack.step(np.array([0.1, 0.6, 0.3]))), kept, strict=True):
        np.testing.assert_array_equal(array, before)


def test_what_a_step_in_place_hands_out_cannot_be_written():
    stack = planar_stack()
    result = stack.step_in_place(np.zeros(3))
    arrays = [result.command, *stack.velocities_of('tip')]
    for level in result.levels:
        arrays += [level.requested, level.achieved]
    for array in arrays:
        with pytest.raises(ValueError, match='read-only'):
            array[0] = 1.0


@pytest.mark.parametrize(
    ('hierarchy', 'fragments'),
    [
        (['', ''], ["''", 'tip, first, spare']),
        (['elbow'], ["'elbow'", 'tip, first, spare']),
        (['tip', ''], ["''", 'tip, first, spare']),
        (['tip + '], ["''", 'joined by +']),
        (['tip first'], ["'tip first'", 'joined by +']),
        (['tip', 'first', 'tip'], ["'tip' twice", 'every task once']),
        (['tip + tip'], ["'tip' twice", 'every task once']),
    ],
)
def test_a_hierarchy_that_cannot_be_used_is_refused_and_the_old_one_stays(hierarchy, fragments):
    stack = planar_stack()
    before = stack.step(np.array([0.1, 0.6, 0.3])).command.copy()
    with pytest.raises(InvalidValue) as caught:
        stack.hierarchy = hierarchy
    assert caught.value.key == 'hierarchy'
    assert all(fragment in str(caught.value) for fragment in fragments)
    assert stack.hierarchy == ('tip', 'first')
    np.testing.assert_array_equal(stack.step(np.array([0.1, 0.6, 0.3])).command, before)


@pytest.mark.parametrize('level', ['tip + first', 'tip+first', ' tip +first '])
def test_spaces_around_the_plus_do_not_matter(level):
    stack = planar_stack([level, 'spare'])
    assert stack.hierarchy == ('tip + first', 'spare')
    assert [stack.level_of(name) for name in ('tip', 'first', 'spare')] == [0, 0, 1]


def test_an_idle_task_has_no_level():
    assert planar_stack().level_of('spare') == -1


def test_a_rotation_in_space_settles_by_the_shortest_way():
    """Integrated, the error of a three-axis orientation falls without a detour."""
    block = {
        'robot': wrist_block(),
        'solver': {'damping': 0.0},
        'hierarchy': ['turn'],
        'tasks': {'turn': {'type': 'orientation', 'frame': 'link_3', 'target': [0, 1, 0, 1]}},
    }
    stack = build_settings(block).stack
    q, dt = np.array([0.2, 0.4, -0.3]), 0.01
    start = None
    for i in range(500):
        q = q + dt * stack.step(q).command
        error = stack.tasks['turn'].error.copy()
        start = error if start is None else start
        np.testing.assert_allclose(error, start * (1.0 - dt) ** i, atol=2e-2)
    assert math.isclose(np.linalg.norm(error), 0.0, abs_tol=1e-2)
