"""Cost of bounds: a step with limits and obstacles beside a plain one, on a 7-joint Panda.

    python benchmarks/hqp_time.py

Plain is the recursion over three levels (position, orientation, posture of the hand) with the
joints' ranges. The others add limits of acceleration, three spheres that the hand keeps out of,
and the scheme. Each stack moves its own arm to the same goals, a third of which lie inside a
sphere; all take turns in short blocks, so that they see the same machine. Steps in which a bound
stopped a level are told apart from those in which none did.
"""

import argparse
import gc
import os
import time

os.environ.update({f'{name}_NUM_THREADS': '1' for name in ('OMP', 'OPENBLAS', 'MKL')})

import numpy as np
from field.cases import PANDA_JOINTS, POSTURE
from field.robots import HAND, PANDA
from rich.console import Console
from rich.table import Table

from tp_controller import build_settings

RATE = 1000.0
SPHERES = {'left': [0.45, 0.35, 0.5], 'right': [0.45, -0.35, 0.5], 'low': [0.6, 0.0, 0.2]}
RADIUS = 0.12
GOALS = [
    [0.45, 0.0, 0.6],
    [0.45, 0.35, 0.5],
    [0.5, 0.2, 0.25],
    [0.6, 0.0, 0.2],
    [0.35, -0.5, 0.6],
    [0.4, -0.35, 0.45],
]
BLOCK = 250
LIMIT = 4.0
"""Most that a bounded step may take, in plain ones, median against median."""


class Side:
    """A stack and its arm."""

    def __init__(self, scheme: str, bounded: bool) -> None:
        hand = {'frame': HAND, 'gain': [3.0]}
        robot = {'urdf': PANDA, 'joints': PANDA_JOINTS}
        tasks = {
            'place': {'type': 'position', **hand},
            'turn': {'type': 'orientation', **hand},
            'rest': {'type': 'posture', 'target': POSTURE},
        }
        levels = list(tasks)
        block = {'rate': RATE, 'robot': robot, 'solver': {'type': scheme, 'damping': 0.05}}
        if bounded:
            robot['limits'] = {'acceleration': [15.0, 7.5, 10.0, 12.5, 15.0, 20.0, 20.0]}
            for name, center in SPHERES.items():
                ball = {'type': 'obstacle', 'frame': HAND, 'center': center, 'radius': RADIUS}
                tasks[name] = ball
            levels = [*SPHERES, *levels]
        self.stack = build_settings(block | {'hierarchy': levels, 'tasks': tasks}).stack
        self.q = np.array(POSTURE)
        self.free: list[int] = []
        self.stopped: list[int] = []

    def run(self, goal: list[float]) -> None:
        """Time a block of steps towards a goal."""
        stack = self.stack
        stack.tasks['place'].target = goal
        for _ in range(BLOCK):
            begin = time.perf_counter_ns()
            command = stack.step(self.q).command
            passed = time.perf_counter_ns() - begin
            stopped = bool(stack.solver.acting.any()) or bool(stack.solver.held.any())
            (self.stopped if stopped else self.free).append(passed)
            self.q = self.q + command / RATE


def run(rounds: int) -> bool:
    """Measure and print; whether a step with bounds costs no more than it may."""
    sides = {
        'recursive, plain': Side('recursive', bounded=False),
        'recursive, bounds': Side('recursive', bounded=True),
        'hqp, bounds': Side('hqp', bounded=True),
    }
    gc.collect()
    gc.freeze()
    for turn in range(rounds):
        for goal in GOALS:
            # Ten blocks of 0.25 s for a goal.
            for _ in range(10):
                order = list(sides.values())
                for side in order[turn % 3 :] + order[: turn % 3]:
                    side.run(goal)
    plain = np.median(sides['recursive, plain'].free)
    table = Table(title='Time of a step on a 7-joint Panda, kinematics included [µs]')
    table.add_column('stack')
    headers = ('steps', 'median', '99 %', '/ plain', 'stopped', 'median', '99 %', '/ plain')
    for header in headers:
        table.add_column(header, justify='right')
    fine = True
    for name, side in sides.items():
        row = []
        for durations in (side.free + side.stopped, side.stopped):
            if not durations:
                row += ['0', '', '', '']
                continue
            middle, late = np.percentile(durations, [50, 99])
            row += [f'{len(durations)}', f'{middle / 1e3:.1f}', f'{late / 1e3:.1f}']
            row += [f'{middle / plain:.2f}']
            fine = fine and middle <= LIMIT * plain
        table.add_row(name, *row)
    Console(width=110).print(table)
    print(
        f'Stopped: steps in which a bound stopped a level. At most {LIMIT:g} times plain: {fine}'
    )
    return fine


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--rounds', type=int, default=2, help='through all goals')
    run(parser.parse_args().rounds)


if __name__ == '__main__':
    main()
