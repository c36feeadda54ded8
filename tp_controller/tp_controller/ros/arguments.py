"""What is wrong with the command line, in one line."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

from rclpy.exceptions import NameValidationException

from tp_controller.config import empty_list, read_blocks
from tp_controller.errors import InvalidValue, listed


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


def check_parameter_rules(argv: Sequence[str]) -> None:
    """Check the parameters that a command line sets with ``-p name:=value``.

    Raises
    ------
    InvalidValue
        For an empty list, which rclpy answers with a traceback.
    """
    for flag, rule in pairwise(argv):
        if flag in ('-p', '--param'):
            key, _, value = rule.partition(':=')
            if ''.join(value.split()) == '[]':
                raise empty_list(key.rpartition(':')[2])


def missing_value_hint(argv: Sequence[str], key: str) -> str:
    """What may have kept a value from arriving, for the end of a message."""
    if key.startswith(('tasks.', 'solver.')):
        # Asked for only because others of its block have arrived.
        return ''
    if '--ros-args' not in argv or not parameter_files(argv):
        return ' (start with --ros-args --params-file FILE)'
    blocks = [name for path in parameter_files(argv) for name in read_blocks(path)]
    return f' (blocks in the parameter file: {listed(blocks)})'


def parameter_files(argv: Sequence[str]) -> list[str]:
    """Paths of the parameter files that a command line names."""
    return [value for flag, value in pairwise(argv) if flag == '--params-file']


def one_line(error: Exception) -> str:
    """What an exception of rclpy says, which may run over many lines."""
    if isinstance(error, NameValidationException):
        said, name, *_ = str(error).splitlines()
        return f'{said} {name.strip()}'
    text = ' '.join(str(error).partition(', at ')[0].split())
    return f'unknown ROS arguments {text}' if text.startswith('[') else text
