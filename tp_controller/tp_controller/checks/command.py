"""Executable that checks parameter files before anything moves."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.console import Console

from tp_controller.checks import ERROR, NOTE, SEVERITIES, WARNING, Finding, check_settings, read
from tp_controller.checks.findings import warning
from tp_controller.checks.tables import frames, joints
from tp_controller.command_line import REFUSED, OneLineParser
from tp_controller.config import read_blocks, read_parameter_file, robot_source
from tp_controller.errors import NO_VALUE, InvalidValue, listed, plural, shown
from tp_controller.robot import Robot, read_description

FINE, WARNED = 0, 1
SIMULATOR = 'tp_sim'
POSITIONS = 'initial_positions'
STYLES = {ERROR: 'bold red', WARNING: 'yellow', NOTE: 'dim'}


def main(arguments: Sequence[str] | None = None) -> int:
    """Check files and print what is found, one line each.

    Parameters
    ----------
    arguments
        Of the command line; those of the process when left out.

    Returns
    -------
    int
        Exit status of the worst file: 0 fine, 1 warnings, 2 errors.
    """
    given = _parser().parse_args(arguments)
    console = Console(soft_wrap=True, highlight=False)
    return max(_check(path, given, console) for path in given.files)


def _parser() -> argparse.ArgumentParser:
    parser = OneLineParser(
        prog='check',
        description='Check parameter files of the controller before anything moves: what it would '
        'refuse, and what will hardly work as meant. Exit status 0: fine, 1: warnings, 2: errors.',
        formatter_class=argparse.RawDescriptionHelpFormatter,
        epilog='examples:\n'
        '  ros2 run tp_controller check config/panda_table.yaml\n'
        '  ros2 run tp_controller check --frames config/panda.yaml\n'
        '  ros2 run tp_controller check my_arm.yaml; test $? -lt 2   # warnings are no matter',
    )
    add = parser.add_argument
    add('files', nargs='+', type=Path, metavar='FILE', help='parameter file')
    add('--node', default='tp_controller', help='name of the node (default: %(default)s)')
    add(
        '--urdf',
        metavar='PATH',
        help='description for a file that names no robot: a path, or package://<package>/<path>',
    )
    add(
        '--start',
        nargs='+',
        type=float,
        metavar='POSITION',
        help=f'first positions [rad, m]; {POSITIONS} of {SIMULATOR} if left out',
    )
    add('--frames', action='store_true', help='print frames and joints of the robot')
    return parser


def _check(path: Path, given: argparse.Namespace, console: Console) -> int:
    """Check one file; return the exit status."""
    try:
        values = read_parameter_file(path, given.node)
        found, robot, start = _look(path, values, given)
    except InvalidValue as error:
        key = error.key.removeprefix(str(path)).lstrip(': ') or 'file'
        found, robot, start = [Finding(ERROR, key, f'got {error.got}', error.accepts)], None, None
    for finding in sorted(found, key=lambda one: SEVERITIES.index(one.severity)):
        console.print(f'{path}: {finding}', style=STYLES[finding.severity], markup=False)
    if given.frames and robot is not None:
        q = robot.neutral if start is None else start
        console.print(joints(robot, q), frames(robot, q))
    counts = {
        severity: sum(finding.severity == severity for finding in found) for severity in SEVERITIES
    }
    words = [plural(count, severity) for severity, count in counts.items() if count]
    console.print(f'{path}: {", ".join(words) or "fine"}', markup=False)
    if counts[ERROR]:
        return REFUSED
    return WARNED if counts[WARNING] else FINE


def _look(
    path: Path, values: Mapping[str, Any], given: argparse.Namespace
) -> tuple[list[Finding], Robot | None, NDArray[np.float64] | None]:
    """Findings, the robot if it can be built, and its first configuration if that is known."""
    description = None if given.urdf is None else read_description(given.urdf)
    if not values:
        blocks = listed(read_blocks(path))
        error = Finding(ERROR, given.node, f'no block of that node among {blocks}', '--node NAME')
        return [error], None, None
    if description is None and robot_source(values) is None:
        missing = warning(
            'robot',
            f'got {NO_VALUE}: the node waits for robot_description, and nothing more is checked',
            'robot.dh or robot.urdf, or --urdf PATH here',
        )
        return [missing], None, None
    reading = read(values, description)
    if reading.settings is None:
        found = [Finding.of(error) for error in reading.errors]
        return found, reading.robot, _start(path, given, reading.robot, found)
    found = []
    start = _start(path, given, reading.robot, found)
    return [*found, *check_settings(reading.settings, start)], reading.robot, start


def _start(
    path: Path, given: argparse.Namespace, robot: Robot | None, found: list[Finding]
) -> NDArray[np.float64] | None:
    """First configuration (nq,), None if it is not known; adds what is wrong with it."""
    key, values = '--start', given.start
    if values is None:
        key, values = POSITIONS, read_parameter_file(path, SIMULATOR).get(POSITIONS)
    if values is None or robot is None:
        return None
    try:
        q = np.array(values, dtype=float).reshape(-1)
    except (TypeError, ValueError):
        q = np.full(1, np.nan)
    if q.size != robot.nq or not np.isfinite(q).all():
        accepts = f'{robot.nq} finite numbers: {listed(robot.coordinates)}'
        found.append(Finding(ERROR, key, f'got {shown(values)}', accepts))
        return None
    return q


if __name__ == '__main__':
    sys.exit(main())
