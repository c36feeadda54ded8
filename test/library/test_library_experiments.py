"""Experiments A1 to A5 by integrating the library's commands, without ROS."""

import math
from pathlib import Path

import numpy as np
import pytest
from planar_config import changed

from tp_controller import build_settings, read_parameter_file

CONFIG = Path(__file__).resolve().parents[2] / 'config'
RATE = 60.0
PI = math.pi


class Experiment:
    """A configuration in closed loop with a perfect velocity-controlled arm."""

    def __init__(self, name, **changes):
        path = CONFIG / f'{name}.yaml'
        parameters = read_parameter_file(path, 'tp_controller')
        parameters |= {key.replace('__', '.'): value for key, value in changes.items()}
        self.stack = build_settings(parameters).stack
        self.q = np.array(read_parameter_file(path, 'tp_sim')['initial_positions'])

    def step(self):
        self.q = self.q + self.stack.step(self.q).command / RATE

    def run(self, seconds):
        for _ in range(round(seconds * RATE)):
            self.step()

    def errors(self):
        """Norm of the present error of every task of the hierarchy."""
        self.stack.step(self.q)
        return [float(np.linalg.norm(self.stack.tasks[name].error)) for name in self.tasks]

    @property
    def tasks(self):
        return [name for level in self.stack.hierarchy for name in level.split(' + ')]


ORIENTATION_PI = {'tasks__ee_orientation__target': [PI]}


@pytest.mark.parametrize(
    ('name', 'changes', 'at_0', 'at_5', 'at_10'),
    [
        ('a1_position', {}, ['0.5044'], ['0.0037'], ['<1e-4']),
        ('a2_configuration', {}, ['0.8393'], ['0.0058'], ['<1e-4']),
        (
            'a3_position_orientation',
            {},
            ['0.5044', '0.6708'],
            ['0.0038', '0.0045'],
            ['<1e-4', '<1e-4'],
        ),
        (
            'a3_position_orientation',
            ORIENTATION_PI,
            ['0.5044', '2.2416'],
            ['0.007', '1.07'],
            ['<1e-4', '1.05'],
        ),
        ('a4_position_joint', {}, ['0.5044', '0'], ['0.0055', '0.0015'], ['<1e-4', '<1e-4']),
    ],
    ids=['A1', 'A2', 'A3', 'A3 that cannot both hold', 'A4'],
)
def test_errors_are_those_of_the_table_to_its_last_digit(name, changes, at_0, at_5, at_10):
    experiment = Experiment(name, **changes)
    # The figures are those of the published laws.
    experiment.stack.settle = False
    for expected in (at_0, at_5, at_10):
        for error, printed in zip(experiment.errors(), expected, strict=True):
            if printed.startswith('<'):
                assert error < float(printed[1:])
            else:
                decimals = len(printed.partition('.')[2])
                assert round(error, decimals) == float(printed)
        experiment.run(5.0)


def test_a_task_that_cannot_hold_does_not_disturb_the_one_above_it():
    experiment = Experiment('a3_position_orientation', **ORIENTATION_PI)
    experiment.run(60.0)
    position, orientation = experiment.errors()
    assert position < 1e-9
    assert orientation > 1.0


@pytest.mark.parametrize(('gain', 'seconds'), [(1.0, 4.27), (3.0, 1.92), (6.0, 1.42)])
def test_the_position_settles_in_the_time_that_its_gain_gives(gain, seconds):
    experiment = Experiment('a5_link_orientation', tasks__ee_position__gain=[gain])
    steps = 0
    while experiment.errors()[0] >= 0.01:
        experiment.step()
        steps += 1
    assert round(steps / RATE, 2) == seconds


def test_the_orientation_of_an_inner_link_settles_below_the_position():
    experiment = Experiment('a5_link_orientation')
    experiment.run(20.0)
    assert max(experiment.errors()) < 1e-3
    q = experiment.q
    assert math.remainder(q[0] + q[1], 2 * PI) == pytest.approx(0.0, abs=1e-3)


def tracking_error(feedforward, gain):
    """Position error after 8 s behind a moving target, and the target's velocity."""
    velocity = np.array([-0.05, 0.08])
    parameters = changed({'solver.damping': 0.0, 'hierarchy': ['tip'], 'tasks.tip.gain': [gain]})
    stack = build_settings(parameters).stack
    tip = stack.tasks['tip']
    tip.feedforward = velocity if feedforward else [0.0, 0.0]
    start, q, dt = np.array([1.0, 0.5]), np.array([0.0, 0.6, 0.3]), 0.004
    for i in range(2000):
        tip.target = start + velocity * i * dt
        q = q + dt * stack.step(q).command
    return tip.error.copy(), velocity


@pytest.mark.parametrize('gain', [1.0, 2.0])
def test_the_tracking_error_of_a_moving_target_vanishes_with_the_matching_feedforward(gain):
    error, _ = tracking_error(feedforward=True, gain=gain)
    assert np.linalg.norm(error) < 5e-4


@pytest.mark.parametrize('gain', [1.0, 2.0])
def test_without_feedforward_the_tracking_error_is_velocity_over_gain(gain):
    error, velocity = tracking_error(feedforward=False, gain=gain)
    np.testing.assert_allclose(error, velocity / gain, atol=5e-4)
