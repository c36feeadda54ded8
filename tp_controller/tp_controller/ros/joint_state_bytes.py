"""Joint states out of the bytes that the middleware delivers."""

from __future__ import annotations

import struct
from array import array
from collections.abc import Callable, Sequence
from operator import itemgetter
from typing import Any, NamedTuple

from builtin_interfaces.msg import Time
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState

from tp_controller.ros.cdr import HEADER, Layout
from tp_controller.ros.joint_states import JointStateValues

LAYOUTS = 8
"""So many layouts are kept: more than one publisher may send joint states."""
STAMP = struct.Struct('=iI')
"""Seconds and nanoseconds of the stamp; they come first."""


class JointStateDecoder:
    """Reads joint states of which only the numbers differ from earlier ones by taking these.

    The others are read by rclpy, which takes several times as long.
    """

    def __init__(self) -> None:
        # By the count of bytes.
        self._known: dict[int, list[_Known]] = {}
        self._count = 0

    def read(self, data: bytes) -> JointStateValues:
        """Read the bytes of a joint state; it has no names if they are not those of one."""
        for known in self._known.get(len(data), ()):
            if known.fixed(data) == known.content:
                stamp = Time()
                stamp.sec, stamp.nanosec = STAMP.unpack_from(data, HEADER)
                position = array('d', data[known.position])
                velocity = array('d', data[known.velocity])
                return JointStateValues(stamp, known.names, position, velocity)
        try:
            msg = deserialize_message(data, JointState)
        except (RuntimeError, UnicodeDecodeError):
            return JointStateValues(Time(), (), array('d'), array('d'))
        self._learn(data, msg)
        return JointStateValues(msg.header.stamp, msg.name, msg.position, msg.velocity)

    def _learn(self, data: bytes, msg: JointState) -> None:
        """Keep where the numbers are, if the bytes are laid out as expected."""
        layout = Layout(msg, list(msg.get_fields_and_field_types()), 0)
        own = data[:HEADER] + layout.bytes
        numbers = {path: _moved(place) for path, place in layout.places().items()}
        fixed = itemgetter(slice(HEADER), *map(_moved, layout.fixed))
        check = itemgetter(slice(HEADER + STAMP.size), *numbers.values())
        if fixed(data) != fixed(own) or check(data) != check(own):
            return
        if self._count >= LAYOUTS:
            self._known.clear()
            self._count = 0
        self._count += 1
        none = slice(0)
        known = _Known(
            fixed,
            fixed(data),
            msg.name,
            numbers.get('position', none),
            numbers.get('velocity', none),
        )
        self._known.setdefault(len(data), []).append(known)


class _Known(NamedTuple):
    """Where the numbers of joint states are."""

    fixed: Callable[[bytes], Any]
    """Takes all that is no number out of the bytes, without the gaps in between."""
    content: Any
    """What that is."""
    names: Sequence[str]
    position: slice
    velocity: slice


def _moved(place: slice) -> slice:
    """Place in all bytes of a place in those that are counted."""
    return slice(place.start + HEADER, place.stop + HEADER)
