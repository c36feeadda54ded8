"""What people at the page ask for, on its way to the controller."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from typing import NamedTuple


class Goal(NamedTuple):
    """A new target of a task."""

    task: str
    values: tuple[float, ...]
    """As ``target`` in a parameter file."""


class Change(NamedTuple):
    """A new value of a parameter of the controller."""

    key: str
    value: bool | list[float] | list[str]


class Hold(NamedTuple):
    """To rest, or go on."""

    on: bool


class Reset(NamedTuple):
    """The simulated robot back to where it started."""


class Save(NamedTuple):
    """The present stack into a file."""

    path: str
    overwrite: bool


class Record(NamedTuple):
    """To record into a file from now on, or no longer."""

    name: str
    """Of the file in the page's folder; empty: no longer."""


Wish = Goal | Change | Hold | Reset | Save | Record

MOST = 200
"""Wishes that wait at most; more come from nobody who presses buttons."""


class Wishes:
    """Wishes of all browsers in the order in which they came; of goals of a task the newest.

    The browsers' threads add to it, another one takes.
    """

    def __init__(self) -> None:
        self._others: deque[Wish] = deque(maxlen=MOST)
        self._goals: dict[str, Goal] = {}

    def add(self, wish: Wish) -> None:
        """Add one."""
        if isinstance(wish, Goal):
            self._goals[wish.task] = wish
        else:
            self._others.append(wish)

    def take(self) -> Iterator[Wish]:
        """Take all that wait."""
        while self._others:
            yield self._others.popleft()
        for task in list(self._goals):
            yield self._goals.pop(task)
