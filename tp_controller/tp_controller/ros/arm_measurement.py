"""The measurement of an arm: its rest, small motions of its joints, and its states meanwhile."""

from __future__ import annotations

import contextlib
import math
import signal
import sys
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import rclpy
from numpy.typing import NDArray
from rclpy.node import Node
from rclpy.qos import QoSProfile
from sensor_msgs.msg import JointState

from tp_controller.config.schema import POSITION_TYPES
from tp_controller.errors import InvalidValue
from tp_controller.identification import Fit, fit_response
from tp_controller.measuring import (
    LONGEST_DELAY,
    LONGEST_LAG,
    Ended,
    Refused,
    braked,
    directions,
    pulses,
)
from tp_controller.position_reference import PositionReference
from tp_controller.robot import Robot
from tp_controller.ros.command_topic import CommandTopic
from tp_controller.ros.commands import CommandPublisher
from tp_controller.ros.joint_states import JointStateReader
from tp_controller.ros.parent import end_with_ros2
from tp_controller.ros.run import SIGNALS
from tp_controller.stack import Stack

Vector = NDArray[np.float64]

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


class Measurement:
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
        self._values, self._limit = values, values['timeouts.joint_state']
        self._topic = CommandTopic(node, robot, values['command.type'])
        rate = values['rate']
        self._period = 1.0 / rate if rate else 0.0
        self._reader = JointStateReader(robot.joints)
        self._q, self._start = np.zeros((2, robot.n))
        self._velocity = np.zeros(robot.n)
        self._commands: CommandPublisher | None = None
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

    def measure(self, confirm: Callable[[str], None] | None) -> tuple[list[Fit], Vector]:
        """Measure; return how each joint responds, and the noise (n,) [rad, m] at rest.

        Parameters
        ----------
        confirm
            Called with the motions in words before the arm moves; raises what ends it.

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
        self._topic.refuse_others()
        rest = self._rest()
        reference = None
        if self._values['command.type'] in POSITION_TYPES:
            stack = Stack(robot, [], rate=1.0 / self._period)
            reference = PositionReference(stack, self._values['command.tolerance'])
        self._commands = self._topic.open(reference)
        ways = directions(robot.joints, self._q, robot.limits, self._amplitude)
        if confirm is not None:
            pairs = zip(robot.joints, ways, strict=True)
            confirm(', '.join(f'{name} by {way:+g}' for name, way in pairs))
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
        return fits, 0.5 * np.ptp(rest, axis=0)

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
        self._topic.ask()

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
        while condition():
            rclpy.spin_once(self._node, timeout_sec=0.02)
            if not self._problem and time.monotonic() - self._arrived > self._limit:
                self._problem = f'no joint state for {self._limit:g} s'
            self._problem = self._problem or self._topic.look()
            if self._problem:
                assert self._commands is not None
                rest = '' if self._commands.withheld else '; the arm was braked to rest'
                raise Ended(f'ended by {self._problem}{rest}')

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
