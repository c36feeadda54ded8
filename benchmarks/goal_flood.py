"""Publishes goals as fast as 4,000 a second, and listens to the controller's state."""

import contextlib
import time

import rclpy
from geometry_msgs.msg import PointStamped
from rclpy.executors import ExternalShutdownException

from tp_interfaces.msg import ControllerState

RATE = 4000.0

rclpy.init()
node = rclpy.create_node('goal_flood')
publisher = node.create_publisher(PointStamped, 'tp_controller/ee_position/goal', 10)
node.create_subscription(ControllerState, 'tp_controller/state', lambda _: None, 10)
msg = PointStamped()
msg.point.x, msg.point.y = 1.0, 0.5
begin, count = time.monotonic(), 0
# A signal may end it in the middle of a call.
with contextlib.suppress(ExternalShutdownException, RuntimeError):
    while rclpy.ok():
        publisher.publish(msg)
        count += 1
        wait = begin + count / RATE - time.monotonic()
        if wait > 0.0:
            time.sleep(wait)
        if count % 20 == 0:
            rclpy.spin_once(node, timeout_sec=0.0)
