"""Executable that looks for configurations that have goals, before anything moves."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tp_controller.command_line import REFUSED, OneLineParser
from tp_controller.config import build_settings, read_parameter_file
from tp_controller.errors import InvalidValue, TaskPriorityError, listed, shown
from tp_controller.planning.search import MOST, SECONDS, Answer, solve
from tp_controller.robot import Robot, read_description
from tp_controller.stack import Stack

NONE_FOUND = 1
SIMULATOR, POSITIONS = 'tp_sim', 'initial_positions'


def main(arguments: Sequence[str] | None = None) -> int:
    """Search and print the solutions, the best first.

    Parameters
    ----------
    arguments
        Of the command line; those of the process when left out.

    Returns
    -------
    int
        Exit status: 0 one was found, 1 none was, 2 an argument or the file cannot be used.
    """
    words = sys.argv[1:] if arguments is None else list(arguments)
    given = _parser().parse_args(words)
    try:
        return _run(given)
    except TaskPriorityError as error:
        print(f'solve: {error}', file=sys.stderr)
        return REFUSED


def _parser() -> argparse.ArgumentParser:
    parser = OneLineParser(
        prog='solve',
        description='Look for configurations that have goals of one or more tasks, inside all '
        'ranges and distances, with every task of the levels above. Exit status 0: found, '
        '1: none found, and why, 2: cannot be used.',
        formatter_class=argparse.RawDescriptionHelpFormatter,
        epilog='examples:\n'
        '  ros2 run tp_controller solve config/panda_table.yaml hand_position 0.5 0.3 0.35\n'
        '  ros2 run tp_controller solve config/a4_position_joint.yaml ee_position 0.3 1.2 '
        'joint_1_position 0.8 --json',
    )
    add = parser.add_argument
    add('file', type=Path, metavar='FILE', help='parameter file')
    add('goals', nargs='+', metavar='TASK VALUES', help='goals: each a task and its values')
    add('--node', default='tp_controller', help='name of the node (default: %(default)s)')
    add('--urdf', metavar='PATH', help='description for a file that names no robot')
    add(
        '--start',
        nargs='+',
        type=float,
        metavar='POSITION',
        help=f'present positions [rad, m]; {POSITIONS} of {SIMULATOR} if left out',
    )
    add('--seconds', type=float, default=SECONDS, help='time [s] of the search (%(default)g)')
    add('--most', type=int, default=MOST, help='number of solutions that are enough (%(default)s)')
    add('--json', action='store_true', help='print one object of JSON')
    return parser


def _run(given: argparse.Namespace) -> int:
    values = read_parameter_file(given.file, given.node)
    description = None if given.urdf is None else read_description(given.urdf)
    try:
        stack = build_settings(values, description).stack
    except InvalidValue as error:
        raise error.within(str(given.file)) from None
    goals = read_goals(stack, given.goals)
    answer = solve(stack, goals, _start(given, stack.robot), given.seconds, given.most)
    if given.json:
        print(json.dumps(as_json(answer, stack.robot)))
    else:
        _show(answer, stack.robot)
    return 0 if answer.solutions else NONE_FOUND


def read_goals(stack: Stack, words: Sequence[str]) -> dict[str, list[float]]:
    """Goals by task out of words: a name, its values, the next name.

    Raises
    ------
    InvalidValue
        If the first word is no name, or a name stands twice or has no value.
    """
    goals: dict[str, list[float]] = {}
    name = ''
    for word in words:
        try:
            value = float(word)
        except ValueError:
            if word in goals:
                raise InvalidValue('goals', f'{shown(word)} twice', 'every task once') from None
            name, goals[word] = word, []
            continue
        if not name:
            raise InvalidValue('goals', shown(word), f'a task first: {listed(stack.tasks)}')
        goals[name].append(value)
    return goals


def _start(given: argparse.Namespace, robot: Robot) -> NDArray[np.float64]:
    """Present configuration (nq,): given, that of the simulator, or zero."""
    key, values = '--start', given.start
    if values is None:
        key, values = POSITIONS, read_parameter_file(given.file, SIMULATOR).get(POSITIONS)
    if values is None:
        return robot.neutral
    q = np.array(values, dtype=float).reshape(-1)
    if q.size != robot.nq or not np.isfinite(q).all():
        accepts = f'{robot.nq} finite numbers: {listed(robot.coordinates)}'
        raise InvalidValue(key, shown(values), accepts)
    return q


def as_json(answer: Answer, robot: Robot) -> dict[str, Any]:
    """Answer as an object of JSON; infinite numbers are null."""
    return {
        'found': bool(answer.solutions),
        'seconds': answer.seconds,
        'starts': answer.starts,
        'coordinates': list(robot.coordinates),
        'solutions': [
            {
                'q': one.q.tolist(),
                'seconds': one.seconds,
                'room': one.room,
                'clearance': one.clearance if np.isfinite(one.clearance) else None,
                'errors': one.errors,
            }
            for one in answer.solutions
        ],
        'why': answer.why,
        'reasons': list(answer.reasons),
    }


def _show(answer: Answer, robot: Robot) -> None:
    """Print one line per solution, the best first, and what was found in words."""
    rows = [['time [s]', 'room [%]', 'clear [m]', *robot.coordinates]] * bool(answer.solutions)
    for one in answer.solutions:
        clear = f'{one.clearance:.3f}' if np.isfinite(one.clearance) else '–'
        cells = [f'{one.seconds:.2f}', f'{100.0 * one.room:.0f}', clear]
        rows.append([*cells, *(f'{value:.4f}' for value in one.q)])
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for row in rows:
        print('  '.join(cell.rjust(width) for cell, width in zip(row, widths, strict=True)))
    print(answer.text)


if __name__ == '__main__':
    sys.exit(main())
