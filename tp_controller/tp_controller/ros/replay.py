"""Executable that steps the controller's stack from a recording, and compares its commands."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from tp_controller.command_line import OneLineParser
from tp_controller.errors import TaskPriorityError, plural
from tp_controller.recording import Recording
from tp_controller.ros.replaying import Answer, Replay

DIFFERENT, REFUSED = 1, 2


def main() -> int:
    """Replay a recording and say whether commands are the same.

    Returns
    -------
    int
        Exit status: 0 if all commands are equal to the last bit; 1 if not; 2 if the file cannot
        be replayed.
    """
    given = _parser().parse_args()
    try:
        recording = Recording(given.file)
        replay = Replay(recording)
        answers = list(replay.answers())
    except TaskPriorityError as error:
        print(f'replay: {error}', file=sys.stderr)
        return REFUSED
    if not answers:
        print(f'replay: {given.file}: no cycle that can be replayed', file=sys.stderr)
        return REFUSED
    for line in report(answers, replay.joints):
        print(line)
    for note in replay.notes:
        print(f'  {note}')
    if not recording.complete:
        print('  the file breaks off: it was not finished')
    return 0 if all(answer.same for answer in answers) else DIFFERENT


def report(answers: Sequence[Answer], joints: Sequence[str]) -> list[str]:
    """What came out, in lines for people."""
    wrong = [answer for answer in answers if not answer.same]
    count = plural(len(answers), 'command')
    if not wrong:
        return [f'replay: {count}, all equal to the last bit']
    first = wrong[0]
    difference = np.abs(first.recorded - first.replayed)
    i = int(np.argmax(difference))
    largest = max(float(np.max(np.abs(a.recorded - a.replayed))) for a in wrong)
    seconds = 1e-9 * (first.stamp - answers[0].stamp)
    return [
        f'replay: {count}, {len(wrong)} of them different',
        f'  first at {seconds:.3f} s, cycle {first.cycle}: {joints[i]} recorded '
        f'{first.recorded[i]:.17g}, replayed {first.replayed[i]:.17g}, '
        f'{difference[i]:.2g} apart',
        f'  largest difference {largest:.2g} rad/s or m/s',
    ]


def _parser() -> argparse.ArgumentParser:
    parser = OneLineParser(
        prog='replay',
        description='Step the stack of a recording from its joint states and goals, without '
        'nodes, and compare the commands with those recorded.',
        formatter_class=argparse.RawDescriptionHelpFormatter,
        epilog='example:\n  ros2 run tp_controller replay run.mcap',
    )
    parser.add_argument('file', type=Path, help='a recording')
    return parser
