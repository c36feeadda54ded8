"""Executable that moves an arm a little and tells its delay, lag and noise."""

from __future__ import annotations

import argparse
import contextlib
import math
import signal
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import rclpy
from numpy.typing import NDArray
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import remove_ros_args
from sensor_msgs.msg import JointState

from tp_controller.command_line import OneLineParser
from tp_controller.config import build_robot, read_parameter_file
from tp_controller.config.build import read_parameters
from tp_controller.config.schema import POSITION_TYPES
from tp_controller.errors import InvalidValue, TaskPriorityError
from tp_controller.identification import Fit, fit_response
from tp_controller.measuring import (
    LONGEST_DELAY,
    LONGEST_LAG,
    block,
    braked,
    directions,
    pulses,
)
from tp_controller.position_reference import PositionReference
from tp_controller.robot import Robot
from tp_controller.ros.arguments import one_line
from tp_controller.ros.commands import CommandPublisher, command_topic, is_stamped
from tp_controller.ros.joint_states import JointStateReader
from tp_controller.ros.neighbours import publishers
from tp_controller.ros.parent import end_with_ros2
from tp_controller.ros.receivers import PERIOD as RECEIVER_PERIOD
from tp_controller.ros.receivers import Receivers
from tp_controller.ros.run import SIGNALS
from tp_controller.stack import Stack

Vector = NDArray[np.float64]

REFUSED, UNANSWERED, ENDED = 2, 3, 4
DISCOVERY = 1.0
"""Time [s] in which other publishers are found."""
REST = 1.5
"""Time [s] at rest in which the noise is measured."""
LEAST_STATES = 50
"""States at rest that it needs."""
STILL = 5e-3
"""Positions of an arm at rest [rad, m] differ by no more."""
STRAYED = 3.0
"""A joint that is so many times the amplitude away from its start ends the measurement."""
NEAR = 0.1
"""A joint is back when it is so many times the amplitude from its start, or less."""
RETURN_GAIN, LONGEST_RETURN = 1.0, 4.0
"""Gain [1/s] on the way back, low enough for the longest delay, and the time [s] it may take."""
ZEROS = 10
"""Zero commands at the end."""
GAIN = 0.05
"""Share by which a joint may move more or less than commanded without being told."""


class Refused(TaskPriorityError):
    """The measurement cannot begin."""


class Ended(TaskPriorityError):
    """The measurement was ended before it was done."""


def main() -> int:
    """Measure the arm.

    Returns
    -------
    int
        Exit status: 0 measured, 2 refused, 3 no joint states, 4 ended by a signal or the arm.
    """
    arguments = _parser().parse_args(remove_ros_args(sys.argv)[1:])
    try:
        values = read_parameters(read_parameter_file(arguments.config, 'tp_controller'))
        robot = build_robot(values)
        if robot.space.blocks:
            raise InvalidValue('robot', 'a base that moves', 'an arm on a fixed base')
        if not 0.0 < arguments.amplitude < math.inf:
            raise InvalidValue('amplitude', f'{arguments.amplitude:g}', 'a number above 0')
        rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    except InvalidValue as error:
        return _fail(str(error), REFUSED)
    except RuntimeError as error:
        return _fail(one_line(error), REFUSED)
    node = rclpy.create_node('measure_arm')
    try:
        measurement = _Measurement(node, robot, values, arguments.amplitude)
        print(measurement.measure(arguments.yes))
    except (InvalidValue, Refused) as error:
        return _fail(str(error), REFUSED)
    except TimeoutError as error:
        return _fail(str(error), UNANSWERED)
    except Ended as error:
        return _fail(str(error), ENDED)
    except (KeyboardInterrupt, EOFError):
        return _fail('interrupted before the arm was moved', ENDED)
    finally:
        node.destroy_node()
        rclpy.try_shutdown()
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = OneLineParser(
        prog='measure_arm',
        description='Move each joint of an arm a little, there and back, and print its delay, lag '
        'and noise for the parameter file. No controller may run meanwhile.',
        formatter_class=argparse.RawDescriptionHelpFormatter,
        epilog='example:\n  ros2 run tp_controller measure_arm --config config/panda.yaml',
    )
    parser.add_argument(
        '--config', type=Path, required=True, help="the controller's parameter file"
    )
    parser.add_argument(
        '--amplitude',
        type=float,
        default=0.02,
        help='how far each joint moves [rad, m] (default: %(default)s)',
    )
    parser.add_argument('--yes', action='store_true', help='do not ask before the arm moves')
    return parser


def _fail(message: str, status: int) -> int:
    print(f'measure_arm: {message}', file=sys.stderr)
    return status


def _ignore(_: str) -> None:
    """Stand in for what is told."""


class _Measurement:
    """Commands, and the states that they answer.

    Parameters
    ----------
    node
        Its node.
    robot
        The arm, for joints and limits.
    values
        Parameters of the controller.
    amplitude
        How far each joint moves [rad, m].
    """

    def __init__(self, node: Node, robot: Robot, values: dict[str, Any], amplitude: float) -> None:
        self._node, self._robot, self._amplitude = node, robot, amplitude
        self._command_type, self._tolerance = (
            values['command.type'],
            values['command.tolerance'],
        )
        self._limit = values['timeouts.joint_state']
        rate = values['rate']
        self._period = 1.0 / rate if rate else 0.0
        self._reader = JointStateReader(robot.joints)
        self._q, self._start = np.zeros((2, robot.n))
        self._velocity = np.zeros(robot.n)
        self._commands: CommandPublisher | None = None
        self._receivers: Receivers | None = None
        self._queue: list[Vector] = []
        self._record: list[tuple[float, Vector, Vector]] = []
        self._last_time, self._arrived = -math.inf, -math.inf
        self._problem = self._ignored = ''
        self._returning = -1
        """The joint that goes back to its start, -1 if none does."""
        # Only the newest state counts.
        self._subscription = node.create_subscription(
            JointState, 'joint_states', self._on_state, QoSProfile(depth=1)
        )

    def measure(self, confirmed: bool) -> str:
        """Measure; return what was found.

        Raises
        ------
        Refused, InvalidValue
            If the arm cannot be moved now.
        TimeoutError
            If no joint states come.
        Ended
            If the measurement was ended; the arm was braked then.
        """
        robot, n = self._robot, self._robot.n
        self._look_for_others()
        rest = self._rest()
        reference = self._begin_commands()
        self._ask_readers()
        ways = directions(robot.joints, self._q, robot.limits, self._amplitude)
        if not confirmed:
            self._ask(ways)
            self._look_again(rest)
        self._handle_signals()
        self._start[:] = self._q
        if reference is not None:
            reference.answer(self._q, None)
        fits = []
        try:
            for i in range(n):
                print(f'{robot.joints[i]} ({i + 1} of {n})', file=sys.stderr)
                fits.append(self._move(i, float(ways[i])))
        finally:
            self._brake()
        return self._report(fits, 0.5 * np.ptp(rest, axis=0))

    def _begin_commands(self) -> PositionReference | None:
        """Make the publisher of commands; return what makes positions of them, if they are."""
        robot, reference = self._robot, None
        if self._command_type in POSITION_TYPES:
            stack = Stack(robot, [], rate=1.0 / self._period)
            reference = PositionReference(stack, self._tolerance)
        self._commands = CommandPublisher(self._node, robot, self._command_type, reference)
        return reference

    def _ask_readers(self) -> None:
        """Wait until the readers of commands without names have told what they take.

        Raises
        ------
        Refused
            If it is not what is sent.
        """
        if is_stamped(self._command_type):
            return
        assert self._commands is not None
        interface = 'position' if self._command_type in POSITION_TYPES else 'velocity'
        if self._receivers is not None:
            self._receivers.close()
        joints = self._robot.joints
        self._receivers = Receivers(self._node, self._commands, joints, interface, _ignore)
        while self._commands.withheld and not self._receivers.problem:
            end = time.monotonic() + RECEIVER_PERIOD
            while time.monotonic() < end:
                rclpy.spin_once(self._node, timeout_sec=RECEIVER_PERIOD)
            self._receivers.look()
        if self._receivers.problem:
            raise Refused(self._receivers.problem)

    def _look_again(self, rest: Vector) -> None:
        """See that all is as before: the confirmation may have taken long.

        Raises
        ------
        Refused
            If the arm is somewhere else, or others read the commands.
        """
        begin, count = time.monotonic(), len(self._record)
        # The first one may have waited since then.
        while len(self._record) < count + 2:
            self._spin(begin)
        moved = np.abs(self._q - rest.mean(axis=0))
        if moved.max() > STILL:
            raise self._moved(moved)
        if self._receivers is not None:
            self._ask_readers()

    def _look_for_others(self) -> None:
        topic = self._node.resolve_topic_name(command_topic(self._command_type))
        end = time.monotonic() + DISCOVERY
        while time.monotonic() < end:
            rclpy.spin_once(self._node, timeout_sec=0.05)
        if names := self._others(topic):
            raise Refused(
                f'{topic} has a publisher, {names}: end it first, only one may move the arm'
            )

    def _others(self, topic: str) -> str:
        names = publishers(self._node, topic)
        own = f'{self._node.get_namespace().rstrip("/")}/{self._node.get_name()}'
        if self._commands is not None and own in names:
            names.remove(own)
        return ', '.join(names)

    def _rest(self) -> Vector:
        """Positions (m, n) of the arm at rest; nothing is sent."""
        self._record.clear()
        begin = time.monotonic()
        while time.monotonic() < begin + REST or len(self._record) < LEAST_STATES:
            self._spin(begin)
        times = np.array([entry[0] for entry in self._record])
        seen = float(np.median(np.diff(times)))
        if self._period == 0.0:
            self._period = seen
        if not 0.7 < seen / self._period < 1.4:
            raise Refused(
                f'joint states come every {1e3 * seen:.3g} ms, rate says {1e3 * self._period:.3g}'
            )
        positions = np.array([entry[1] for entry in self._record])
        moved = np.ptp(positions, axis=0)
        if moved.max() > STILL:
            raise self._moved(moved)
        return positions

    def _spin(self, begin: float) -> None:
        """Wait for a joint state; they are waited for since a steady time [s].

        Raises
        ------
        TimeoutError
            If none comes for 5 s.
        """
        rclpy.spin_once(self._node, timeout_sec=0.05)
        if time.monotonic() > max(begin, self._arrived) + 5.0:
            why = f' ({self._ignored})' if self._ignored else ''
            topic = self._subscription.topic_name
            raise TimeoutError(f'no joint states on {topic} for 5 s{why}')

    def _moved(self, moved: Vector) -> Refused:
        i = int(np.argmax(moved))
        return Refused(f'{self._robot.joints[i]} moved by {moved[i]:.3g}: the arm has to rest')

    def _ask(self, ways: Vector) -> None:
        if not sys.stdin.isatty():
            raise Refused('this moves the arm: say --yes, or run it in a terminal')
        moves = ', '.join(
            f'{name} by {way:+g}' for name, way in zip(self._robot.joints, ways, strict=True)
        )
        answer = input(f'The arm will move, one joint after the other: {moves}. Go on? [y/N] ')
        if answer.strip().lower() not in ('y', 'yes'):
            raise Refused('not confirmed')

    def _handle_signals(self) -> None:
        def request(number: int, frame: Any) -> None:
            self._problem = self._problem or signal.Signals(number).name

        for number in SIGNALS:
            if number != signal.SIGHUP or signal.getsignal(number) != signal.SIG_IGN:
                signal.signal(number, request)
        end_with_ros2()

    def _move(self, i: int, way: float) -> Fit:
        """Move one joint there and back; return what it makes of its commands."""
        limits = self._robot.limits
        wave = pulses(way, float(limits.velocity[i]), float(limits.acceleration[i]), self._period)
        self._record.clear()
        self._arrived = time.monotonic()
        for value in wave:
            command = np.zeros(self._robot.n)
            command[i] = value
            self._queue.append(command)
        self._answer_while(lambda: bool(self._queue))
        times, positions, commands = (
            np.array(column) for column in zip(*self._record, strict=True)
        )
        fit = fit_response(times, commands[:, i], positions[:, i], LONGEST_DELAY, LONGEST_LAG)
        self._go_back(i)
        return fit

    def _go_back(self, i: int) -> None:
        """Bring a joint back that is not where it began, as when states or commands came late."""
        end = time.monotonic() + LONGEST_RETURN
        self._returning = i
        near = NEAR * self._amplitude
        self._answer_while(
            lambda: abs(self._start[i] - self._q[i]) > near and time.monotonic() < end
        )
        self._returning = -1

    def _answer_while(self, condition: Callable[[], bool]) -> None:
        """Answer states as long as a condition holds.

        Raises
        ------
        Ended
            If the measurement has to end.
        """
        looked = asked = time.monotonic()
        topic = self._node.resolve_topic_name(command_topic(self._command_type))
        while condition():
            rclpy.spin_once(self._node, timeout_sec=0.02)
            now = time.monotonic()
            if now - self._arrived > self._limit:
                self._problem = self._problem or f'no joint state for {self._limit:g} s'
            if self._receivers is not None and now - asked > RECEIVER_PERIOD:
                asked = now
                self._receivers.look()
                self._end_if_withheld()
            if now - looked > 0.5:
                looked = now
                if names := self._others(topic):
                    self._problem = self._problem or f'{names} publishes commands, too'
            if self._problem:
                assert self._commands is not None
                rest = '' if self._commands.withheld else '; the arm was braked to rest'
                raise Ended(f'ended by {self._problem}{rest}')

    def _end_if_withheld(self) -> None:
        """End if the readers of commands take them for something else, or are gone."""
        assert self._commands is not None
        assert self._receivers is not None
        if self._commands.withheld:
            gone = f'{self._commands.topic}, which nobody reads any more'
            self._problem = self._problem or self._receivers.problem or gone

    def _on_state(self, msg: JointState) -> None:
        """Answer a state with the next command, if there is one."""
        try:
            self._reader.read(msg, self._q)
        except InvalidValue as error:
            self._ignored = str(error)
            return
        stamp = msg.header.stamp
        now = stamp.sec + 1e-9 * stamp.nanosec or time.monotonic()
        if now <= self._last_time:
            return
        self._last_time, self._arrived = now, time.monotonic()
        if self._commands is not None and not self._problem and self._next_velocity():
            self._commands.send(self._velocity, stamp)
            away = np.abs(self._q - self._start)
            if away.max() > STRAYED * self._amplitude:
                i = int(np.argmax(away))
                self._problem = f'{self._robot.joints[i]}, which is {away[i]:.3g} from its start'
        self._record.append((now, self._q.copy(), self._velocity.copy()))

    def _next_velocity(self) -> bool:
        """Set the velocities of the next command, if there is one."""
        if self._queue:
            self._velocity = self._queue.pop(0)
            return True
        i = self._returning
        if i < 0:
            return False
        last = float(self._velocity[i])
        change = float(self._robot.limits.acceleration[i]) * self._period
        wish = RETURN_GAIN * float(self._start[i] - self._q[i])
        self._velocity = np.zeros(self._robot.n)
        self._velocity[i] = min(max(wish, last - change), last + change)
        return True

    def _brake(self) -> None:
        """Run down inside the limits of acceleration on a clock of its own, then send zeros."""
        assert self._commands is not None
        self._queue.clear()
        zeros = 0
        while zeros < ZEROS:
            acceleration = self._robot.limits.acceleration
            self._velocity = braked(self._velocity, acceleration, self._period)
            self._commands.send(self._velocity)
            zeros += not self._velocity.any()
            time.sleep(self._period)
        with contextlib.suppress(RuntimeError):
            self._commands.wait_until_arrived()

    def _report(self, fits: list[Fit], noise: Vector) -> str:
        lines = []
        for joint, fit in zip(self._robot.joints, fits, strict=True):
            line = (
                f'# {joint}: delay {1e3 * fit.delay:.1f} ms, lag {1e3 * fit.lag:.1f} ms, differs '
                f'from that by {fit.residual:.2g} at most, {fit.rms:.2g} rms of {fit.motion:.2g}'
            )
            if not fit.explains:
                line += '; that does not explain its motion, do not use these values'
            elif abs(fit.gain - 1.0) > GAIN:
                line += f'; it moves {fit.gain:.3g} times as far as it is told'
            lines.append(line)
        return '\n'.join([*lines, block(fits, noise)])
