"""Executable that records a running controller."""

from __future__ import annotations

import argparse
import math
import os
import signal
import sys
import time
from pathlib import Path

import rclpy
from rclpy.exceptions import NameValidationException
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import remove_ros_args
from rclpy.validate_topic_name import validate_topic_name

from tp_controller.command_line import REFUSED, OneLineParser, positive_time
from tp_controller.errors import InvalidValue
from tp_controller.recording import Contents, RecordingWriter
from tp_controller.ros.arguments import one_line
from tp_controller.ros.parent import end_with_ros2
from tp_controller.ros.recorder import Recorder

NOTHING_SEEN = 1
PERIOD = 0.005
"""Time [s] between two looks for messages."""


def main() -> int:
    """Record until Ctrl-C, or for a time.

    Returns
    -------
    int
        Exit status: 0; 1 if no controller was seen, then there is no file; 2 if an argument
        cannot be used.
    """
    given = _parser().parse_args(remove_ros_args(sys.argv)[1:])
    ended: list[int] = []
    for number in (signal.SIGINT, signal.SIGTERM):
        # An exception in the middle of a write would spoil the file.
        signal.signal(number, lambda signum, _: ended.append(signum))
    end_with_ros2()
    try:
        rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    except RuntimeError as error:
        return _refuse(one_line(error))
    node = rclpy.create_node(f'tp_record_{os.getpid()}', start_parameter_services=False)
    try:
        validate_topic_name(given.controller)
        with RecordingWriter(given.file, given.overwrite) as writer:
            recorder = Recorder(node, given.controller, writer)
            print(f'record: {recorder.controller} into {given.file}, Ctrl-C ends it', flush=True)
            _record(recorder, given.seconds, ended)
            if not recorder.seen:
                writer.discard()
                print(f'record: no state of {recorder.controller}, no file', file=sys.stderr)
                return NOTHING_SEEN
    except InvalidValue as error:
        return _refuse(str(error))
    except NameValidationException as error:
        return _refuse(one_line(error))
    finally:
        node.destroy_node()
        rclpy.try_shutdown()
    for line in summary(given.file, writer.contents):
        print(line)
    return 0


def _record(recorder: Recorder, seconds: float, ended: list[int]) -> None:
    end = time.monotonic() + seconds
    while not ended and time.monotonic() < end:
        if not recorder.work():
            time.sleep(PERIOD)
        for note in recorder.take_notes():
            print(f'record: {note}', file=sys.stderr)
    recorder.finish()


def summary(path: Path, contents: Contents) -> list[str]:
    """What is in a recording, for people."""
    lines = [f'record: {path}: {contents.text}']
    width = max(map(len, contents.counts), default=0)
    lines += [f'  {topic:{width}}  {count}' for topic, count in sorted(contents.counts.items())]
    return lines


def _parser() -> argparse.ArgumentParser:
    parser = OneLineParser(
        prog='record',
        description='Record a running controller into an MCAP file: every topic that it listens '
        'to or publishes, its parameters and its robot. Ctrl-C ends it.',
        formatter_class=argparse.RawDescriptionHelpFormatter,
        epilog='examples:\n'
        '  ros2 run tp_controller record run.mcap\n'
        '  ros2 run tp_controller record run.mcap --controller /arm_1/tp_controller --seconds 60',
    )
    parser.add_argument('file', type=Path, help='the recording, a new file that ends in .mcap')
    parser.add_argument(
        '--controller', default='tp_controller', help='name of the node (default: %(default)s)'
    )
    parser.add_argument(
        '--seconds',
        type=positive_time,
        default=math.inf,
        help='time [s] after which it ends by itself',
    )
    parser.add_argument('--overwrite', action='store_true', help='replace a file that is there')
    return parser


def _refuse(message: str) -> int:
    print(f'record: {message}', file=sys.stderr)
    return REFUSED
