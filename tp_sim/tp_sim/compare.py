"""Executable that runs the same goals under several resolution schemes and prints a table.

It computes what the nodes do in lockstep, without processes and topics: the stack answers a
configuration, the integrator moves the joints.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from tp_controller.command_line import OneLineParser
from tp_controller.config import build_settings, read_parameter_file
from tp_controller.errors import InvalidValue
from tp_controller.parameters import Flat
from tp_controller.robot import Space
from tp_controller.solvers import SOLVER_TYPES
from tp_controller.stack import Stack
from tp_sim.demo.script import Circle, Goal, goal_text, read_script
from tp_sim.settings import build_simulator_settings


class Outcome(NamedTuple):
    """What a scheme made of one group of goals."""

    errors: dict[str, float]
    """Error norm [m, rad] at the end by task."""
    largest_speed: float
    """Largest norm of the joint velocity [rad/s, m/s]."""
    ends: list[NDArray[np.float64]]
    """Configuration (nq,) at the start and after every round of a circle."""
    space: Space
    """Configuration space of the robot."""

    def drift(self, begin: int, end: int) -> float:
        """How far the joints are apart after two rounds [rad, m]."""
        return float(np.linalg.norm(self.space.difference(self.ends[begin], self.ends[end])))


def main() -> int:
    """Compare schemes.

    Returns
    -------
    int
        Exit status: 0, 2 if the file cannot be used, 130 after Ctrl-C.
    """
    return _parser().run(lambda given: compare(given.config, given.schemes, Console()))


def _parser() -> OneLineParser:
    parser = OneLineParser(
        prog='compare',
        description='Run the goals that a parameter file lists under tp_demo, each from the '
        'initial positions, under several resolution schemes.',
    )
    parser.add_argument('--config', type=Path, required=True, help='parameter file')
    parser.add_argument(
        '--schemes',
        nargs='+',
        choices=list(SOLVER_TYPES),
        default=list(SOLVER_TYPES),
        help='values of solver.type (all that the file has the parameters for)',
    )
    return parser


def compare(config: Path, schemes: Sequence[str], console: Console) -> None:
    """Print a table of every goal under every scheme.

    Raises
    ------
    InvalidValue
        If the file cannot be used, by any of the schemes.
    """
    values = read_parameter_file(config, 'tp_controller')
    script = read_script(config)
    stacks: dict[str, Stack] = {}
    refusals: list[tuple[str, InvalidValue]] = []
    for scheme in schemes:
        try:
            stacks[scheme] = build_settings(values | {'solver.type': scheme}).stack
            script.check(stacks[scheme])
        except InvalidValue as error:
            refusals.append((scheme, error))
    if not stacks:
        raise refusals[0][1]
    console.print(f'Running {config} under {", ".join(stacks)}', soft_wrap=True)
    for goals in script.goals:
        outcomes = {
            scheme: run(config, stack, goals, script.seconds_per_goal)
            for scheme, stack in stacks.items()
        }
        console.print(_table(goals, script.seconds_per_goal, outcomes))
    for scheme, refusal in refusals:
        console.print(escape(f'Not under {scheme}: {refusal}'), soft_wrap=True)


def run(config: Path, stack: Stack, goals: Sequence[Goal], seconds: float) -> Outcome:
    """Let a stack pursue goals from the initial positions of a parameter file.

    Parameters
    ----------
    config
        The parameter file, for the simulator.
    stack
        The stack, under the scheme to be tried.
    goals
        Goals that are sent together.
    seconds
        Time [s] for them.
    """
    parameters: Flat = read_parameter_file(config, 'tp_sim')
    settings = build_simulator_settings(parameters)
    integrator, dt = settings.integrator, 1.0 / settings.values['rate']
    stack.step(integrator.q)
    starts = {name: stack.tasks[name].current for name, _ in goals}
    for name, values in goals:
        if not isinstance(values, Circle):
            stack.tasks[name].target = values
    circles = [(name, values) for name, values in goals if isinstance(values, Circle)]
    ends: list[NDArray[np.float64]] = []
    largest = 0.0
    for i in range(round(seconds / dt) + 1):
        for name, circle in circles:
            task = stack.tasks[name]
            task.target, task.feedforward = circle.at(starts[name], i * dt)
        q = integrator.q
        command = stack.step(q).command
        largest = max(largest, float(np.linalg.norm(command)))
        if circles and (late := len(ends) * circles[0][1].period - i * dt) < dt:
            # A round ends between two steps.
            ends.append(settings.space.integrate(q, late * command))
        integrator.step(command, dt)
    listed = [name for level in stack.hierarchy for name in level.split(' + ')]
    errors = {name: float(np.linalg.norm(stack.tasks[name].error)) for name in listed}
    return Outcome(errors, largest, ends, settings.space)


def _table(goals: list[Goal], seconds: float, outcomes: dict[str, Outcome]) -> Table:
    table = Table(title=escape(f'{goal_text(goals)}: error norms after {seconds:g} s'))
    table.add_column('solver.type', no_wrap=True)
    first = next(iter(outcomes.values()))
    for name in first.errors:
        # A narrow terminal folds a long name rather than cutting it.
        table.add_column(name, justify='right', overflow='fold')
    table.add_column('largest ‖qd‖', justify='right')
    # How far the joints are, after some rounds of a circle, from where they were before.
    rounds = len(first.ends) - 1
    drifts = [(0, 1), (0, rounds), (1, rounds)] if rounds > 1 else [(0, 1)][:rounds]
    for begin, end in drifts:
        table.add_column(f'drift {begin} to {end}', justify='right')
    for scheme, outcome in outcomes.items():
        cells = [_short(error) for error in outcome.errors.values()]
        cells.append(f'{outcome.largest_speed:.3f}')
        cells += [_short(outcome.drift(begin, end)) for begin, end in drifts]
        table.add_row(scheme, *cells)
    return table


def _short(value: float) -> str:
    return f'{value:.4f}' if value == 0.0 or value >= 1e-3 else f'{value:.0e}'
