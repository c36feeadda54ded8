"""Plots that scroll: errors of tasks, and distances of set-based ones."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import viser
from viser import uplot

from tp_controller.view.history import History
from tp_controller.view.palette import css

LEAST = 1e-6
"""Values below this one are drawn there on a logarithmic scale."""
HEIGHT = 190
ROOM = {
    'min': {'pad': 0.1, 'soft': 0.0, 'mode': 1},
    'max': {'pad': 0.1, 'soft': 0.01, 'mode': 1},
}
"""The scale of values: from zero, and not finer than a hundredth."""


class Plot:
    """One plot of a value of some tasks over the last minute.

    Parameters
    ----------
    gui
        Where it is, in the present container.
    title
        What it shows, with the unit.
    numbers
        Number of each task by name, which decides on its color.
    value
        The value of a task's state.
    logarithmic
        Whether its scale is.
    """

    def __init__(
        self,
        gui: viser.GuiApi,
        title: str,
        numbers: dict[str, int],
        value: Callable[[Any], float],
        logarithmic: bool,
    ) -> None:
        self._names, self._value = list(numbers), value
        self._logarithmic = logarithmic
        self.history = History(len(numbers))
        scale: Any = {'distr': 3, 'log': 10} if logarithmic else {'range': ROOM}
        self._handle = gui.add_uplot(
            self._data(),
            (
                uplot.Series(label='s'),
                *(
                    uplot.Series(label=name, stroke=css(number), width=1.5, spanGaps=False)
                    for name, number in numbers.items()
                ),
            ),
            title=title,
            scales={
                'x': uplot.Scale(time=False, range=(-self.history.seconds, 0.0)),
                'y': scale,
            },
            axes=(uplot.Axis(), uplot.Axis(size=52)),
            height=HEIGHT,
            padding=(10, 24, 0, 0),
        )

    def see(self, time: float, tasks: dict[str, Any]) -> None:
        """Keep the values at a time [s]."""
        found = [self._value(tasks[name]) if name in tasks else math.nan for name in self._names]
        self.history.add(time, np.array(found))

    def forget(self) -> None:
        """Forget all values so far."""
        self.history.clear()

    def draw(self) -> None:
        """Bring what is drawn up to date."""
        self._handle.data = self._data()

    def _data(self) -> tuple[np.ndarray, ...]:
        times, values = self.history.recent()
        if len(times) < 2:
            times, values = np.array([-1.0, 0.0]), np.full((len(self._names), 2), LEAST)
        if self._logarithmic:
            values = np.maximum(values, LEAST)
        return (times, *values)


def error(task: Any) -> float:
    """Error norm of a task that takes part, else not a number."""
    return float(task.error_norm) if task.enabled and not task.distance else math.nan


def nearest(task: Any) -> float:
    """Least distance of a set-based task, not a number if it has none."""
    finite = [value for value in task.distance if math.isfinite(value)]
    return min(finite) if finite and task.enabled else math.nan


def split(tasks: Sequence[Any]) -> tuple[dict[str, int], dict[str, int]]:
    """Numbers of tasks with errors, and of those with distances."""
    numbers = {task.name: i for i, task in enumerate(tasks)}
    keeps = {task.name for task in tasks if len(task.distance)}
    return (
        {name: i for name, i in numbers.items() if name not in keeps},
        {name: i for name, i in numbers.items() if name in keeps},
    )
