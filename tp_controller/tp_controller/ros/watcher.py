"""The newest state of a running controller when it is asked for, and why there is none."""

from __future__ import annotations

import math
import time
from typing import Any

from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy

from tp_controller.ros.polled import subscribe, take
from tp_controller.ros.watch_table import Sight
from tp_interfaces.msg import ControllerState

SILENT = 1.0
"""Time [s] without a state after which that is said; a controller gives one every 0.1 s."""
SETTLE = 0.5
"""Time [s] that it takes to know the rate."""
QOS = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
"""The newest state alone; the controller sends none again for a watcher."""
TYPE = 'tp_interfaces/msg/ControllerState'


class Watcher:
    """Takes the newest state when asked, and finds out why there is none.

    Parameters
    ----------
    node
        Listens; nothing spins it.
    controller
        Name of the controller's node.
    """

    def __init__(self, node: Node, controller: str) -> None:
        self._node = node
        self._subscription = subscribe(node, ControllerState, f'{controller}/state', QOS)
        self.topic = str(self._subscription.topic_name)
        self._state: ControllerState | None = None
        self._seen = time.monotonic()
        self._before: tuple[float, int] | None = None
        self._rate = math.nan

    def look(self) -> Sight:
        """Take the newest state, if there is a new one."""
        found: Any = take(self._subscription)
        now = time.monotonic()
        if found is not None:
            self._count(found.cycles, now)
            self._state, self._seen = found, now
        silence = '' if now - self._seen < SILENT else self._silence(now - self._seen)
        if not silence and self._state is None:
            silence = f'listening to {self.topic}'
        return Sight(self.topic, self._state, self._rate, silence)

    def _count(self, cycles: int, now: float) -> None:
        """Find the rate; a controller that was started anew counts from zero again."""
        if self._before is None or cycles < self._before[1]:
            self._before, self._rate = (now, cycles), math.nan
            return
        passed = now - self._before[0]
        if passed >= 0.9 * SETTLE:
            self._rate = (cycles - self._before[1]) / passed
            self._before = (now, cycles)

    def _silence(self, seconds: float) -> str:
        when = f'no state for {seconds:.0f} s: '
        if self._node.count_publishers(self.topic):
            return f'{when}a controller is there, but silent on {self.topic}'
        others = [
            topic.removesuffix('/state')
            for topic, types in self._node.get_topic_names_and_types()
            if TYPE in types and topic != self.topic and self._node.count_publishers(topic)
        ]
        hint = f'; there is {", ".join(others)} (--controller NAME)' if others else ''
        return f'{when}nothing publishes {self.topic}{hint}'
