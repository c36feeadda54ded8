"""Executable that runs simulator, controller and the page in the browser on one file."""

from __future__ import annotations

import argparse
import os
import signal
import sys
import time
from contextlib import ExitStack
from pathlib import Path

from tp_controller.command_line import OneLineParser
from tp_controller.config import read_parameters
from tp_controller.config.files import read_parameter_file
from tp_controller.errors import TaskPriorityError
from tp_controller.ros.parent import end_with_ros2
from tp_sim.harness import HarnessError, NodeProcess

REFUSED, ENDED = 2, 1
PERIOD = 0.1
"""Time [s] between two looks at the processes."""


def main() -> int:
    """Run all three until Ctrl-C.

    Returns
    -------
    int
        Exit status: 0; 1 if one of them has ended by itself; 2 if an argument cannot be used.
    """
    given = _parser().parse_args()
    for number in (signal.SIGINT, signal.SIGTERM):
        # Who started this in the background of a script had SIGINT ignored.
        signal.signal(number, signal.default_int_handler)
    end_with_ros2()
    try:
        # What the controller would refuse is refused before any process starts.
        read_parameters(read_parameter_file(given.config, 'tp_controller'))
        with ExitStack() as stack:
            return _run(given, stack)
    except (TaskPriorityError, HarnessError) as error:
        print(f'live: {error}', file=sys.stderr)
        return REFUSED
    except KeyboardInterrupt:
        return 0


def _parser() -> argparse.ArgumentParser:
    parser = OneLineParser(
        prog='live',
        description='Run simulator and controller in real time, with the page in the browser. '
        'Ctrl-C ends all three.',
    )
    parser.add_argument('--config', type=Path, required=True, help='parameter file')
    parser.add_argument('--namespace', default='', help='namespace of all nodes')
    parser.add_argument('--host', default='127.0.0.1', help='as view (default: %(default)s)')
    parser.add_argument('--port', default='8080', help='as view (default: %(default)s)')
    parser.add_argument('--read-only', action='store_true', help='as view')
    return parser


def _run(given: argparse.Namespace, stack: ExitStack) -> int:
    remap = ['-r', f'__ns:={given.namespace}'] if given.namespace else []
    page = ['--config', str(given.config), '--host', given.host, '--port', given.port]
    page += ['--read-only'] * given.read_only
    environment = dict(os.environ)

    def start(package: str, executable: str, file: Path | None, *arguments: str) -> NodeProcess:
        process = NodeProcess(package, executable, file, environment, remap, arguments)
        stack.callback(process.stop)
        return process

    processes = [
        # The page takes longest to come up, and stops first.
        start('tp_sim', 'simulator', given.config),
        start('tp_controller', 'controller', given.config),
        start('tp_controller', 'view', None, *page),
    ]
    printed = [0] * len(processes)
    while True:
        ended = [process for process in processes if not process.running]
        for i, process in enumerate(processes):
            text, printed[i] = process.output_since(printed[i])
            print(text, end='', flush=True)
        if ended:
            print(f'live: {ended[0].name} has ended', file=sys.stderr)
            return ended[0].wait() or ENDED
        time.sleep(PERIOD)
