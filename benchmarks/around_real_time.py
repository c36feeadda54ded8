"""Ways around by the nodes in real time, on arms that are not ideal.

`python benchmarks/around_real_time.py` runs simulator and controller as two processes. The
simulated arm has delay, lag and noise, which the controller is told; random goals, one after the
other, go to `~/reach` with ``around``. Measured positions are judged, so that with noise they may
be beyond a range by its amplitude. ``--busy`` adds busy loops beside.
"""

from __future__ import annotations

import argparse
import math
import subprocess
import sys
from collections import Counter
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from around import POSE
from around_motion import CONFIG
from first_motion import goal
from rich.console import Console
from rich.table import Table

from tp_controller.config import build_settings, read_parameter_file
from tp_controller.stack import Stack
from tp_interfaces.action import Reach
from tp_sim.harness import ClosedLoop

LIMIT = 60.0
"""Time [s] that a goal has."""
EVERY = 5
"""Every so many states distances are looked at."""


class Arm(NamedTuple):
    """An arm, and what it is not ideal in."""

    file: str
    rate: float
    delay: int
    """Cycles,"""
    lag: float
    """time constant [s],"""
    noise: float
    """and amplitude [rad]."""
    changes: dict[str, Any]

    def blocks(self) -> dict[str, Any]:
        """Changes of the parameter file."""
        plant = {'delay': self.delay, 'lag': [self.lag], 'noise': [self.noise]}
        known = {'delay': [self.delay / self.rate], 'lag': [self.lag], 'noise': [self.noise]}
        return {
            '/**': {'robot': known},
            'tp_sim': {'plant': plant},
            'tp_controller': self.changes,
        }


PLANAR = {
    'hierarchy': ['joint_1_range', *(f'obstacle_{i}' for i in (1, 2, 3)), 'ee_position', 'rest'],
    'tasks': {
        'rest': {'type': 'posture', 'gain': [4.0]},
        'ee_position': {'gain': [4.0]},
    },
}
ARMS = {
    'planar': Arm('b3_pressed', 60.0, 3, 0.05, 0.002, PLANAR),
    'table': Arm('panda_table', 200.0, 2, 0.02, 0.0005, POSE),
}


def least(stack: Stack, q: np.ndarray) -> float:
    """Least distance [m, rad] of all set-based tasks at q (n,), the ends of ranges included."""
    limits = stack.robot.limits
    found = float(np.min([q - limits.position_min, limits.position_max - q]))
    stack.robot.update(q)
    for level in stack.members:
        for task in level:
            if task.set_based and task.type != 'joint_limits':
                distance = np.empty(task.k)
                task.probe(distance)
                found = min(found, float(distance.min()))
    return found


def measure(arm: Arm, count: int, console: Console) -> list[str]:
    """Cells of the arm's row."""
    rng, kinds, times = np.random.default_rng(1), Counter(), []
    nearest, reached = math.inf, 0
    with ClosedLoop(CONFIG / f'{arm.file}.yaml', arm.blocks(), lockstep=False) as loop:
        values = read_parameter_file(loop.parameter_file, 'tp_controller')
        stack = build_settings(values, find_rate=True).stack
        for i in range(count):
            task, target = goal(stack, rng)
            loop.clear_record()
            call = loop.client.start_reach(
                {task: target}, tolerance=1e-3, time_limit=LIMIT, around=True
            )
            result = loop.finish(call)
            times.append(result.time)
            said = [feedback.phase for feedback in call.feedback]
            kinds['around' if 'following' in said else 'straight'] += 1
            if result.outcome == Reach.Result.REACHED:
                reached += 1
            else:
                console.print(f'{arm.file} {i}: {result.message}', markup=False, soft_wrap=True)
            nearest = min(nearest, *(least(stack, q) for q in loop.record.q[::EVERY]))
    return [
        str(count), str(kinds['around']), str(reached), f'{np.median(times):.1f}',
        f'{max(times):.1f}', f'{nearest:.4f}', f'{arm.noise:g}',
    ]  # fmt: skip


def run(names: Sequence[str], count: int, busy: int) -> int:
    """Print the table."""
    console = Console(width=100)
    table = Table(title=f'Ways around in real time, beside {busy} busy loops')
    heads = (
        'goals',
        'around',
        'reached',
        'median [s]',
        'slowest [s]',
        'nearest',
        'noise',
    )
    for head in ('arm', *heads):
        table.add_column(head, justify='left' if head == 'arm' else 'right')
    loops = [subprocess.Popen([sys.executable, '-c', 'while True: pass']) for _ in range(busy)]
    try:
        for name in names:
            table.add_row(name, *measure(ARMS[name], count, console))
    finally:
        for process in loops:
            process.kill()
            process.wait()
    console.print(table)
    console.print(
        'Nearest: least distance [m, rad] to an obstacle, another link or the end of a range; '
        'noise [rad].',
        markup=False,
    )
    return 0


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--arms', nargs='+', choices=ARMS, default=list(ARMS), help='(all)')
    parser.add_argument('--count', type=int, default=20, help='goals per arm (%(default)s)')
    parser.add_argument('--busy', type=int, default=0, help='busy loops beside (%(default)s)')
    arguments = parser.parse_args()
    return run(arguments.arms, arguments.count, arguments.busy)


if __name__ == '__main__':
    raise SystemExit(main())
