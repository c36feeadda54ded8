"""The least that a node can do: every joint state back as it came."""

import contextlib

import rclpy
from rclpy.executors import ExternalShutdownException
from sensor_msgs.msg import JointState


def main() -> None:
    rclpy.init()
    node = rclpy.create_node('echo')
    publisher = node.create_publisher(JointState, 'echo/command', 100)
    node.create_subscription(JointState, 'echo/joint_states', publisher.publish, 100)
    with contextlib.suppress(KeyboardInterrupt, ExternalShutdownException):
        rclpy.spin(node)


if __name__ == '__main__':
    main()
