"""Executable that runs many closed loops without ROS and writes a table and pictures."""

from __future__ import annotations

import argparse
import logging
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table

from tp_controller.batch.engine import check_engine, run_batch
from tp_controller.batch.plan import SECONDS, TOLERANCE, Batch, plan_batch
from tp_controller.batch.plots import draw_plots
from tp_controller.batch.table import FILE, check_folder, column, write_runs
from tp_controller.command_line import OneLineParser
from tp_controller.config import read_parameter_file
from tp_controller.errors import InvalidValue

if TYPE_CHECKING:
    import pyarrow as pa


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a batch.

    Parameters
    ----------
    arguments
        Of the command line; those of the process when left out.

    Returns
    -------
    int
        Exit status: 0, 2 if an argument or the file cannot be used, 130 after Ctrl-C.
    """
    return _parser().run(_run, arguments)


def _parser() -> OneLineParser:
    parser = OneLineParser(
        prog='batch',
        description='Run closed loops from random starts to random goals on all cores, without '
        'ROS. The joints carry out every command exactly.',
    )
    add = parser.add_argument
    add('--config', type=Path, required=True, help='parameter file')
    add('--out', type=Path, required=True, help='folder for runs.parquet and the plots')
    add('--runs', type=int, default=100, help='number of draws of start, goals and gain')
    add('--seed', type=int, default=0, help='the same seed gives the same results')
    add('--seconds', type=float, default=SECONDS, help='length of a run (10)')
    add(
        '--schemes',
        nargs='+',
        metavar='TYPE',
        help='values of solver.type, each of which makes all runs; that of the file if left out',
    )
    add(
        '--goals',
        nargs='+',
        metavar='TASK',
        help='tasks that get random goals; those that control a frame if left out',
    )
    add(
        '--gain',
        nargs=2,
        type=float,
        default=(1.0, 1.0),
        metavar=('LEAST', 'LARGEST'),
        help='random factor on the gains of these tasks (1 1)',
    )
    add('--start', nargs='+', type=float, metavar='POSITION', help='start of all runs [rad, m]')
    add(
        '--tolerance',
        type=float,
        default=TOLERANCE,
        help='error of a goal reached [m, rad] (0.01)',
    )
    add('--workers', type=int, help='processes of this machine, one per core if left out')
    add('--scheduler', metavar='ADDRESS', help='run on this Dask cluster: tcp://host:port')
    return parser


def _silence() -> None:
    """Leave it to `main` to say what went wrong: Dask's own messages fill pages."""
    import distributed  # noqa: F401 - sets the levels of its loggers

    for name in list(logging.root.manager.loggerDict):
        if name.partition('.')[0] == 'distributed':
            logging.getLogger(name).setLevel(logging.CRITICAL + 1)


def _run(given: argparse.Namespace) -> None:
    _silence()
    check_engine(given.scheduler, given.workers)
    batch = _plan(given)
    check_folder(given.out)
    started = time.perf_counter()
    with _progress(batch) as step:
        table = run_batch(batch, given.scheduler, given.workers, step)
    seconds = time.perf_counter() - started
    write_runs(table, given.out / FILE)
    draw_plots(table, given.out)
    console = Console()
    console.print(_summary(given.config.name, batch, table))
    console.print(
        f'{batch.cycles:,} cycles in {seconds:.1f} s, start of the workers included: '
        f'{batch.cycles / seconds:,.0f} a second. Written: {given.out}',
        soft_wrap=True,
        highlight=False,
    )


def _plan(given: argparse.Namespace) -> Batch:
    own = {
        key: getattr(given, key)
        for key in ('schemes', 'runs', 'seed', 'seconds', 'goals', 'gain', 'tolerance', 'start')
    }
    values = read_parameter_file(given.config, 'tp_controller')
    try:
        return plan_batch(values, **own)
    except InvalidValue as error:
        raise (error if error.key in own else error.within(str(given.config))) from None


@contextmanager
def _progress(batch: Batch) -> Iterator[Callable[[int], None]]:
    """Progress bar on the standard error; called with the number of runs that were done."""
    columns = (
        BarColumn(),
        TextColumn('{task.completed:.0f} of {task.total:.0f} runs'),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=Console(stderr=True)) as shown:
        task = shown.add_task('', total=batch.runs * len(batch.schemes))
        yield lambda count: shown.advance(task, count)


def _summary(name: str, batch: Batch, table: pa.Table) -> Any:
    text = f'{name}: {batch.runs:,} runs of {(batch.steps - 1) * batch.period:g} s'
    shown = Table(title=escape(text), title_style='bold')
    shown.add_column('')
    found = table.to_pylist()
    cells: dict[str, list[str]] = {}
    for scheme in batch.schemes:
        shown.add_column(scheme, justify='right')
        rows = [row for row in found if row['scheme'] == scheme]
        times = column(rows, 'time_to_reach')
        reached = 100.0 * sum(row['reached'] for row in rows) / len(rows)
        for label, value in (
            ('reached [%]', f'{reached:.1f}'),
            ('median time to reach [s]', f'{np.median(times):.2f}' if times else '–'),
            ('least clearance [m]', _extreme(min, rows, 'clearance')),
            ('worst velocity / limit', _extreme(max, rows, 'velocity_use')),
            ('worst range / limit', _extreme(max, rows, 'range_use')),
            ('worst acceleration / limit', _extreme(max, rows, 'acceleration_use')),
            ('runs with braked steps', f'{sum(row["braked"] > 0 for row in rows)}'),
            ('most reversals of a joint', f'{max(row["reversals"] for row in rows)}'),
        ):
            cells.setdefault(label, []).append(value)
    for label, values in cells.items():
        shown.add_row(escape(label), *values)
    return shown


def _extreme(pick: Any, rows: list[dict[str, Any]], name: str) -> str:
    values = column(rows, name)
    return f'{pick(values):.6f}' if values else '–'
