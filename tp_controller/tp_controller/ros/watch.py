"""Executable that shows a running controller in the terminal, for people."""

from __future__ import annotations

import argparse
import os
import signal
import sys
import time

import rclpy
from rclpy.exceptions import NameValidationException
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import remove_ros_args
from rich.console import Console
from rich.live import Live

from tp_controller.command_line import OneLineParser, positive_time
from tp_controller.ros.arguments import one_line
from tp_controller.ros.cycle import ANSWERING
from tp_controller.ros.parent import end_with_ros2
from tp_controller.ros.watch_table import render
from tp_controller.ros.watcher import SETTLE, Watcher

NOTHING_SEEN, REFUSED, NOT_RUNNING = 1, 2, 3
PERIOD, PLAIN_PERIOD = 0.2, 1.0
"""Time [s] between two pictures: in a terminal, and in a file or pipe."""


def main() -> int:
    """Show a controller until Ctrl-C, or once.

    Returns
    -------
    int
        Exit status: 0; with ``--once`` 1 if no controller was seen and 3 if it does not answer
        joint states; 2 if an argument cannot be used.
    """
    given = _parser().parse_args(remove_ros_args(sys.argv)[1:])
    for number in (signal.SIGINT, signal.SIGTERM):
        # Who started this in the background of a script had SIGINT ignored.
        signal.signal(number, signal.default_int_handler)
    end_with_ros2()
    try:
        rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    except RuntimeError as error:
        return _refuse(one_line(error))
    node = rclpy.create_node(f'tp_watch_{os.getpid()}', start_parameter_services=False)
    try:
        watcher = Watcher(node, given.controller)
        return _once(watcher, given.timeout) if given.once else _watch(watcher, given.period)
    except NameValidationException as error:
        return _refuse(one_line(error))
    except BrokenPipeError:
        # The reader of a pipe has had enough; nothing is to be flushed into it at the end.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except KeyboardInterrupt:
        return 0
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


def _parser() -> argparse.ArgumentParser:
    parser = OneLineParser(
        prog='watch',
        description='Show what a running controller does: its levels and tasks, who blocks whom, '
        'what limits it, and how old its commands are. Ctrl-C ends it.',
        formatter_class=argparse.RawDescriptionHelpFormatter,
        epilog='examples:\n'
        '  ros2 run tp_controller watch\n'
        '  ros2 run tp_controller watch --controller /arm_1/tp_controller\n'
        '  ros2 run tp_controller watch --once || echo "not running"',
    )
    parser.add_argument(
        '--controller', default='tp_controller', help='name of the node (default: %(default)s)'
    )
    parser.add_argument(
        '--once',
        action='store_true',
        help='print one table; exit status 0: it answers joint states, 1: no controller was seen, '
        '3: it does not answer joint states',
    )
    parser.add_argument(
        '--timeout',
        type=positive_time,
        default=5.0,
        help='time [s] that --once waits for a controller (default: %(default)s)',
    )
    parser.add_argument(
        '--period',
        type=positive_time,
        help=f'time [s] between two tables (default: {PERIOD}; {PLAIN_PERIOD} in a file or pipe)',
    )
    return parser


def _refuse(message: str) -> int:
    print(f'watch: {message}', file=sys.stderr)
    return REFUSED


def _once(watcher: Watcher, timeout: float) -> int:
    """Print one table and return the exit status."""
    end = time.monotonic() + timeout
    while (sight := watcher.look()).state is None:
        if time.monotonic() > end:
            print(f'watch: {_nothing(watcher, timeout)}', file=sys.stderr)
            return NOTHING_SEEN
        time.sleep(0.02)
    end = time.monotonic() + SETTLE
    while time.monotonic() < end:
        time.sleep(0.02)
        sight = watcher.look()
    Console().print(render(sight))
    assert sight.state is not None
    return 0 if sight.state.status in ANSWERING and not sight.silence else NOT_RUNNING


def _nothing(watcher: Watcher, timeout: float) -> str:
    return watcher.look().silence or f'no state of {watcher.topic} in {timeout:g} s'


def _watch(watcher: Watcher, period: float | None) -> int:
    """Show table after table until Ctrl-C."""
    console = Console()
    if not console.is_terminal:
        while True:
            time.sleep(period or PLAIN_PERIOD)
            console.print(render(watcher.look()), '')
            sys.stdout.flush()
    sight = watcher.look()
    try:
        with Live(render(sight), console=console, screen=True, auto_refresh=False) as live:
            while True:
                time.sleep(period or PERIOD)
                sight = watcher.look()
                live.update(render(sight), refresh=True)
    finally:
        # The last picture stays, to be read and copied.
        console.print(render(sight))
