"""A stack in closed loop with an ideal arm: every cycle is kept as a run that can be drawn."""

import math
from pathlib import Path
from typing import NamedTuple

import numpy as np

from tp_controller import build_settings, read_parameter_file
from tp_controller.recording import Run, TaskCourse
from tp_controller.stack import Stack
from tp_controller.tasks import SetBasedTask

CONFIG = Path(__file__).resolve().parents[2] / 'config'


class Made(NamedTuple):
    """A run and the stack that it was made with."""

    run: Run
    stack: Stack

    def error(self, task):
        """Error norm of a task (N,) [m, rad]."""
        return self.run.task(task).error_norm


class Goal(NamedTuple):
    """A new target."""

    time: float
    """When it comes [s]."""
    task: str
    target: list[float]


class Circle(NamedTuple):
    """A target that goes round from where its task is, with its velocity as feedforward."""

    task: str
    radius: float
    """[m]."""
    period: float
    """[s]."""


def simulate(name, seconds, *goals, settle=True, start=None, **changes):
    """Run a parameter file for a time [s].

    Parameters
    ----------
    name
        The file in ``config``.
    seconds
        Time [s] of the last cycle.
    goals
        A `Goal` or `Circle` each.
    settle
        False gives the published laws alone.
    start
        First configuration; that of the file's simulator if None.
    changes
        Parameters by key with ``__`` for the dots.
    """
    path = CONFIG / f'{name}.yaml'
    parameters = read_parameter_file(path, 'tp_controller')
    parameters |= {key.replace('__', '.'): value for key, value in changes.items()}
    stack = build_settings(parameters).stack
    stack.settle = settle
    simulated = read_parameter_file(path, 'tp_sim')
    q = np.array(simulated['initial_positions'] if start is None else start)
    rate = parameters['rate']
    circles = []
    for goal in goals:
        if isinstance(goal, Circle):
            stack.step(q)
            circles.append((goal, np.array(stack.tasks[goal.task].current)))
    keeper = _Keeper(stack)
    for i in range(round(seconds * rate) + 1):
        time = i / rate
        for goal in goals:
            if isinstance(goal, Goal) and i == round(goal.time * rate):
                stack.tasks[goal.task].target = goal.target
        for circle, begin in circles:
            _go_round(stack.tasks[circle.task], circle, begin, time)
        q = q + keeper.step(q, time) / rate
    return Made(keeper.run(), stack)


def _go_round(task, circle, begin, time):
    angle = math.tau * time / circle.period
    arm = circle.radius * np.array([math.cos(angle), math.sin(angle)])
    task.target = begin - [circle.radius, 0.0] + arm
    task.feedforward = np.array([-arm[1], arm[0]]) * math.tau / circle.period


class _Keeper:
    """Steps a stack and keeps what it does."""

    def __init__(self, stack):
        self._stack = stack
        self._rows = {'time': [], 'q': [], 'command': [], 'scale': []}
        self._tasks = {name: {key: [] for key in KEPT} for name in stack.tasks}

    def step(self, q, time):
        """Velocities (n,) that answer a configuration."""
        stack = self._stack
        step = stack.step(q)
        for key, value in zip(self._rows, (time, q, step.command, step.scale), strict=True):
            self._rows[key].append(np.copy(value))
        for name, kept in self._tasks.items():
            task = stack.tasks[name]
            enabled = stack.level_of(name) >= 0
            requested, achieved = (
                stack.velocities_of(name) if enabled else (np.zeros(task.k), np.zeros(task.k))
            )
            target = task.target
            values = (
                stack.place_of(name),
                enabled,
                enabled and task.active,
                np.zeros(0) if target is None else target,
                task.current,
                task.error,
                float(np.linalg.norm(task.error)),
                task.distance if isinstance(task, SetBasedTask) else np.zeros(0),
                requested,
                achieved,
            )
            for key, value in zip(KEPT, values, strict=True):
                kept[key].append(np.copy(value))
        return step.command

    def run(self):
        """Everything so far."""
        stack, robot = self._stack, self._stack.robot
        rows = {key: np.array(values) for key, values in self._rows.items()}
        courses = [
            TaskCourse(
                name=name,
                type=task.type,
                frame=task.frame_name,
                relative_to=task.relative_to,
                components=tuple(task.components),
                target_components=tuple(task.target_components),
                **{key: np.array(values) for key, values in self._tasks[name].items()},
            )
            for name, task in stack.tasks.items()
        ]
        courses.sort(key=lambda course: course.place if course.place >= 0 else len(courses))
        none = np.zeros(len(rows['time']))
        return Run(
            start=0,
            joints=tuple(robot.joints),
            coordinates=tuple(robot.coordinates),
            braking=none > 0.0,
            age=none,
            solve_time=none,
            tasks=tuple(courses),
            level_time=np.zeros(0),
            levels=(),
            **rows,
        )


KEPT = (
    'level', 'enabled', 'active', 'desired', 'current', 'error', 'error_norm', 'distance',
    'requested', 'achieved',
)  # fmt: skip
"""Fields of `TaskCourse` that change from cycle to cycle."""
