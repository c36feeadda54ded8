"""How long it takes to take a trajectory over: from the bytes of the message to the task's path.

Beside it, how long rclpy takes to make objects of the points, which is not done. Processor time of
the thread, median of 20.

    python benchmarks/trajectory_input.py
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from builtin_interfaces.msg import Duration
from geometry_msgs.msg import Transform, Twist
from rclpy.serialization import deserialize_message, serialize_message
from rich.console import Console
from rich.table import Table
from trajectory_msgs.msg import (
    JointTrajectory,
    JointTrajectoryPoint,
    MultiDOFJointTrajectory,
    MultiDOFJointTrajectoryPoint,
)

from tp_controller import build_settings
from tp_controller.config import read_parameter_file
from tp_controller.ros.codecs import GOALS
from tp_controller.ros.goals import GoalReader
from tp_controller.ros.trajectory_bytes import trajectory_message
from tp_controller.ros.trajectory_messages import Begin

CONFIG = Path(__file__).resolve().parent.parent / 'config' / 'panda.yaml'
BEGIN = Begin(0.0, None, 0.0, 0.0, 1.0)


def joints(count: int, names: list[str]) -> JointTrajectory:
    """Positions, velocities and accelerations of joints."""
    msg = JointTrajectory(joint_names=names)
    rows = {key: [0.0] * len(names) for key in ('positions', 'velocities', 'accelerations')}
    for i in range(count):
        msg.points.append(JointTrajectoryPoint(time_from_start=Duration(sec=i + 1), **rows))
    return msg


def poses(count: int) -> MultiDOFJointTrajectory:
    """Poses, velocities and accelerations of a frame."""
    msg = MultiDOFJointTrajectory()
    for i in range(count):
        transform = Transform()
        transform.translation.x, transform.rotation.w = 0.5, 1.0
        point = MultiDOFJointTrajectoryPoint(time_from_start=Duration(sec=i + 1))
        point.transforms, point.velocities, point.accelerations = [transform], [Twist()], [Twist()]
        msg.points.append(point)
    return msg


def milliseconds(do: Callable[[], object]) -> str:
    """Median time of doing something, in words."""
    times = []
    for _ in range(20):
        begin = time.thread_time()
        do()
        times.append(time.thread_time() - begin)
    return f'{1e3 * np.median(times):.2f}'


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--points', type=int, default=1000)
    count = parser.parse_args().points
    stack = build_settings(read_parameter_file(CONFIG, 'tp_controller')).stack
    limits = stack.robot.limits
    stack.step(0.5 * (limits.position_min + limits.position_max))
    frames = GoalReader(stack.robot)
    table = Table(title=f'trajectories of {count} points')
    for column in ('', 'bytes', 'objects by rclpy, ms', 'taken over, ms'):
        table.add_column(column, justify='right' if column else 'left')
    cases = (
        ('posture', joints(count, list(stack.robot.joints))),
        ('hand_orientation', poses(count)),
    )
    for name, msg in cases:
        task, kind, data = stack.tasks[name], type(msg), serialize_message(msg)
        path = GOALS[task.type].path
        table.add_row(
            kind.__name__,
            f'{len(data)}',
            milliseconds(lambda data=data, kind=kind: deserialize_message(data, kind)),
            milliseconds(
                lambda data=data, kind=kind, task=task, path=path: path(
                    task, trajectory_message(data, kind), frames, BEGIN
                )
            ),
        )
    Console(width=100).print(table)


if __name__ == '__main__':
    main()
