"""Joint states as they wait for the controller."""

from __future__ import annotations

import time
from typing import Any

from rclpy.node import Node
from sensor_msgs.msg import JointState

from tp_controller.ros.state_watch import Arrival, StateWatch

QUEUE_DEPTH = 100
"""States that wait while the process is not scheduled, to be counted: 0.1 s at 1 kHz."""


class Intake:
    """Takes all joint states that wait, at any moment.

    The executor hands over one message of a subscription and then one of each other before the
    next; so the rest is taken here.

    Parameters
    ----------
    node
        The controller's node.
    watch
        Judges every state that comes.
    """

    def __init__(self, node: Node, watch: StateWatch) -> None:
        self._watch = watch
        self._stored: list[tuple[JointState, dict[str, Any]]] = []
        self._emptied = time.monotonic()
        self._subscription = node.create_subscription(
            JointState, 'joint_states', self._store, QUEUE_DEPTH
        )

    @property
    def topic(self) -> str:
        """Full name of the topic."""
        return str(self._subscription.topic_name)

    def take(self) -> list[Arrival]:
        """All states that wait, the newest last; without those that newer ones overtook."""
        arrivals: list[Arrival] = []
        idle = time.monotonic() - self._emptied
        handle = self._subscription.handle
        with handle:
            # More than the queue holds come only while they are taken.
            for _ in range(QUEUE_DEPTH + 1):
                if self._stored:
                    msg, info = self._stored.pop(0)
                else:
                    found = handle.take_message(JointState, False)
                    if found is None:
                        break
                    msg, info = found
                arrival = self._watch.arrive(msg, info, time.monotonic(), idle)
                if arrival is not None:
                    arrivals.append(arrival)
        self._emptied = time.monotonic()
        return arrivals

    def waits(self) -> bool:
        """Whether a state waits; who asks has to `take` it before the executor goes on."""
        if not self._stored:
            handle = self._subscription.handle
            with handle:
                found = handle.take_message(JointState, False)
            if found is None:
                self._emptied = time.monotonic()
                return False
            self._stored.append(found)
        return True

    def _store(self, msg: JointState, info: dict[str, Any]) -> None:
        self._stored.append((msg, info))
