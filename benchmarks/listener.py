"""Listens to a controller's state on the topic that it is given."""

import contextlib
import sys

import rclpy
from rclpy.executors import ExternalShutdownException

from tp_interfaces.msg import ControllerState

rclpy.init()
node = rclpy.create_node('listener')
node.create_subscription(ControllerState, sys.argv[1], lambda _: None, 10)
with contextlib.suppress(ExternalShutdownException):
    rclpy.spin(node)
