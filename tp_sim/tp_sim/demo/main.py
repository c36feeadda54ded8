"""Executable that runs a parameter file's demo goals and reports on them."""

from __future__ import annotations

from pathlib import Path

from rich.console import Console

from tp_controller.command_line import OneLineParser
from tp_controller.config import build_settings, read_parameter_file
from tp_controller.plots import draw_plots
from tp_controller.recording import Recording
from tp_sim.demo.progress import Progress
from tp_sim.demo.script import Leg, read_script
from tp_sim.demo.tables import outcome_table, reason_lines
from tp_sim.demo.timing import Stopwatch
from tp_sim.harness import ClosedLoop


def main() -> int:
    """Run the demo.

    Returns
    -------
    int
        Exit status: 0 if every goal was reached, 1 if not, 2 if it could not run.
    """
    return _parser().run(lambda given: _run(given.config, given.out, given.record, Console()))


def _parser() -> OneLineParser:
    parser = OneLineParser(
        prog='demo',
        description='Run simulator and controller in real time through the goals that a '
        'parameter file lists under tp_demo.',
    )
    parser.add_argument('--config', type=Path, required=True, help='parameter file')
    parser.add_argument(
        '--out', type=Path, default=Path('out/demo'), help='folder for plots (%(default)s)'
    )
    parser.add_argument(
        '--record', type=Path, help='recording of the run (run.mcap in the folder for plots)'
    )
    return parser


def _run(config: Path, out: Path, record: Path | None, console: Console) -> int:
    # What the controller would refuse is refused before any process starts.
    stack = build_settings(read_parameter_file(config, 'tp_controller'), find_rate=True).stack
    script = read_script(config)
    script.check(stack)
    out.mkdir(parents=True, exist_ok=True)
    console.print(f'Starting simulator and controller with {config}')
    legs: list[Leg] = []
    path = out / 'run.mcap' if record is None else record
    with (
        ClosedLoop(config, lockstep=False, record=path) as loop,
        Progress(console) as progress,
    ):
        watch = Stopwatch()
        loop.client.on_state += [progress.follow, watch.follow]
        for number, goals in enumerate(script.goals, start=1):
            leg = Leg(loop, goals)
            progress.begin(f'goal {number} of {len(script.goals)}: {leg.text}', loop.state)
            begin = len(watch)
            leg.run(loop, script.seconds_per_goal)
            leg.timing = watch.timing(begin)
            legs.append(leg)
    console.print(outcome_table(legs, script.tolerance))
    for line in reason_lines(legs, script.tolerance):
        console.print(line)
    console.print(f'Commands: {watch.timing().text}')
    recording = Recording(path)
    console.print(f'Recording: {path}: {recording.contents.text}', soft_wrap=True)
    plots = draw_plots(recording, out)
    console.print(f'Plots in {out}: {", ".join(plot.name for plot in plots)}', soft_wrap=True)
    return 0 if all(leg.reached(script.tolerance) for leg in legs) else 1
