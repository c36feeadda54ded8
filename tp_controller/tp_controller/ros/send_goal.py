"""Executable that sends one goal to a task, for people."""

from __future__ import annotations

import argparse
import sys
from decimal import Decimal, InvalidOperation
from functools import partial

import rclpy
from rclpy.exceptions import InvalidTopicNameException
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import remove_ros_args

from tp_controller.command_line import OneLineParser
from tp_controller.errors import InvalidValue, TaskPriorityError, listed
from tp_controller.ros.arguments import one_line
from tp_controller.ros.goals import goal_message
from tp_controller.ros.waiting import spin_until
from tp_interfaces.action import Reach
from tp_interfaces.msg import ControllerState, TaskGoal, TaskState

NOT_REACHED = 1
REFUSED = 2
UNANSWERED = 3


def main() -> int:
    """Send a goal and say what became of it.

    Returns
    -------
    int
        Exit status: 0 accepted, with ``--wait`` reached; 1 not reached; 2 refused; 3 no answer
        from the controller.
    """
    words = [_plain(word) for word in remove_ros_args(sys.argv)[1:]]
    parser = _parser()
    arguments = parser.parse_args(words)
    arguments.wait |= arguments.around
    unused = (arguments.tolerance, arguments.time_limit) != (None, None)
    if unused and not arguments.wait:
        parser.error('--tolerance and --time-limit count with --wait')
    handlers = SignalHandlerOptions.NO if arguments.wait else SignalHandlerOptions.ALL
    try:
        rclpy.init(signal_handler_options=handlers)
    except RuntimeError as error:
        return _fail(one_line(error), REFUSED)
    node: Node | None = None
    try:
        # What spins is made before anybody sees the node: from then on a signal ends the context.
        rclpy.get_global_executor()
        node = rclpy.create_node('send_goal')
        if arguments.wait:
            return _wait(node, arguments)
        print(_GoalSender(node, arguments.controller, arguments.timeout).send(arguments))
    except (InvalidValue, InvalidTopicNameException, GoalRefused) as error:
        return _fail(str(error), REFUSED)
    except TimeoutError as error:
        return _fail(str(error), UNANSWERED)
    except (KeyboardInterrupt, ExternalShutdownException):
        return _fail('interrupted', UNANSWERED)
    except RuntimeError:
        # A signal between two waits ends the context under rcl.
        if rclpy.ok():
            raise
        return _fail('interrupted', UNANSWERED)
    finally:
        if node is not None:
            node.destroy_node()
        rclpy.try_shutdown()
    return 0


def _wait(node: Node, arguments: argparse.Namespace) -> int:
    """Send the goal by ``~/reach`` and wait for its end; return the exit status."""
    # Loaded here: a goal by topic has no use for it.
    from tp_controller.ros.wait_for_goal import GoalWaiter

    one = TaskGoal(task=arguments.task, values=arguments.values, frame_id=arguments.frame)
    goal = Reach.Goal(goals=[one], around=arguments.around)
    if arguments.tolerance is not None:
        goal.tolerance = arguments.tolerance
    if arguments.time_limit is not None:
        goal.time_limit = arguments.time_limit
    result = GoalWaiter(node, arguments.controller, arguments.timeout).run(goal)
    if result.outcome == Reach.Result.REFUSED:
        raise GoalRefused(result.message)
    print(f'{arguments.task}: {result.message}')
    return 0 if result.outcome == Reach.Result.REACHED else NOT_REACHED


class GoalRefused(TaskPriorityError):
    """The controller's reason for not taking a goal."""


def _plain(word: str) -> str:
    """Word of the command line, a number such as -1e-1 without its exponent.

    argparse takes it for an option else.
    """
    try:
        number = Decimal(word)
    except InvalidOperation:
        return word
    return format(number, 'f') if number.is_finite() else word


def _parser() -> argparse.ArgumentParser:
    parser = OneLineParser(
        prog='send_goal',
        description='Send a goal to a task of a running controller.',
        formatter_class=argparse.RawDescriptionHelpFormatter,
        epilog='examples:\n'
        '  ros2 run tp_controller send_goal ee_position 1.0 0.5\n'
        '  ros2 run tp_controller send_goal ee_orientation 1.57\n'
        '  ros2 run tp_controller send_goal ee_position 1.0 0.5 --wait --tolerance 0.001\n'
        '  ros2 run tp_controller send_goal ee_position 1.0 0.5 --around',
    )
    parser.add_argument('task', help='name of the task')
    parser.add_argument(
        'values',
        nargs='+',
        type=float,
        help='as target in the parameter file: one per axis, joint or angle; a quaternion '
        'x y z w for a rotation about more than one axis',
    )
    parser.add_argument(
        '--frame', default='', help='frame that the values are given in (default: the base frame)'
    )
    parser.add_argument(
        '--controller', default='tp_controller', help='name of the node (default: %(default)s)'
    )
    parser.add_argument(
        '--timeout', type=float, default=5.0, help='time [s] for an answer (default: %(default)s)'
    )
    parser.add_argument(
        '--wait',
        action='store_true',
        help='wait until it is reached (status 0) or cannot be (status 1); Ctrl-C cancels it',
    )
    parser.add_argument(
        '--around',
        action='store_true',
        help='as --wait; where the straight way would get stuck, go a planned one',
    )
    parser.add_argument(
        '--tolerance', type=float, help='largest error norm that counts as reached (default: 0.01)'
    )
    parser.add_argument(
        '--time-limit', type=float, help='time [s] to reach it, 0 for none (default: none)'
    )
    return parser


def _fail(message: str, status: int) -> int:
    print(f'send_goal: {message}', file=sys.stderr)
    return status


class _GoalSender:
    """Finds a controller by its state, sends it a goal and watches its counters."""

    def __init__(self, node: Node, controller: str, timeout: float) -> None:
        self._node, self._controller = node, controller
        self._wait = partial(spin_until, node, timeout)
        self._state: ControllerState | None = None
        node.create_subscription(ControllerState, f'{controller}/state', self._on_state, 10)

    def send(self, arguments: argparse.Namespace) -> str:
        """Send the goal; return what became of it.

        Raises
        ------
        InvalidValue
            If there is no such task, the values do not fit, or the controller refuses.
        TimeoutError
            If the controller does not answer.
        """
        topic = self._node.resolve_topic_name(f'{self._controller}/state')
        self._wait(lambda: self._state is not None, f'no controller speaks on {topic}')
        before = self._task(arguments.task)
        msg = goal_message(before, arguments.values, arguments.frame)
        publisher = self._node.create_publisher(
            type(msg), f'{self._controller}/{arguments.task}/goal', 10
        )
        self._wait(
            lambda: publisher.get_subscription_count() > 0,
            f'nobody takes goals on {publisher.topic_name}',
        )
        publisher.publish(msg)

        def answered() -> bool:
            now = self._task(arguments.task)
            return (
                now.accepted_goals + now.rejected_goals
                > before.accepted_goals + before.rejected_goals
            )

        self._wait(answered, 'the controller did not answer')
        after = self._task(arguments.task)
        if after.rejected_goals > before.rejected_goals:
            raise GoalRefused(f'{arguments.task}: {after.message}')
        desired = ' '.join(f'{value:.4g}' for value in after.desired)
        why = 'the task is not in the hierarchy' if after.level < 0 else 'the task is off'
        note = '' if after.enabled else f' (idle: {why})'
        if self._state is not None and self._state.held:
            note += ' (held: it counts once ~/hold is called with false)'
        return f'{arguments.task}: accepted, desired {desired}{note}'

    def _task(self, name: str) -> TaskState:
        assert self._state is not None
        for task in self._state.tasks:
            if task.name == name:
                return task
        names = [task.name for task in self._state.tasks]
        if not names:
            raise GoalRefused(f'the controller is {self._state.message}')
        raise InvalidValue('task', repr(name), f'one of {listed(names)}')

    def _on_state(self, msg: ControllerState) -> None:
        self._state = msg
