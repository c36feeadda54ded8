"""Experiment C: schemes for redundancy, on the library."""

from pathlib import Path

import numpy as np
import pytest

from tp_controller import build_settings, read_parameter_file

CONFIG = Path(__file__).resolve().parents[2] / 'config'


def experiment(name, **changes):
    """Stack, first configuration and step [s] of a parameter file."""
    path = CONFIG / f'{name}.yaml'
    simulator = read_parameter_file(path, 'tp_sim')
    parameters = read_parameter_file(path, 'tp_controller') | changes
    q = np.array(simulator['initial_positions'])
    return build_settings(parameters).stack, q, 1.0 / simulator['rate']


def run(stack, q, dt, seconds, before=lambda time: None):
    """Configurations (N + 1, n) of a run."""
    path = [q]
    for i in range(round(seconds / dt)):
        before(i * dt)
        path.append(path[-1] + dt * stack.step(path[-1]).command)
    stack.step(path[-1])
    return np.array(path)


def go_round(stack, q, radius, period):
    """Function of time that moves the target of the tip on a circle, from where it is."""
    stack.step(q)
    tip = stack.tasks['tip']
    centre = tip.current - [radius, 0.0]

    def move(time):
        angle = 2.0 * np.pi * time / period
        arm = radius * np.array([np.cos(angle), np.sin(angle)])
        tip.target = centre + arm
        tip.feedforward = np.array([-arm[1], arm[0]]) * 2.0 * np.pi / period

    return move


def at(path, dt, time):
    """Configuration at a time between two steps."""
    i = int(time / dt)
    share = time / dt - i
    return path[i] if share == 0.0 else (1.0 - share) * path[i] + share * path[i + 1]


# tip target, scheme, error of the tip and of the last link with the tolerances of the figures
C1 = [
    ([2.5, 1.2], 'augmented', (0.0, 1e-5), (0.0, 1e-5)),
    ([2.5, 1.2], 'extended_jacobian', (0.0, 1e-5), (0.0, 1e-5)),
    ([2.5, 1.2], 'recursive', (0.0, 1e-5), (0.0, 1e-5)),
    ([3.3, 1.0], 'augmented', (0.151, 5e-4), (0.149, 5e-4)),
    ([3.3, 1.0], 'extended_jacobian', (0.151, 5e-4), (0.149, 5e-4)),
    ([3.3, 1.0], 'recursive', (0.0, 1e-5), (0.305, 5e-4)),
]


@pytest.mark.parametrize(('target', 'scheme', 'tip', 'last_link'), C1)
def test_c1_errors_at_and_away_from_the_algorithmic_singularity(target, scheme, tip, last_link):
    stack, q, dt = experiment('c1_algorithmic_singularity', **{'solver.type': scheme})
    stack.tasks['tip'].target = target
    run(stack, q, dt, 20.0)
    for name, (expected, tolerance) in (('tip', tip), ('last_link', last_link)):
        error = float(np.linalg.norm(stack.tasks[name].error))
        assert error == pytest.approx(expected, abs=tolerance)


@pytest.mark.parametrize('scheme', ['augmented', 'extended_jacobian', 'recursive'])
def test_c2_the_macro_joints_stay_still_while_the_micro_joints_work(scheme):
    stack, q, dt = experiment('c2_macro_micro', **{'solver.type': scheme})
    path = run(stack, q, dt, 10.0, go_round(stack, q, 0.05, 5.0))
    assert np.abs(path[:, :2] - q[:2]).max() < 1e-6
    assert np.abs(path[:, 2:] - q[2:]).max() > 0.1
    assert np.linalg.norm(stack.tasks['tip'].error) < 1e-3


def test_c2_the_augmented_jacobian_is_block_triangular():
    """The carrier's rows have no columns for the micro joints."""
    stack, q, _ = experiment('c2_macro_micro')
    stack.step(q)
    assert not stack.tasks['carrier'].J[:, 2:].any()
    assert np.abs(stack.tasks['tip'].J).min() > 0.01


def test_c3_the_pseudo_inverse_drifts_by_the_published_angles():
    stack, q, dt = experiment('c3_repeatability', **{'solver.type': 'recursive'})
    path = run(stack, q, dt, 20.0 * np.pi, go_round(stack, q, 0.3, 2.0 * np.pi))
    drifts = [np.linalg.norm(at(path, dt, 2.0 * np.pi * i) - q) for i in (1, 10)]
    assert drifts == pytest.approx([0.0091, 0.083], rel=6e-3)


def test_c3_the_extended_jacobian_returns_after_every_cycle():
    """At half the published rate."""
    stack, q, dt = experiment('c3_repeatability')
    dt *= 2.0
    path = run(stack, q, dt, 20.0 * np.pi, go_round(stack, q, 0.3, 2.0 * np.pi))
    ends = [at(path, dt, 2.0 * np.pi * i) for i in range(1, 11)]
    assert max(np.linalg.norm(end - ends[0]) for end in ends) < 1e-4
    assert np.linalg.norm(ends[0] - q) < 1e-4
