"""Executable that draws the pictures of a recording."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from tp_controller.command_line import REFUSED, OneLineParser
from tp_controller.errors import TaskPriorityError
from tp_controller.plots.animation import check_animation, draw_animation
from tp_controller.plots.report import draw_plots, run_and_stack
from tp_controller.plots.style import FORMATS
from tp_controller.recording import Recording


def main() -> int:
    """Draw the pictures.

    Returns
    -------
    int
        Exit status: 0; 2 if an argument or the recording cannot be used.
    """
    given = _parser().parse_args()
    try:
        if given.animation is not None:
            check_animation(given.animation)
        recording = Recording(given.file)
        if not recording.complete:
            print(f'plot: {given.file} breaks off: it was not finished', file=sys.stderr)
        for path in draw_plots(recording, given.out, given.format):
            print(path)
        if given.animation is not None:
            draw_animation(*run_and_stack(recording), given.animation)
            print(given.animation)
    except TaskPriorityError as error:
        print(f'plot: {error}', file=sys.stderr)
        return REFUSED
    except OSError as error:
        print(f'plot: {error.filename}: {error.strerror}', file=sys.stderr)
        return REFUSED
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = OneLineParser(
        prog='plot',
        description='Draw what is in a recording: errors by level, joints and their limits, '
        'distances, ranks, ages, and the arm.',
        formatter_class=argparse.RawDescriptionHelpFormatter,
        epilog='examples:\n'
        '  ros2 run tp_controller plot run.mcap --out pictures\n'
        '  ros2 run tp_controller plot run.mcap --out pictures --format pdf '
        '--animation arm.gif',
    )
    parser.add_argument('file', type=Path, help='a recording')
    parser.add_argument(
        '--out', type=Path, default=Path(), help='folder for the pictures (default: this one)'
    )
    parser.add_argument(
        '--format', choices=FORMATS, default='png', help='of the pictures (default: %(default)s)'
    )
    parser.add_argument(
        '--animation', type=Path, help='moving picture of the arm, .gif, or .mp4 with ffmpeg'
    )
    return parser
