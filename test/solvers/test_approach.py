"""Levels approach their targets no faster than joints can brake there."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from random_stacks import examples, numbers, positive_vectors, states, vectors
from small_arms import planar_block

from tp_controller import build_settings
from tp_controller.config import read_parameter_file

RATE = 100.0
ENOUGH = 1e-3
"""Largest overshoot [rad, m]."""


def posture(gain, acceleration, target, settle=True):
    return {
        'rate': RATE,
        'robot': planar_block(1.0, 0.8, 0.5) | {'limits': {'acceleration': acceleration}},
        'solver': {'settle': settle},
        'hierarchy': ['posture'],
        'tasks': {'posture': {'type': 'posture', 'target': target, 'gain': gain}},
    }


def errors_of(stack, task, q, steps):
    """Errors (steps, k) of a task while the arm follows its commands."""
    found = []
    for _ in range(steps):
        command = stack.step(q).command
        found.append(stack.tasks[task].error.copy())
        q = q + command / RATE
    return np.array(found)


@given(states(3), vectors(3, 2), positive_vectors(3, 1.0, 20.0), numbers(1.0, 50.0))
@examples(25)
def test_no_joint_goes_beyond_its_target(q, target, acceleration, gain):
    stack = build_settings(posture([gain], acceleration, target)).stack
    errors = errors_of(stack, 'posture', np.array(q), 1500)
    start = np.sign(errors[0])
    assert (errors * start).min() > -1e-9
    assert np.abs(errors[-1]).max() < ENOUGH


def test_joints_go_beyond_their_targets_by_the_published_law_alone():
    q, target = np.zeros(3), [1.0, 0.0, 0.0]
    by = {}
    for settle in (True, False):
        stack = build_settings(posture([40.0], [5.0], target, settle)).stack
        by[settle] = -errors_of(stack, 'posture', q, 400)[:, 0].min()
    assert by[True] < 1e-9
    assert by[False] > 0.1


@given(positive_vectors(3, 10.0, 50.0), positive_vectors(3, 2.0, 20.0), vectors(3, 1))
@examples(15)
def test_with_different_gains_every_row_gets_to_its_target(gains, acceleration, target):
    stack = build_settings(posture(gains, acceleration, target)).stack
    errors = errors_of(stack, 'posture', np.zeros(3), 1500)
    assert np.abs(errors[-1]).max() < ENOUGH


@pytest.mark.parametrize('share', [0.1, 0.5])
@pytest.mark.parametrize('levels', [['hand_position'], ['hand_position', 'posture']])
@pytest.mark.parametrize('seed', range(3))
def test_the_hand_of_a_panda_does_not_go_beyond_its_target(config, share, levels, seed):
    values = read_parameter_file(config / 'panda.yaml', 'tp_controller')
    values |= {'rate': RATE, 'hierarchy': levels}
    for task in ('hand_position', 'hand_orientation', 'posture'):
        values[f'tasks.{task}.gain'] = [share * RATE]
    stack = build_settings(values).stack
    random = np.random.default_rng(seed)
    q = np.array([0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785]) + random.uniform(-0.2, 0.2, 7)
    stack.step(q)
    # Targets that all levels can have at once.
    stack.robot.update(q + random.uniform(-0.6, 0.6, 7))
    for task in stack.tasks.values():
        task.update()
        task.hold()
    errors = errors_of(stack, 'hand_position', q, 400)
    along = errors @ errors[0] / np.linalg.norm(errors[0])
    assert along.min() > -ENOUGH
    assert np.linalg.norm(errors[-1]) < ENOUGH


def test_feedforward_is_not_slowed_down():
    block = posture([40.0], [5.0], [0.3, 0.0, 0.0])
    block['tasks']['posture']['feedforward'] = [0.4, 0.0, 0.0]
    stack = build_settings(block).stack
    task, requested = stack.tasks['posture'], stack.velocities_of('posture')[0]
    q = np.zeros(3)
    for _ in range(200):
        command = stack.step(q).command
        share = (requested[0] - 0.4) / (40.0 * task.error[0]) if task.error[0] else 1.0
        assert -1e-12 <= share <= 1.0 + 1e-12
        q = q + command / RATE


@given(st.data())
@examples(20)
def test_without_limits_of_acceleration_nothing_changes(data):
    q, target = data.draw(states(3)), data.draw(vectors(3, 2))
    commands = []
    for settle in (True, False):
        block = posture([20.0], [1.0], target, settle)
        block['robot']['limits'] = {'velocity': [3.0]}
        commands.append(build_settings(block).stack.step(np.array(q)).command.copy())
    np.testing.assert_array_equal(*commands)
