"""What is wrong with the command line, in one line."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

from tp_controller.config import read_blocks
from tp_controller.errors import InvalidValue


def check_parameter_files(argv: Sequence[str]) -> None:
    """Check the parameter files that a command line names.

    ROS 2 refuses what it cannot read without naming the key or the reason, so the files
    are looked at first.

    Parameters
    ----------
    argv
        The process's arguments.

    Raises
    ------
    InvalidValue
        As `read_blocks`, naming the file.
    """
    for path in parameter_files(argv):
        try:
            read_blocks(path)
        except InvalidValue as error:
            raise error if error.key.startswith(path) else error.within(path) from None


def parameter_files(argv: Sequence[str]) -> list[str]:
    """Paths of the parameter files that a command line names."""
    return [value for flag, value in pairwise(argv) if flag == '--params-file']


def one_line(error: Exception) -> str:
    """First sentence of an exception of ``rclpy.init``, which may run over many lines."""
    return ' '.join(str(error).partition(', at ')[0].split())
