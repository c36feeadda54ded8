"""Long runs to random goals: no limit is ever broken. The full length is in docs/safety.md."""

import itertools
import subprocess

import numpy as np
import pytest
from ament_index_python.packages import get_package_prefix

from tp_controller import InvalidValue, read_parameter_file
from tp_controller.robot import Limits
from tp_controller.solvers import SOLVER_TYPES
from tp_sim import stress
from tp_sim.integrator import Integrator
from tp_sim.long_runs import declaration, run
from tp_sim.plant import Plant
from tp_sim.plant_settings import PlantSettings
from tp_sim.settings import build_simulator_settings
from tp_sim.watch import Watch

STEPS = 1500
SCHEMES = [name for name in SOLVER_TYPES if name != 'extended_jacobian']
"""All but the square one, which takes no rows that come and go."""
OBJECTIVE = {'solver.objective.type': 'posture', 'solver.objective.positions': [0.0] * 3}


def parameters(path):
    start = build_simulator_settings(read_parameter_file(path, 'tp_sim')).integrator.q
    return read_parameter_file(path, 'tp_controller'), start


@pytest.mark.parametrize('scheme', SCHEMES)
@pytest.mark.parametrize('name', ['b1_obstacles', 'b2_joint_limits', 'b3_pressed'])
def test_no_limit_is_ever_broken(config, name, scheme):
    values, start = parameters(config / f'{name}.yaml')
    values |= {'solver.type': scheme}
    if scheme == 'projected_gradient':
        values |= OBJECTIVE
    if name == 'b2_joint_limits':
        values['tasks.joint_1_range.switching'] = 'smooth'
        del values['tasks.joint_1_range.release']
    seen = run(values, start, STEPS, seed=1)
    assert seen.steps == STEPS
    assert seen.least_distance >= 0.0
    assert seen.least_room >= 0.0
    assert seen.speed <= 1.0
    assert seen.acceleration <= 1.0 + 1e-9
    assert not seen.broken


def test_the_panda_among_obstacles_never_touches_one_or_itself(config):
    values, start = parameters(config / 'panda_table.yaml')
    seen = run(values, start, 2500, seed=2)
    assert not seen.broken
    assert 0.0 < seen.least_distance < 0.01
    assert seen.acceleration > 0.99
    assert seen.braked < 0.01 * seen.steps


@pytest.mark.parametrize('saturation', ['uniform', 'null_space'])
def test_both_saturations_keep_the_limits_and_hardly_ever_need_the_last_check(config, saturation):
    values, start = parameters(config / 'b3_pressed.yaml')
    seen = run(values | {'solver.saturation': saturation}, start, 5000)
    assert not seen.broken
    assert seen.braked < 0.02 * seen.steps
    assert seen.activations > 10


def pressed(config, switching, **changes):
    """Half a minute pressed against a circle and the end of a range."""
    values, start = parameters(config / 'b3_pressed.yaml')
    for name in ('joint_1_range', 'obstacle_1', 'obstacle_2', 'obstacle_3'):
        values[f'tasks.{name}.switching'] = switching
    goal = [np.array([-0.2, 1.1])]
    return run(values | changes, start, 1800, targets=itertools.repeat(goal))


def test_smooth_switching_does_not_chatter(config):
    seen = pressed(config, 'smooth')
    # Two rows come in and stay.
    assert seen.activations <= 4
    assert seen.acceleration <= 1.0 + 1e-9
    assert seen.braked == 0
    assert seen.least_distance > 0.0


def test_hysteresis_does(config):
    assert pressed(config, 'hysteresis').activations > 50


def test_a_run_that_breaks_a_limit_says_so(config):
    """Hysteresis at the boundary itself goes deep into the circles."""
    values, start = parameters(config / 'b1_obstacles.yaml')
    for i in (1, 2, 3):
        task = f'tasks.obstacle_{i}'
        values |= {f'{task}.switching': 'hysteresis', f'{task}.activation': 1e-9}
        values[f'{task}.release'] = 0.05
    seen = run(values, start, 7500)
    assert seen.broken
    assert seen.least_distance < -0.005


@pytest.mark.parametrize(
    ('change', 'key'), [({'rate': None}, 'rate'), ({'hierarchy': ['joint_1_position']}, 'tasks')]
)
def test_what_cannot_be_run_is_refused(config, change, key):
    name = 'a4_position_joint' if 'hierarchy' in change else 'a1_position'
    values, start = parameters(config / f'{name}.yaml')
    if 'hierarchy' in change:
        kept = {key: value for key, value in values.items() if 'ee_position' not in key}
        values = kept | {'rate': 60.0}
    with pytest.raises(InvalidValue) as caught:
        run(values | change, start, 10)
    assert caught.value.key == key


def test_the_command_prints_a_table_and_its_status_tells(config, tmp_path):
    executable = f'{get_package_prefix("tp_sim")}/lib/tp_sim/stress'

    def call(*arguments):
        command = [executable, *map(str, arguments)]
        return subprocess.run(command, check=False, capture_output=True, text=True, timeout=60)

    fine = call('--config', config / 'b3_pressed.yaml', '--steps', 500)
    assert fine.returncode == 0, fine.stderr
    assert 'b3_pressed.yaml: 500 steps to random goals' in fine.stdout
    assert 'least distance' in fine.stdout
    file = tmp_path / 'without_rate.yaml'
    text = (config / 'a1_position.yaml').read_text()
    file.write_text(text.replace('    rate: 60.0', ''))
    refused = call('--config', file, '--steps', 500)
    assert (refused.returncode, refused.stdout) == (2, '')
    assert refused.stderr == 'stress: rate: got no value; accepts a number above 0\n'


@pytest.mark.parametrize(
    'given',
    [{'delay': 2}, {'lag': 0.03}, {'delay': 1, 'noise': 1e-3}, {'command_loss': 0.5}],
)
def test_an_arm_that_the_controller_knows_breaks_no_limit_and_one_that_it_does_not_does(
    config, given
):
    values, start = parameters(config / 'b3_pressed.yaml')
    simulated = read_parameter_file(config / 'b3_pressed.yaml', 'tp_sim')
    simulated |= {f'plant.{key}': value for key, value in given.items()}
    told = run(values, start, 1800, 0, None, simulated)
    assert not told.broken
    assert told.restless < 0.01
    assert told.astray == 0
    assert run(values, start, 1800, 0, None, simulated, declared=False).broken


def test_an_arm_that_its_watchdog_stopped_goes_on_from_what_its_joints_do(config, monkeypatch):
    values, start = parameters(config / 'b3_pressed.yaml')
    simulated = read_parameter_file(config / 'b3_pressed.yaml', 'tp_sim') | {
        'plant.state_loss': 0.5
    }
    assert not run(values, start, 3000, 0, None, simulated).broken
    see = Watch.see_command
    monkeypatch.setattr(Watch, 'see_command', lambda *given: see(*given[:4]))
    assert run(values, start, 3000, 0, None, simulated).acceleration > 2.0


def test_distances_and_ranges_are_those_of_the_true_arm(config):
    """A wrong scale cannot be told: the controller believes that all is well."""
    values, start = parameters(config / 'b3_pressed.yaml')
    simulated = read_parameter_file(config / 'b3_pressed.yaml', 'tp_sim')
    seen = run(values, start, 1800, 0, None, simulated | {'plant.scale': 0.97})
    assert seen.least_room < -0.01
    assert seen.broken


def test_what_a_controller_is_told_of_its_arm():
    lossy = PlantSettings(delay=2, lag=[0.0, 0.1], noise=1e-3, quantum=2e-3, command_loss=0.1)
    told = declaration(Plant(Integrator([0.0] * 2, Limits(2)), lossy, 0.5), 0.01)
    assert told == {
        'robot.delay': [0.02],
        'robot.lag': [0.0, 0.1],
        'robot.noise': [2e-3],
        'robot.hold': pytest.approx(0.09),
    }
    assert declaration(Plant(Integrator([0.0], Limits(1))), 0.01) == {}


def test_the_table_of_plants_shows_each(config, monkeypatch, capsys):
    rows = {name: stress.PLANTS[name] for name in ('ideal', 'delay 3')}
    monkeypatch.setattr(stress, 'PLANTS', rows)
    monkeypatch.setenv('COLUMNS', '200')
    file = str(config / 'panda_table.yaml')
    arguments = ['--plant', 'rigid_body', '--plants', 'table', '--steps', '20', '--undeclared']
    monkeypatch.setattr('sys.argv', ['stress', '--config', file, *arguments])
    assert stress.main() in {0, 1}
    text = capsys.readouterr().out
    assert 'the controller does not know the arm: 20 steps' in text
    assert all(name in text for name in rows)
    monkeypatch.setattr('sys.argv', ['stress', '--config', file, '--command-loss', '2'])
    assert stress.main() == 2
    assert 'plant.command_loss: got 2.0; accepts a number from 0 to 1' in capsys.readouterr().err
