"""Messages of which only numbers change, kept as the bytes that are sent."""

from __future__ import annotations

import struct
from array import array
from typing import Any

import numpy as np
from builtin_interfaces.msg import Time
from numpy.typing import NDArray
from rclpy.serialization import serialize_message

STAMP = struct.Struct('=iI')
"""A stamp: seconds and nanoseconds."""
SEEN = (0x0123_4567, 0x2345_6789)
"""Seconds and nanoseconds that nothing else in a message looks like."""


class Serialized:
    """A message that is serialized once; a stamp and an array are then written into its bytes.

    Serializing it anew for every command would take a third of the time of a step.

    Parameters
    ----------
    msg
        The message; its stamp and array are overwritten.
    field
        Name of its float64[] field that changes.
    size
        Number of values there.
    """

    def __init__(self, msg: Any, field: str, size: int) -> None:
        seen = np.pi * 1e-9 * (1.0 + np.arange(size))
        setattr(msg, field, array('d', seen))
        stamped = hasattr(msg, 'header')
        if stamped:
            msg.header.stamp.sec, msg.header.stamp.nanosec = SEEN
        # Fast DDS and Cyclone DDS write numbers as this machine has them in its memory.
        self._bytes = bytearray(serialize_message(msg))
        self._stamp_at = self._bytes.index(STAMP.pack(*SEEN)) if stamped else -1
        begin = self._bytes.index(seen.tobytes())
        # The values need not begin at a multiple of eight, so they are written as bytes.
        self._values = np.frombuffer(self._bytes, np.uint8, 8 * size, begin)

    def write(self, values: NDArray[np.float64], stamp: Time | None) -> bytes:
        """Bytes of the message with other values (size,) and another stamp, if it has one."""
        self._values[:] = values.view(np.uint8)
        if self._stamp_at >= 0 and stamp is not None:
            STAMP.pack_into(self._bytes, self._stamp_at, stamp.sec, stamp.nanosec)
        return bytes(self._bytes)
