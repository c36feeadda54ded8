"""Trajectories out of the bytes that the middleware delivers, all points at once.

rclpy makes a Python object of every point, and several of every pose: a thousand poses then take
longer than ten cycles at 500 Hz. Here arrays are laid over the bytes. That works because a usable
trajectory has the same fields in all points, so these are at equal distances.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from rclpy.serialization import deserialize_message, serialize_message
from std_msgs.msg import Header
from trajectory_msgs.msg import JointTrajectory, MultiDOFJointTrajectory

from tp_controller.errors import InvalidValue
from tp_controller.ros.cdr import HEADER

Matrix = NDArray[np.float64]

LITTLE = b'\x00\x01'
"""First bytes of the representation that is read here: CDR, numbers with the lowest byte first."""
FIELDS: Mapping[type, Mapping[str, int]] = {
    JointTrajectory: {'positions': 1, 'velocities': 1, 'accelerations': 1, 'effort': 1},
    MultiDOFJointTrajectory: {'transforms': 7, 'velocities': 6, 'accelerations': 6},
}
"""Lists of a point by the type of the message, and numbers in each of their entries."""
MOST = 1000
"""Points of one trajectory, and names in it: more would hold up the cycle."""
COUNT = struct.Struct('<I')
STAMP = struct.Struct('<iI')


class PointValues(NamedTuple):
    """Numbers of consecutive points that have equally many of each kind."""

    times: Matrix
    """Times (m,) [s] from the start."""
    columns: Mapping[str, Matrix]
    """Numbers (m, size) by the name of the list; none of a size of zero."""
    sizes: Mapping[str, int]
    """How many numbers a point has, by the name of the list."""
    unlike: tuple[int, Mapping[str, int]] | None
    """Number and sizes of the first point that has others, None if all are alike; `times` and
    `columns` end before it."""


class TrajectoryMessage:
    """A JointTrajectory or MultiDOFJointTrajectory of which only the bytes are kept.

    Parameters
    ----------
    data
        The bytes.
    kind
        Type of the message.

    Raises
    ------
    InvalidValue
        If the bytes are not those of such a message, or it has too many points or names.

    Attributes
    ----------
    header, joint_names
        As in the message.
    points
        The points of the message, which are made as soon as one is asked for.
    """

    def __init__(self, data: bytes, kind: type) -> None:
        if not data.startswith(LITTLE):
            data = _converted(data, kind)
        self._kind, self._data = kind, data
        self._values: PointValues | None = None
        try:
            reader = _Reader(memoryview(data)[HEADER:])
            self.header = Header()
            self.header.stamp.sec, self.header.stamp.nanosec = reader.numbers(STAMP)
            self.header.frame_id = reader.text()
            self.joint_names = [reader.text() for _ in range(_few('joint_names', reader.count()))]
            count = _few('points', reader.count())
        except (struct.error, UnicodeDecodeError) as error:
            raise _broken(data, kind) from error
        self.points = _Points(self, count)
        self._begin = reader.at

    @property
    def values(self) -> PointValues:
        """Numbers of all points.

        Raises
        ------
        InvalidValue
            If the bytes end too early.
        """
        if self._values is None:
            memory = memoryview(self._data)[HEADER:]
            try:
                self._values = _values(memory, self._begin, len(self.points), FIELDS[self._kind])
            except struct.error as error:
                raise _broken(self._data, self._kind) from error
        return self._values

    def whole(self) -> Any:
        """Make the message with an object for each point."""
        return deserialize_message(self._data, self._kind)


def trajectory_message(msg: Any, kind: type) -> Any:
    """Message of a trajectory as `TrajectoryMessage`, if it is of such a type.

    Parameters
    ----------
    msg
        The message, or its bytes.
    kind
        Its type.
    """
    if kind not in FIELDS or isinstance(msg, TrajectoryMessage):
        return msg
    return TrajectoryMessage(msg if isinstance(msg, bytes) else serialize_message(msg), kind)


class _Points(Sequence[Any]):
    """Points of a message; who asks for one gets it from the whole message."""

    def __init__(self, message: TrajectoryMessage, count: int) -> None:
        self._message, self._count = message, count
        self._made: Sequence[Any] = ()

    def __len__(self) -> int:
        return self._count

    def __getitem__(self, place: Any) -> Any:
        if self._count and not self._made:
            self._made = self._message.whole().points
        return self._made[place]


class _Reader:
    """Reads numbers and strings one after the other."""

    def __init__(self, data: memoryview, at: int = 0) -> None:
        self._data, self.at = data, at

    def numbers(self, form: struct.Struct) -> tuple[Any, ...]:
        """Numbers of four bytes each."""
        self.at += -self.at % COUNT.size
        found = form.unpack_from(self._data, self.at)
        self.at += form.size
        return found

    def count(self) -> int:
        """Length of a list."""
        return int(self.numbers(COUNT)[0])

    def text(self) -> str:
        """String, which ends with a zero."""
        size, begin = self.count(), self.at
        if not 0 < size <= len(self._data) - begin:
            raise struct.error
        self.at += size
        return str(self._data[begin : self.at - 1], 'utf-8')

    def list_at(self, width: int) -> tuple[int, int]:
        """Count of a list of entries with so many numbers of eight bytes, and where they begin."""
        count = self.count()
        if count:
            self.at += -self.at % 8
        begin = self.at
        self.at += 8 * width * count
        if self.at > len(self._data):
            raise struct.error
        return count, begin


class _Layout(NamedTuple):
    """Where the fields of a point are."""

    begin: int
    counts: list[int]
    """Counts of its lists,"""
    heads: list[int]
    """where these are,"""
    lists: dict[str, int]
    """and where the lists begin."""
    time: int
    end: int


def _layout(data: memoryview, begin: int, fields: Mapping[str, int]) -> _Layout:
    """Read where the fields of a point are that begins there."""
    reader = _Reader(data, begin)
    counts, heads, lists = list[int](), list[int](), dict[str, int]()
    for name, width in fields.items():
        heads.append(reader.at)
        count, lists[name] = reader.list_at(width)
        counts.append(count)
    time = reader.at
    reader.numbers(STAMP)
    return _Layout(begin, counts, heads, lists, time, reader.at)


def _sizes(layout: _Layout, fields: Mapping[str, int]) -> dict[str, int]:
    return {
        name: count * width
        for count, (name, width) in zip(layout.counts, fields.items(), strict=True)
    }


def _values(data: memoryview, begin: int, points: int, fields: Mapping[str, int]) -> PointValues:
    """Numbers of points that begin there."""
    if not points:
        return PointValues(np.zeros(0), {}, dict.fromkeys(fields, 0), None)
    first = _layout(data, begin, fields)
    sizes = _sizes(first, fields)
    runs = [(first, 1)]
    if points > 1:
        # In the first point the gaps before numbers of eight bytes may be others.
        second = _layout(data, first.end, fields)
        runs.append((second, _alike(data, second, first.counts, points - 1)))
    found = sum(count for _, count in runs)
    unlike = None
    if found < points:
        last, count = runs[-1]
        other = _layout(data, last.begin + count * (last.end - last.begin), fields)
        unlike = (found, _sizes(other, fields))
    times = np.concatenate([_times(data, *run) for run in runs])
    columns = {
        name: np.concatenate([_numbers(data, *run, name, size) for run in runs])
        for name, size in sizes.items()
        if size
    }
    return PointValues(times, columns, sizes, unlike)


def _alike(data: memoryview, layout: _Layout, counts: Sequence[int], points: int) -> int:
    """How many of consecutive points have these counts; the first one has that layout."""
    if layout.counts != counts:
        return 0
    step = layout.end - layout.begin
    alike = min(points, (len(data) - layout.begin) // step)
    for head, count in zip(layout.heads, counts, strict=True):
        other = np.flatnonzero(_laid(data, head, '<u4', (alike,), step) != count)
        alike = int(other[0]) if other.size else alike
    return alike


def _times(data: memoryview, layout: _Layout, count: int) -> Matrix:
    step = layout.end - layout.begin
    seconds = _laid(data, layout.time, '<i4', (count,), step)
    return np.asarray(seconds + 1e-9 * _laid(data, layout.time + 4, '<u4', (count,), step))


def _numbers(data: memoryview, layout: _Layout, count: int, name: str, size: int) -> Matrix:
    step = layout.end - layout.begin
    return _laid(data, layout.lists[name], '<f8', (count, size), step)


def _laid(
    data: memoryview, begin: int, kind: str, shape: tuple[int, ...], step: int
) -> NDArray[Any]:
    """Array over bytes whose rows are so many bytes apart."""
    item = np.dtype(kind)
    strides = (step, item.itemsize)[: len(shape)]
    return np.ndarray(shape, item, data, begin, strides)


def _few(key: str, count: int) -> int:
    if count > MOST:
        raise InvalidValue(key, f'{count}', f'up to {MOST}')
    return count


def _converted(data: bytes, kind: type) -> bytes:
    """Bytes of another representation in that of this machine."""
    try:
        return serialize_message(deserialize_message(data, kind))
    except (RuntimeError, UnicodeDecodeError) as error:
        raise _broken(data, kind) from error


def _broken(data: bytes, kind: type) -> InvalidValue:
    return InvalidValue('trajectory', f'{len(data)} bytes of none', f'a {kind.__name__}')
