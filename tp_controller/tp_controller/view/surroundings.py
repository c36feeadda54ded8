"""Obstacles, and how far the arm is from them and from itself."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from typing import Any

import numpy as np
import pinocchio as pin
import viser
from numpy.typing import NDArray

from tp_controller.robot import Robot, Shape
from tp_controller.scenery import obstacle_shape
from tp_controller.tasks import ClearanceTask, ObstacleTask, Task, WholeArmTask
from tp_controller.view.palette import FAR, NEAR, OBSTACLE
from tp_controller.view.solids import Paint, add_solid, put
from tp_controller.view.targets import AXES, has_values

CLOSE = 0.3
"""Distances [m] up to which a line is drawn between links and obstacles."""
MOST = 4
"""Lines of one task: those of its nearest links."""

Matrix = NDArray[np.float64]


class Surroundings:
    """Draws the obstacles of tasks, and on request the distances of set-based tasks.

    Parameters
    ----------
    scene
        Where it is drawn.
    robot
        The robot.
    tasks
        Its tasks.
    """

    def __init__(self, scene: viser.SceneApi, robot: Robot, tasks: Iterable[Task]) -> None:
        self._scene, self._robot = scene, robot
        tasks = list(tasks)
        self._kept = {
            task.name: task for task in tasks if isinstance(task, ClearanceTask | ObstacleTask)
        }
        self._obstacles: dict[str, viser.SceneNodeHandle] = {}
        for task in tasks:
            shape = obstacle_shape(task)
            if shape is None:
                continue
            wall = shape.kind == 'half_space'
            paint = Paint((170, 160, 150) if wall else OBSTACLE, 0.55 if wall else 0.5)
            node = scene.add_frame(f'/obstacles/{task.name}', show_axes=False)
            add_solid(scene, f'/obstacles/{task.name}/solid', _centred(shape), paint)
            put(node, pin.SE3(np.eye(3), shape.pose.translation))
            self._obstacles[task.name] = node
        self._lines: viser.LineSegmentsHandle | None = None
        self._labels: dict[str, viser.LabelHandle] = {}

    def follow(self, states: Iterable[Any]) -> None:
        """Move obstacles to where the controller has them; those of tasks that are off fade."""
        for task in states:
            node = self._obstacles.get(task.name)
            if node is None:
                continue
            node.visible = bool(task.enabled)
            if has_values(task):
                center = np.array(node.position)
                for axis, value in zip(task.target_components, task.desired, strict=True):
                    center[AXES.index(axis)] = value
                put(node, pin.SE3(np.eye(3), center))

    def measure(self, states: Iterable[Any]) -> None:
        """Draw the shortest ways of tasks that keep a distance; the nearest has its number."""
        ways: list[Matrix] = []
        distances: list[float] = []
        for task in states:
            own = self._kept.get(task.name)
            found = None if own is None or not task.enabled else shortest_ways(own, task)
            if found is None:
                self._label(task.name, None)
                continue
            between, far = found
            near = [row for row in np.argsort(far)[:MOST] if far[row] < CLOSE]
            ways += [between[row] for row in near]
            distances += [float(far[row]) for row in near]
            i = int(np.argmin(far))
            self._label(task.name, (between[i].mean(axis=0), float(far[i])) if i in near else None)
        self._draw(np.array(ways).reshape(-1, 2, 3), np.array(distances))

    def hide_distances(self) -> None:
        """Take lines and numbers away."""
        self._draw(np.zeros((0, 2, 3)), np.zeros(0))
        for label in self._labels.values():
            label.visible = False

    def _draw(self, ways: Matrix, distances: NDArray[np.float64]) -> None:
        share = np.clip(distances / CLOSE, 0.0, 1.0)[:, None]
        colors = (np.array(NEAR) * (1.0 - share) + np.array(FAR) * share).astype(np.uint8)
        both = np.repeat(colors[:, None, :], 2, axis=1)
        if self._lines is None:
            if len(ways):
                points = ways.astype(np.float32)
                self._lines = self._scene.add_line_segments(
                    '/distances', points, both, thickness=3.0, thickness_units='screen'
                )
            return
        self._lines.visible = bool(len(ways))
        if len(ways):
            self._lines.colors = both
            self._lines.points = ways.astype(np.float32)

    def _label(self, name: str, found: tuple[Matrix, float] | None) -> None:
        label = self._labels.get(name)
        if found is None:
            if label is not None:
                label.visible = False
            return
        place, distance = found
        text = f'{name} {1e3 * distance:.0f} mm'
        if label is None:
            label = self._scene.add_label(f'/labels/{name}', text)
            self._labels[name] = label
        label.text, label.position, label.visible = text, place, True


def shortest_ways(task: Task, state: Any) -> tuple[Matrix, NDArray[np.float64]] | None:
    """Nearest points (k, 2, 3) [m] of every row, and their signed distances (k,) [m].

    Parameters
    ----------
    task
        A task that keeps a distance, whose robot is where the arm is.
    state
        The same as ``~/state`` tells it, with the place of its obstacle.
    """
    if isinstance(task, ClearanceTask):
        if isinstance(task, WholeArmTask) and has_values(state):
            task.target = np.array(state.desired)
            task.obstacle  # noqa: B018 - moves it
        return task.clearance.nearest_points(), task.clearance.distances()
    if isinstance(task, ObstacleTask) and has_values(state):
        own = np.array(task.frame.position)
        center = own.copy()
        center[task.twist_rows] = state.desired
        way = own - center
        length = float(np.linalg.norm(way))
        if length == 0.0:
            return None
        surface = center + task.radius / length * way
        return np.array([[own, surface]]), np.array([length - task.radius])
    return None


def frames_seen(states: Iterable[Any], frames: Collection[str]) -> list[str]:
    """Frames that enabled tasks control, each once."""
    found = [task.frame for task in states if task.enabled and task.frame in frames]
    return list(dict.fromkeys(found))


def _centred(shape: Shape) -> Shape:
    return shape._replace(pose=pin.SE3(shape.pose.rotation, np.zeros(3)))
