"""Executable that sends an arm to random goals for a long time and counts broken limits.

It computes what the nodes do in lockstep, without processes and topics. Goals are drawn from
the positions that the controlled frames can have, and from 0.7 to 1.3 times as far away, so
that many lie inside obstacles or out of reach. The joints carry out every command exactly:
nothing but the controller keeps them inside their limits.
"""

from __future__ import annotations

import argparse
import math
import os
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from tp_controller.config import build_robot, build_settings, read_parameter_file
from tp_controller.config.build import read_parameters
from tp_controller.errors import InvalidValue, TaskPriorityError
from tp_controller.robot import Robot
from tp_controller.solvers import SOLVER_TYPES
from tp_controller.stack import Stack
from tp_controller.tasks import PositionTask, SetBasedTask
from tp_sim.settings import build_simulator_settings

Vector = NDArray[np.float64]

BROKEN, REFUSED, INTERRUPTED = 1, 2, 130
SECONDS_PER_GOAL = 10.0
REACHED = 0.01
"""Error [m] of a goal that is reached."""
ROUNDING = 1e-9
"""A limit that is exceeded by less than this share of it is not broken."""
TURN = 2.0 * math.pi
"""Range [rad] of random positions of a joint without limits."""


class Outcome(NamedTuple):
    """What was seen in one long run."""

    steps: int
    least_distance: float
    """Of every set-based task [m, rad]; infinite if there is none."""
    least_room: float
    """Of every joint from the nearer end of its range [rad, m]."""
    speed: float
    """Largest share of a velocity limit."""
    acceleration: float
    """Largest share of an acceleration limit; zero if there is none."""
    activations: int
    """How often a row of a set-based task began to act."""
    braked: int
    """Steps in which the command had to give way to braking."""
    goals: int
    reached: int
    seconds: float
    """Time that it took [s]."""

    @property
    def broken(self) -> bool:
        """Whether any limit was."""
        return (
            self.least_distance < 0.0
            or self.least_room < 0.0
            or max(self.speed, self.acceleration) > 1.0 + ROUNDING
        )


def main() -> int:
    """Run the schemes.

    Returns
    -------
    int
        Exit status: 0, 1 if a limit was broken, 2 if the file cannot be used, 130 after Ctrl-C.
    """
    arguments = _parser().parse_args()
    try:
        outcomes = run_schemes(
            arguments.config, arguments.schemes, arguments.steps, arguments.seed
        )
    except TaskPriorityError as error:
        print(f'stress: {error}', file=sys.stderr)
        return REFUSED
    except KeyboardInterrupt:
        print('stress: interrupted', file=sys.stderr)
        return INTERRUPTED
    Console().print(_table(arguments.config.name, outcomes))
    return BROKEN if any(outcome.broken for outcome in outcomes.values()) else 0


def _at_least(least: int) -> Callable[[str], int]:
    def read(text: str) -> int:
        if not text.isdigit() or int(text) < least:
            raise argparse.ArgumentTypeError(f'got {text!r}; accepts a whole number from {least}')
        return int(text)

    return read


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog='stress', description=(__doc__ or '').split('\n')[0])
    parser.add_argument('--config', type=Path, required=True, help='parameter file')
    parser.add_argument('--steps', type=_at_least(1), default=100_000, help='of every scheme')
    parser.add_argument('--seed', type=_at_least(0), default=0, help='of the random goals')
    parser.add_argument(
        '--schemes',
        nargs='+',
        choices=sorted(SOLVER_TYPES),
        help='values of solver.type; that of the file when left out',
    )
    return parser


def run_schemes(
    path: Path, schemes: Sequence[str] | None, steps: int, seed: int
) -> dict[str, Outcome]:
    """Run every scheme on a parameter file, each in a process of its own.

    Raises
    ------
    TaskPriorityError
        If the file cannot be used.
    """
    values = read_parameter_file(path, 'tp_controller')
    names = schemes or [read_parameters(values)['solver.type']]
    start = build_simulator_settings(read_parameter_file(path, 'tp_sim')).integrator.q
    for name in names:
        build_settings(values | {'solver.type': name})
    count = min(len(names), os.cpu_count() or 1)
    with ProcessPoolExecutor(count) as pool:
        found = pool.map(
            run,
            [values | {'solver.type': name} for name in names],
            [start] * len(names),
            [steps] * len(names),
            [seed] * len(names),
        )
        return dict(zip(names, found, strict=True))


def run(
    values: dict[str, Any],
    q: Vector,
    steps: int,
    seed: int = 0,
    targets: Iterable[Sequence[Vector]] | None = None,
) -> Outcome:
    """Send an arm to goals, with a new one every 10 s.

    Parameters
    ----------
    values
        Parameters of the controller.
    q
        First configuration (n,) [rad, m].
    steps
        How many steps.
    seed
        Of the random goals.
    targets
        Goals of all position tasks, one after the other, in place of random ones.

    Raises
    ------
    InvalidValue
        If the parameters cannot be used, have no rate or no task that takes a position.
    """
    stack = build_settings(values).stack
    goals = [task for task in stack.tasks.values() if isinstance(task, PositionTask)]
    period = stack.safety_filter.period
    if not math.isfinite(period):
        raise InvalidValue('rate', 'no value', 'a number above 0')
    if not goals:
        raise InvalidValue('tasks', 'no position task', 'one that is sent to random goals')
    if targets is None:
        elsewhere = build_robot(read_parameters(values))
        targets = _places(elsewhere, goals, np.random.default_rng(seed))
    places = iter(targets)
    watch = Watch(stack)
    started, every = time.perf_counter(), max(1, round(SECONDS_PER_GOAL / period))
    for i in range(steps):
        if i % every == 0:
            watch.count_goal(goals if i else ())
            for task, target in zip(goals, next(places), strict=True):
                task.target = target
        command = stack.step(q).command
        watch.see(q, command)
        q = q + period * command
    watch.count_goal(goals)
    return watch.outcome(time.perf_counter() - started)


def _places(
    robot: Robot, tasks: Sequence[PositionTask], rng: np.random.Generator
) -> Iterator[list[Vector]]:
    limits = robot.limits
    low, high = (
        np.where(np.isfinite(ends), ends, 0.5 * sign * TURN)
        for ends, sign in ((limits.position_min, -1.0), (limits.position_max, 1.0))
    )
    while True:
        robot.update(rng.uniform(low, high))
        far = rng.choice([1.0, rng.uniform(0.7, 1.3)])
        yield [far * robot.frame(task.frame_name).position[task.rows] for task in tasks]


class Watch:
    """Looks at every command of a stack.

    Parameters
    ----------
    stack
        The stack; its arm stands still.
    """

    def __init__(self, stack: Stack) -> None:
        self._stack = stack
        self._sets = [
            task
            for task in stack.tasks.values()
            if isinstance(task, SetBasedTask) and stack.level_of(task.name) >= 0
        ]
        self._acted = [task.acting.copy() for task in self._sets]
        self._before = np.zeros(stack.robot.n)
        self.steps = self.activations = self.braked = self.goals = self.reached = 0
        self.distance = self.room = math.inf
        self.speed = self.acceleration = 0.0

    def see(self, q: Vector, command: Vector) -> None:
        """Take note of a configuration and of the command (n,) that answers it."""
        limits, guard = self._stack.robot.limits, self._stack.safety_filter
        self.steps += 1
        for task in self._sets:
            self.distance = min(self.distance, float(task.distance.min()))
        room = np.minimum(q - limits.position_min, limits.position_max - q)
        self.room = min(self.room, float(room.min()))
        self.speed = max(self.speed, float(np.max(np.abs(command) / limits.velocity)))
        change = np.abs(command - self._before) / (limits.acceleration * guard.period)
        self.acceleration = max(self.acceleration, float(change.max()))
        self._before[:] = command
        for i, task in enumerate(self._sets):
            acts = task.acting if task.one_sided else task.on
            self.activations += int(np.count_nonzero(acts & ~self._acted[i]))
            self._acted[i][:] = acts
        self.braked += bool(guard.stopped_by)

    def count_goal(self, tasks: Sequence[PositionTask]) -> None:
        """Take note of how near a goal was come to."""
        if tasks:
            self.goals += 1
            self.reached += all(float(np.linalg.norm(task.error)) < REACHED for task in tasks)

    def outcome(self, seconds: float) -> Outcome:
        """What was seen until now, in so much time [s]."""
        return Outcome(
            self.steps,
            self.distance,
            self.room,
            self.speed,
            self.acceleration,
            self.activations,
            self.braked,
            self.goals,
            self.reached,
            seconds,
        )


def _table(name: str, outcomes: dict[str, Outcome]) -> Table:
    steps = next(iter(outcomes.values())).steps
    table = Table(title=f'{escape(name)}: {steps:,} steps to random goals', title_style='bold')
    table.add_column('')
    for scheme, seen in outcomes.items():
        table.add_column(scheme, justify='right', style='red' if seen.broken else None)
    found = outcomes.values()
    for label, values in (
        ('least distance \\[m, rad]', [f'{seen.least_distance:.7f}' for seen in found]),
        ("least room of a joint's range \\[rad, m]", [f'{s.least_room:.9f}' for s in found]),
        ('largest share of a velocity limit', [f'{seen.speed:.6f}' for seen in found]),
        ('largest share of an acceleration limit', [f'{s.acceleration:.6f}' for s in found]),
        ('rows that began to act', [f'{seen.activations:,}' for seen in found]),
        ('steps that the last check braked', [f'{seen.braked:,}' for seen in found]),
        (f'goals reached within {REACHED:g} m', [f'{s.reached} of {s.goals}' for s in found]),
        ('time per step \\[µs]', [f'{1e6 * seen.seconds / seen.steps:.0f}' for seen in found]),
    ):
        table.add_row(label, *values)
    return table


if __name__ == '__main__':
    sys.exit(main())
