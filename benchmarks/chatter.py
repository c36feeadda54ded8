"""Chatter at an obstacle and the end of a range: `python benchmarks/chatter.py`.

The arm of config/b3_pressed.yaml is sent to a goal that it cannot reach, inside a circle and
beyond the end of its first joint's range, and pressed against both for 60 s. The largest change
of the command from step to step is told as a share of the acceleration limit; once with that
limit enforced, and once without it and from a second after the goal: what the tasks ask for.
"""

import itertools
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from tp_controller.config import build_settings, read_parameter_file
from tp_sim.long_runs import run
from tp_sim.settings import build_simulator_settings

CONFIG = Path(__file__).resolve().parent.parent / 'config' / 'b3_pressed.yaml'
SETS = ('joint_1_range', 'obstacle_1', 'obstacle_2', 'obstacle_3')
GOAL = [-0.2, 1.1]
SECONDS = 60.0
ENDLESS = 1e6
"""Acceleration limit [rad/s²] in place of none."""


def largest_change(values: dict, q: np.ndarray, steps: int) -> float:
    """Largest change of a joint's velocity [rad/s²] in a second or more after the goal."""
    stack = build_settings(values | {'robot.limits.acceleration': [ENDLESS]}).stack
    stack.tasks['ee_position'].target = GOAL
    commands = []
    for _ in range(steps):
        commands.append(stack.step(q).command.copy())
        q = q + stack.safety_filter.period * commands[-1]
    after = np.diff(commands[round(1.0 / stack.safety_filter.period) :], axis=0)
    return float(np.abs(after).max()) / stack.safety_filter.period


def main() -> None:
    values = read_parameter_file(CONFIG, 'tp_controller')
    start = build_simulator_settings(read_parameter_file(CONFIG, 'tp_sim')).integrator.q
    limit, steps = values['robot.limits.acceleration'][0], round(SECONDS * values['rate'])
    table = Table(title=f'{SECONDS:g} s pressed against a circle and the end of a range')
    table.add_column('solver.type')
    table.add_column('switching')
    for header in (
        'rows that\nbegan to act',
        'change of command\n/ limit, enforced',
        'the same,\nnot enforced',
        'least\ndistance',
    ):
        table.add_column(header, justify='right')
    for scheme, switching in itertools.product(('recursive', 'hqp'), ('smooth', 'hysteresis')):
        how = {f'tasks.{name}.switching': switching for name in SETS}
        pressed = values | how | {'solver.type': scheme}
        seen = run(pressed, start, steps, targets=itertools.repeat([np.array(GOAL)]))
        table.add_row(
            scheme,
            switching,
            f'{seen.activations}',
            f'{seen.acceleration:.3f}',
            f'{largest_change(pressed, start, steps) / limit:.3f}',
            f'{seen.least_distance:.4f}',
        )
    Console().print(table)


if __name__ == '__main__':
    main()
