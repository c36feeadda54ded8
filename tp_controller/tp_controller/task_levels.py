"""Which tasks act on which level."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import chain

from tp_controller.hierarchy import split_hierarchy
from tp_controller.solvers import Solver
from tp_controller.tasks import Task


class TaskLevels:
    """A hierarchy of tasks, of which some are off and some may have a stand-in.

    Parameters
    ----------
    tasks
        All tasks by name; whoever has them may add and remove some outside the hierarchy.

    Attributes
    ----------
    stand_in
        A task that acts in place of levels, and names of tasks on these; None if there is none.
    """

    def __init__(self, tasks: Mapping[str, Task]) -> None:
        self._tasks = tasks
        self._listed: list[list[str]] = []
        self.stand_in: tuple[Task, tuple[str, ...]] | None = None

    @property
    def hierarchy(self) -> tuple[str, ...]:
        """Task names by level, highest first, on or off."""
        return tuple(' + '.join(names) for names in self._listed)

    @property
    def on(self) -> Iterator[Task]:
        """Tasks in the hierarchy that are on, in order."""
        named = (self._tasks[name] for name in chain.from_iterable(self._listed))
        return (task for task in named if task.enabled)

    def adopt(self, hierarchy: Sequence[str]) -> None:
        """Take over a hierarchy that passes `checked`."""
        self._listed = split_hierarchy(hierarchy, self._tasks)

    def place_of(self, name: str) -> int:
        """List position of a task in the hierarchy, on or off; -1 outside it."""
        for i, names in enumerate(self._listed):
            if name in names:
                return i
        return -1

    def checked(
        self,
        hierarchy: Sequence[str],
        solver: Solver,
        damping: float | None = None,
        tasks: Mapping[str, Task] | None = None,
        enabled: Mapping[str, bool] | None = None,
    ) -> list[list[Task]]:
        """Tasks of every level of a hierarchy, without those that are off.

        Parameters, result and errors are those of `Stack.check_hierarchy`.
        """
        tasks = self._tasks if tasks is None else tasks
        on = {name: task.enabled for name, task in tasks.items()} | dict(enabled or {})
        levels = split_hierarchy(hierarchy, tasks)
        members = [[tasks[name] for name in names if on[name]] for names in levels]
        members = [level for level in members if level]
        if members:
            solver.check(members, damping)
        return members

    def acting(self, members: list[list[Task]]) -> list[list[Task]]:
        """Levels with the stand-in, if there is one, in the place of those that it stands for.

        Set-based tasks of these go on to act, on a level of their own above it.
        """
        if self.stand_in is None:
            return members
        task, names = self.stand_in
        first = min(
            (i for i, level in enumerate(members) if any(one.name in names for one in level)),
            default=len(members),
        )
        left = [one for level in members[first:] for one in level if one.set_based]
        return [*members[:first], *([left] if left else []), [task]]
