"""Curves over time: errors, joints, distances, levels, and how quick the controller was."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from tp_controller.plots.style import (
    LIMIT,
    RED,
    color,
    dash,
    end_time,
    panels,
    shade,
    styled,
)
from tp_controller.recording import Run, TaskCourse
from tp_controller.robot import Robot
from tp_controller.units import unit

Array = NDArray[np.float64]
METRES = tuple(f'base/{name}' for name in ('forward', 'left', 'up'))
"""Velocities of a base that are along a line."""
MOST_ROWS = 12
"""Rows of a task that get a line each; of more the least distance alone."""


def errors(run: Run, robot: Robot) -> Figure:
    """Error norms of the tasks of each level, grey while a set-based task of it acts."""
    with styled():
        levels = _by_level(run.tasks)
        figure, axes = panels(len(levels))
        for panel, (level, tasks) in zip(axes[:, 0], levels.items(), strict=True):
            _draw_level(panel, run, tasks, robot)
            place = 'idle' if level < 0 else f'level {level}'
            panel.set_title(f'{place}: {" + ".join(task.name for task in tasks)}', loc='left')
            _mark_goals(panel, run, tasks)
        end_time(figure, run.time)
        some = any(task.distance.size for task in run.tasks)
        dotted = '; dotted: a new goal' if goal_times(run) else ''
        grey = '; grey: a set-based task acts' if some else ''
        figure.suptitle(f'Tasks by level{dotted}{grey}')
        return figure


def joints(run: Run, robot: Robot) -> Figure:
    """Positions in their ranges, and speeds and accelerations of the commands at their limits."""
    with styled():
        limits = robot.limits
        names = list(run.joints)
        figure, axes = panels(len(names), 1.25, 10.0, 3)
        acceleration = accelerations(run)
        for i, name in enumerate(names):
            place, speed, change = axes[i]
            if name in run.coordinates:
                j = run.coordinates.index(name)
                place.plot(run.time, run.q[:, j], color=color(0))
                _limits(place, limits.position_min[i], limits.position_max[i])
            else:
                # A velocity in the frame of a base is that of no coordinate.
                place.set_yticks([])
            speed.plot(run.time, run.command[:, i], color=color(2))
            _limits(speed, -limits.velocity[i], limits.velocity[i])
            change.plot(run.time, acceleration[:, i], color=color(1))
            _limits(change, -limits.acceleration[i], limits.acceleration[i])
            metres = bool(robot.sliding[i]) or name in METRES
            unit_of = 'm' if metres else 'rad'
            place.set_ylabel(f'{name}\n[{unit_of}]')
            speed.set_ylabel(f'[{unit_of}/s]')
            change.set_ylabel(f'[{unit_of}/s²]')
        for panel, title in zip(axes[0], ('position', 'speed', 'acceleration'), strict=True):
            panel.set_title(title)
        end_time(figure, run.time)
        figure.suptitle('Joints: measured positions, commanded speeds; dashed: limits')
        return figure


def accelerations(run: Run) -> Array:
    """Changes of the command per time (N, n) [rad/s², m/s²], not a number for the first."""
    found = np.full_like(run.command, math.nan)
    passed = np.diff(run.time)[:, None]
    found[1:] = np.diff(run.command, axis=0) / passed
    return found


def distances(run: Run, robot: Robot) -> Figure | None:
    """Distances of set-based tasks from their boundaries, red beyond; None without such tasks."""
    tasks = [task for task in run.tasks if task.distance.size and task.place >= 0]
    if not tasks:
        return None
    with styled():
        figure, axes = panels(len(tasks))
        for panel, task in zip(axes[:, 0], tasks, strict=True):
            least = least_distance(task)
            shade(panel, run.time, task.active)
            if 1 < task.distance.shape[1] <= MOST_ROWS:
                far = np.where(np.isfinite(task.distance), task.distance, math.nan)
                panel.plot(run.time, far, color='0.6', linewidth=0.7)
            panel.plot(run.time, least, color=color(0))
            panel.axhline(0.0, color=LIMIT, linewidth=0.8)
            below = least < 0.0
            panel.plot(run.time, np.where(below, least, math.nan), color=RED, linewidth=2.2)
            panel.fill_between(run.time, least, 0.0, where=below, color=RED, alpha=0.3)
            units = unit(task.type, robot)
            panel.set_ylabel(f'distance [{units}]')
            low = float(np.nanmin(least)) if np.any(np.isfinite(least)) else math.nan
            panel.set_title(f'{task.name}: least {low:.3g} {units}', loc='left')
        end_time(figure, run.time)
        figure.suptitle('Distances; thick: least of all rows; grey: acts; red: negative')
        return figure


def least_distance(task: TaskCourse) -> Array:
    """Least distance (N,) [m, rad] of a set-based task; not a number where none counts."""
    finite = np.where(np.isfinite(task.distance), task.distance, math.inf)
    least = finite.min(axis=1, initial=math.inf)
    return np.where(np.isfinite(least), least, math.nan)


def levels(run: Run) -> Figure | None:
    """Rank and smallest singular value of each level; None if levels were not explained."""
    if not run.levels or not run.level_time.size:
        return None
    with styled():
        figure, axes = panels(2, 2.3)
        rank, value = axes[:, 0]
        for i, level in enumerate(run.levels):
            look = {'color': color(i), 'linestyle': dash(i)}
            name = f'{i}: {" + ".join(level.tasks)}'
            rank.step(run.level_time, level.rank, where='post', label=name, **look)
            finite = np.where(
                np.isfinite(level.smallest_singular_value), level.smallest_singular_value, math.nan
            )
            value.plot(run.level_time, finite, **look)
        rank.set_ylabel('rank [-]')
        rank.set_ylim(bottom=-0.1)
        rank.yaxis.get_major_locator().set_params(integer=True)
        value.set_yscale('log')
        value.set_ylabel('smallest singular\nvalue [m/rad, -]')
        figure.legend(loc='outside lower center', ncols=2)
        end_time(figure, run.time)
        figure.suptitle('Freedom that higher levels leave to each level')
        return figure


def timing(run: Run) -> Figure:
    """Scale of the commands, their age when they were sent, and the time of the computation."""
    with styled():
        figure, axes = panels(3, 1.5)
        scale, age, solving = axes[:, 0]
        shade(scale, run.time, run.braking)
        scale.plot(run.time, run.scale, color=color(0))
        scale.set_ylabel('scale [-]')
        scale.set_ylim(-0.02, 1.05)
        age.plot(run.time, 1e3 * run.age, color=color(1))
        age.set_ylabel('command age\n[ms]')
        age.set_ylim(bottom=0.0)
        solving.plot(run.time, 1e3 * run.solve_time, color=color(2))
        solving.set_ylabel('computation\n[ms]')
        solving.set_ylim(bottom=0.0)
        end_time(figure, run.time)
        figure.suptitle('What the velocity limits left, and how quick the controller was')
        return figure


def goal_times(run: Run, tasks: Sequence[TaskCourse] | None = None) -> list[int]:
    """Cycles at which the target of a task that takes part has jumped."""
    found = np.zeros(len(run.time), dtype=bool)
    for task in run.tasks if tasks is None else tasks:
        if task.distance.size or not task.desired.shape[1]:
            continue
        change = np.any(np.diff(task.desired, axis=0) != 0.0, axis=1)
        known = np.all(np.isfinite(task.desired), axis=1)
        # A target that moves all the time does not jump.
        jump = change & known[1:] & known[:-1]
        jump[1:] &= ~change[:-1]
        jump[:-1] &= ~change[1:]
        found[1:] |= jump & task.enabled[1:]
    return [int(i) for i in np.flatnonzero(found)]


def _by_level(tasks: Sequence[TaskCourse]) -> dict[int, list[TaskCourse]]:
    """Tasks by their last level; idle ones only if there are no others."""
    found: dict[int, list[TaskCourse]] = {}
    for task in tasks:
        if task.place >= 0 or all(other.place < 0 for other in tasks):
            found.setdefault(task.place, []).append(task)
    return dict(sorted(found.items()))


def _draw_level(axes: Axes, run: Run, tasks: Sequence[TaskCourse], robot: Robot) -> None:
    top = 0.0
    for i, task in enumerate(tasks):
        if task.distance.size:
            shade(axes, run.time, task.active & task.enabled)
            course = least_distance(task)
            what = 'distance'
        else:
            course = np.where(task.enabled, task.error_norm, math.nan)
            what = 'error norm'
        axes.plot(run.time, course, color=color(i), linestyle=dash(i), label=task.name)
        top = max(top, float(np.nanmax(course, initial=0.0)))
    units = dict.fromkeys(unit(task.type, robot) for task in tasks)
    axes.set_ylabel(f'{what} [{", ".join(units)}]')
    if all(not task.distance.size for task in tasks):
        axes.set_ylim(0.0, max(1.1 * top, 1e-3))
    else:
        axes.axhline(0.0, color=LIMIT, linewidth=0.8)
    if len(tasks) > 1:
        axes.legend(loc='lower right', bbox_to_anchor=(1.0, 1.0), ncols=4, borderaxespad=0.2)


def _mark_goals(axes: Axes, run: Run, tasks: Sequence[TaskCourse]) -> None:
    for i in goal_times(run, tasks):
        axes.axvline(run.time[i], color='0.5', linestyle=':', linewidth=1.0)


def _limits(axes: Axes, low: float, high: float) -> None:
    for value in (low, high):
        if math.isfinite(value):
            axes.axhline(value, color=LIMIT, linestyle='--', linewidth=1.0)
