"""Executable that runs the fault table."""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console
from rich.live import Live
from rich.markup import escape
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table

from tp_controller.command_line import OneLineParser
from tp_sim.faults.case import Case, Outcome, run_case
from tp_sim.faults.pauses import PauseWatch, take_priority
from tp_sim.faults.relay import Topics
from tp_sim.faults.report import page_table, read_section, terminal_table, write_section
from tp_sim.faults.rig import Judged
from tp_sim.faults.table import CASES

FAILED = 1
SECTION = 'faults'
LINES = 100
"""So many lines of what the nodes of a case printed are shown at most."""


def main() -> int:
    """Run the cases.

    Returns
    -------
    int
        Exit status: 0, 1 if a case failed, 2 if it could not run, 130 after Ctrl-C.
    """
    return _parser().run(_run)


def _run(arguments: argparse.Namespace) -> int:
    if arguments.list:
        for case in CASES:
            print(f'{case.name:20} {case.done}')
        return 0
    chosen = [case for case in CASES if not arguments.only or case.name in arguments.only]
    own = Judged()
    judged = Judged(
        arguments.controller,
        arguments.node,
        Topics(
            arguments.states,
            arguments.commands,
            arguments.goals or own.topics.goals,
            arguments.command_type == 'joint_state',
        ),
    )
    console = Console()
    # A page that cannot be written to is told before anything runs.
    before = read_section(arguments.page, SECTION) if arguments.page else ''
    rows = run_cases(chosen, judged, console, arguments.verbose, arguments.record)
    if arguments.page:
        kept = before if arguments.only else ''
        write_section(arguments.page, SECTION, page_table(rows, kept))
    return 0 if all(row.passed for row in rows) else FAILED


def run_cases(
    cases: Sequence[Case],
    judged: Judged,
    console: Console,
    verbose: bool = False,
    record: Path | None = None,
) -> list[Outcome]:
    """Run cases one after the other, with a table that grows in the terminal.

    What the relay recorded is written to the folder ``record``, if one is given.
    """
    take_priority()
    rows: list[Outcome] = []
    progress = Progress(
        TextColumn('{task.description}'),
        BarColumn(bar_width=30),
        TextColumn('{task.completed}/{task.total}'),
        TimeElapsedColumn(),
    )
    bar = progress.add_task('', total=len(cases))
    watch = PauseWatch()
    try:
        with Live(_view(rows, progress), console=console, refresh_per_second=2) as live:
            for case in cases:
                progress.update(bar, description=escape(f'{case.name}: {case.done}'))
                row = run_case(case, judged, watch)
                rows.append(row)
                if record is not None:
                    record.mkdir(parents=True, exist_ok=True)
                    text = json.dumps(row.record)
                    (record / f'{case.name}.json').write_text(text, encoding='utf-8')
                row.record.clear()
                progress.advance(bar)
                live.update(_view(rows, progress))
            progress.update(bar, description='')
    finally:
        watch.close()
    for row in rows:
        for text in (*row.found.wrong, *(row.notes if verbose else ())):
            console.print(escape(f'{row.case.name}: {text}'), soft_wrap=True)
        if row.printed and (verbose or not row.passed):
            console.print(escape('\n'.join(row.printed.splitlines()[-LINES:])), soft_wrap=True)
    passed, minutes = sum(row.passed for row in rows), sum(row.seconds for row in rows) / 60.0
    console.print(f'{passed} of {len(rows)} cases passed, in {minutes:.1f} minutes')
    return rows


def _view(rows: Sequence[Outcome], progress: Progress) -> Table:
    grid = Table.grid()
    grid.add_row(terminal_table(rows))
    grid.add_row(progress)
    return grid


def _parser() -> OneLineParser:
    own = Topics()
    parser = OneLineParser(
        prog='faults',
        description='Run a velocity controller in real time with faults around it, and judge '
        'its commands. Speed and change: largest share of a limit. Data: age of the oldest joint '
        'state that moved the arm. Gap: longest time between two commands. Moves, goal: time '
        'until the arm moved again and was at its goal. Pause: longest time for which the '
        'machine did not run a process that was ready.',
    )
    parser.add_argument(
        '--only',
        nargs='+',
        metavar='NAME',
        choices=[case.name for case in CASES],
        help='run these cases',
    )
    parser.add_argument('--list', action='store_true', help='print the cases and end')
    parser.add_argument('--verbose', action='store_true', help='print notes and the nodes’ output')
    parser.add_argument(
        '--page',
        type=Path,
        help='page whose marked section gets the table, in Markdown; with --only others stay',
    )
    parser.add_argument(
        '--record', type=Path, metavar='FOLDER', help='write all joint states and commands there'
    )
    judged = parser.add_argument_group('another controller')
    judged.add_argument(
        '--controller',
        default='',
        metavar='COMMAND',
        help='command line of a ROS node; {parameters} in it is the parameter file of the arm',
    )
    judged.add_argument('--node', default='tp_controller', help='name of its node (%(default)s)')
    judged.add_argument('--states', default=own.states, help='joint states (%(default)s)')
    judged.add_argument('--commands', default=own.commands, help='commands (%(default)s)')
    judged.add_argument(
        '--goals',
        help=f'goals of the position of the arm’s end, PointStamped ({own.goals})',
    )
    judged.add_argument(
        '--command-type',
        choices=('joint_state', 'float64_multi_array'),
        default='joint_state',
        help='message of commands (%(default)s)',
    )
    return parser
