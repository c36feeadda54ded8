"""Executable that sends an arm to random goals for a long time and counts broken limits."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Mapping
from pathlib import Path

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from tp_controller.command_line import OneLineParser
from tp_controller.solvers import SOLVER_TYPES
from tp_sim.long_runs import run_all
from tp_sim.settings import KINEMATIC, PLANT, RIGID_BODY
from tp_sim.watch import REACHED, Outcome

BROKEN = 1
OPTIONS = ('delay', 'lag', 'noise', 'scale', 'quantum', 'command_loss', 'state_loss')
"""Parameters ``plant.…`` that can be given."""
PLANTS: Mapping[str, Mapping[str, float]] = {
    'ideal': {},
    'delay 1': {'delay': 1},
    'delay 2': {'delay': 2},
    'delay 3': {'delay': 3},
    'lag 10 ms': {'lag': 0.01},
    'lag 30 ms': {'lag': 0.03},
    'lag 50 ms': {'lag': 0.05},
    'noise 1e-4': {'noise': 1e-4},
    'noise 1e-3': {'noise': 1e-3},
    'command loss 10 %': {'command_loss': 0.1},
    'command loss 50 %': {'command_loss': 0.5},
    'state loss 10 %': {'state_loss': 0.1},
    'state loss 50 %': {'state_loss': 0.5},
    'delay 1, lag 20 ms, noise 1e-4, losses 10 %': {
        'delay': 1,
        'lag': 0.02,
        'noise': 1e-4,
        'command_loss': 0.1,
        'state_loss': 0.1,
    },
    'delay 3, lag 50 ms, noise 1e-3, losses 50 %': {
        'delay': 3,
        'lag': 0.05,
        'noise': 1e-3,
        'command_loss': 0.5,
        'state_loss': 0.5,
    },
}
"""Arms of ``--plants table``, by what is not ideal of them."""


def main() -> int:
    """Run the schemes.

    Returns
    -------
    int
        Exit status: 0, 1 if a limit was broken, 2 if the file or an argument cannot be used, 130
        after Ctrl-C.
    """
    return _parser().run(_run)


def _run(arguments: argparse.Namespace) -> int:
    plant = {f'plant.{key}': getattr(arguments, key) for key in OPTIONS}
    plant |= {'plant.type': arguments.plant, 'plant.seed': arguments.seed}
    plant = {key: value for key, value in plant.items() if value is not None}
    plants = PLANTS if arguments.plants else {'': {}}
    arms = {
        name: plant | {f'plant.{key}': value for key, value in given.items()}
        for name, given in plants.items()
    }
    config, schemes, declared = arguments.config, arguments.schemes, arguments.declared
    found = run_all(config, schemes, arguments.steps, arguments.seed, arms, declared)
    name = arguments.config.name
    if arguments.plants:
        told = 'the controller knows' if arguments.declared else 'the controller does not know'
        for scheme in next(iter(found.values())):
            by_plant = {plant: outcomes[scheme] for plant, outcomes in found.items()}
            Console().print(_plant_table(f'{name}, {scheme}; {told} the arm', by_plant))
    else:
        Console().print(_table(name, found['']))
    broken = any(seen.broken for outcomes in found.values() for seen in outcomes.values())
    return BROKEN if broken else 0


def _at_least(least: int) -> Callable[[str], int]:
    def read(text: str) -> int:
        if not text.isdigit() or int(text) < least:
            raise argparse.ArgumentTypeError(f'got {text!r}; accepts a whole number from {least}')
        return int(text)

    return read


def _parser() -> OneLineParser:
    parser = OneLineParser(prog='stress', description=__doc__)
    parser.add_argument('--config', type=Path, required=True, help='parameter file')
    parser.add_argument('--steps', type=_at_least(1), default=100_000, help='of every scheme')
    parser.add_argument(
        '--seed', type=_at_least(0), default=0, help='of the random goals, noise and losses'
    )
    parser.add_argument(
        '--schemes',
        nargs='+',
        choices=sorted(SOLVER_TYPES),
        help='values of solver.type; that of the file when left out',
    )
    arm = parser.add_argument_group('the arm, in place of plant.… of tp_sim in the file')
    for key in OPTIONS:
        arm.add_argument(
            f'--{key.replace("_", "-")}',
            type=_at_least(0) if key == 'delay' else float,
            help=PLANT[f'plant.{key}'].description.replace('%', '%%'),
        )
    arm.add_argument('--plant', choices=(KINEMATIC, RIGID_BODY), help='plant.type')
    arm.add_argument(
        '--plants',
        choices=('table',),
        help='run many arms, one after the other, with delays, lags, noise and losses',
    )
    arm.add_argument(
        '--declared',
        action=argparse.BooleanOptionalAction,
        default=True,
        help='tell the controller what its arm is like, by robot.delay, lag, noise and hold',
    )
    arm.add_argument(
        '--undeclared', dest='declared', action='store_false', help='same as --no-declared'
    )
    return parser


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
        ('steps that the safety filter braked', [f'{seen.braked:,}' for seen in found]),
        ('steps in which the arm did not follow', [f'{seen.astray:,}' for seen in found]),
        ('steps at rest with a change of sign', [f'{seen.restless:.2%}' for seen in found]),
        (f'goals reached within {REACHED:g} m', [f'{s.reached} of {s.goals}' for s in found]),
        ('time per step \\[µs]', [f'{1e6 * seen.seconds / seen.steps:.0f}' for seen in found]),
    ):
        table.add_row(label, *values)
    return table


def _plant_table(name: str, outcomes: dict[str, Outcome]) -> Table:
    steps = next(iter(outcomes.values())).steps
    title = f'{escape(name)}: {steps:,} steps to random goals'
    table = Table(title=title, title_style='bold', box=SIMPLE_HEAD, padding=(0, 1, 0, 0))
    table.add_column('arm')
    for header in (
        'least\ndistance',
        'least\nroom',
        'speed\n/ limit',
        'accel.\n/ limit',
        'signs\nat rest',
        'not\nfollowing',
        'goals\nreached',
    ):
        # The first column is broken into lines on a narrow terminal, numbers are not.
        table.add_column(header, justify='right', no_wrap=True)
    for plant, seen in outcomes.items():
        table.add_row(
            plant,
            f'{seen.least_distance:.6f}',
            f'{seen.least_room:.6f}',
            f'{seen.speed:.4f}',
            f'{seen.acceleration:.4f}',
            f'{seen.restless:.2%}',
            f'{seen.astray:,}',
            f'{seen.reached}/{seen.goals}',
            style='red' if seen.broken else None,
        )
    return table


if __name__ == '__main__':
    sys.exit(main())
