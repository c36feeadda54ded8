"""One line per task in the terminal while the robot moves."""

from __future__ import annotations

import time

from rich.console import Console
from rich.progress import BarColumn, TaskID, TextColumn
from rich.progress import Progress as Bars

from tp_interfaces.msg import ControllerState

REFRESH = 0.1
"""Time [s] between redraws."""


class Progress:
    """Bars that fill as the error of each task shrinks.

    Parameters
    ----------
    console
        Where to draw.
    """

    def __init__(self, console: Console) -> None:
        self._console = console
        self._bars = Bars(
            TextColumn('  {task.description}'),
            BarColumn(bar_width=30),
            TextColumn('error {task.fields[error]:.4f}'),
            console=console,
            auto_refresh=False,
        )
        self._ids: dict[str, TaskID] = {}
        self._largest: dict[str, float] = {}
        self._drawn = 0.0

    def __enter__(self) -> Progress:
        self._bars.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._bars.stop()

    def begin(self, title: str, state: ControllerState) -> None:
        """Start anew for a goal."""
        self._bars.console.print(title)
        self._largest.clear()
        for task in state.tasks:
            if task.name not in self._ids and not task.distance:
                label = f'level {task.level} {task.name}' if task.enabled else f'idle {task.name}'
                self._ids[task.name] = self._bars.add_task(label, total=1.0, error=0.0)
        self.follow(state)

    def follow(self, state: ControllerState) -> None:
        """Show a state, unless the last one was shown just now."""
        for task in state.tasks:
            largest = self._largest.get(task.name, 0.0)
            self._largest[task.name] = max(largest, task.error_norm)
        if time.monotonic() - self._drawn < REFRESH:
            return
        self._drawn = time.monotonic()
        for task in state.tasks:
            if task.name in self._ids:
                largest = self._largest[task.name] or 1.0
                done = 1.0 - task.error_norm / largest
                self._bars.update(self._ids[task.name], completed=done, error=task.error_norm)
        self._bars.refresh()
