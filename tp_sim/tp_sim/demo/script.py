"""What a demo does: goals one after the other, each with a time."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tp_controller.errors import InvalidValue, listed, shown
from tp_controller.parameters import NUMBER, REQUIRED, TEXTS, Parameter, flatten, read_all
from tp_controller.stack import Stack
from tp_sim.demo.timing import Timing
from tp_sim.harness import ClosedLoop, read_document

DEMO: Mapping[str, Parameter] = {
    'goals': Parameter(
        TEXTS,
        'Goals one after the other, each "<task> <values>" or "<task> circle <radius [m]> '
        '<period [s]>"; "; " joins goals sent together',
        default=REQUIRED,
    ),
    'seconds_per_goal': Parameter(NUMBER, 'Time [s] for each', default=8.0, above=0.0),
    'tolerance': Parameter(
        NUMBER,
        'Largest error norm [m, rad] of a goal that counts as reached',
        default=0.01,
        above=0.0,
    ),
}
"""Parameters of the demo, block ``tp_demo`` of a parameter file."""


RESTING = 0.1
"""A task that moves by less than this share of the tolerance in a second is at rest."""

Array = NDArray[np.float64]


class Circle(NamedTuple):
    """A target that goes round in the plane of a position task's first two axes.

    It begins where the task is, at the circle's point of largest first coordinate.
    """

    radius: float
    """[m]."""
    period: float
    """[s]."""

    def at(self, start: Sequence[float] | Array, time: float) -> tuple[list[float], list[float]]:
        """Target and its velocity, one value per axis [m, m/s], ``time`` [s] after the start."""
        angle = math.tau * time / self.period
        x, y = self.radius * math.cos(angle), self.radius * math.sin(angle)
        speed = math.tau / self.period
        rest = [float(value) for value in start[2:]]
        target = [float(start[0]) - self.radius + x, float(start[1]) + y, *rest]
        return target, [-speed * y, speed * x, *(0.0 for _ in rest)]


Goal = tuple[str, list[float] | Circle]
"""Task name, and the values or the path of its target."""


class Script(NamedTuple):
    """Goals of a demo."""

    goals: list[list[Goal]]
    """Goals that are sent together, one group after the other."""
    seconds_per_goal: float
    """Time [s] for each group."""
    tolerance: float
    """Largest error norm [m, rad] of a goal that counts as reached."""

    def check(self, stack: Stack) -> None:
        """Check that the goals are for tasks of a stack.

        Raises
        ------
        InvalidValue
            For a task that there is not, or values that it does not take.
        """
        for name, values in (goal for goals in self.goals for goal in goals):
            if name not in stack.tasks:
                raise InvalidValue(
                    'tp_demo.goals', f'the task {shown(name)}', f'one of {listed(stack.tasks)}'
                )
            if isinstance(values, Circle):
                if stack.tasks[name].type != 'position' or stack.tasks[name].k < 2:
                    raise InvalidValue(
                        'tp_demo.goals', f'a circle for {name}', 'a position task of two axes'
                    )
                continue
            try:
                stack.tasks[name].check_target(values)
            except InvalidValue as error:
                raise error.under(f'tp_demo.goals: {name}') from None


def read_script(path: Path) -> Script:
    """Read the block ``tp_demo`` of a parameter file.

    Raises
    ------
    InvalidValue
        If there is none or it cannot be used.
    """
    block: Mapping[str, Any] = read_document(path).get('tp_demo', {})
    try:
        values = read_all(flatten(block), DEMO)
    except InvalidValue as error:
        raise error.under('tp_demo') from None
    return Script(
        [[_goal(part) for part in text.split(';')] for text in values['goals']],
        values['seconds_per_goal'],
        values['tolerance'],
    )


def _goal(text: str) -> Goal:
    name, *words = text.split() or ['']
    round_ = words[:1] == ['circle']
    try:
        values = [float(word) for word in words[round_:]]
        if not round_:
            return name, values
        radius, period = values
        if radius > 0.0 and period > 0.0:
            return name, Circle(radius, period)
    except ValueError:
        pass
    accepts = 'a task name followed by numbers, or by circle, a radius and a period above 0'
    raise InvalidValue('tp_demo.goals', shown(text), accepts)


def goal_text(goals: list[Goal]) -> str:
    """Goals in words, as in a parameter file."""
    return '; '.join(
        f'{name} {"circle " if isinstance(values, Circle) else ""}'
        + ' '.join(f'{value:g}' for value in values)
        for name, values in goals
    )


class Leg:
    """One group of goals under way.

    Attributes
    ----------
    text
        The goals in words.
    tasks
        Names of the tasks that got a goal.
    start, end
        Times [s] in the loop's record.
    desired
        Desired value of every task that got a goal.
    errors
        Error norm at the end of every task that got a goal or is in the hierarchy.
    losses
        For every level with such a task, where what it asked for went at the end.
    limits
        Limits that the last command met.
    timing
        Rate and ages during the leg.
    """

    def __init__(self, loop: ClosedLoop, goals: list[Goal]) -> None:
        self._circles = {
            name: (circle, list(loop.client.task(name).current))
            for name, circle in goals
            if isinstance(circle, Circle)
        }
        for name, values in goals:
            if not isinstance(values, Circle):
                loop.send_goal(name, values)
        self.tasks = [name for name, _ in goals]
        self.text = goal_text(goals)
        self.start = self.end = loop.time
        self.desired: dict[str, list[float]] = {}
        self.errors: dict[str, float] = {}
        self.losses: dict[str, str] = {}
        self.limits: list[str] = []
        self.timing: Timing | None = None
        self._pace = 0.0

    def run(self, loop: ClosedLoop, seconds: float) -> None:
        """Let the loop run for a time [s], with targets on their circles where they move."""
        while self._circles and (time := loop.time - self.start) < seconds - 1e-9:
            for name, (circle, start) in self._circles.items():
                target, velocity = circle.at(start, time)
                loop.send_goal(name, target)
                loop.send_feedforward(name, velocity)
            loop.run_a_little()
        if not self._circles:
            loop.run(seconds)
        self._finish(loop)

    def _finish(self, loop: ClosedLoop) -> None:
        """Take the targets and the errors at the end."""
        self.end = loop.time
        self.desired = {
            task.name: list(task.desired) for task in loop.state.tasks if task.name in self.tasks
        }
        self.errors = {
            task.name: task.error_norm
            for task in loop.state.tasks
            if (task.enabled and not task.distance) or task.name in self.tasks
        }
        aimed = [task for task in loop.state.tasks if task.name in self.tasks]
        self._pace = max((float(np.linalg.norm(t.achieved_velocity)) for t in aimed), default=0.0)
        self.losses = {
            ' + '.join(level.tasks): level.text
            for level in loop.state.levels
            if level.text and set(level.tasks) & set(self.tasks)
        }
        self.limits = list(loop.state.active_limits)

    def reason(self, tolerance: float) -> str:
        """Why a goal was not reached, as the controller's state tells it; empty if all were."""
        if self.reached(tolerance):
            return ''
        found = [f'{name} lost {text}' for name, text in self.losses.items()]
        if self.limits:
            found.append(f'at its limits: {listed(self.limits)}')
        if self._pace > tolerance * RESTING:
            found.append(f'still moving, {self._pace:.2g} m/s or rad/s: seconds_per_goal')
        if self.timing is not None and self.timing.late:
            found.append(f'late commands, {self.timing.text}')
        return '; '.join(found) or 'no level lost anything: at rest where its error is balanced'

    def reached(self, tolerance: float) -> bool:
        """Whether the error of every goal is within a tolerance [m, rad]."""
        return all(self.errors[name] <= tolerance for name in self.tasks)
