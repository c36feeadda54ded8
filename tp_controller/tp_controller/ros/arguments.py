"""Why ROS 2 refused the command line, in one line."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from tp_controller.config import read_parameter_file
from tp_controller.errors import InvalidValue


def init_failure(error: Exception, argv: Sequence[str], node: str) -> str:
    """One line about an exception of ``rclpy.init``.

    ROS 2 names neither the key nor the reason when it refuses a parameter file, so the
    files are read again here to find both.

    Parameters
    ----------
    error
        The exception.
    argv
        The process's arguments.
    node
        Name of the node, to pick its block.
    """
    for path in _parameter_files(argv):
        try:
            read_parameter_file(path, node)
        except InvalidValue as reason:
            text = str(reason)
            return text if text.startswith(path) else f'{path}: {text}'
    text = str(error).partition(', at ')[0]
    return ' '.join(text.split())


def _parameter_files(argv: Sequence[str]) -> Iterator[str]:
    for flag, value in zip(argv, argv[1:], strict=False):
        if flag == '--params-file':
            yield value
