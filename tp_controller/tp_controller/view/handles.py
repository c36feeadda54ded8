"""Targets in the scene, which one drags."""

from __future__ import annotations

import time
from collections.abc import Callable, Collection, Iterable
from typing import Any

import numpy as np
import pinocchio as pin
import viser

from tp_controller.robot import Robot
from tp_controller.view.palette import TARGET
from tp_controller.view.solids import add_axes, put
from tp_controller.view.targets import Freedom, freedom, handle_place, has_values, target_values
from tp_controller.view.wishes import Goal

PAUSE = 0.5
"""Time [s] after a drag in which a target stays where it was put: its goal is on the way."""
SIZE = 0.2
"""Length of a handle's arrows as a share of the arm's extent."""


class Handles:
    """Draws the targets of tasks; with `ask` one can drag them.

    Parameters
    ----------
    scene
        Where they are drawn.
    robot
        The robot.
    extent
        Size of the arm [m].
    types
        Types of tasks that take goals.
    ask
        Called with the goals of drags, by another thread; None if nothing can be dragged.
    """

    def __init__(
        self,
        scene: viser.SceneApi,
        robot: Robot,
        extent: float,
        types: Collection[str],
        ask: Callable[[Goal], None] | None,
    ) -> None:
        self._scene, self._robot, self._types, self._ask = scene, robot, types, ask
        self._size = SIZE * extent
        self._nodes: dict[str, viser.SceneNodeHandle] = {}
        self._tasks: dict[str, Any] = {}
        self._busy: dict[str, float] = {}
        self._shown, self._obstacles = True, False

    def show(self, targets: bool, obstacles: bool) -> None:
        """Choose whether targets are shown, and handles at obstacles, which move these."""
        self._shown, self._obstacles = targets, obstacles

    def follow(self, states: Iterable[Any]) -> None:
        """Move every target to where the controller has it, unless somebody drags it."""
        now = time.monotonic()
        self._tasks = {task.name: task for task in states}
        for name, task in self._tasks.items():
            free = freedom(task, self._types)
            if free is None:
                continue
            wanted = self._obstacles and self._ask is not None
            wanted = wanted if task.type == 'obstacle' else self._shown
            visible = bool(task.enabled) and wanted and has_values(task)
            node = self._nodes.get(name)
            if node is None:
                if not visible:
                    continue
                node = self._nodes[name] = self._add(name, free)
            node.visible = visible
            if visible and now >= self._busy.get(name, 0.0):
                put(node, handle_place(self._robot, task))

    def _add(self, name: str, free: Freedom) -> viser.SceneNodeHandle:
        node: viser.SceneNodeHandle
        path = f'/targets/{name}'
        if self._ask is None:
            node = self._scene.add_frame(path, show_axes=False)
        else:
            node = self._scene.add_transform_controls(
                path, self._size, line_width=3.0, depth_test=False, opacity=0.85, **_limbs(free)
            )
            node.on_update(self._listener(name))
        if any(free.axes):
            self._scene.add_icosphere(f'{path}/ball', 0.22 * self._size, TARGET, opacity=0.9)
        if any(free.turns):
            add_axes(self._scene, f'{path}/axes', 0.6 * self._size)
        return node

    def _listener(self, name: str) -> Callable[[viser.TransformControlsEvent], Any]:
        # On the event loop of the server: in the order in which the browser sends.
        async def moved(event: viser.TransformControlsEvent) -> None:
            self._busy[name] = time.monotonic() + (PAUSE if event.phase == 'end' else 10 * PAUSE)
            task = self._tasks.get(name)
            if task is not None and event.phase != 'start' and self._ask is not None:
                w, x, y, z = event.target.wxyz
                turn = pin.Quaternion(np.array([x, y, z, w])).normalized().toRotationMatrix()
                place = pin.SE3(turn, np.array(event.target.position))
                self._ask(Goal(name, tuple(target_values(self._robot, task, place))))

        return moved


def _limbs(free: Freedom) -> dict[str, Any]:
    """Which arrows and rings a handle has; a ring about an axis needs the other two axes."""
    axes: tuple[bool, ...] = free.axes
    if not any(axes):
        axes = tuple(any(free.turns[j] for j in range(3) if j != i) for i in range(3))
    return {
        'active_axes': axes,
        'disable_axes': not any(free.axes),
        'disable_sliders': sum(free.axes) < 2,
        'disable_rotations': not any(free.turns),
    }
