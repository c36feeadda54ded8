"""Joint states as they wait for the controller."""

from __future__ import annotations

import time
from collections.abc import Collection
from typing import Any

from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from sensor_msgs.msg import JointState

from tp_controller.ros.joint_state_bytes import JointStateDecoder
from tp_controller.ros.other_devices import OtherDevices
from tp_controller.ros.polled import subscribe, taker
from tp_controller.ros.state_watch import Arrival, StateWatch

QUEUE_DEPTH = 100
"""States that wait while the process is not scheduled, to be counted: 0.1 s at 1 kHz."""


class Intake:
    """Waits for joint states, and takes all that wait, at any moment.

    No executor does that: it would look at everything else the node has for every state.

    Parameters
    ----------
    node
        The controller's node.
    watch
        Judges every state of the robot that comes.
    joints
        Names of the robot's joints in joint states.

    Attributes
    ----------
    others
        Other devices that send joint states; `take` leaves theirs out.
    """

    def __init__(self, node: Node, watch: StateWatch, joints: Collection[str]) -> None:
        self._watch = watch
        self.others = OtherDevices(joints)
        self._decoder = JointStateDecoder()
        self._stored: list[tuple[bytes, dict[str, Any]]] = []
        self._emptied = time.monotonic()
        self.subscription = subscribe(node, JointState, 'joint_states', QUEUE_DEPTH, raw=True)
        self._take = taker(self.subscription)
        self._context = node.context
        self._wait_set = rclpy_implementation.WaitSet(1, 0, 0, 0, 0, 0, node.context.handle)

    @property
    def topic(self) -> str:
        """Full name of the topic."""
        return str(self.subscription.topic_name)

    def wait(self, seconds: float) -> None:
        """Wait for a joint state, no longer than a time [s]."""
        if self._stored or seconds <= 0.0:
            return
        handle, wait_set = self.subscription.handle, self._wait_set
        with handle, self._context.handle:
            wait_set.clear_entities()
            wait_set.add_subscription(handle)
            wait_set.wait(int(1e9 * seconds))

    def take(self) -> list[Arrival]:
        """All states that wait, the newest last; without those that newer ones overtook.

        Those of other devices are left out, too.
        """
        arrivals: list[Arrival] = []
        idle = time.monotonic() - self._emptied
        # More than the queue holds come only while they are taken.
        for _ in range(QUEUE_DEPTH + 1):
            found = self._stored.pop(0) if self._stored else self._take()
            if found is None:
                break
            data, info = found
            taken = time.monotonic()
            msg = self._decoder.read(data)
            if self.others.sent(msg, taken):
                continue
            arrival = self._watch.arrive(msg, info, taken, idle)
            if arrival is not None:
                arrivals.append(arrival)
        self._emptied = time.monotonic()
        return arrivals

    def waits(self) -> bool:
        """Whether a state waits; who asks has to `take` it."""
        if not self._stored:
            found = self._take()
            if found is None:
                self._emptied = time.monotonic()
                return False
            self._stored.append(found)
        return True
