"""Whether a no is right, and comes in time: `python benchmarks/no_way.py`.

Goals that no configuration has, made up so that the reason is known:

- out of reach: places farther from the Panda's shoulder than its links are long;
- inside an obstacle: places of the hand at random configurations of the Panda at its table, at
  least 2 cm deep in the ball, the pillar or the table;
- beyond a range: places of a planar arm of two joints, both of whose configurations (found by
  trigonometry) have a joint out of its range;
- a level above: places of a planar arm of three joints under an orientation of the last link. The
  wrist, which that orientation puts where it has to be, is out of reach of the first two links,
  and the place itself is not out of reach of all three.

A reason is right if it names just what was made up: nothing, the obstacle that the place is in,
joints that are out of range in one of the two configurations, the orientation.
"""

from __future__ import annotations

import argparse
import math
import multiprocessing
import os
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import NamedTuple

os.environ.update({f'{name}_NUM_THREADS': '1' for name in ('OMP', 'OPENBLAS', 'MKL')})

import numpy as np
from rich.console import Console
from rich.table import Table

from tp_controller import (
    OrientationTask,
    PositionTask,
    PostureTask,
    Robot,
    Stack,
    build_settings,
    read_parameter_file,
)
from tp_controller.planning import solve
from tp_controller.robot.draws import random_configuration

CONFIG = Path(__file__).resolve().parent.parent / 'config'
SHOULDER, LENGTH = np.array([0.0, 0.0, 0.333]), 1.3
"""Of the Panda [m]: no place of the hand is farther away than the links in a row."""
DEEP = 0.02
LINKS = 0.6, 0.5, 0.3
SECONDS = 2.0


class Case(NamedTuple):
    """A goal, and the names that a right reason may have."""

    stack: Stack
    goals: dict[str, list[float]]
    q: np.ndarray
    right: Callable[[tuple[str, ...]], bool]


def some_of(sets: Sequence[set[str]], found: tuple[str, ...]) -> bool:
    """Whether names were found, all of them in one set."""
    return any(bool(found) and set(found) <= names for names in sets)


def panda() -> Stack:
    return build_settings(read_parameter_file(CONFIG / 'panda_table.yaml', 'tp_controller')).stack


def out_of_reach(rng: np.random.Generator) -> Case:
    stack = STACKS['panda']
    way = rng.normal(size=3)
    way[2] = abs(way[2])
    place = SHOULDER + way / np.linalg.norm(way) * rng.uniform(LENGTH, 3.0)
    q = random_configuration(stack.robot, rng)
    return Case(stack, {'hand_position': place.tolist()}, q, lambda names: names == ())


def depth(stack: Stack, place: np.ndarray) -> dict[str, float]:
    """How deep [m] a place is in each obstacle that it is in."""
    ball, pillar = stack.tasks['ball'].obstacle, stack.tasks['pillar'].obstacle
    box = pillar.pose.actInv(place)
    found = {
        'ball': ball.size[0] - float(np.linalg.norm(place - ball.pose.translation)),
        'pillar': float((0.5 * np.array(pillar.size) - np.abs(box)).min()),
        'table': -float(place[2]),
    }
    return {name: value for name, value in found.items() if value > 0.0}


def in_an_obstacle(rng: np.random.Generator) -> Case:
    stack = STACKS['panda']
    while True:
        stack.robot.update(random_configuration(stack.robot, rng))
        place = stack.robot.frame('panda_hand_tcp').position.copy()
        inside = depth(stack, place)
        # The table alone would be nearly all of them.
        skipped = 'table' in inside and rng.uniform() < 0.9
        if skipped or max(inside.values(), default=0.0) < DEEP:
            continue
        q = random_configuration(stack.robot, rng)
        names = set(inside)
        return Case(
            stack,
            {'hand_position': place.tolist()},
            q,
            partial(some_of, [names]),
        )


def beyond_a_range(rng: np.random.Generator) -> Case:
    a, b = LINKS[:2]
    while True:
        low, high = np.sort(rng.uniform(-3.0, 3.0, (2, 2)), axis=0)
        if (high - low).min() < 0.5:
            continue
        place = rng.uniform(-1.1, 1.1, 2)
        cosine = (place @ place - a * a - b * b) / (2.0 * a * b)
        if abs(cosine) > 0.98:
            continue
        blamed = []
        for sign in (1.0, -1.0):
            second = sign * math.acos(cosine)
            first = math.atan2(place[1], place[0]) - math.atan2(
                b * math.sin(second), a + b * math.cos(second)
            )
            first = math.remainder(first, math.tau)
            # A joint that turns on by a whole turn may be in its range.
            out = [
                not any(
                    low[j] - 0.02 <= value + math.tau * turn <= high[j] + 0.02
                    for turn in (-1, 0, 1)
                )
                for j, value in enumerate((first, second))
            ]
            blamed.append({f'joint_{j + 1}' for j in range(2) if out[j]})
        if not all(blamed):
            continue
        limits = {'velocity': 1.0, 'position_min': low.tolist(), 'position_max': high.tolist()}
        robot = Robot.from_dh(a=[a, b], limits=limits)
        tip = PositionTask('tip', robot, 'link_2', axes='xy')
        stack = Stack(robot, [tip, PostureTask('rest', robot)], rate=100.0)
        return Case(
            stack,
            {'tip': place.tolist()},
            0.5 * (low + high),
            partial(some_of, blamed),
        )


def under_a_level(rng: np.random.Generator) -> Case:
    a, b, c = LINKS
    while True:
        place, angle = rng.uniform(-1.4, 1.4, 2), rng.uniform(-3.0, 3.0)
        wrist = place - c * np.array([math.cos(angle), math.sin(angle)])
        far = float(np.linalg.norm(wrist))
        alone = float(np.linalg.norm(place))
        if a - b + 0.02 < far < a + b + 0.02 or not 0.02 < alone < a + b + c - 0.02:
            continue
        robot = Robot.from_dh(a=[a, b, c], limits={'velocity': 1.0})
        tip = PositionTask('tip', robot, 'link_3', axes='xy')
        heading = OrientationTask('heading', robot, 'link_3', axes='z', target=[angle])
        stack = Stack(robot, [heading, tip, PostureTask('rest', robot)], rate=100.0)
        q = random_configuration(robot, rng)
        return Case(stack, {'tip': place.tolist()}, q, lambda found: found == ('heading',))


KINDS = {
    'out of reach': out_of_reach,
    'inside an obstacle': in_an_obstacle,
    'beyond a range': beyond_a_range,
    'a level above': under_a_level,
}
STACKS: dict[str, Stack] = {}


class Outcome(NamedTuple):
    said_no: bool
    right: bool
    seconds: float
    text: str


def judge(job: tuple[str, int]) -> Outcome:
    """Ask about one goal."""
    kind, number = job
    if not STACKS:
        STACKS['panda'] = panda()
    rng = np.random.default_rng([number, list(KINDS).index(kind)])
    case = KINDS[kind](rng)
    answer = solve(case.stack, case.goals, case.q, SECONDS)
    no = not answer.solutions
    return Outcome(no, no and case.right(answer.reasons), answer.seconds, answer.text)


def run(count: int) -> int:
    table = Table(title=f'Goals that no configuration has, {SECONDS:g} s each')
    for head in (
        'reason',
        'goals',
        'no',
        'right reason',
        'right [%]',
        'median [s]',
        'slowest [s]',
    ):
        table.add_column(head, justify='left' if head == 'reason' else 'right')
    right = 0
    wrong = []
    with multiprocessing.get_context('spawn').Pool(2) as pool:
        for kind in KINDS:
            found = list(pool.imap(judge, [(kind, i) for i in range(count)], chunksize=5))
            good = sum(one.right for one in found)
            right += good
            wrong += [f'{kind} {i}: {one.text}' for i, one in enumerate(found) if not one.right]
            times = [one.seconds for one in found]
            table.add_row(
                kind,
                str(count),
                str(sum(one.said_no for one in found)),
                str(good),
                f'{100.0 * good / count:.1f}',
                f'{np.median(times):.2f}',
                f'{max(times):.2f}',
            )
    console = Console(width=110)
    console.print(table)
    total = count * len(KINDS)
    console.print(f'{right} of {total} reasons are right: {100.0 * right / total:.1f} %')
    for line in wrong:
        console.print(line, markup=False, highlight=False, soft_wrap=True)
    return 0 if right >= 0.95 * total else 1


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--count', type=int, default=50, help='goals per reason (%(default)s)')
    return run(parser.parse_args().count)


if __name__ == '__main__':
    raise SystemExit(main())
