"""Experiment C over DDS: moving targets, schemes by parameter, and the comparison command."""

import subprocess

import numpy as np
import pytest
from ament_index_python.packages import get_package_prefix

from tp_sim.demo.script import Leg, read_script
from tp_sim.harness import ClosedLoop


def test_c1_the_explanation_tells_whose_freedom_the_lower_level_needs(config):
    with ClosedLoop(config / 'c1_algorithmic_singularity.yaml') as loop:
        loop.send_goal('tip', [3.3, 1.0])
        loop.run(20.0)
        record = loop.record
        levels = {tuple(level.tasks): level for level in loop.state.levels}
    blocked = levels['last_link',]
    assert list(blocked.blocked_by) == ['tip']
    assert blocked.shortfall == pytest.approx(0.61, abs=5e-3)
    assert blocked.text == f'{blocked.lost_to_levels[0]:.3g} to tip'
    assert levels['tip',].shortfall < 1e-6
    assert record.error_norm['tip'][-1] == pytest.approx(0.0, abs=5e-4)
    assert record.error_norm['last_link'][-1] == pytest.approx(0.305, abs=5e-4)


def test_c2_the_tip_follows_the_circle_while_the_macro_joints_stay_still(config):
    """A quarter of the circle; the rest is on the library."""
    path = config / 'c2_macro_micro.yaml'
    with ClosedLoop(path) as loop:
        leg = Leg(loop, read_script(path).goals[0])
        leg.run(loop, 1.25)
        record = loop.record
    assert leg.reached(1e-3)
    assert np.abs(record.q[:, :2] - record.q[0, :2]).max() < 1e-6
    assert np.ptp(record.q[:, 2:], axis=0).min() > 0.1


def run_compare(*arguments):
    executable = f'{get_package_prefix("tp_sim")}/lib/tp_sim/compare'
    return subprocess.run(
        [executable, *arguments], capture_output=True, text=True, timeout=60, check=False
    )


def test_the_table_of_schemes_has_the_published_errors(config):
    result = run_compare(
        '--config', config / 'c1_algorithmic_singularity.yaml',
        '--schemes', 'recursive', 'augmented', 'extended_jacobian',
    )  # fmt: skip
    assert result.returncode == 0, result.stderr
    _, table = result.stdout.split('tip 3.3 1')
    rows = {words[1]: words for words in map(str.split, table.splitlines()) if len(words) > 6}
    assert float(rows['recursive'][3]) < 1e-5
    assert float(rows['recursive'][5]) == pytest.approx(0.305, abs=5e-4)
    for scheme in ('augmented', 'extended_jacobian'):
        assert float(rows[scheme][3]) == pytest.approx(0.151, abs=5e-4)
        assert float(rows[scheme][5]) == pytest.approx(0.149, abs=5e-4)


def test_schemes_that_the_file_has_not_the_parameters_for_are_named(config):
    result = run_compare('--config', config / 'a3_position_orientation.yaml')
    assert result.returncode == 0, result.stderr
    assert 'Not under projected_gradient: solver.objective.type: got no value' in result.stdout
    assert 'recursive' in result.stdout


def test_a_long_name_is_not_cut_in_a_narrow_table(config):
    result = run_compare('--config', config / 'b1_obstacles.yaml', '--schemes', 'recursive')
    assert result.returncode == 0, result.stderr
    assert 'ee_positio' in result.stdout
    assert '…' not in result.stdout


@pytest.mark.parametrize(
    ('arguments', 'message'),
    [
        (['--config', 'nowhere.yaml'], 'nowhere.yaml'),
        (['--config', 'c2_macro_micro.yaml', '--schemes', 'projected_gradient'], 'solver.obj'),
        (['--config', 'c2_macro_micro.yaml', '--schemes', 'best'], "invalid choice: 'best'"),
    ],
)
def test_what_cannot_be_compared_gives_status_2(config, arguments, message):
    file = config / arguments[1]
    result = run_compare('--config', file if file.exists() else arguments[1], *arguments[2:])
    assert result.returncode == 2
    assert message in result.stderr
