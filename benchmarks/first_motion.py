"""Time from a goal with around to the first motion: `python benchmarks/first_motion.py`.

Simulator and controller run as two processes in real time. Random goals, one after the other, go
to `~/reach` with ``around``; each begins where the one before ended. The time is that of this
process, from before the goal is sent to the first state whose command moves a joint. The files
table_pose and table_upright are `panda_table.yaml` with the hierarchies of benchmarks/around.py;
their goals are chosen such that a planner here finds neither a straight way nor one that is
straight in joint space, so that OMPL has to plan one.
"""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from around import POSE, UPRIGHT
from rich.console import Console
from rich.table import Table

from tp_controller.config import build_settings, read_parameter_file
from tp_controller.planning import Planner
from tp_controller.robot.draws import random_configuration
from tp_controller.stack import Stack
from tp_interfaces.action import Reach
from tp_interfaces.msg import ControllerState
from tp_sim.harness import ClosedLoop

CONFIG = Path(__file__).resolve().parent.parent / 'config'
FILES = ('panda_pose', 'ur5_pose', 'kinova_pose', 'panda_table')
PLANNED_FILES = {'table_pose': POSE, 'table_upright': UPRIGHT}
TABLE = 'panda_table'
WAY = ': a way of '
"""Words in the controller's log."""
MOVES = 1e-3
"""Command [rad/s] from which on a joint moves."""
LONGEST, STILL = 20.0, 3
"""Time [s] that is waited for rest at most, and looks in a row that have to see it."""
STRAIGHT, AROUND, PLANNED, NONE = 'straight', 'around', 'planned', 'no'


class Watch:
    """Takes note of the first command that moves a joint."""

    def __init__(self) -> None:
        self.begin = self.first = math.nan

    def see(self, state: ControllerState) -> None:
        """Look at a state."""
        if math.isnan(self.first) and np.abs(state.command).max() > MOVES:
            self.first = time.monotonic() - self.begin

    def start(self) -> None:
        """Wait for motion from now on."""
        self.begin, self.first = time.monotonic(), math.nan


def goal(stack: Stack, rng: np.random.Generator) -> tuple[str, list[float]]:
    """Task and target of a configuration that keeps all distances."""
    (task,) = [one for level in stack.members for one in level if one.frame_name][-1:]
    guards = [one for level in stack.members for one in level if one.set_based]
    while True:
        stack.robot.update(random_configuration(stack.robot, rng))
        rooms = []
        for guard in guards:
            distance = np.empty(guard.k)
            guard.probe(distance)
            rooms.append((distance - guard.kept).min())
        if min(rooms, default=1.0) > 0.0:
            return task.name, list(task.current)


def planned_goal(
    planner: Planner, q: np.ndarray, rng: np.random.Generator
) -> tuple[str, list[float]]:
    """Task and target of a configuration that OMPL has to plan a way to."""
    while True:
        task, target = goal(planner.stack, rng)
        way = planner.plan({task: target}, q, {task: 1e-3}).way
        if way is not None and way.planned:
            return task, target


def measure(name: str, count: int, console: Console) -> dict[str, list[float]]:
    """Times [s] by kind of the way."""
    changes = PLANNED_FILES.get(name, {})
    path = CONFIG / f'{TABLE if changes else name}.yaml'
    values = read_parameter_file(path, 'tp_controller') | changes
    stack = build_settings(values).stack
    planner = Planner(values) if changes else None
    rng, watch = np.random.default_rng(1), Watch()
    found: dict[str, list[float]] = {STRAIGHT: [], AROUND: [], PLANNED: [], NONE: []}
    blocks = {'tp_controller': changes} if changes else None
    with ClosedLoop(path, blocks, lockstep=False, on_state=watch.see) as loop:
        for i in range(count + 1):
            if planner is None:
                task, target = goal(stack, rng)
            else:
                task, target = planned_goal(planner, loop.record.q[-1], rng)
            watch.start()
            call = loop.client.start_reach(
                {task: target}, tolerance=1e-3, time_limit=60.0, around=True
            )
            result = loop.finish(call)
            kind = STRAIGHT
            if any(feedback.phase == 'following' for feedback in call.feedback):
                lines = [line for line in loop.controller.output.splitlines() if WAY in line]
                kind = PLANNED if lines and lines[-1].endswith(', planned') else AROUND
            if result.outcome != Reach.Result.REACHED:
                kind = NONE
                console.print(f'{name} {i}: {result.message}', markup=False, soft_wrap=True)
            # The first goal starts the planner's process.
            if i:
                found[kind].append(watch.first)
                console.print(f'{name} {i}: {kind}, {watch.first:.2f} s', markup=False)
            else:
                console.print(f'{name}: first goal of all: {watch.first:.2f} s')
            wait_for_rest(loop)
    return found


def wait_for_rest(loop: ClosedLoop) -> None:
    """Wait until the levels below the goal have come to rest, too."""
    end, still = time.monotonic() + LONGEST, 0
    while still < STILL and time.monotonic() < end:
        loop.run(0.1)
        still = still + 1 if np.abs(loop.state.command).max() < MOVES else 0


def run(names: Sequence[str], count: int) -> int:
    console = Console(width=100)
    table = Table(title='Time from a goal with around to the first motion [s]')
    for head in ('file', 'way', 'goals', 'median', 'largest'):
        table.add_column(head, justify='left' if head in ('file', 'way') else 'right')
    for name in names:
        for kind, times in measure(name, count, console).items():
            if times:
                values = [f'{np.nanmedian(times):.2f}', f'{np.nanmax(times):.2f}']
                table.add_row(name, kind, str(len(times)), *values)
        table.add_section()
    console.print(table)
    return 0


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    every = (*FILES, *PLANNED_FILES)
    parser.add_argument('--files', nargs='+', choices=every, default=every, help='(all)')
    parser.add_argument('--count', type=int, default=20, help='goals per file (%(default)s)')
    arguments = parser.parse_args()
    return run(arguments.files, arguments.count)


if __name__ == '__main__':
    raise SystemExit(main())
