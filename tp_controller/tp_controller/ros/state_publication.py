"""When the controller's state is published, and the line that it tells."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable

from rclpy.publisher import Publisher

from tp_controller.ros.control import Control

LEAST_PERIOD = 0.01
"""Least time [s] between two states that are published without a cycle."""
LONGEST_SILENCE = 0.1
"""Time [s] after which the state is published even while joint states wait."""


class StatePublication:
    """Publishes ``~/state``: after a cycle, or because something has changed.

    Parameters
    ----------
    publisher
        Where to.
    control
        The parts that the state tells of.
    texts
        What is told before the warnings that are present.

    Attributes
    ----------
    due
        Whether something has changed that is not published yet.
    rearranged
        Whether other levels act: before the next step there is nothing to explain.
    """

    def __init__(
        self, publisher: Publisher, control: Control, texts: Callable[[], Iterable[str]]
    ) -> None:
        self._publisher, self._intake = publisher, control.intake
        self._state, self._commands, self._cycle = control.state, control.commands, control.cycle
        self._warnings, self._texts = control.warnings, texts
        self._published = -math.inf
        self.due = self.rearranged = False

    def publish_cycle(self, explain: bool) -> None:
        """Publish the state of a cycle; of some only, if these are too many already."""
        if not self._publisher.get_subscription_count():
            return
        if self._cycle.choice.behind and time.monotonic() - self._published < LONGEST_SILENCE:
            self.due = True
            return
        self._state.refresh(self._commands.velocity)
        explain, self.rearranged = explain and not self.rearranged, False
        try:
            if explain and not self._cycle.refused:
                self._state.explain(self._intake.waits)
        except Exception as error:
            self._state.forget_explanation()
            self._warnings.warn('explanation', f'no explanation: {type(error).__name__}: {error}')
        self.publish()

    def publish_change(self) -> None:
        """Publish what is `due`, if the last state was not published just now."""
        if self.due and time.monotonic() - self._published >= LEAST_PERIOD:
            if self._cycle.running:
                self._state.refresh(self._commands.velocity)
            self.publish()

    def publish(self) -> None:
        """Publish the state as it is."""
        self.due = False
        self._published = time.monotonic()
        texts = (*self._texts(), self._warnings.message)
        self._state.msg.message = '; '.join(text for text in texts if text)
        self._publisher.publish(self._state.serialized())
