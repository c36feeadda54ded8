"""The hierarchy as a list of levels that one moves a task in, one press of a button at a time."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

Levels = list[list[str]]
"""Task names of every level, highest first."""


def levels_of(tasks: Iterable[Any]) -> Levels:
    """Levels of the tasks of a controller's state; those that are idle are in none."""
    found: dict[int, list[str]] = {}
    for task in tasks:
        if task.level >= 0:
            found.setdefault(task.level, []).append(task.name)
    return [found[level] for level in sorted(found)]


def raised(levels: Sequence[Sequence[str]], name: str) -> Levels:
    """Levels with a task one place higher; one that shares its level gets its own above it."""
    return _moved(levels, name, 0)


def lowered(levels: Sequence[Sequence[str]], name: str) -> Levels:
    """Levels with a task one place lower; one that shares its level gets its own below it."""
    return _moved(levels, name, 1)


def joined(levels: Sequence[Sequence[str]], name: str) -> Levels:
    """Levels with a task on the level above its own."""
    place = _place(levels, name)
    if place is None or place == 0:
        return _copy(levels)
    found = _copy(levels)
    found[place].remove(name)
    found[place - 1].append(name)
    return [names for names in found if names]


def listed(levels: Sequence[Sequence[str]], name: str) -> Levels:
    """Levels with a task that was idle as the lowest one."""
    return _copy(levels) if _place(levels, name) is not None else [*_copy(levels), [name]]


def left_out(levels: Sequence[Sequence[str]], name: str) -> Levels:
    """Levels without a task."""
    return [rest for names in levels if (rest := [other for other in names if other != name])]


def parameter(levels: Sequence[Sequence[str]]) -> list[str]:
    """Value of the parameter ``hierarchy`` for these levels."""
    return [' + '.join(names) for names in levels] or ['']


def _moved(levels: Sequence[Sequence[str]], name: str, down: int) -> Levels:
    place = _place(levels, name)
    found = _copy(levels)
    if place is None:
        return found
    if len(found[place]) > 1:
        found[place].remove(name)
        found.insert(place + down, [name])
        return found
    other = place + 2 * down - 1
    if 0 <= other < len(found):
        found[place], found[other] = found[other], found[place]
    return found


def _place(levels: Sequence[Sequence[str]], name: str) -> int | None:
    return next((i for i, names in enumerate(levels) if name in names), None)


def _copy(levels: Sequence[Sequence[str]]) -> Levels:
    return [list(names) for names in levels]
