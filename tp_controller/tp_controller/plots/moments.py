"""What an arm and its surroundings look like at a cycle of a run."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from tp_controller.plots.curves import goal_times
from tp_controller.recording import Run
from tp_controller.robot import Shape, capsule
from tp_controller.robot.frames import Frame
from tp_controller.scenery import is_planar, obstacle_shape
from tp_controller.stack import Stack
from tp_controller.tasks import ObstacleTask, Task, WholeArmTask

Array = NDArray[np.float64]
THICKNESS = 0.03
"""Radius of links that have no shape, as a share of the arm's extent."""
AXES = 'xyz'
NEWS = 0.04
"""Share of the way of the joints between two pictures at least."""
WAYS = 400
"""Points of a path that are drawn at most."""


class Target(NamedTuple):
    """Where a task wants its frame to be."""

    task: str
    place: Array
    """(3,) [m]; not a number along axes that the task leaves free."""


class Scene:
    """Robot, obstacles, paths and targets of a run, at any cycle of it.

    Parameters
    ----------
    run
        The run.
    stack
        The stack that it was made with.
    """

    def __init__(self, run: Run, stack: Stack) -> None:
        self.run, self.robot = run, stack.robot
        self._obstacles = {
            name: task
            for name, task in stack.tasks.items()
            if isinstance(task, ObstacleTask | WholeArmTask)
        }
        self._courses = {task.name: task for task in run.tasks}
        self.planar = is_planar(self.robot)
        order = [run.coordinates.index(name) for name in self.robot.coordinates]
        self._q = run.q[:, order]
        courses = [task for task in run.tasks if task.place >= 0 and not task.distance.size]
        frames = dict.fromkeys(task.frame for task in courses if task.frame)
        self._cycles = np.unique(np.linspace(0, len(run.time) - 1, WAYS, dtype=int))
        self._ways = self._paths([frame for frame in frames if frame in self.robot.frames])
        self.extent = self._extent()

    def _paths(self, frames: Sequence[str]) -> dict[str, Array]:
        found: dict[str, list[Array]] = {frame: [] for frame in frames}
        for i in self._cycles:
            self.robot.update(self._q[i])
            for frame, places in found.items():
                places.append(np.array(self.robot.frame(frame).position))
        return {frame: np.array(places) for frame, places in found.items()}

    def _extent(self) -> float:
        self.robot.update(self._q[0])
        ends = self.robot.segments().reshape(-1, 3)
        return max(float(np.ptp(ends, axis=0).max()) if len(ends) else 0.0, 0.1)

    @property
    def paths(self) -> dict[str, Array]:
        """Ways (p, 3) [m] of the controlled frames, by their names."""
        return self._ways

    def paths_until(self, cycle: int) -> dict[str, Array]:
        """Ways up to a cycle."""
        count = int(np.searchsorted(self._cycles, cycle, 'right'))
        return {frame: places[:count] for frame, places in self._ways.items()}

    def skeleton(self, cycle: int) -> Array:
        """Segments (s, 2, 3) [m] of the arm at a cycle."""
        self.robot.update(self._q[cycle])
        return np.array(self.robot.segments())

    def links(self, cycle: int) -> list[Shape]:
        """Shapes of the links in the base frame at a cycle; of those without, thin capsules."""
        robot = self.robot
        robot.update(self._q[cycle])
        bodies = robot.bodies
        found = []
        for link, shapes in bodies.items():
            place = robot.base if link not in robot.frames else robot.frame(link)
            pose = _pose(place)
            found += [shape.moved(pose) for shape in shapes]
        if not found:
            found = [
                capsule(start, end, THICKNESS * self.extent)
                for start, end in robot.segments()
                if np.linalg.norm(end - start) > 1e-6
            ]
        return found

    def obstacles(self, cycle: int) -> dict[str, Shape]:
        """Obstacles that are kept clear of, at a cycle, by their tasks."""
        found = {}
        for name, task in self._obstacles.items():
            course = self._courses.get(name)
            if course is None or not course.enabled[cycle]:
                continue
            shape = _placed(task, course.desired[cycle])
            if shape is not None:
                found[name] = shape
        return found

    def targets(self, cycle: int) -> list[Target]:
        """Targets of tasks that control the place of a frame, at a cycle."""
        found = []
        for task in self.run.tasks:
            if not (task.enabled[cycle] and task.frame) or task.distance.size or task.relative_to:
                continue
            place = np.full(3, math.nan)
            for name, value in zip(task.target_components, task.desired[cycle], strict=True):
                if name in AXES:
                    place[AXES.index(name)] = value
            if np.any(np.isfinite(place)):
                found.append(Target(task.name, place))
        return found

    def stills(self, count: int) -> list[int]:
        """Cycles that tell the story: the start, the end, and evenly along the way of the joints.

        Where targets jump, the last cycle before each jump is among them.
        """
        last = len(self.run.time) - 1
        moved = np.linalg.norm(np.diff(self._q, axis=0), axis=1)
        way = np.concatenate([[0.0], np.cumsum(moved)])
        if not way[-1]:
            return [0] if last == 0 else [0, last]
        chosen = {0, last}
        for i in goal_times(self.run):
            # A goal that comes when little has happened since another one tells no story.
            far = min(abs(way[i - 1] - way[j]) for j in chosen)
            if far > NEWS * way[-1] and len(chosen) < count:
                chosen.add(i - 1)
        while len(chosen) < min(count, last + 1):
            # Halve the longest way between two of them.
            found = sorted(chosen)
            gaps = np.diff(way[found])
            i = int(np.argmax(gaps))
            middle = int(np.searchsorted(way, 0.5 * (way[found[i]] + way[found[i + 1]])))
            middle = min(max(middle, found[i] + 1), found[i + 1] - 1)
            if middle in chosen or not gaps[i]:
                break
            chosen.add(middle)
        return sorted(chosen)


def _pose(frame: Frame) -> pin.SE3:
    return pin.SE3(np.array(frame.rotation), np.array(frame.position))


def _placed(task: Task, center: Array) -> Shape | None:
    """Shape of a task's obstacle around a centre."""
    shape = obstacle_shape(task)
    if shape is None or not np.all(np.isfinite(center)):
        return shape
    place = shape.pose.translation.copy()
    for axis, value in zip(task.target_components, center, strict=True):
        place[AXES.index(axis)] = value
    return shape._replace(pose=pin.SE3(shape.pose.rotation, place))
