"""Warnings: one line per subject and a time, and what of them still holds."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import NamedTuple

PERIOD = 5.0
"""Least time [s] between two lines about one subject."""
HOLD = 2.0
"""Time [s] that a warning counts as present after it was last given."""


class Warnings:
    """Logs warnings, throttled by subject, and tells which of them are present.

    Parameters
    ----------
    log
        Writes one line.
    clock
        Steady time [s].
    """

    def __init__(
        self, log: Callable[[str], object], clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._log = log
        self._clock = clock
        self._entries: dict[str, _Entry] = {}

    def warn(self, subject: str, message: str) -> None:
        """Give a warning.

        Parameters
        ----------
        subject
            What it is about. Within `PERIOD` one line is logged about it, whatever numbers the
            message has; the others are counted, and the next line says how many they were.
        message
            The line.
        """
        now = self._clock()
        entry = self._entries.get(subject)
        # Put last: the newest is told first.
        logged, held = (-PERIOD, 0) if entry is None else (entry.logged, entry.held)
        self._entries.pop(subject, None)
        self._entries[subject] = self._logged(_Entry(message, now, logged, held + 1), now)

    def clear(self, subject: str) -> None:
        """Take note that the cause is gone."""
        if subject in self._entries:
            self._entries[subject] = self._entries[subject]._replace(given=-HOLD)

    def flush(self) -> None:
        """Log what was held back and is due."""
        now = self._clock()
        for subject, entry in self._entries.items():
            if entry.held:
                self._entries[subject] = self._logged(entry, now)

    @property
    def message(self) -> str:
        """All warnings that are present, the newest first; empty if there is none."""
        if not self._entries:
            return ''
        since = self._clock() - HOLD
        return '; '.join(
            entry.message for entry in reversed(self._entries.values()) if entry.given > since
        )

    def _logged(self, entry: _Entry, now: float) -> _Entry:
        if now - entry.logged < PERIOD:
            return entry
        more = f' ({entry.held} times in {now - entry.logged:.0f} s)' if entry.held > 1 else ''
        self._log(entry.message + more)
        return entry._replace(logged=now, held=0)


class _Entry(NamedTuple):
    message: str
    given: float
    """When the warning was last given [s]."""
    logged: float
    """When a line about the subject was last logged [s]."""
    held: int
    """Warnings since that line."""
