"""The page as a whole: takes states and a robot, gives what people ask for."""

from __future__ import annotations

import math
import time
from collections.abc import Collection, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any, NamedTuple

import numpy as np

from tp_controller.errors import TaskPriorityError
from tp_controller.robot import Robot, Shape
from tp_controller.scenery import is_planar
from tp_controller.stack import Stack
from tp_controller.units import unit
from tp_controller.view.arm import ArmPicture
from tp_controller.view.ground import Ground
from tp_controller.view.handles import Handles
from tp_controller.view.history import KEPT
from tp_controller.view.page import Page
from tp_controller.view.panel import Panel
from tp_controller.view.paths import Paths
from tp_controller.view.surroundings import Surroundings, frames_seen
from tp_controller.view.task_folder import Range
from tp_controller.view.visuals import Visual
from tp_controller.view.wishes import Wishes

TEXTS, PLOTS, DISTANCES = 0.25, 0.25, 0.1
"""Times [s] between two pictures of these."""
FIELD = math.radians(50.0)
"""Vertical angle [rad] that the camera sees."""


class _Drawn(NamedTuple):
    """What is drawn of a robot."""

    robot: Robot
    arm: ArmPicture
    ground: Ground
    paths: Paths
    surroundings: Surroundings
    handles: Handles


class View:
    """Shows a controller on a page.

    Parameters
    ----------
    page
        The page.
    types
        Types of tasks that take goals.
    file
        Proposed for the stack to be saved to.
    read_only
        Whether nothing can be asked for.
    """

    def __init__(
        self, page: Page, types: Collection[str], file: str = '', read_only: bool = False
    ) -> None:
        self.wishes = Wishes()
        """What people ask for."""
        self._page, self._types = page, types
        self._ask = None if read_only else self.wishes.add
        self._scene = page.server.scene
        self.panel = Panel(page.server.gui, file, self._ask)
        self._drawn: _Drawn | None = None
        self._names: tuple[str, ...] = ()
        self._due: dict[str, float] = {}
        self._begin = time.monotonic()
        self._cycles = -1
        self._scene.configure_default_lights(cast_shadow=False)
        # The picture of a room that is mirrored in surfaces by default is most of the work of a
        # browser without a graphics card.
        self._scene.configure_environment_map(hdri=None)
        self._thread = ThreadPoolExecutor(1, 'shapes')
        self._bodies: tuple[Robot, Future[Mapping[str, tuple[Shape, ...]]]] | None = None

    def set_stack(self, stack: Stack, same_robot: bool = False) -> None:
        """Draw a robot, and the obstacles of its tasks, from now on.

        Parameters
        ----------
        stack
            Robot and tasks.
        same_robot
            Whether the robot looks as the one before, which then stays with its meshes.
        """
        robot, before = stack.robot, self._drawn
        with self._page.server.atomic():
            if same_robot and before is not None:
                for name in ('/obstacles', '/targets', '/labels', '/distances'):
                    self._scene.remove_by_name(name)
                arm, paths, ground = before.arm, before.paths, before.ground
                arm.robot = robot
            else:
                self._scene.reset()
                arm = ArmPicture(self._scene, robot)
                paths = Paths(self._scene, arm.extent)
                ground = self._furnish(robot, arm.extent, before is None)
            around = Surroundings(self._scene, robot, stack.tasks.values())
            handles = Handles(self._scene, robot, arm.extent, self._types, self._ask)
            self._drawn = _Drawn(robot, arm, ground, paths, around, handles)
        self._names = ()
        self._cycles = -1

    def add_visual(self, visual: Visual) -> None:
        """Show a mesh of a link of the robot."""
        if self._drawn is not None:
            self._drawn.arm.add_visual(visual)

    def show(
        self,
        state: Any,
        rate: float,
        parameters: Mapping[str, Any],
        moment: float | None = None,
    ) -> None:
        """Show a state, or the one before once more.

        Parameters
        ----------
        state
            The controller's state, None before the first.
        rate
            Commands per second [Hz], not a number if unknown.
        parameters
            The controller's parameters by dotted key, as far as they are known.
        moment
            Time [s] of the state, for the plots; that since the start if None.
        """
        now = time.monotonic()
        moment = now - self._begin if moment is None else moment
        drawn = self._drawn
        fits = drawn is not None and state is not None and self._take_tasks(state, drawn.robot)
        with self._page.server.atomic():
            if fits and drawn is not None:
                self._draw(drawn, state)
            if self._is_due('texts', TEXTS, now):
                self.panel.refresh()
                self.panel.follow(state, rate, parameters)
            if fits:
                self.panel.see(moment, state)
                if self._is_due('plots', PLOTS, now) and self._page.watched:
                    self.panel.draw_plots()

    def see(self, state: Any, moment: float) -> None:
        """Keep a state of a time [s] for plots and paths without showing it."""
        drawn = self._drawn
        if drawn is not None and self._take_tasks(state, drawn.robot):
            self._move(drawn, state)
            self.panel.see(moment, state)

    def forget(self) -> None:
        """Forget what plots and paths have kept."""
        self.panel.forget()
        self._cycles = -1
        if self._drawn is not None:
            self._drawn.paths.clear()

    @property
    def memory(self) -> float:
        """Time [s] that plots keep."""
        return KEPT

    def _move(self, drawn: _Drawn, state: Any) -> None:
        """Bring the robot to where a state has it."""
        robot = drawn.robot
        moved = state.cycles != self._cycles
        self._cycles = state.cycles
        positions = np.array(state.position)
        if moved and positions.size == robot.nq and np.all(np.isfinite(positions)):
            order = [list(state.position_names).index(name) for name in robot.coordinates]
            robot.update(positions[order])
            drawn.paths.see(robot, frames_seen(state.tasks, robot.frames))

    def _draw(self, drawn: _Drawn, state: Any) -> None:
        now = time.monotonic()
        panel = self.panel
        self._move(drawn, state)
        if not self._page.watched:
            return
        shapes = bool(panel.shapes.value)
        if shapes and not drawn.arm.has_shapes:
            self._add_shapes(drawn)
        drawn.arm.show(bool(panel.meshes.value), bool(panel.fine.value), shapes)
        drawn.arm.follow()
        drawn.ground.show(bool(panel.shadows.value))
        drawn.surroundings.follow(state.tasks)
        drawn.handles.show(bool(panel.targets.value), bool(panel.obstacles.value))
        drawn.handles.follow(state.tasks)
        drawn.paths.show(bool(panel.paths.value))
        drawn.paths.draw()
        if self._is_due('distances', DISTANCES, now):
            if panel.distances.value:
                drawn.surroundings.measure(state.tasks)
            else:
                drawn.surroundings.hide_distances()

    def _add_shapes(self, drawn: _Drawn) -> None:
        """Add the shapes of links once they are there: hulls of meshes take seconds."""
        if self._bodies is None or self._bodies[0] is not drawn.robot:
            robot = drawn.robot
            self._bodies = robot, self._thread.submit(lambda: robot.bodies)
        found = self._bodies[1]
        if not found.done():
            return
        try:
            drawn.arm.add_shapes(found.result())
        except TaskPriorityError as error:
            drawn.arm.add_shapes({})
            self._page.say(str(error))

    def _take_tasks(self, state: Any, robot: Robot) -> bool:
        """Make the panel fit the tasks of a state; return whether it has any."""
        frames = {task.frame for task in state.tasks} | {task.relative_to for task in state.tasks}
        if set(state.position_names) != set(robot.coordinates) or frames - {'', *robot.frames}:
            # Of another robot, whose model is not there yet.
            return False
        names = tuple(task.name for task in state.tasks)
        if names != self._names:
            self._names = names
            ranges = {task.name: _ranges(robot, task, self._types) for task in state.tasks}
            units = {task.name: unit(task.type, robot) for task in state.tasks}
            self.panel.set_tasks(state.tasks, ranges, units)
        return bool(names)

    def _is_due(self, what: str, period: float, now: float) -> bool:
        if now < self._due.get(what, 0.0):
            return False
        self._due[what] = now + period
        return True

    def _furnish(self, robot: Robot, extent: float, first: bool) -> Ground:
        """Put a grid under the arm, and the camera where all of it is seen, at the first time."""
        flat = is_planar(robot)
        reach = reach_of(robot, extent)
        ground = Ground(self._scene, 4.0 * reach, -0.08 * extent if flat else -0.001, extent)
        if not first:
            return ground
        camera = self._page.server.initial_camera
        camera.fov = FIELD
        if flat:
            away = 0.95 * reach / math.tan(0.5 * FIELD)
            camera.look_at = (0.35 * reach, 0.1 * reach, 0.0)
            # A little from below: exactly from above the camera could not turn.
            camera.position = (0.35 * reach, 0.1 * reach - 0.12 * away, away)
        else:
            away = 0.75 * reach / math.tan(0.5 * FIELD)
            aim = np.array([0.25, 0.25, 0.33]) * reach
            camera.look_at = aim
            camera.position = aim + away * np.array([0.86, 0.22, 0.4])
        return ground


def _ranges(robot: Robot, task: Any, types: Collection[str]) -> dict[str, Range]:
    """Range of each joint of a task whose target is positions of joints; else none."""
    names = list(task.target_components)
    if task.type not in types or task.frame or not names or task.type == 'obstacle':
        return {}
    if not set(names) <= set(robot.joints):
        return {}
    limits = robot.limits
    found = {}
    for name in names:
        i = robot.joints.index(name)
        least, most = float(limits.position_min[i]), float(limits.position_max[i])
        found[name] = (
            least if math.isfinite(least) else -math.pi,
            most if math.isfinite(most) else math.pi,
        )
    return found


def reach_of(robot: Robot, extent: float) -> float:
    """How far [m] the robot gets from its base, roughly."""
    found = [float(np.max(robot.reach(frame))) for frame in robot.frames]
    finite = [value for value in found if math.isfinite(value) and value > 0.0]
    return max([*finite, 0.5 * extent])
