"""The least that a node can do: every joint state back as it came.

Usage: ``echo_node.py NAME [state]``. With ``state`` it also publishes a controller's state, bytes
that are made once: what remains is the cost of the listener itself.
"""

import contextlib
import sys

import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState

from tp_interfaces.msg import ControllerState, LevelState, TaskState

JOINTS = ['joint_1', 'joint_2', 'joint_3']


def state() -> ControllerState:
    """State of a controller with the tasks of experiment A4."""
    position, joint = (
        TaskState(
            name=name,
            type='position',
            frame='link_3',
            components=rows,
            target_components=rows,
            desired=[0.5] * len(rows),
            current=[0.5] * len(rows),
            error=[0.5] * len(rows),
            requested_velocity=[0.5] * len(rows),
            achieved_velocity=[0.5] * len(rows),
        )
        for name, rows in (('ee_position', ['x', 'y']), ('joint_1_position', ['joint_1']))
    )
    return ControllerState(
        joint_names=JOINTS,
        position_names=JOINTS,
        position=[0.5] * 3,
        command=[0.5] * 3,
        levels=[LevelState(tasks=[task.name]) for task in (position, joint)],
        tasks=[position, joint],
    )


def main() -> None:
    rclpy.init()
    name = sys.argv[1]
    node = rclpy.create_node(name)
    publisher = node.create_publisher(JointState, f'{name}/command', 100)
    answer = publisher.publish
    if 'state' in sys.argv:
        states = node.create_publisher(ControllerState, f'{name}/state', 100)
        told = serialize_message(state())

        def answer(msg: JointState) -> None:
            publisher.publish(msg)
            states.publish(told)

    node.create_subscription(JointState, f'{name}/joint_states', answer, 100)
    with contextlib.suppress(KeyboardInterrupt, ExternalShutdownException):
        rclpy.spin(node)


if __name__ == '__main__':
    main()
