"""Whether arms come to rest, and stay there, under goals that cannot be had.

Random goals out of reach, lower levels that pull elsewhere, ranges and speeds of the joints kept,
joints that carry out every command exactly. Rest: from 5 s on no joint is faster than 1e-3 of its
limit. Reversals of a joint (changes of sign of its command) are counted in the 10 s after that.
The exit status is 1 if an arm does not rest, or a joint reverses more than twice.

    python benchmarks/unreachable.py --goals 200
"""

from __future__ import annotations

import argparse
import copy
import os
import sys
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any, NamedTuple

# One thread per process: small matrices gain nothing from more.
os.environ.update({f'{name}_NUM_THREADS': '1' for name in ('OMP', 'OPENBLAS', 'MKL')})

import numpy as np
from rich.console import Console
from rich.table import Table

from tp_controller import build_settings
from tp_sim.harness.document import edited, read_document

CONFIG = Path(__file__).resolve().parent.parent / 'config'
SCHEMES = {
    'recursive': {'type': 'recursive', 'saturation': 'uniform'},
    'null_space': {'type': 'recursive', 'saturation': 'null_space'},
    'hqp': {'type': 'hqp'},
}
WITHIN, WATCH = 5.0, 10.0
"""Time [s] in which the arm has to come to rest, and for how long it is watched then."""
REST = 1e-3
REVERSALS = 2
MOVES = 1e-9
"""Share of a velocity limit below which a command has no sign."""

PLANAR = {
    'robot': {'limits': {'velocity': [4.0]}},
    'tasks': {'ee_position': {'gain': [3.0]}, 'joint_1_position': {'gain': [3.0]}},
}
BAXTER = 'package://example-robot-data/robots/baxter_description/urdf/baxter.urdf'
SIDES = ('s0', 's1', 'e0', 'e1', 'w0', 'w1', 'w2')
ELBOWS = (0.0, -0.55, 0.0, 0.75, 0.0, 1.26, 0.0)
DUAL = {
    'rate': 100.0,
    'robot': {
        'urdf': BAXTER,
        'joints': [f'{side}_{joint}' for side in ('left', 'right') for joint in SIDES],
    },
    'hierarchy': ['object', 'hand', 'posture'],
    'tasks': {
        'object': {
            'type': 'pose',
            'frame': 'left_gripper_base_link',
            'relative_to': 'right_gripper_base_link',
            'gain': [3.0],
        },
        'hand': {'type': 'position', 'frame': 'right_gripper_base_link', 'gain': [3.0]},
        'posture': {'type': 'posture', 'target': [*ELBOWS, *ELBOWS], 'gain': [2.0]},
    },
}


class Arm(NamedTuple):
    """An arm, the task that gets goals out of reach, and how far away these are."""

    file: str | None
    changes: dict[str, Any]
    task: str
    far: float


ARMS = {
    'planar': Arm('a4_position_joint', PLANAR, 'ee_position', 2.5),
    'panda': Arm('panda', {}, 'hand_position', 1.3),
    'ur5': Arm('ur5', {}, 'tool_position', 1.3),
    'kinova': Arm('kinova', {}, 'hand_position', 1.6),
    'dual': Arm(None, DUAL, 'hand', 2.0),
}


class Ending(NamedTuple):
    """What became of one goal."""

    rest: float
    """Time [s] after which no joint is faster than `REST` of its limit."""
    later: float
    """Largest share of a velocity limit after `WITHIN`."""
    reversals: int
    """Most reversals of any joint after `WITHIN`."""
    goal: list[float]

    @property
    def passed(self) -> bool:
        return self.later <= REST and self.reversals <= REVERSALS


def chase(name: str, scheme: str, seed: int) -> Ending:
    """Send an arm to one goal."""
    arm = ARMS[name]
    values: dict[str, Any] = copy.deepcopy(arm.changes)
    start = None
    if arm.file:
        document = read_document(CONFIG / f'{arm.file}.yaml')
        values = edited(edited(document['/**'], document['tp_controller']), arm.changes)
        start = document['tp_sim'].get('initial_positions')
    values = edited(values, {'solver': SCHEMES[scheme]})
    stack = build_settings(values).stack
    robot, period = stack.robot, stack.safety_filter.period
    limit = robot.limits.velocity
    q = np.array(ELBOWS * 2 if start is None else start, dtype=float)
    task = stack.tasks[arm.task]
    direction = np.random.default_rng(seed).normal(size=task.target_size)
    goal = arm.far * direction / np.linalg.norm(direction)
    task.target = goal
    steps, settled = round((WITHIN + WATCH) / period), round(WITHIN / period)
    rest, later = 0.0, 0.0
    reversals, signs = np.zeros((2, robot.n))
    for i in range(steps):
        command = stack.step(q).command
        share = float(np.max(np.abs(command) / limit))
        if share > REST:
            rest = (i + 1) * period
        if i >= settled:
            later = max(later, share)
            sign = np.sign(command) * (np.abs(command) > MOVES * limit)
            reversals += sign * signs < 0.0
            signs = np.where(sign != 0.0, sign, signs)
        q = q + period * command
    return Ending(rest, later, int(reversals.max()), [round(float(x), 2) for x in goal])


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--goals', type=int, default=20, help='per arm and scheme')
    parser.add_argument('--arms', nargs='+', choices=list(ARMS), default=list(ARMS))
    parser.add_argument('--schemes', nargs='+', choices=list(SCHEMES), default=list(SCHEMES))
    chosen = parser.parse_args()
    table = Table(title=f'{chosen.goals} goals out of reach', title_style='bold')
    for column in ('arm', 'scheme', 'at rest within 5 s', 'slowest [s]', 'largest command later'):
        table.add_column(column, justify='left' if column in ('arm', 'scheme') else 'right')
    table.add_column('most reversals later', justify='right')
    failed = []
    with ProcessPoolExecutor(os.cpu_count()) as pool:
        for arm in chosen.arms:
            for scheme in chosen.schemes:
                seeds = range(chosen.goals)
                count = len(seeds)
                found = list(pool.map(chase, [arm] * count, [scheme] * count, seeds))
                failed += [(arm, scheme, ending) for ending in found if not ending.passed]
                table.add_row(
                    arm,
                    scheme,
                    f'{sum(ending.passed for ending in found)} of {count}',
                    f'{max(ending.rest for ending in found):.2f}',
                    f'{max(ending.later for ending in found):.1e}',
                    str(max(ending.reversals for ending in found)),
                )
    Console(width=max(100, Console().width)).print(table)
    for arm, scheme, ending in failed:
        print(f'{arm} {scheme}: goal {ending.goal} {ending}')
    return 1 if failed else 0


if __name__ == '__main__':
    sys.exit(main())
