"""Executable that moves an arm a little and tells its delay, lag and noise."""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import rclpy
from numpy.typing import NDArray
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import remove_ros_args

from tp_controller.command_line import OneLineParser
from tp_controller.config import build_robot, read_parameter_file
from tp_controller.config.build import read_parameters
from tp_controller.errors import InvalidValue
from tp_controller.identification import Fit
from tp_controller.measuring import Ended, Refused, block
from tp_controller.ros.arguments import one_line
from tp_controller.ros.arm_measurement import Measurement

REFUSED, UNANSWERED, ENDED = 2, 3, 4
GAIN = 0.05
"""Share by which a joint may move more or less than commanded without being told."""


def main() -> int:
    """Measure the arm.

    Returns
    -------
    int
        Exit status: 0 measured, 2 refused, 3 no joint states, 4 ended by a signal or the arm.
    """
    arguments = _parser().parse_args(remove_ros_args(sys.argv)[1:])
    try:
        values = read_parameters(read_parameter_file(arguments.config, 'tp_controller'))
        robot = build_robot(values)
        if robot.space.blocks:
            raise InvalidValue('robot', 'a base that moves', 'an arm on a fixed base')
        if not 0.0 < arguments.amplitude < math.inf:
            raise InvalidValue('amplitude', f'{arguments.amplitude:g}', 'a number above 0')
        rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    except InvalidValue as error:
        return _fail(str(error), REFUSED)
    except RuntimeError as error:
        return _fail(one_line(error), REFUSED)
    node = rclpy.create_node('measure_arm')
    try:
        measurement = Measurement(node, robot, values, arguments.amplitude)
        fits, noise = measurement.measure(None if arguments.yes else _ask)
        print(_report(robot.joints, fits, noise))
    except (InvalidValue, Refused) as error:
        return _fail(str(error), REFUSED)
    except TimeoutError as error:
        return _fail(str(error), UNANSWERED)
    except Ended as error:
        return _fail(str(error), ENDED)
    except (KeyboardInterrupt, EOFError):
        return _fail('interrupted before the arm was moved', ENDED)
    finally:
        node.destroy_node()
        rclpy.try_shutdown()
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = OneLineParser(
        prog='measure_arm',
        description='Move each joint of an arm a little, there and back, and print its delay, lag '
        'and noise for the parameter file. No controller may run meanwhile.',
        formatter_class=argparse.RawDescriptionHelpFormatter,
        epilog='example:\n  ros2 run tp_controller measure_arm --config config/panda.yaml',
    )
    parser.add_argument(
        '--config', type=Path, required=True, help="the controller's parameter file"
    )
    parser.add_argument(
        '--amplitude',
        type=float,
        default=0.02,
        help='how far each joint moves [rad, m] (default: %(default)s)',
    )
    parser.add_argument('--yes', action='store_true', help='do not ask before the arm moves')
    return parser


def _fail(message: str, status: int) -> int:
    print(f'measure_arm: {message}', file=sys.stderr)
    return status


def _ask(moves: str) -> None:
    """Ask for a confirmation of motions.

    Raises
    ------
    Refused
        If it is not given.
    """
    if not sys.stdin.isatty():
        raise Refused('this moves the arm: say --yes, or run it in a terminal')
    answer = input(f'The arm will move, one joint after the other: {moves}. Go on? [y/N] ')
    if answer.strip().lower() not in ('y', 'yes'):
        raise Refused('not confirmed')


def _report(joints: Sequence[str], fits: Sequence[Fit], noise: NDArray[np.float64]) -> str:
    """A line per joint on how well its fit explains it, and the `block` for the file."""
    lines = []
    for joint, fit in zip(joints, fits, strict=True):
        line = (
            f'# {joint}: delay {1e3 * fit.delay:.1f} ms, lag {1e3 * fit.lag:.1f} ms, differs '
            f'from that by {fit.residual:.2g} at most, {fit.rms:.2g} rms of {fit.motion:.2g}'
        )
        if not fit.explains:
            line += '; that does not explain its motion, do not use these values'
        elif abs(fit.gain - 1.0) > GAIN:
            line += f'; it moves {fit.gain:.3g} times as far as it is told'
        lines.append(line)
    return '\n'.join([*lines, block(fits, noise)])
