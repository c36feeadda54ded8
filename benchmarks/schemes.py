"""Time of a step under every scheme and inverse, on a 7-joint Panda, side by side.

Position and orientation of the hand are two levels; the objective, where a scheme uses one,
is nearness to a posture. All take turns in short blocks, so that they see the same machine.

    python benchmarks/schemes.py
"""

import argparse
import gc
import os
import time

import numpy as np
from field.cases import PANDA_GOAL, PANDA_JOINTS, POSTURE
from field.robots import HAND, PANDA
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from tp_controller import build_settings
from tp_controller.rotations import quaternion_from_rotation
from tp_controller.solvers import INVERSES, SOLVER_TYPES


def stack_of(scheme: str, inverse: str):
    """Stack of both levels under a scheme; its goal is the hand's pose at one configuration."""
    hand = {'frame': HAND}
    stack = build_settings(
        {
            'rate': 1000.0,
            'robot': {'urdf': PANDA, 'joints': PANDA_JOINTS},
            'solver': {
                'type': scheme,
                'inverse': inverse,
                'objective': {'type': 'posture', 'positions': POSTURE},
            },
            'hierarchy': ['place', 'turn'],
            'tasks': {
                'place': {'type': 'position', **hand},
                'turn': {'type': 'orientation', **hand},
            },
        }
    ).stack
    stack.robot.update(np.array(PANDA_GOAL))
    frame = stack.robot.frame(HAND)
    stack.tasks['place'].target = frame.position
    stack.tasks['turn'].target = quaternion_from_rotation(frame.rotation)
    return stack


def configurations(robot, count: int) -> np.ndarray:
    """Smooth way (count, n) through most of the range of every joint."""
    lower, upper = robot.limits.position_min, robot.limits.position_max
    phases = np.outer(np.arange(count) * 1e-3, np.linspace(0.7, 1.3, robot.n)) + np.arange(robot.n)
    return (lower + upper) / 2 + 0.4 * (upper - lower) * np.sin(phases)


def measure(blocks: int, steps: int) -> dict[str, np.ndarray]:
    """Durations (blocks * steps,) [µs] of a step by scheme and inverse."""
    cases = [(scheme, 'dls') for scheme in SOLVER_TYPES]
    cases += [('recursive', inverse) for inverse in INVERSES if inverse != 'dls']
    stacks = {', '.join(case): stack_of(*case) for case in cases}
    path = configurations(next(iter(stacks.values())).robot, blocks * steps)
    durations: dict[str, list[int]] = {name: [] for name in stacks}
    gc.disable()
    names = list(stacks)
    for block in range(-1, blocks):
        # The block before the first warms up. Each case begins as often as the others.
        turn = block % len(names)
        for name in names[turn:] + names[:turn]:
            step = stacks[name].step
            for q in path[max(block, 0) * steps : (max(block, 0) + 1) * steps]:
                before = time.perf_counter_ns()
                step(q)
                if block >= 0:
                    durations[name].append(time.perf_counter_ns() - before)
        gc.collect()
    return {name: np.array(values) * 1e-3 for name, values in durations.items()}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--blocks', type=int, default=20, help='of steps, in turns')
    parser.add_argument('--steps', type=int, default=200, help='in a block')
    arguments = parser.parse_args()
    durations = measure(arguments.blocks, arguments.steps)
    count = arguments.blocks * arguments.steps
    table = Table(title=escape(f'Time of a step [µs], Panda with 7 joints, {count} steps each'))
    table.add_column('solver.type, inverse')
    for column in ('median', '99 %', 'share of the first'):
        table.add_column(column, justify='right')
    first = np.median(next(iter(durations.values())))
    for name, times in durations.items():
        table.add_row(
            name,
            f'{np.median(times):.1f}',
            f'{np.percentile(times, 99):.1f}',
            f'{np.median(times) / first:.2f}',
        )
    console = Console(width=100)
    console.print(table)
    console.print(f'({os.cpu_count()} cores)')


if __name__ == '__main__':
    main()
