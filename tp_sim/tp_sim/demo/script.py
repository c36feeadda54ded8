"""What a demo does: goals one after the other, each with a time."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

from tp_controller.errors import InvalidValue, listed, shown
from tp_controller.parameters import NUMBER, REQUIRED, TEXTS, Parameter, flatten, read_all
from tp_controller.stack import Stack
from tp_sim.harness import ClosedLoop, read_document

DEMO: Mapping[str, Parameter] = {
    'goals': Parameter(
        TEXTS,
        'Goals one after the other, each "<task> <values>"; "; " joins goals sent together',
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

Goal = tuple[str, list[float]]
"""Task name and values."""


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
    name, *values = text.split() or ['']
    try:
        return name, [float(value) for value in values]
    except ValueError:
        raise InvalidValue(
            'tp_demo.goals', shown(text), 'a task name followed by numbers'
        ) from None


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
    """

    def __init__(self, loop: ClosedLoop, goals: list[Goal]) -> None:
        for name, values in goals:
            loop.send_goal(name, values)
        self.tasks = [name for name, _ in goals]
        self.text = '; '.join(
            f'{name} {" ".join(f"{value:g}" for value in values)}' for name, values in goals
        )
        self.start = self.end = loop.time
        self.desired = {
            task.name: list(task.desired) for task in loop.state.tasks if task.name in self.tasks
        }
        self.errors: dict[str, float] = {}

    def finish(self, loop: ClosedLoop) -> None:
        """Take the errors at the end."""
        self.end = loop.time
        self.errors = {
            task.name: task.error_norm
            for task in loop.state.tasks
            if task.enabled or task.name in self.tasks
        }

    def reached(self, tolerance: float) -> bool:
        """Whether the error of every goal is within a tolerance [m, rad]."""
        return all(self.errors[name] <= tolerance for name in self.tasks)
