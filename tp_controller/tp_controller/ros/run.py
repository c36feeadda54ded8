"""Life of a node's process: signals, refusals and exit statuses.

Nothing heavy is imported before `run_node` has taken charge of the signals.
"""

from __future__ import annotations

import contextlib
import gc
import importlib
import os
import signal
import sys
import traceback
from collections.abc import Sequence
from typing import Any

from tp_controller.ros.parent import end_with_ros2

REFUSED = 2
"""Exit status after a configuration that cannot be used."""


CRASHED = 1
"""Exit status after an error that nobody expected."""
SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT, signal.SIGUSR1)
"""Signals that end the process in a planned way; they would kill it otherwise."""
PRIORITY = -10
"""Nice value of a node, where that is permitted: a busy machine then delays it less."""
FAILURES = 10
"""So many callbacks in a row that fail are too many to go on."""
HELP = """\
usage: {program} --ros-args --params-file FILE [-p {name}:KEY:=VALUE] [-r FROM:=TO]

The keys of the file are in docs/parameters.md; ros2 run tp_controller check FILE tells what is
wrong with it."""


class _Stop:
    """Set by a signal."""

    def __init__(self) -> None:
        self.requested = ''

    def request(self, number: int, frame: Any) -> None:
        """Signal handler."""
        self.requested = signal.Signals(number).name


def run_node(name: str, module: str, node_class: str) -> int:
    """Run one node until a signal ends it.

    Parameters
    ----------
    name
        Default name of the node, for messages.
    module, node_class
        Where to find the node's class, a `RobotNode`. It is made without arguments and raises
        `InvalidValue` for a configuration that cannot be used.

    Returns
    -------
    int
        Exit status: 0 after a signal, 1 after an error, 2 after a refused configuration.
    """
    if _asks_for_help(sys.argv):
        print(HELP.format(program=os.path.basename(sys.argv[0]), name=name))
        return 0
    _ask_for_priority()
    _leave_out()
    for number in SIGNALS:
        # Before the node exists there is nothing to bring to rest.
        _handle(number, lambda *_: os._exit(0))
    end_with_ros2()
    import rclpy
    from rclpy.signals import SignalHandlerOptions

    from tp_controller.errors import NO_VALUE, InvalidValue
    from tp_controller.ros import arguments

    make_node = getattr(importlib.import_module(module), node_class)
    stop = _Stop()
    for number in SIGNALS:
        _handle(number, stop.request)
    try:
        arguments.check_parameter_files(sys.argv)
        arguments.check_parameter_rules(sys.argv)
        rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
        node = make_node()
        gc.enable()
    except InvalidValue as error:
        rclpy.try_shutdown()
        hint = arguments.missing_value_hint(sys.argv, error.key) if error.got == NO_VALUE else ''
        return _refuse(name, f'{error}{hint}')
    except RuntimeError as error:
        if rclpy.ok():
            raise
        # rcl could not read the arguments; its exceptions have no other root.
        return _refuse(name, arguments.one_line(error))
    return _spin(name, node, stop)


def _asks_for_help(argv: Sequence[str]) -> bool:
    """Whether an argument before those of ROS asks for help."""
    for word in argv[1:]:
        if word == '--ros-args':
            break
        if word in ('-h', '--help'):
            return True
    return False


def _handle(number: int, handler: Any) -> None:
    """Set a signal's handler; who started the process may have it ignore a hang-up (nohup)."""
    if number != signal.SIGHUP or signal.getsignal(number) != signal.SIG_IGN:
        signal.signal(number, handler)


def _ask_for_priority() -> None:
    """Go before ordinary processes, if the user may; not if a priority was chosen already.

    The threads of the middleware, which start later, do the same.
    """
    with contextlib.suppress(OSError):
        if os.getpriority(os.PRIO_PROCESS, 0) == 0:
            os.setpriority(os.PRIO_PROCESS, 0, PRIORITY)


def _leave_out() -> None:
    """Leave out what takes time or memory at the start and is of no use to a node."""
    # What is made during the start stays: there is nothing to collect.
    gc.disable()
    # Matrices are small: threads for the large ones would only wait, each with its memory.
    os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')
    # rclpy's messages need their loader alone; the package tries to import the generator too.
    sys.modules['rosidl_generator_py.generate_py_impl'] = None  # type: ignore[assignment]


def _spin(name: str, node: Any, stop: _Stop) -> int:
    """Run a node's callbacks until a signal or an error; then bring it to rest."""
    import rclpy
    from rclpy.executors import SingleThreadedExecutor

    from tp_controller.errors import InvalidValue

    executor = SingleThreadedExecutor()
    executor.add_node(node)
    status, cause, failures = 0, '', 0
    try:
        while not stop.requested:
            try:
                # A signal is seen when the wait ends, so the wait is bounded.
                node.spin(executor)
                node.work()
                failures = 0
            except InvalidValue as error:
                # Of a node that got to know its robot only now.
                if node.started:
                    raise
                status = _refuse(name, str(error))
                break
            except Exception as error:
                failures += 1
                if failures >= FAILURES or not node.survives(error):
                    raise
        cause = stop.requested
    except BaseException as error:
        status, cause = CRASHED, f'{type(error).__name__}: {error}'
        traceback.print_exc()
    rest = node.stop()
    if rest:
        print(f'{name}: ended by {cause}: {rest}', file=sys.stderr, flush=True)
    elif status == CRASHED:
        print(f'{name}: ended by {cause}', file=sys.stderr, flush=True)
    executor.shutdown()
    node.destroy_node()
    rclpy.try_shutdown()
    return status


def _refuse(name: str, message: str) -> int:
    print(f'{name}: {message}', file=sys.stderr, flush=True)
    return REFUSED
