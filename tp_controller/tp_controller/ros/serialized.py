"""Messages kept as the bytes that are sent: as long as only numbers change, these are replaced."""

from __future__ import annotations

from array import array
from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rclpy.serialization import serialize_message

from tp_controller.ros.cdr import HEADER, LARGEST, TEXT, Layout, text_bytes


def field_view(msg: Any, field: str, size: int, value: float = 0.0) -> NDArray[np.float64]:
    """Make a float64[] field of a message ``size`` long; return a view that writes into it.

    The view is taken from the message itself, whose constructor and setters copy.
    """
    setattr(msg, field, array('d', [value] * size))
    return np.frombuffer(getattr(msg, field)) if size else np.zeros(0)


class Serialized:
    """A message of which mostly numbers change; rclpy takes several times as long to serialize it.

    Parameters
    ----------
    msg
        The message. All its fields may be set, and those of messages within it.
    cuts
        Names of fields that begin a block. The bytes of a block are laid out anew when a string
        or a length changes in it, those of the others are not.

    Raises
    ------
    TypeError
        See `Layout`.
    """

    def __init__(self, msg: Any, cuts: Sequence[str] = ()) -> None:
        self._header = serialize_message(msg)[:HEADER]
        names = list(msg.get_fields_and_field_types())
        begins = [0, *(names.index(cut) for cut in cuts), len(names)]
        self._blocks = [_block(msg, names[begin:end]) for begin, end in pairwise(begins)]
        self.write()

    def write(self) -> bytes:
        """Return the bytes of the message as it is now."""
        chunks: list[bytes | bytearray] = [self._header]
        end = 0
        for block in self._blocks:
            chunk = block.write(end)
            chunks.append(chunk)
            end += len(chunk)
        return b''.join(chunks)


class _Block:
    """Consecutive fields of a message."""

    def __init__(self, msg: Any, names: Sequence[str]) -> None:
        self._msg, self._names = msg, names
        # How far numbers are apart depends on where the block begins.
        self._layouts: list[Layout | None] = [None] * LARGEST

    def write(self, begin: int) -> bytearray:
        """Bytes of the fields, with `begin` bytes before them; valid until the next call."""
        place = begin % LARGEST
        layout = self._layouts[place]
        if layout is None or not layout.refresh():
            layout = self._layouts[place] = Layout(self._msg, self._names, place)
        return layout.bytes


class _Text:
    """A string; nothing of it is worth keeping."""

    def __init__(self, msg: Any, name: str) -> None:
        self._msg, self._name = msg, name

    def write(self, begin: int) -> bytes:
        """Bytes of the string, with `begin` bytes before them."""
        return text_bytes(getattr(self._msg, self._name), begin)


def _block(msg: Any, names: Sequence[str]) -> _Block | _Text:
    if len(names) == 1 and msg.get_fields_and_field_types()[names[0]] == TEXT:
        return _Text(msg, names[0])
    return _Block(msg, names)
