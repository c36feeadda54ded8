"""Life of a node's process: signals, refusals and exit statuses.

Nothing heavy is imported before `run_node` has taken charge of the signals.
"""

from __future__ import annotations

import importlib
import os
import signal
import sys
from typing import Any

REFUSED = 2
"""Exit status after a configuration that cannot be used."""


class _Stop:
    """Set by SIGINT and SIGTERM."""

    def __init__(self) -> None:
        self.requested = False

    def request(self, signum: int, frame: Any) -> None:
        """Signal handler."""
        self.requested = True


def run_node(name: str, module: str, node_class: str) -> int:
    """Run one node until SIGINT or SIGTERM.

    Parameters
    ----------
    name
        Default name of the node, for messages.
    module, node_class
        Where to find the node's class. It is made without arguments, raises
        `InvalidValue` for a configuration that cannot be used, and has a method ``stop``
        that leaves the robot safe.

    Returns
    -------
    int
        Exit status: 0 after a signal, 2 after a refused configuration.
    """
    for number in (signal.SIGINT, signal.SIGTERM):
        # Before the node exists there is nothing to bring to rest.
        signal.signal(number, lambda *_: os._exit(0))
    import rclpy
    from rclpy.executors import SingleThreadedExecutor
    from rclpy.signals import SignalHandlerOptions

    from tp_controller.errors import NO_VALUE, InvalidValue
    from tp_controller.ros import arguments

    make_node = getattr(importlib.import_module(module), node_class)
    stop = _Stop()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, stop.request)
    try:
        arguments.check_parameter_files(sys.argv)
        arguments.check_parameter_rules(sys.argv)
        rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
        node = make_node()
    except InvalidValue as error:
        rclpy.try_shutdown()
        hint = arguments.missing_value_hint(sys.argv, error.key) if error.got == NO_VALUE else ''
        return _refuse(name, f'{error}{hint}')
    except RuntimeError as error:
        if rclpy.ok():
            raise
        # rcl could not read the arguments; its exceptions have no other root.
        return _refuse(name, arguments.one_line(error))
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    status = 0
    while not stop.requested and status == 0:
        try:
            # A signal is seen when the wait ends, so the wait is bounded.
            executor.spin_once(timeout_sec=0.1)
        except InvalidValue as error:
            # Of a node that got to know its robot only now.
            status = _refuse(name, str(error))
    node.stop()
    executor.shutdown()
    node.destroy_node()
    rclpy.try_shutdown()
    return status


def _refuse(name: str, message: str) -> int:
    print(f'{name}: {message}', file=sys.stderr, flush=True)
    return REFUSED
