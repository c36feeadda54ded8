"""The demo: real time, goals over topics, a report, plots, and a status that tells."""

import math
import subprocess

import pytest
from ament_index_python.packages import get_package_prefix

from tp_interfaces.msg import ControllerState
from tp_sim.demo.timing import Stopwatch, Timing
from tp_sim.harness import edited, read_document, write_document


def run_demo(config, tmp_path, changes):
    document = read_document(config / 'a4_position_joint.yaml')
    fast = {'tp_controller': {'tasks': {'ee_position': {'gain': [6.0]}}}}
    path = tmp_path / 'demo.yaml'
    write_document(edited(edited(document, fast), changes), path)
    executable = f'{get_package_prefix("tp_sim")}/lib/tp_sim/demo'
    return subprocess.run(
        [executable, '--config', path, '--out', tmp_path / 'out'],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )


def test_goals_that_are_reached_give_status_0_and_plots(config, tmp_path):
    result = run_demo(
        config,
        tmp_path,
        {
            'tp_demo': {
                'goals': ['ee_position 1.3 0.6', 'ee_position 1.2 0.5'],
                'seconds_per_goal': 1.5,
            }
        },
    )
    assert result.returncode == 0, result.stderr + result.stdout
    assert 'goal 2 of 2: ee_position 1.2 0.5' in result.stdout
    assert 'level 1 joint_1_position' in result.stdout
    assert 'Commands: ' in result.stdout
    assert 'not reached' not in result.stdout
    for name in ('errors.png', 'arm.png'):
        assert (tmp_path / 'out' / name).read_bytes().startswith(b'\x89PNG')


def test_a_goal_out_of_reach_gives_status_1(config, tmp_path):
    result = run_demo(
        config, tmp_path, {'tp_demo': {'goals': ['ee_position 3.0 0.0'], 'seconds_per_goal': 1.0}}
    )
    assert result.returncode == 1, result.stderr + result.stdout
    words = ' '.join(result.stdout.split())
    assert 'goal 1 not reached: ' in words
    assert 'ee_position lost ' in words


def state(cycles, age=0.0, status=ControllerState.RUNNING):
    msg = ControllerState(cycles=cycles, status=status, command_age=age)
    msg.header.stamp.nanosec = 10_000_000 * cycles
    return msg


def test_the_rate_counts_cycles_whose_state_was_missed_and_leaves_out_repeats():
    watch = Stopwatch()
    assert math.isnan(watch.timing().rate)
    for cycles in (3, 4, 4, 9, 10):
        watch.follow(state(cycles))
    watch.follow(state(40, status=ControllerState.STALE))
    assert len(watch) == 4
    timing = watch.timing()
    assert timing.rate == pytest.approx(100.0)
    assert timing.period == pytest.approx(0.01)
    assert timing.text.startswith('100 Hz')
    assert watch.timing(2).rate == pytest.approx(100.0)


def test_a_timing_says_its_ages_and_whether_they_are_late():
    timing = Timing(rate=200.0, age=0.0012, late_age=0.04, period=0.005)
    assert timing.text == '200 Hz; age of the commands: median 1.2 ms, 99 % 40 ms'
    assert timing.late
    assert not timing._replace(late_age=0.004).late


@pytest.mark.parametrize(
    ('changes', 'message'),
    [
        ({'tp_demo': None}, 'tp_demo.goals: got no value'),
        ({'tp_demo': {'goals': ['ee_position up']}}, "tp_demo.goals: got 'ee_position up'"),
        ({'tp_controller': {'hierarchy': ['hand']}}, "hierarchy: got 'hand'"),
        ({'tp_demo': {'goals': ['hand 1.0']}}, "tp_demo.goals: got the task 'hand'"),
    ],
)
def test_what_cannot_be_run_gives_status_2_and_one_line(config, tmp_path, changes, message):
    result = run_demo(config, tmp_path, changes)
    assert result.returncode == 2
    assert result.stderr.startswith('demo: ')
    assert message in result.stderr
    assert len(result.stderr.strip().splitlines()) == 1
