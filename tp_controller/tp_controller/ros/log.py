"""Lines in the log of a node, quickly."""

from __future__ import annotations

from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.logging import LoggingSeverity
from rclpy.node import Node


class Log:
    """Writes lines as ``node.get_logger()`` does, but does not look for who called.

    rclpy's logger reads source files to find that out: 80 ms for the first line, and some for
    the first from every other place, in the middle of a cycle.

    Parameters
    ----------
    node
        The node whose log it is.
    """

    def __init__(self, node: Node) -> None:
        self._logger = node.get_logger()

    def info(self, line: str) -> None:
        """Log what is good to know."""
        self._write(LoggingSeverity.INFO, line)

    def warning(self, line: str) -> None:
        """Log what may be wrong."""
        self._write(LoggingSeverity.WARN, line)

    def _write(self, severity: LoggingSeverity, line: str) -> None:
        if self._logger.is_enabled_for(severity):
            rclpy_implementation.rclpy_logging_rcutils_log(
                severity, self._logger.name, line, '', '', 0
            )
