"""Publishes one goal 4,000 times a second: ``python -m tp_sim.faults.goal_flood TOPIC``.

With a second argument it listens to the controller's state of that topic, too.
"""

from __future__ import annotations

import contextlib
import sys
import time
from collections.abc import Sequence

import rclpy
from geometry_msgs.msg import PointStamped
from rclpy.executors import ExternalShutdownException

from tp_interfaces.msg import ControllerState

RATE = 4000.0


def main(topic: str, state_topics: Sequence[str] = ()) -> None:
    """Publish until a signal comes."""
    rclpy.init()
    node = rclpy.create_node('goal_flood')
    publisher = node.create_publisher(PointStamped, topic, 10)
    for state in state_topics:
        node.create_subscription(ControllerState, state, lambda _: None, 10)
    msg = PointStamped()
    msg.point.x, msg.point.y = 1.0, 0.5
    begin, count = time.monotonic(), 0
    # A signal may end it in the middle of a call.
    with contextlib.suppress(ExternalShutdownException, RuntimeError, KeyboardInterrupt):
        while rclpy.ok():
            publisher.publish(msg)
            count += 1
            wait = begin + count / RATE - time.monotonic()
            if wait > 0.0:
                time.sleep(wait)
            if count % 20 == 0:
                rclpy.spin_once(node, timeout_sec=0.0)


if __name__ == '__main__':
    main(sys.argv[1], sys.argv[2:])
