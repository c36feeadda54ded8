"""What RViz shows: the arm, paths of the controlled frames, targets and obstacles."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable

import numpy as np
import pinocchio as pin
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Point
from numpy.typing import NDArray
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from tp_controller.robot import Robot
from tp_controller.ros.shape_markers import shape_markers
from tp_controller.tasks import ClearanceTask, ObstacleTask, Task, WholeArmTask
from tp_controller.view.targets import target_place
from tp_interfaces.msg import ControllerState

PERIOD = 0.1
"""Time [s] between markers."""
PATH_POINTS = 300
"""Length of a path: 30 s."""

GREY = ColorRGBA(r=0.6, g=0.6, b=0.6, a=1.0)
BLUE = ColorRGBA(r=0.12, g=0.47, b=0.71, a=1.0)
RED = ColorRGBA(r=0.84, g=0.15, b=0.16, a=0.5)
GLASS = ColorRGBA(r=0.12, g=0.47, b=0.71, a=0.25)
ORANGE = ColorRGBA(r=1.0, g=0.5, b=0.05, a=1.0)


class Markers:
    """Makes marker arrays of a robot and its tasks.

    Parameters
    ----------
    robot
        The robot.
    state
        The controller's state, kept up to date by its owner.
    tasks
        Tasks: obstacles are shown, and the links' shapes if any task needs them.
    """

    def __init__(self, robot: Robot, state: ControllerState, tasks: Iterable[Task] = ()) -> None:
        self._robot = robot
        self._state = state
        self._paths: dict[str, deque[Point]] = {}
        self._shown: dict[str, int] = {}
        self.way: NDArray[np.float64] = np.zeros((0, 3))
        """Places (m, 3) [m] of a way around."""
        self.follow_tasks(tasks)

    def follow_tasks(self, tasks: Iterable[Task]) -> None:
        """Show the obstacles among these tasks from now on, and the links if any needs them."""
        tasks = list(tasks)
        self._obstacles = [task for task in tasks if isinstance(task, ObstacleTask | WholeArmTask)]
        self._shows_bodies = any(isinstance(task, ClearanceTask) for task in tasks)

    def array(self, stamp: Time) -> MarkerArray:
        """Markers of the present configuration; every call adds a point to the paths."""
        ends = self._robot.segments().reshape(-1, 3)
        width = 0.03 * max(np.ptp(ends, axis=0).max(), 0.1)
        points = [_point(position) for position in ends]
        markers = [
            self._marker(stamp, 'robot', 0, Marker.LINE_LIST, points, width, GREY),
            self._marker(stamp, 'robot', 1, Marker.SPHERE_LIST, points, 1.6 * width, BLUE),
        ]
        controlled = [task for task in self._state.tasks if task.enabled and task.frame]
        for i, frame in enumerate(dict.fromkeys(task.frame for task in controlled)):
            path = self._paths.setdefault(frame, deque(maxlen=PATH_POINTS))
            path.append(_point(self._robot.frame(frame).position))
            markers.append(
                self._marker(stamp, 'path', i, Marker.LINE_STRIP, list(path), 0.3 * width, BLUE)
            )
        targets = [
            _point(target_place(self._robot, task).translation)
            for task in controlled
            if task.type != 'obstacle' and set(task.target_components) & set('xyz')
        ]
        # An empty list takes the targets of an earlier hierarchy away.
        markers.append(
            self._marker(stamp, 'target', 0, Marker.SPHERE_LIST, targets, 2.0 * width, ORANGE)
        )
        way = [_point(place) for place in self.way]
        markers.append(self._marker(stamp, 'way', 0, Marker.LINE_STRIP, way, 0.5 * width, ORANGE))
        for i, task in enumerate(self._obstacles):
            if isinstance(task, WholeArmTask):
                found = shape_markers(task.obstacle, pin.SE3.Identity())
                markers += [self._named(marker, stamp, 'obstacle', i, RED) for marker in found]
            else:
                markers.append(self._obstacle(stamp, i, task))
        bodies = self._bodies(stamp) if self._shows_bodies else []
        markers += bodies
        # What has gone with its task is taken away.
        for name, count in (('obstacle', len(self._obstacles)), ('body', len(bodies))):
            for i in range(count, self._shown.get(name, 0)):
                markers.append(self._marker(stamp, name, i, Marker.SPHERE, [], 1.0, RED))
            self._shown[name] = count
        return MarkerArray(markers=markers)

    def _bodies(self, stamp: Time) -> list[Marker]:
        """Shapes of the links."""
        robot = self._robot
        found = [
            marker
            for link, shapes in robot.bodies.items()
            for shape in shapes
            for marker in shape_markers(shape, _place(robot, link))
        ]
        return [self._named(marker, stamp, 'body', i, GLASS) for i, marker in enumerate(found)]

    def _obstacle(self, stamp: Time, number: int, task: ObstacleTask) -> Marker:
        """Sphere, or for two axes a disc of the links' thickness."""
        center = np.zeros(3)
        center[task.twist_rows] = task.center
        marker = self._marker(stamp, 'obstacle', number, Marker.SPHERE, [], 2.0 * task.radius, RED)
        marker.action = Marker.ADD
        marker.pose.position = _point(center)
        if len(task.twist_rows) == 2:
            marker.type = Marker.CYLINDER
            marker.scale.z = 0.1 * task.radius
            # The disc is normal to the axis that does not count.
            axis = ({0, 1, 2} - set(task.twist_rows.tolist())).pop()
            if axis < 2:
                marker.pose.orientation.w = math.sqrt(0.5)
                setattr(marker.pose.orientation, 'yx'[axis], math.sqrt(0.5))
        return marker

    def _marker(
        self,
        stamp: Time,
        name: str,
        number: int,
        kind: int,
        points: list[Point],
        width: float,
        color: ColorRGBA,
    ) -> Marker:
        marker = Marker(type=kind, points=points)
        marker.action = Marker.ADD if points else Marker.DELETE
        self._named(marker, stamp, name, number, color)
        marker.scale.x = marker.scale.y = marker.scale.z = width
        return marker

    def _named(
        self, marker: Marker, stamp: Time, name: str, number: int, color: ColorRGBA
    ) -> Marker:
        """Marker with its name, color and header filled in."""
        marker.ns, marker.id, marker.color = name, number, color
        marker.header.stamp = stamp
        marker.header.frame_id = self._robot.base_frame
        return marker


def _place(robot: Robot, link: str) -> pin.SE3:
    """Present pose of a link."""
    frame = robot.base if link not in robot.frames else robot.frame(link)
    return pin.SE3(frame.rotation, frame.position)


def _point(position: NDArray[np.float64]) -> Point:
    x, y, z = position.tolist()
    return Point(x=x, y=y, z=z)
