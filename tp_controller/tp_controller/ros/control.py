"""The parts that turn joint states and goals into commands, of the node or of a replay."""

from __future__ import annotations

from collections.abc import Callable

from rclpy.node import Node

from tp_controller.config import Settings, know_rate
from tp_controller.config.schema import POSITION_TYPES
from tp_controller.errors import InvalidValue
from tp_controller.position_reference import PositionReference
from tp_controller.ros.commands import CommandPublisher
from tp_controller.ros.cycle import Cycle
from tp_controller.ros.intake import Intake
from tp_controller.ros.log import Log
from tp_controller.ros.state import StateMessage
from tp_controller.ros.state_watch import StateWatch
from tp_controller.ros.task_inputs import TaskInputs
from tp_controller.ros.warnings import Warnings


class Control:
    """Makes the parts and joins them.

    Parameters
    ----------
    node
        Publishes commands and listens to goals.
    settings
        What the controller runs on.
    intake, watch, limit, warnings, log, found_rate
        As for `Cycle`; whether a rate has to be found is seen here.
    refuse_at_rest
        As for `TaskInputs`.

    Attributes
    ----------
    settings, intake, watch, warnings
        As they were given.
    state, inputs, commands, cycle
        The parts.
    positions
        Whether commands are positions.
    missing_rate
        Why the arm rests until a rate is found; empty if none has to be found.
    """

    def __init__(
        self,
        node: Node,
        settings: Settings,
        intake: Intake,
        watch: StateWatch,
        limit: float,
        warnings: Warnings,
        log: Log,
        refuse_at_rest: Callable[[str], None],
        found_rate: Callable[[float], object],
    ) -> None:
        values, stack = settings.values, settings.stack
        self.settings, self.intake, self.watch, self.warnings = settings, intake, watch, warnings
        self._found_rate = found_rate
        self.state = StateMessage(stack)
        self.inputs = TaskInputs(
            node, settings, self.state, warnings, watch.period, refuse_at_rest
        )
        command_type, reference = values['command.type'], None
        self.positions = command_type in POSITION_TYPES
        if self.positions:
            reference = PositionReference(stack, values['command.tolerance'])
        self.commands = CommandPublisher(node, stack.robot, command_type, reference)
        self.missing_rate = self._missing_rate()
        self.cycle = Cycle(
            stack,
            intake,
            watch,
            self.commands,
            self.state.msg,
            warnings,
            log,
            values['rate'],
            limit,
            self.inputs.answered,
            self.inputs.handle,
            self._know_rate if self.missing_rate else None,
            reference,
        )

    def _missing_rate(self) -> str:
        stack = self.settings.stack
        if self.positions and self.settings.values['rate'] is None:
            return (
                'rate: got no value: the arm rests until it is found from the joint states, '
                'command.type needs it'
            )
        try:
            stack.robot.limits.check_period(stack.robot.joints, stack.safety_filter.period)
        except InvalidValue as error:
            return f'{error}: the arm rests until it is found from the joint states'
        return ''

    def _know_rate(self, rate: float) -> None:
        know_rate(self.settings, rate)
        self.watch.period = 1.0 / rate
        self.inputs.know_period(1.0 / rate)
        self._found_rate(rate)
