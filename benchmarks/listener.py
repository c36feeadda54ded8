"""Listens to the controller's state."""

import contextlib

import rclpy
from rclpy.executors import ExternalShutdownException

from tp_interfaces.msg import ControllerState

rclpy.init()
node = rclpy.create_node('listener')
node.create_subscription(ControllerState, 'tp_controller/state', lambda _: None, 10)
with contextlib.suppress(ExternalShutdownException):
    rclpy.spin(node)
