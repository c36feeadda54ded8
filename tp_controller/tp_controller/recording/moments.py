"""The states of a recording by their time, read and decoded when they are asked for."""

from __future__ import annotations

import bisect
import struct
from collections import OrderedDict
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from tp_controller.errors import InvalidValue
from tp_controller.recording.index import Part, read_part
from tp_controller.recording.reader import Recording

PARTS, STATES = 64, 2048
"""Parts of the file, and states, that are kept for the next question."""


class Moment(NamedTuple):
    """A state of the controller."""

    time: float
    """Time [s] of the joint state that it answers, from the first cycle."""
    state: Any
    """Has the fields of ``ControllerState``."""


class Moments:
    """Finds states by the stamps of the joint states that they answer, which grow in a file.

    The memory that it takes does not depend on the number of states.

    Parameters
    ----------
    recording
        The recording.

    Raises
    ------
    InvalidValue
        If there is no cycle in it.

    Attributes
    ----------
    seconds
        Time [s] of the last cycle, from the first one.
    """

    def __init__(self, recording: Recording) -> None:
        self._path = recording.path
        found = recording.parts(recording.state) or {0: []}
        # One topic has one channel, but a file may repeat it under another number.
        self._number, self._parts = max(found.items(), key=lambda item: len(item[1]))
        if not self._parts:
            raise self._nothing()
        self._decode = recording.decoder(self._number)
        self._read: OrderedDict[int, list[tuple[int, bytes]]] = OrderedDict()
        self._states: OrderedDict[tuple[int, int], Any] = OrderedDict()
        self._first: dict[int, int] = {}
        self._start = self._first_cycle()
        self.seconds = 1e-9 * (self._last_stamp() - self._start)

    def at(self, time: float) -> Moment:
        """Last state up to a time [s], the first one before all."""
        place = self._find(self._start + round(1e9 * max(time, 0.0)))
        return self._moment(*place)

    def before(self, time: float, span: float, step: float) -> Iterator[Moment]:
        """States of the last `span` [s] up to a time [s], no finer than `step` [s], in order.

        Their moments are multiples of the step: those of a later time are partly the same.
        """
        last = -1.0
        for i in range(max(0, int((time - span) / step) + 1), int(time / step) + 1):
            found = self.at(min(i * step, time))
            if found.time > last:
                last = found.time
                yield found

    def _find(self, stamp: int) -> tuple[int, int]:
        """Part, and place in it, of the last state up to a stamp [ns]."""
        low, high = 0, len(self._parts) - 1
        while low < high:
            middle = (low + high + 1) // 2
            if self._first_of(middle) <= stamp:
                low = middle
            else:
                high = middle - 1
        stamps = [found for found, _ in self._part(low)]
        return low, max(bisect.bisect_right(stamps, stamp) - 1, 0)

    def _moment(self, part: int, place: int) -> Moment:
        stamp, data = self._part(part)[place]
        key = part, place
        if key in self._states:
            self._states.move_to_end(key)
        else:
            self._states[key] = self._decode(data)
            if len(self._states) > STATES:
                self._states.popitem(last=False)
        return Moment(1e-9 * (stamp - self._start), self._states[key])

    def _first_of(self, part: int) -> int:
        if part not in self._first:
            self._first[part] = self._part(part)[0][0]
        return self._first[part]

    def _part(self, part: int) -> list[tuple[int, bytes]]:
        """Stamps [ns] and bytes of the states of a part."""
        if part in self._read:
            self._read.move_to_end(part)
        else:
            self._read[part] = _stamped(self._path, self._parts[part], self._number)
            if len(self._read) > PARTS:
                self._read.popitem(last=False)
        return self._read[part]

    def _first_cycle(self) -> int:
        """Stamp [ns] of the first cycle; states before it, and their parts, are left out."""
        for i, _ in enumerate(self._parts):
            for stamp, data in self._part(i):
                if self._decode(data).cycles > 0:
                    del self._parts[:i]
                    self._read.clear()
                    return stamp
        raise self._nothing()

    def _nothing(self) -> InvalidValue:
        return InvalidValue(str(self._path), 'no cycle', 'a recording with one')

    def _last_stamp(self) -> int:
        return self._part(len(self._parts) - 1)[-1][0]


def _stamped(path: Path, part: Part, number: int) -> list[tuple[int, bytes]]:
    found = []
    for message in read_part(path, part):
        if message.channel_id == number:
            found.append((_stamp(message.data), message.data))
    return found


def _stamp(data: bytes) -> int:
    """Stamp [ns] at the beginning of a message, where its header is."""
    seconds, rest = struct.unpack_from('<iI' if data[1] & 1 else '>iI', data, 4)
    return int(seconds) * 1_000_000_000 + int(rest)
