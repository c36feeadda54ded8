"""Through a stretched arm: the claims of docs/schemes.md on config/singularity.yaml."""

import itertools
import math
import re
import runpy
from functools import cache

import numpy as np
import pytest
from plain_levels import resolve

from tp_controller import read_parameter_file
from tp_controller.solvers import Inverse, RecursiveSolver

DAMPINGS, REGIONS = (0.05, 0.1, 0.2), (0.1, 0.2, 0.4)


@pytest.fixture(scope='module')
def run(repository):
    """Run of an inverse; the same one is computed once."""
    return cache(runpy.run_path(str(repository / 'examples' / 'singularity.py'))['run'])


@pytest.fixture(scope='module')
def limit(repository):
    values = read_parameter_file(repository / 'config' / 'singularity.yaml', 'tp_controller')
    return float(values['robot.limits.velocity'][0])


CASES = [('pinv', None, None), *(('dls', damping, None) for damping in DAMPINGS)]
CASES += [('adaptive', *pair) for pair in itertools.product(DAMPINGS, REGIONS)]


@pytest.mark.parametrize('case', CASES, ids=str)
def test_every_command_is_finite_and_within_the_limits(run, limit, case):
    result = run(*case)
    assert np.isfinite(result.command).all()
    assert np.abs(result.command).max() <= limit


def test_the_target_leaves_the_reach_and_the_arm_comes_to_be_stretched(run):
    for case in CASES:
        result = run(*case)
        assert result.error.max() >= 0.005 - 1e-9
        start, smallest = result.singular_value[0], result.singular_value.min()
        # Damping keeps the arm a little bent; more of it, more.
        assert smallest < 0.3 * start
    assert run('pinv').singular_value.min() < 0.002


def test_the_pseudo_inverse_asks_for_far_more_than_the_limits_and_jumps(run):
    result = run('pinv')
    assert result.wanted.max() > 10.0
    assert result.largest_acceleration > 100.0


@pytest.mark.parametrize('region', REGIONS)
@pytest.mark.parametrize('damping', DAMPINGS)
def test_adaptive_damping_needs_no_scaling_and_tracks_better_than_constant_damping(
    run, damping, region
):
    adaptive, constant = run('adaptive', damping, region), run('dls', damping)
    assert adaptive.wanted.max() < 1.0
    assert (adaptive.scale == 1.0).all()
    assert adaptive.error.max() < constant.error.max()
    assert adaptive.rms_error < constant.rms_error


def test_with_the_damping_of_the_file_it_is_clearly_better(run):
    adaptive, constant = run('adaptive'), run('dls')
    assert adaptive.error.max() < 0.7 * constant.error.max()
    assert adaptive.rms_error < 0.5 * constant.rms_error


@pytest.mark.parametrize('damping', DAMPINGS)
def test_the_command_changes_little_from_step_to_step_where_the_region_is_twice_the_damping(
    run, damping
):
    """At most 4 rad/s², a fiftieth of the pseudo-inverse's."""
    assert run('adaptive', damping, 2.0 * damping).largest_acceleration < 4.0


def test_the_table_of_the_documentation_is_the_one_of_these_runs(repository, run):
    text = (repository / 'docs' / 'schemes.md').read_text(encoding='utf-8')
    rows = re.findall(r'^│ (pinv|dls|adaptive) +│(.*)│$', text, flags=re.MULTILINE)
    assert len(rows) == len(CASES)
    for inverse, cells in rows:
        values = [float(cell) if cell.strip() else None for cell in cells.split('│')]
        result = run(inverse, *values[:2])
        found = (
            result.wanted.max(),
            100.0 * np.mean(result.scale < 1.0),
            1e3 * result.error.max(),
            1e3 * result.rms_error,
            result.largest_acceleration,
        )
        # What the pseudo-inverse does at the singularity hangs on rounding.
        tolerance = 0.5 if inverse == 'pinv' else 0.02
        assert values[2:] == pytest.approx(found, rel=tolerance, abs=0.06)


@pytest.mark.parametrize('ratio', [0.5, 1.0, 1.4, 1.5, 2.0, 4.0])
def test_the_largest_gain_of_adaptive_damping_is_the_documented_one(ratio):
    """1/ε up to ε = √2 λ, then 1 / (2 λ √(1 - (λ/ε)²))."""
    damping, region = 0.1, 0.1 * ratio
    solver = RecursiveSolver(1, Inverse('adaptive', damping, region))
    velocity = np.array([1.0])
    gains = [
        float(resolve(solver, [(np.array([[s]]), velocity)])[0])
        for s in np.linspace(1e-4, 2.0 * region, 4001)
    ]
    if region <= math.sqrt(2.0) * damping:
        expected = 1.0 / region
    else:
        expected = 1.0 / (2.0 * damping * math.sqrt(1.0 - (damping / region) ** 2))
    assert max(gains) == pytest.approx(expected, rel=1e-3)
