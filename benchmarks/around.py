"""How often random goals are reached with a way around: `python benchmarks/around.py`.

The draws of poses are those of benchmarks/reach.py. What the nodes do in lockstep is computed
without them: the planner looks ahead, searches and plans; the stack of the shipped parameter file
follows the way and goes on to the goal; the joints carry out every command exactly. Everything
that has to be kept is judged at every step, distances at every fifth. Three more sets of draws
have obstacles: starts and goals are random configurations of `panda_table.yaml` that keep all
distances, so that a solution exists. With the hand upright a task above the goal has to
hold all along.
"""

from __future__ import annotations

import argparse
import math
import multiprocessing
import os
from collections.abc import Sequence
from typing import NamedTuple

# One thread per process: small matrices gain nothing from more.
os.environ.update({f'{name}_NUM_THREADS': '1' for name in ('OMP', 'OPENBLAS', 'MKL')})

import numpy as np
from around_motion import CONFIG, Case, Outcome, pursue, tools
from draws import ARMS, draw
from rich.console import Console
from rich.table import Table

from tp_controller.config import read_parameter_file
from tp_controller.planning import Planner, solve
from tp_controller.robot import Robot
from tp_controller.robot.draws import random_configuration
from tp_controller.stack import Stack

CHUNK = 10
UPRIGHT = {
    'tasks.down.type': 'orientation',
    'tasks.down.frame': 'panda_hand_tcp',
    'tasks.down.axes': 'xy',
    'tasks.down.target': [1.0, 0.0, 0.0, 0.0],
    'tasks.down.gain': [3.0],
    'hierarchy': ['ranges', 'table + pillar + ball', 'self', 'down', 'hand_position', 'posture'],
}
POSE = {
    'tasks.hand_pose.type': 'pose',
    'tasks.hand_pose.frame': 'panda_hand_tcp',
    'tasks.hand_pose.gain': [3.0],
    'hierarchy': ['ranges', 'table + pillar + ball', 'self', 'hand_pose', 'posture'],
}


def cases() -> list[Case]:
    found = []
    for arm, name in ARMS.items():
        hierarchy = read_parameter_file(CONFIG / f'{arm}.yaml', 'tp_controller')['hierarchy']
        position, posture = hierarchy[0], hierarchy[-1]
        levels = (('hierarchy', [position, posture]),)
        found.append(Case(f'{name}, position', arm, (position,), levels))
        pose = read_parameter_file(CONFIG / f'{arm}_pose.yaml', 'tp_controller')['hierarchy'][0]
        found.append(Case(f'{name}, pose', f'{arm}_pose', (pose,)))
    table = 'panda_table'
    found.append(Case('table, position', table, ('hand_position',), clear=True))
    found.append(Case('table, pose', table, ('hand_pose',), tuple(POSE.items()), clear=True))
    upright = tuple(UPRIGHT.items())
    found.append(Case('table, upright', table, ('hand_position',), upright, True, True))
    return found


def draws(job: Job, robot: Robot) -> list[tuple[np.ndarray, np.ndarray]]:
    """Starts and configurations of goals (n,) [rad]."""
    if not job.case.clear:
        return list(zip(*draw(robot, job.count), strict=True))[job.draws.start : job.draws.stop]
    planner, _ = tools(job.case)
    found = []
    for i in job.draws:
        rng = np.random.default_rng([1, i])
        found.append((clear(job.case, planner, rng), clear(job.case, planner, rng)))
    return found


def clear(case: Case, planner: Planner, rng: np.random.Generator) -> np.ndarray:
    """Random configuration (n,) that keeps all distances, and the hand down if it has to be."""
    stack, robot = planner.stack, planner.robot
    while True:
        q = random_configuration(robot, rng)
        if case.upright:
            robot.update(q)
            place = robot.frame('panda_hand_tcp').position
            found = solve(stack, {'hand_position': place}, q, 0.2, 1)
            if found.best is None:
                continue
            q = found.best.q
        robot.update(q)
        if least(stack) > 0.0:
            return q


def least(stack: Stack) -> float:
    """Least distance [m, rad] beyond what is kept."""
    found = math.inf
    for level in stack.members:
        for task in level:
            if task.set_based:
                distance = np.empty(task.k)
                task.probe(distance)
                found = min(found, float((distance - task.kept).min()))
    return found


class Job(NamedTuple):
    """Some of the draws of a case."""

    case: Case
    draws: range
    count: int


def outcomes(job: Job) -> list[Outcome]:
    """Try some draws."""
    planner, _ = tools(job.case)
    found = []
    for start, end in draws(job, planner.robot):
        planner.robot.update(end)
        goals = {name: planner.stack.tasks[name].current for name in job.case.goals}
        found.append(pursue(job.case, start, goals))
    return found


def run(names: Sequence[str], count: int) -> int:
    """Try all draws and print the table; the exit status is 1 if anything was broken."""
    console = Console(width=130)
    table = Table(title='Goals reached with a way around, within 1 mm and 0.1°')
    for head in ('case', 'straight', 'around', 'planned', 'no', 'reached'):
        table.add_column(f'{head} [%]' if head != 'case' else head, justify='right')
    for head in ('ahead', 'search', 'plan', 'all: straight', 'all: around', 'slowest'):
        table.add_column(f'{head} [s]', justify='right')
    table.add_column('length', justify='right')
    table.add_column('broken', justify='right')
    broken = motions = 0
    missed = []
    with multiprocessing.get_context('spawn').Pool(2) as pool:
        for case in cases():
            if names and not any(name.lower() in case.name.lower() for name in names):
                continue
            jobs = [
                Job(case, range(i, min(i + CHUNK, count)), count) for i in range(0, count, CHUNK)
            ]
            tried = [one for some in pool.imap(outcomes, jobs) for one in some]
            table.add_row(case.name, *cells(tried))
            broken += sum(bool(one.broken) for one in tried)
            motions += len(tried)
            missed += [
                f'{case.name} {i}: {one.text} {one.broken}'
                for i, one in enumerate(tried)
                if not one.reached or one.broken
            ]
    console.print(table)
    console.print(
        f'{count} draws per case; {motions} motions, {broken} of which broke a range, speed, '
        'acceleration, distance or a task that has to hold. Times are medians: to look ahead, to '
        'search, to plan, and from the goal to the first motion for straight and other ways. '
        'Length: that of the motion over that of the straight line in joint space, median of '
        'those around.'
    )
    for line in missed:
        console.print(line, markup=False, highlight=False, soft_wrap=True)
    return 1 if broken else 0


def cells(tried: Sequence[Outcome]) -> list[str]:
    share = 100.0 / len(tried)
    straight = [one for one in tried if one.kind == 'straight']
    around = [one for one in tried if one.kind == 'around']
    counts = [len(straight), len(around), sum(one.planned for one in tried)]
    counts += [sum(one.kind == 'none' for one in tried), sum(one.reached for one in tried)]
    times = [median([one.seconds[i] for one in tried if one.seconds[i] > 0.0]) for i in range(3)]
    whole = [median([sum(one.seconds) for one in some]) for some in (straight, around)]
    slowest = max(sum(one.seconds) for one in tried)
    ratios = [one.length / max(one.direct, 1e-3) for one in around]
    return [
        *(f'{share * number:.1f}' for number in counts),
        *(f'{value:.3f}' for value in (*times, *whole, slowest)),
        f'{median(ratios):.2f}',
        str(sum(bool(one.broken) for one in tried)),
    ]


def median(values: Sequence[float]) -> float:
    return float(np.median(values)) if len(values) else math.nan


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--cases', nargs='+', default=[], help='parts of the names of cases (all)')
    parser.add_argument('--count', type=int, default=200, help='draws per case (%(default)s)')
    arguments = parser.parse_args()
    return run(arguments.cases, arguments.count)


if __name__ == '__main__':
    raise SystemExit(main())
