"""Experiment D: two small arms under the pseudo-inverse and its damped form."""

from pathlib import Path

import numpy as np
import pytest

from tp_controller import build_settings, read_parameter_file

CONFIG = Path(__file__).resolve().parents[2] / 'config'

# arm, damping, gain, final error norm, largest joint speed
TABLE = [
    ('d_rr', 0.0, 0.5, 0.135717, 0.190),
    ('d_rr', 0.0, 1.0, 0.130341, 0.381),
    ('d_rr', 0.0, 10.0, 0.130167, 3.81),
    ('d_rr', 0.01, 0.5, 0.135802, 0.189),
    ('d_rr', 0.01, 1.0, 0.130347, 0.379),
    ('d_rr', 0.01, 10.0, 0.130167, 3.79),
    ('d_prr', 0.0, 0.5, 0.004030, 0.283),
    ('d_prr', 0.0, 1.0, 0.000027, 0.565),
    ('d_prr', 0.0, 10.0, 0.0, 5.65),
    ('d_prr', 0.01, 0.5, 0.004032, 0.282),
    ('d_prr', 0.01, 1.0, 0.000027, 0.564),
    ('d_prr', 0.01, 10.0, 0.0, 5.64),
]


@pytest.mark.parametrize(('arm', 'damping', 'gain', 'error', 'speed'), TABLE)
def test_final_errors_and_largest_speeds_are_the_published_ones(arm, damping, gain, error, speed):
    values = read_parameter_file(CONFIG / f'{arm}.yaml', 'tp_controller')
    changes = {'solver.damping': damping, 'tasks.hand.gain': [gain]}
    stack = build_settings(values | changes).stack
    q = np.zeros(stack.robot.n)
    speeds = []
    for _ in range(10_000):
        qd = stack.step(q).command
        speeds.append(np.linalg.norm(qd))
        q = q + 0.001 * qd
    stack.step(q)
    assert np.linalg.norm(stack.tasks['hand'].error) == pytest.approx(error, abs=6e-7)
    assert max(speeds) == pytest.approx(speed, rel=5e-3)


@pytest.mark.parametrize('q', [[0.0, 0.0, 0.0], [0.3, 0.4, 0.5], [-0.1, 1.0, -0.7]])
def test_the_slide_of_the_prr_arm_moves_along_x(q):
    robot = build_settings(read_parameter_file(CONFIG / 'd_prr.yaml', 'tp_controller')).stack.robot
    robot.update(np.array(q))
    tip = robot.frame('link_3')
    x = 0.2 + q[0] + 0.1 * np.cos(q[1]) + 0.3 * np.cos(q[1] + q[2])
    y = 0.1 * np.sin(q[1]) + 0.3 * np.sin(q[1] + q[2])
    np.testing.assert_allclose(tip.position, [x, y, 0.0], atol=1e-12)
    angle = np.arctan2(tip.rotation[1, 0], tip.rotation[0, 0])
    np.testing.assert_allclose(angle, q[1] + q[2], atol=1e-12)
