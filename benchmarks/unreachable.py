"""Whether arms come to rest, and stay there, under goals that cannot be had.

Random goals out of reach, lower levels that pull elsewhere, ranges and speeds of the joints kept,
joints that carry out every command exactly. At rest is an arm from when on no joint is faster than
1e-3 of its limit. Reversals of a joint (changes of sign of its command) are counted from 5 s on,
while some arms are still on their way, and again in the 10 s from 15 s on. Beside the time until
rest stands the least time in which the joints can make the way that they made, at the limits of
speed and acceleration all along, and that until the gain has brought the last motion down to
rest: no controller with this gain comes to rest sooner at that place. The exit status is 1 if
an arm is not at rest after 15 s, or a joint reverses more than twice after that.

    python benchmarks/unreachable.py --goals 200
    python benchmarks/unreachable.py --goals 200 --free
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
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from tp_controller import build_settings
from tp_sim.harness.document import edited, read_document

Vector = NDArray[np.float64]
CONFIG = Path(__file__).resolve().parent.parent / 'config'
SCHEMES = {
    'recursive': {'type': 'recursive', 'saturation': 'uniform'},
    'null_space': {'type': 'recursive', 'saturation': 'null_space'},
    'hqp': {'type': 'hqp'},
}
SOON, LATEST, WATCH = 5.0, 15.0, 10.0
"""Times [s] after which arms are looked at, and for how long they are watched then."""
REST = 1e-3
REVERSALS = 2
FREE = {'robot': {'limits': {'acceleration': [1e6]}}}
"""No limit of acceleration that counts."""
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
    moving: int
    """Most reversals of any joint from `SOON` to `LATEST`."""
    reversals: int
    """Most reversals of any joint after `LATEST`."""
    least: float
    """Least time [s] for the way from the start to that place, with the gain's decay to rest."""
    goal: list[float]

    @property
    def passed(self) -> bool:
        return self.rest <= LATEST and self.reversals <= REVERSALS


def chase(name: str, scheme: str, seed: int, free: bool = False) -> Ending:
    """Send an arm to one goal, with or without its limits of acceleration."""
    arm = ARMS[name]
    values: dict[str, Any] = copy.deepcopy(arm.changes)
    start = None
    if arm.file:
        document = read_document(CONFIG / f'{arm.file}.yaml')
        values = edited(edited(document['/**'], document['tp_controller']), arm.changes)
        start = document['tp_sim'].get('initial_positions')
    values = edited(edited(values, {'solver': SCHEMES[scheme]}), FREE if free else {})
    stack = build_settings(values).stack
    robot, period = stack.robot, stack.safety_filter.period
    limit = robot.limits.velocity
    q = np.array(ELBOWS * 2 if start is None else start, dtype=float)
    task = stack.tasks[arm.task]
    direction = np.random.default_rng(seed).normal(size=task.target_size)
    goal = arm.far * direction / np.linalg.norm(direction)
    task.target = goal
    begin = q.copy()
    soon, latest = round(SOON / period), round(LATEST / period)
    rest = 0.0
    moving, reversals, signs = np.zeros((3, robot.n))
    for i in range(round((LATEST + WATCH) / period)):
        command = stack.step(q).command
        share = float(np.max(np.abs(command) / limit))
        if share > REST:
            rest = (i + 1) * period
        if i >= soon:
            sign = np.sign(command) * (np.abs(command) > MOVES * limit)
            counter = moving if i < latest else reversals
            counter += sign * signs < 0.0
            signs = np.where(sign != 0.0, sign, signs)
        q = q + period * command
    far = [round(float(x), 2) for x in goal]
    gain = float(np.max(np.abs(task.gain)))
    least = least_time(np.abs(q - begin), limit, robot.limits.acceleration, gain)
    return Ending(rest, int(moving.max()), int(reversals.max()), least, far)


def least_time(way: Vector, speed: Vector, acceleration: Vector | None, gain: float) -> float:
    """Least time [s] in which joints go a way (n,) and the gain [1/s] brings them to `REST`.

    At the limits as long as the gain's own motion, which ends the way, would be faster.
    """
    tail = speed / gain
    fast = np.maximum(way - tail, 0.0)
    if acceleration is None:
        rise = np.zeros_like(way)
    else:
        # Half of the distance while speeding up is lost.
        rise = np.minimum(0.5 * speed / acceleration, np.sqrt(0.5 * fast / acceleration))
    decay = np.log(np.maximum(np.minimum(way, tail) * gain / (REST * speed), 1.0)) / gain
    return float(np.max(fast / speed + rise + decay))


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--goals', type=int, default=20, help='per arm and scheme')
    parser.add_argument('--arms', nargs='+', choices=list(ARMS), default=list(ARMS))
    parser.add_argument('--schemes', nargs='+', choices=list(SCHEMES), default=list(SCHEMES))
    parser.add_argument('--free', action='store_true', help='no limits of acceleration')
    chosen = parser.parse_args()
    table = Table(title=f'{chosen.goals} goals out of reach', title_style='bold')
    for column in ('arm', 'scheme'):
        table.add_column(column)
    for column in ('at rest within 5 s', 'within 15 s', 'median [s]', 'least [s]', 'slowest [s]'):
        table.add_column(column, justify='right')
    table.add_column('most reversals from 5 s on', justify='right')
    table.add_column('from 15 s on', justify='right')
    failed = []
    with ProcessPoolExecutor(os.cpu_count()) as pool:
        for arm in chosen.arms:
            for scheme in chosen.schemes:
                seeds = range(chosen.goals)
                count = len(seeds)
                free = [chosen.free] * count
                found = list(pool.map(chase, [arm] * count, [scheme] * count, seeds, free))
                times = [ending.rest for ending in found]
                failed += [(arm, scheme, ending) for ending in found if not ending.passed]
                table.add_row(
                    arm,
                    scheme,
                    f'{sum(time <= SOON for time in times)} of {count}',
                    f'{sum(time <= LATEST for time in times)} of {count}',
                    f'{np.median(times):.1f}',
                    f'{np.median([ending.least for ending in found]):.1f}',
                    f'{max(times):.1f}',
                    str(max(ending.moving for ending in found)),
                    str(max(ending.reversals for ending in found)),
                )
    Console(width=max(100, Console().width)).print(table)
    for arm, scheme, ending in failed:
        print(f'{arm} {scheme}: goal {ending.goal} {ending}')
    return 1 if failed else 0


if __name__ == '__main__':
    sys.exit(main())
