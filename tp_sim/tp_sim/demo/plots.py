"""Pictures of a run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Patch, Rectangle
from numpy.typing import NDArray

from tp_controller.robot import Robot
from tp_controller.stack import Stack
from tp_controller.tasks import ObstacleTask, WholeArmTask
from tp_interfaces.msg import TaskState
from tp_sim.demo.script import Leg
from tp_sim.harness import Record

Array = NDArray[np.float64]

UNITS = {
    'position': 'm',
    'orientation': 'rad',
    'gaze': 'rad',
    'obstacle': 'm',
    'self_collision': 'm',
}
"""Units of the tasks that do not mix metres and radians."""
COLORS: Sequence[Any] = mpl.color_sequences['tab10']


STILLS = 12
"""Faint arms drawn between the first and the last."""


def draw_errors(
    record: Record, tasks: Sequence[TaskState], legs: Sequence[Leg], path: Path
) -> None:
    """Draw the error norm of every task in the hierarchy over time as a PNG."""
    tasks = sorted((task for task in tasks if task.enabled), key=lambda task: task.level)
    figure = Figure(figsize=(8.0, 1.2 + 2.1 * len(tasks)), layout='constrained')
    panels = figure.subplots(len(tasks), 1, sharex=True, squeeze=False)[:, 0]
    for i, (task, axes) in enumerate(zip(tasks, panels, strict=True)):
        top = _draw_course(axes, record, task, COLORS[i % len(COLORS)])
        for number, leg in enumerate(legs, start=1):
            axes.axvline(leg.start, color='0.6', linestyle='--', linewidth=1.0)
            axes.annotate(
                f'goal {number}',
                (leg.start, 0.96),
                xycoords=('data', 'axes fraction'),
                xytext=(4, 0),
                textcoords='offset points',
                va='top',
                color='0.4',
                fontsize=9,
            )
        axes.set_title(f'level {task.level}: {task.name}', loc='left', fontsize=10)
        axes.set_ylim(bottom=0.0, top=max(1.1 * top, 1e-3))
        axes.grid(alpha=0.3)
    panels[-1].set_xlabel('time [s]')
    panels[-1].set_xlim(record.time[0], record.time[-1])
    some = any(task.distance for task in tasks)
    figure.suptitle('Tasks over time' + ('; set-based ones act where it is grey' if some else ''))
    figure.savefig(path, dpi=130)


def _draw_course(axes: Axes, record: Record, task: TaskState, color: Any) -> float:
    """Draw the error norm of a task, or the least distance of a set-based one; return the top."""
    if not task.distance:
        axes.plot(record.time, record.error_norm[task.name], color=color)
        axes.set_ylabel(f'error norm [{UNITS.get(task.type, "m, rad")}]')
        return float(record.error_norm[task.name].max())
    course = record.distance[task.name].min(axis=1)
    axes.plot(record.time, course, color=color)
    acts = record.active[task.name]
    axes.fill_between(
        record.time, 0.0, 1.0, where=acts, transform=axes.get_xaxis_transform(), color='0.85'
    )
    axes.set_ylabel(f'distance [{UNITS.get(task.type, "m, rad")}]')
    # Distances that do not count are infinite.
    return float(course[np.isfinite(course)].max(initial=0.0))


def draw_arm(
    stack: Stack, record: Record, tasks: Sequence[TaskState], legs: Sequence[Leg], path: Path
) -> None:
    """Draw the arm with the paths of its controlled frames and their targets as a PNG.

    An arm that stays in the plane z = constant is seen from above; any other one from
    above and from the side.
    """
    robot = stack.robot
    kinds = ObstacleTask | WholeArmTask
    obstacles = [task for task in stack.tasks.values() if isinstance(task, kinds)]
    arms = _arms(robot, record.q)
    planar = np.nanmax(arms[..., 2]) - np.nanmin(arms[..., 2]) < 1e-6
    frames = dict.fromkeys(task.frame for task in tasks if task.enabled and task.frame)
    paths = {frame: _path(robot, frame, record.q) for frame in frames}
    views = ('xy',) if planar else ('xy', 'xz')
    figure = Figure(figsize=(3.0 + 5.6 * len(views), 6.0), layout='constrained')
    panels = figure.subplots(1, len(views), squeeze=False)[0]
    ends = [int(np.searchsorted(record.time, leg.end)) for leg in legs]
    ends = [min(end, len(arms) - 1) for end in ends]
    for view, axes in zip(views, panels, strict=True):
        _draw_arms(axes, view, arms, ends)
        _draw_paths(axes, view, paths)
        _draw_obstacles(axes, view, obstacles)
        _draw_targets(axes, view, tasks, legs)
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc='outside right upper', fontsize=9)
    panels[0].set_title('Arm, paths of the controlled frames, and targets')
    figure.savefig(path, dpi=130)


def _arms(robot: Robot, configurations: Array) -> Array:
    """Lines (N, 3 s, 3) [m] of the arm at configurations (N, n), a NaN after every segment."""
    arms = []
    for q in configurations:
        robot.update(q)
        segments = robot.segments()
        gaps = np.full((len(segments), 1, 3), np.nan)
        arms.append(np.concatenate([segments, gaps], axis=1).reshape(-1, 3))
    return np.array(arms)


def _path(robot: Robot, frame: str, configurations: Array) -> Array:
    """Positions (N, 3) [m] of a frame at configurations (N, n)."""
    points = []
    for q in configurations:
        robot.update(q)
        points.append(robot.frame(frame).position.copy())
    return np.array(points)


def _draw_arms(axes: Axes, view: str, arms: Array, ends: Sequence[int]) -> None:
    i, j = ('xyz'.index(letter) for letter in view)
    for still in np.linspace(0, ends[-1], STILLS, dtype=int):
        axes.plot(arms[still, :, i], arms[still, :, j], color='0.85', linewidth=1.5, zorder=1)
    axes.plot(
        arms[0, :, i], arms[0, :, j], 'o--', color='0.55', markersize=4, label='start', zorder=2
    )
    for number, end in enumerate(ends):
        axes.plot(
            arms[end, :, i],
            arms[end, :, j],
            'o-',
            color=COLORS[number % len(COLORS)],
            linewidth=3.0,
            label=f'arm at goal {number + 1}',
            zorder=4,
        )
    axes.set_xlabel(f'{view[0]} [m]')
    axes.set_ylabel(f'{view[1]} [m]')
    axes.set_aspect('equal', adjustable='datalim')
    axes.margins(0.1)
    axes.grid(alpha=0.3)


def _draw_paths(axes: Axes, view: str, paths: Mapping[str, Array]) -> None:
    i, j = ('xyz'.index(letter) for letter in view)
    for number, (frame, points) in enumerate(paths.items()):
        axes.plot(
            points[:, i],
            points[:, j],
            linestyle=('-', ':', '--', '-.')[number % 4],
            color='black',
            linewidth=1.2,
            label=f'path of {frame}',
            zorder=3,
        )


def _draw_obstacles(
    axes: Axes, view: str, obstacles: Sequence[ObstacleTask | WholeArmTask]
) -> None:
    """Draw circles, and the rectangles that boxes and cylinders lie in; half-spaces are left."""
    for task in obstacles:
        center = dict(zip(task.target_components, task.center, strict=True))
        if not set(view) <= center.keys():
            continue
        middle = (center[view[0]], center[view[1]])
        patch: Patch
        if isinstance(task, ObstacleTask):
            patch = Circle(middle, task.radius)
        elif task.obstacle.kind == 'sphere':
            patch = Circle(middle, task.obstacle.size[0])
        elif task.obstacle.kind == 'half_space':
            continue
        else:
            points, radius = task.obstacle.hull()
            sides = points[:, ['xyz'.index(axis) for axis in view]]
            low, high = sides.min(axis=0) - radius, sides.max(axis=0) + radius
            patch = Rectangle((low[0], low[1]), *(high - low))
        patch.set(color='tab:red', alpha=0.3, zorder=0)
        axes.add_patch(patch)
        axes.annotate(task.name, middle, ha='center', va='center', fontsize=9, color='0.3')


def _draw_targets(axes: Axes, view: str, tasks: Sequence[TaskState], legs: Sequence[Leg]) -> None:
    for number, leg in enumerate(legs):
        for task in tasks:
            if task.name not in leg.desired or not set(view) <= set(task.target_components):
                continue
            if task.relative_to:
                continue
            desired = dict(zip(task.target_components, leg.desired[task.name], strict=True))
            axes.plot(
                desired[view[0]],
                desired[view[1]],
                'x',
                color=COLORS[number % len(COLORS)],
                markersize=13,
                markeredgewidth=3,
                label=f'target {number + 1} of {task.name}',
                zorder=5,
            )
