"""Oscillations of whole stacks: found with their cause, and none where nobody should see one."""

from pathlib import Path

import numpy as np
import pytest

from tp_controller import build_settings, read_parameter_file
from tp_controller.oscillation import OscillationWatch
from tp_sim.settings import build_simulator_settings

CONFIG = Path(__file__).resolve().parents[2] / 'config'
POSITION = 'tasks.ee_position.gain'
SETS = ('joint_1_range', 'obstacle_1', 'obstacle_2', 'obstacle_3')
PRESSED = {'tasks.ee_position.target': [-0.2, 1.1]}


class Run:
    """A stack, an arm that is not ideal, and the watch of them."""

    def __init__(self, name, changes=None, plant=None):
        path = CONFIG / f'{name}.yaml'
        values = read_parameter_file(path, 'tp_controller') | (changes or {})
        simulated = read_parameter_file(path, 'tp_sim')
        simulated |= {f'plant.{key}': value for key, value in (plant or {}).items()}
        self.stack = build_settings(values).stack
        self.arm = build_simulator_settings(simulated).plant
        self.period = 1.0 / values['rate']
        self.watch = OscillationWatch(self.stack)
        self.time = 0.0
        self.causes = set()

    def go(self, seconds, before=lambda run: None):
        """Go on; return whether something oscillated meanwhile."""
        found = False
        for _ in range(round(seconds / self.period)):
            before(self)
            q = self.arm.measured()[0]
            command = self.stack.step(q, self.period).command
            if self.watch.see(q, command, self.period):
                found = True
                self.causes.add(self.watch.found.cause)
            self.arm.step(command, self.period)
            self.time += self.period
        return found


@pytest.mark.parametrize(
    ('name', 'changes', 'plant', 'cause'),
    [
        (
            'a4_position_joint',
            {POSITION: [30.0]},
            {'delay': 3},
            'moves 50 ms after its commands, robot.delay and robot.lag say 0 ms; set robot.delay: '
            '0.05 and robot.lag: 0, or tasks.ee_position.gain below 7.3',
        ),
        (
            'b3_pressed',
            PRESSED,
            {'delay': 4},
            'moves 66.7 ms after its commands, robot.delay and robot.lag say 0 ms',
        ),
        (
            'a4_position_joint',
            {POSITION: [20.0]},
            {'noise': 1e-4},
            'tasks.ee_position.gain of 20 makes it of the noise in measured positions, 0.0001',
        ),
        (
            'b3_pressed',
            PRESSED,
            {'noise': 1e-3},
            'measured positions are wrong by up to 0.001',
        ),
        (
            'a4_position_joint',
            {POSITION: [115.0]},
            {'noise': 1e-4},
            'tasks.ee_position.gain of 115 is too high for periods of 16.7 ms; use at most 30',
        ),
        (
            'b3_pressed',
            PRESSED | {f'tasks.{name}.switching': 'hysteresis' for name in SETS},
            {},
            'switching: smooth does not, or make its release larger',
        ),
        (
            'panda',
            {'solver.settle': False, 'tasks.hand_position.target': [1.5, 0.0, 0.5]},
            {},
            'level 0 (hand_position) does not get what it asks for, and solver.settle is false',
        ),
    ],
    ids=['gain', 'bounds', 'noise', 'noise at bounds', 'rate', 'hysteresis', 'settle'],
)
def test_what_oscillates_is_found_with_its_cause(name, changes, plant, cause):
    run = Run(name, changes, plant)
    assert run.go(9.0)
    assert any(cause in found for found in run.causes), run.causes


def test_it_ends_with_a_lower_gain_and_begins_with_a_higher_one():
    run = Run('a4_position_joint', {POSITION: [30.0]}, {'delay': 3})
    assert run.go(10.0)
    assert run.watch.found.task == 'ee_position'
    assert run.watch.found.level == 0
    run.stack.tasks['ee_position'].gain = [5.0]
    run.go(4.0)
    assert run.watch.found is None
    assert not run.go(4.0)
    run.stack.tasks['ee_position'].gain = [40.0]
    run.stack.tasks['ee_position'].target = [1.0, 0.6]
    assert run.go(10.0)


def shipped():
    """All files but the one whose arm really chatters for a moment, with its many bounds."""
    return sorted(path.stem for path in CONFIG.glob('*.yaml') if path.stem != 'panda_table')


def pursue(run, goals):
    """Function to be called before every step of a goal of the demo."""
    for goal in goals.split(';'):
        name, *words = goal.split()
        task = run.stack.tasks[name]
        if words[0] != 'circle':
            task.target = [float(word) for word in words]
            continue
        radius, period = (float(word) for word in words[1:])
        center, began = task.target[:2] - [radius, 0.0], run.time

        def follow(run, task=task, radius=radius, period=period, center=center, began=began):
            angle = 2.0 * np.pi * (run.time - began) / period
            task.target = center + radius * np.array([np.cos(angle), np.sin(angle)])

        return follow
    return lambda run: None


@pytest.mark.parametrize('name', shipped())
def test_no_shipped_file_does(name):
    demo = read_parameter_file(CONFIG / f'{name}.yaml', 'tp_demo')
    run = Run(name)
    run.go(0.1)
    for goals in demo['goals']:
        assert not run.go(min(demo['seconds_per_goal'], 6.0), pursue(run, goals)), run.causes


@pytest.mark.parametrize(
    ('frequency', 'rate'), [(0.3, 10.0), (1.0, 10.0), (0.3, 60.0), (1.0, 60.0), (4.0, 60.0)]
)
def test_a_circle_that_is_asked_for_is_none(frequency, rate):
    """By goals that come so often, with a feedforward or without."""
    run = Run('a1_position', {POSITION: [10.0], 'robot.limits.velocity': [5.0]})
    task = run.stack.tasks['ee_position']
    run.go(3.0)
    center, radius = task.current, 0.1

    def ask(run):
        if run.time // (1.0 / rate) == (run.time - run.period) // (1.0 / rate):
            return
        angle = 2.0 * np.pi * frequency * run.time
        task.target = center + radius * np.array([np.cos(angle) - 1.0, np.sin(angle)])
        if rate > 30.0:
            speed = 2.0 * np.pi * frequency * radius
            task.feedforward = speed * np.array([-np.sin(angle), np.cos(angle)])

    assert not run.go(8.0, ask), run.causes


@pytest.mark.parametrize('frequency', [1.0, 2.0, 5.0, 10.0])
def test_goals_that_change_often_are_none(frequency):
    for seed in range(3):
        rng = np.random.default_rng(seed)
        run = Run('a4_position_joint', {POSITION: [10.0]})

        def ask(run, rng=rng):
            if run.time // (1.0 / frequency) != (run.time - run.period) // (1.0 / frequency):
                run.stack.tasks['ee_position'].target = rng.uniform(0.3, 1.1, 2)

        assert not run.go(8.0, ask), run.causes


def test_a_state_after_a_pause_begins_anew():
    run = Run('a4_position_joint', {POSITION: [30.0]}, {'delay': 3})
    assert run.go(9.0)
    q = run.arm.measured()[0]
    assert not run.watch.see(q, np.zeros(3), np.inf)
    assert run.watch.found is None
