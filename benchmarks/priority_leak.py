"""How much lower levels cost higher ones at the limits, over random draws.

Three levels (position, orientation, posture) on the Panda and on random arms, which move already,
at limits of speed and acceleration (four times that). The leak is by how much the velocity of the
first and second level changes when those below are taken away, as a share of it or of 1. The exit
status is 1 if it is above 1e-6 anywhere.

    python benchmarks/priority_leak.py --draws 10000
"""

from __future__ import annotations

import argparse
import os
import sys
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

# One thread per process: small matrices gain nothing from more.
os.environ.update({f'{name}_NUM_THREADS': '1' for name in ('OMP', 'OPENBLAS', 'MKL')})

import numpy as np
from field.leak import change, random_goals
from rich.console import Console
from rich.table import Table

from tp_controller import build_settings
from tp_controller.config import read_parameter_file

CONFIG = Path(__file__).resolve().parent.parent / 'config' / 'panda.yaml'
LIMITS = (20.0, 5.0, 2.0, 0.5)
"""Limits of speed [rad/s, m/s]."""
SCHEMES = {
    'recursive, dls': {'solver.type': 'recursive', 'solver.inverse': 'dls'},
    'recursive, adaptive': {'solver.type': 'recursive', 'solver.inverse': 'adaptive'},
    'hqp, adaptive': {'solver.type': 'hqp', 'solver.inverse': 'adaptive'},
}
MOST = 1e-6
PER_ARM = 50
"""Draws with one random arm."""


def panda() -> dict[str, Any]:
    """The Panda of the file."""
    return dict(read_parameter_file(CONFIG, 'tp_controller'))


def random_arm(random: np.random.Generator) -> dict[str, Any]:
    """A spatial arm of 4 to 9 turning joints, with ranges."""
    n = int(random.integers(4, 10))
    turns = random.choice([0.0, np.pi / 2, -np.pi / 2], n)
    return {
        'rate': 200.0,
        'robot.joints': [f'joint_{i + 1}' for i in range(n)],
        'robot.dh.theta': [0.0] * n,
        'robot.dh.d': random.uniform(0.0, 0.5, n).tolist(),
        'robot.dh.a': random.uniform(0.0, 0.5, n).tolist(),
        'robot.dh.alpha': turns.tolist(),
        'robot.dh.types': ['revolute'] * n,
        'robot.limits.position_min': [-2.5] * n,
        'robot.limits.position_max': [2.5] * n,
        'hierarchy': ['hand_position', 'hand_orientation', 'posture'],
        'tasks.hand_position.type': 'position',
        'tasks.hand_position.frame': f'link_{n}',
        'tasks.hand_position.gain': [3.0],
        'tasks.hand_orientation.type': 'orientation',
        'tasks.hand_orientation.frame': f'link_{n}',
        'tasks.hand_orientation.gain': [3.0],
        'tasks.posture.type': 'posture',
        'tasks.posture.gain': [2.0],
        'solver.damping': 0.05,
        'solver.singular_region': 0.05,
    }


def leaks(arm: str, scheme: str, limit: float, draws: int, seed: int) -> tuple[float, float]:
    """Largest leak of the first and of the second level."""
    random = np.random.default_rng([seed, int(10 * limit)])
    worst = [0.0, 0.0]
    for _ in range(max(1, draws // PER_ARM)):
        values = panda() if arm == 'panda' else random_arm(random)
        values |= SCHEMES[scheme]
        values |= {
            'robot.limits.velocity': [limit],
            'robot.limits.acceleration': [4.0 * limit],
        }
        names = values['hierarchy']
        stacks = [
            build_settings(values | {'hierarchy': names[:count]}).stack for count in (1, 2, 3)
        ]
        for _ in range(PER_ARM if arm != 'panda' else draws):
            found = draw(stacks, names, limit, random)
            worst = [max(pair) for pair in zip(worst, found, strict=True)]
        if arm == 'panda':
            break
    return worst[0], worst[1]


def draw(
    stacks: list[Any], names: list[str], limit: float, random: np.random.Generator
) -> list[float]:
    """Leaks of the two upper levels in a random state with random targets."""
    robot = stacks[0].robot
    q = random.uniform(robot.limits.position_min, robot.limits.position_max)
    before = random.uniform(-0.5, 0.5, robot.n) * limit
    targets = random_goals(random, robot.n)
    got = []
    for stack in stacks:
        for name, target in zip(names, targets, strict=True):
            stack.tasks[name].target = target
        stack.rest()
        got.append([level.achieved.copy() for level in stack.step(q, qd=before).levels])
    # As a share of the level's velocity, or of 1 if it is smaller.
    return [
        change(got[level][level], [one[level] for one in got[level + 1 :]], 1.0)
        for level in range(2)
    ]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--draws', type=int, default=1000, help='per arm, scheme and limit')
    parser.add_argument('--seed', type=int, default=0)
    chosen = parser.parse_args()
    table = Table(
        title=f'Largest leak over {chosen.draws} draws per cell, limits in rad/s',
        title_style='bold',
    )
    for column in ('arm', 'scheme', 'level', *(f'{limit:g}' for limit in LIMITS)):
        table.add_column(column, justify='left' if column in ('arm', 'scheme') else 'right')
    worst = 0.0
    with ProcessPoolExecutor(os.cpu_count()) as pool:
        for arm in ('panda', 'random'):
            for scheme in SCHEMES:
                cells = len(LIMITS)
                found = list(
                    pool.map(
                        leaks,
                        [arm] * cells,
                        [scheme] * cells,
                        LIMITS,
                        [chosen.draws] * cells,
                        [chosen.seed] * cells,
                    )
                )
                worst = max(worst, *(max(pair) for pair in found))
                for level in range(2):
                    row = [f'{pair[level]:.1e}' for pair in found]
                    table.add_row(arm, scheme, str(level + 1), *row)
    Console(width=max(100, Console().width)).print(table)
    return 1 if worst > MOST else 0


if __name__ == '__main__':
    sys.exit(main())
