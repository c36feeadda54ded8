"""How the controller is, on /diagnostics once a second, as REP 107 has it.

REP 107 knows OK, WARN and ERROR; a node that has fallen silent is shown as stale by the tools.
"""

from __future__ import annotations

import math
import time
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.node import Node

from tp_controller.ros.commands import CommandPublisher
from tp_controller.ros.state_watch import StateWatch
from tp_controller.ros.warnings import Warnings
from tp_controller.stack import Stack
from tp_interfaces.msg import ControllerState

TOPIC = '/diagnostics'
PERIOD = 1.0
"""Time [s] between two messages."""
JOINT_STATES, CYCLE, MOTION, GOALS = PARTS = ('joint states', 'cycle', 'motion', 'goals')
"""What is told of, each in a status of its own."""
PART_OF: Mapping[str, str] = {
    'clock': JOINT_STATES,
    'old states': JOINT_STATES,
    'joint states': JOINT_STATES,
    'sender': JOINT_STATES,
    'rate': JOINT_STATES,
    'found rate': JOINT_STATES,
    'stale': JOINT_STATES,
    'late': CYCLE,
    'commands': CYCLE,
    'explanation': CYCLE,
}
"""Where warnings are told by their subjects, see `part_of`."""
STATUS = {
    ControllerState.WAITING: 'waiting for joint states',
    ControllerState.RUNNING: 'running',
    ControllerState.STALE: 'no joint states: braking, or at rest',
    ControllerState.HELD: 'held at rest',
    ControllerState.INACTIVE: 'inactive: no command is sent',
}


class Second(NamedTuple):
    """What came and went since one second ago."""

    passed: float
    """Time [s]."""
    received: int
    """Joint states, answered or not."""
    cycles: int
    """Commands that answered them."""
    overruns: int
    """Those of them that were late."""
    least: float
    """Least scale that was seen."""
    limited: float
    """Share of the time at velocity limits."""


class Health:
    """Judges a controller by its state and its present warnings.

    Parameters
    ----------
    state
        The controller's state; its counters and times are read.
    rate
        Joint states per second [Hz] that are expected, None if unknown.
    """

    def __init__(self, state: ControllerState, rate: float | None) -> None:
        self._state = state
        self.rate = rate
        self._before = (time.monotonic(), 0, 0, 0)
        self._seen = self._limited = 0
        self._least = 1.0

    def see(self) -> None:
        """Take note of the present scale; called some ten times a second."""
        scale = self._state.scale
        self._seen += 1
        self._limited += scale < 1.0
        self._least = min(self._least, scale)

    def count(self, now: float, received: int) -> Second:
        """Begin a new second.

        Parameters
        ----------
        now
            Steady time [s].
        received
            Joint states since start.
        """
        counts = (now, received, self._state.cycles, self._state.overruns)
        passed, came, cycles, late = (b - a for a, b in zip(self._before, counts, strict=True))
        second = Second(
            passed, came, cycles, late, self._least, self._limited / max(self._seen, 1)
        )
        self._before = counts
        self._least, self._seen, self._limited = 1.0, 0, 0
        return second

    def statuses(
        self, second: Second, limits: Sequence[str], warnings: Mapping[str, str]
    ) -> list[DiagnosticStatus]:
        """Make one status for each of `PARTS`, without the node's name.

        Parameters
        ----------
        second
            What happened in the last second.
        limits
            Limits that the command meets.
        warnings
            Warnings that are present, by subject.
        """
        state = self._state
        found = {
            JOINT_STATES: {
                'actual frequency (Hz)': f'{second.received / second.passed:.1f}',
                'expected frequency (Hz)': f'{self.rate:g}' if self.rate else 'unknown',
                'ignored since start': str(state.ignored_states),
                'skipped since start': str(state.skipped),
                'overtaken since start': str(state.overtaken),
            },
            CYCLE: {
                'commands (Hz)': f'{second.cycles / second.passed:.1f}',
                'late in the last second': str(second.overruns),
                'late since start': str(state.overruns),
                'age (ms)': f'{1e3 * state.command_age:.2f}',
                'largest age (ms)': f'{1e3 * state.largest_command_age:.2f}',
                'computation (ms)': f'{1e3 * state.solve_time:.2f}',
            },
            MOTION: {
                'status': STATUS[state.status],
                'scale': f'{state.scale:.3f}',
                'least scale of the last second': f'{min(second.least, state.scale):.3f}',
                'time at velocity limits (%)': f'{100.0 * second.limited:.0f}',
                'limits met': ', '.join(limits) or 'none',
                'oscillation': warnings.get('oscillation', 'none'),
            },
            GOALS: {
                'accepted since start': str(sum(task.accepted_goals for task in state.tasks)),
                'refused since start': str(state.rejected_goals),
            },
        }
        return [self._status(part, values, warnings) for part, values in found.items()]

    def _status(
        self, part: str, values: Mapping[str, str], warnings: Mapping[str, str]
    ) -> DiagnosticStatus:
        told = [text for subject, text in warnings.items() if part_of(subject) == part]
        level = DiagnosticStatus.WARN if told else DiagnosticStatus.OK
        if part == JOINT_STATES and self._state.status == ControllerState.WAITING:
            level = DiagnosticStatus.WARN
            told = told or [STATUS[ControllerState.WAITING]]
        elif part == JOINT_STATES and self._state.status == ControllerState.STALE:
            level = DiagnosticStatus.ERROR
            told = told or [STATUS[ControllerState.STALE]]
        message = '; '.join(told) or (STATUS[self._state.status] if part == MOTION else 'ok')
        pairs = [KeyValue(key=key, value=value) for key, value in values.items()]
        return DiagnosticStatus(level=level, name=part, message=message, values=pairs)


def part_of(subject: str) -> str:
    """Which of `PARTS` tells a warning about a subject."""
    inputs = ('goal', 'feedforward', 'trajectory')
    if any(f' {word}' in subject or f'/{word}' in subject for word in inputs):
        return GOALS
    if subject.startswith('/'):
        return JOINT_STATES
    return PART_OF.get(subject, MOTION)


class Diagnostics:
    """Publishes statuses on ``/diagnostics``, if anybody listens.

    Parameters
    ----------
    node
        The node whose full name they have: ``tp_controller: cycle``, in a namespace
        ``arm_1/tp_controller: cycle``.
    """

    def __init__(self, node: Node) -> None:
        self._node = node
        self._name = node.get_fully_qualified_name().lstrip('/')
        self._publisher = node.create_publisher(DiagnosticArray, TOPIC, 1)
        self._told = -math.inf

    @property
    def _heard(self) -> bool:
        return bool(self._publisher.get_subscription_count())

    def wait(self, message: str) -> None:
        """Tell once a second what is waited for; to be called more often."""
        now = time.monotonic()
        if now - self._told >= PERIOD and self._heard:
            self._told = now
            level = DiagnosticStatus.WARN
            self._publish([DiagnosticStatus(level=level, name=JOINT_STATES, message=message)], '')

    def begin(
        self,
        stack: Stack,
        state: ControllerState,
        rate: float | None,
        watch: StateWatch,
        commands: CommandPublisher,
        warnings: Warnings,
    ) -> None:
        """Know what is told of from now on; see `Health`."""
        self.health = Health(state, rate)
        self._stack, self._watch = stack, watch
        self._commands, self._warnings = commands, warnings

    def tick(self) -> None:
        """Tell how the controller is; to be called once a second, between two cycles."""
        second = self.health.count(time.monotonic(), self._watch.received)
        if not self._heard:
            return
        command, limits = self._commands.velocity, []
        # Zero is sent to an arm that rests, whatever the limits are.
        if command.any() or not self._stack.resting:
            limits = self._stack.safety_filter.active_limits(command)
        statuses = self.health.statuses(second, limits, self._warnings.present)
        self._publish(statuses, self._stack.robot.model.name)

    def _publish(self, statuses: Sequence[DiagnosticStatus], robot: str) -> None:
        for status in statuses:
            status.name, status.hardware_id = f'{self._name}: {status.name}', robot
        msg = DiagnosticArray(status=list(statuses))
        msg.header.stamp = self._node.get_clock().now().to_msg()
        self._publisher.publish(msg)
