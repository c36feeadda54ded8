"""Warnings: a line when something begins and one when it is over, and what of them holds."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass

PERIOD = 5.0
"""Least time [s] between two lines about one subject that nobody clears; so long without a
warning, it is over."""
HOLD = 2.0
"""Time [s] that a warning counts as present after it was last given."""


class Warnings:
    """Logs when a warning begins and when it is over, and tells which of them are present.

    In between nothing is logged, however often the warning is given. What begins again within
    `PERIOD` of its last line is held back, and told once that time is over.

    Parameters
    ----------
    begun, over
        Write one line: of a warning, and of its end.
    clock
        Steady time [s].
    """

    def __init__(
        self,
        begun: Callable[[str], object],
        over: Callable[[str], object],
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._begun, self._over = begun, over
        self._clock = clock
        self._entries: dict[str, _Entry] = {}

    def warn(self, subject: str, message: str, lasting: bool = False) -> None:
        """Give a warning.

        Parameters
        ----------
        subject
            What it is about.
        message
            The line.
        lasting
            Whether it holds until `clear`, given once; else until it is no more given.
        """
        now = self._clock()
        before = self._entries.get(subject)
        if before is not None and not before.lasting and now - before.given >= PERIOD:
            self.flush()
        # Put last: the newest is told first.
        entry = self._entries.pop(subject, None) or _Entry()
        self._entries[subject] = entry
        if not entry.count:
            entry.begin = now
        entry.message, entry.given, entry.lasting, entry.on = message, now, lasting, True
        entry.count += 1
        if not entry.told and now - entry.logged >= PERIOD:
            self._tell_begin(entry, now)

    def clear(self, subject: str, line: str | None = None) -> bool:
        """Take note that the cause is gone.

        Parameters
        ----------
        subject
            As in `warn`.
        line
            What is logged in place of that the warning is over; nothing if empty.

        Returns
        -------
        bool
            Whether it was there.
        """
        entry = self._entries.get(subject)
        if entry is None or not entry.on:
            return False
        entry.on = False
        if entry.told:
            now = self._clock()
            self._tell_end(entry, now, now, line)
        return True

    def flush(self) -> None:
        """Log what is over, and what was held back; to be called every second or so."""
        now = self._clock()
        for subject, entry in list(self._entries.items()):
            if now - entry.logged < PERIOD:
                continue
            if entry.on and (entry.lasting or now - entry.given < PERIOD):
                if not entry.told:
                    self._tell_begin(entry, now)
                continue
            entry.on = False
            if not entry.count or (entry.told and entry.count == 1):
                del self._entries[subject]
            elif entry.told or entry.lasting:
                self._tell_end(entry, now, entry.given)
            else:
                # An event that was held back.
                self._tell_begin(entry, now)
                entry.count = 0

    @property
    def present(self) -> Mapping[str, str]:
        """Warnings that hold by subject, the newest first."""
        since = self._clock() - HOLD
        return {
            subject: entry.message
            for subject, entry in reversed(self._entries.items())
            if entry.on and (entry.lasting or entry.given > since)
        }

    @property
    def message(self) -> str:
        """All warnings that are present, the newest first; empty if there is none."""
        return '; '.join(self.present.values()) if self._entries else ''

    def _tell_begin(self, entry: _Entry, now: float) -> None:
        more = f' ({entry.count} times in {now - entry.begin:.0f} s)' if entry.count > 1 else ''
        self._begun(entry.message + more)
        entry.told, entry.logged = True, now

    def _tell_end(self, entry: _Entry, now: float, end: float, line: str | None = None) -> None:
        if line is None:
            often = f', {entry.count} times in' if entry.count > 1 else ' after'
            line = f'over{often} {end - entry.begin:.2g} s: {entry.message}'
        if line:
            self._over(line)
        entry.told, entry.count, entry.logged = False, 0, now


@dataclass
class _Entry:
    begin: float = 0.0
    """When it began [s]."""
    message: str = ''
    given: float = 0.0
    """When it was last given [s]."""
    logged: float = -math.inf
    """When a line about the subject was last logged [s]."""
    count: int = 0
    """How often it was given since it began."""
    lasting: bool = False
    on: bool = False
    """Whether it is not over."""
    told: bool = False
    """Whether the last line says that it began."""
