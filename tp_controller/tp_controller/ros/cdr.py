"""Bytes of messages as middlewares send them, and where the numbers are in them.

Common Data Representation (CDR), version 1: every number begins at a multiple of its size, a
string ends with a zero, and strings and lists begin with their length in four bytes.
"""

from __future__ import annotations

import struct
from array import array
from collections.abc import Callable, Iterator, Sequence
from copy import copy
from operator import attrgetter
from typing import Any

HEADER = 4
"""Bytes before the first one that is counted: how the others are to be read."""
LARGEST = 8
"""Size [bytes] of the largest number."""
CODES = {
    'boolean': '?',
    'int8': 'b',
    'uint8': 'B',
    'int16': 'h',
    'uint16': 'H',
    'int32': 'i',
    'uint32': 'I',
    'int64': 'q',
    'uint64': 'Q',
    'float': 'f',
    'double': 'd',
}
"""Numbers of messages and their codes in `struct`."""
TEXT = 'string'
COUNT = struct.Struct('=I')
"""Length of a string or a list."""

Read = Callable[[Any], Any]


def text_bytes(text: str, begin: int = 0) -> bytes:
    """Bytes of a string with `begin` bytes before it."""
    data = text.encode()
    return bytes(-begin % COUNT.size) + COUNT.pack(len(data) + 1) + data + b'\0'


class Layout:
    """Bytes of consecutive fields of a message, and where their numbers are.

    Parameters
    ----------
    msg
        The message.
    names
        Names of the fields.
    begin
        Bytes before them; only the remainder of a division by `LARGEST` counts.

    Raises
    ------
    TypeError
        If a field is of a kind that is not handled, such as an array of fixed size.

    Attributes
    ----------
    bytes
        The bytes of the fields.
    fixed
        Where strings and lengths are in these.
    """

    def __init__(self, msg: Any, names: Sequence[str], begin: int) -> None:
        self._begin = begin
        self.bytes = bytearray()
        self.fixed: list[slice] = []
        # Each entry begins with the message that it is read from, and how.
        self._texts: list[tuple[Any, Read, tuple[Any, ...]]] = []
        self._numbers: list[tuple[Any, Read, Callable[..., None], int]] = []
        self._places: list[tuple[Any, str, str, int, int]] = []
        self._add_fields(msg, names)
        # From here on the bytes stay where they are.
        memory: Any = memoryview(self.bytes)
        self._arrays = [
            (root, attrgetter(path), memory[at:end].cast(code))
            for root, path, code, at, end in self._places
        ]
        self.refresh()

    def refresh(self) -> bool:
        """Write the present numbers; return whether the layout is still that of the message."""
        for root, get, known in self._texts:
            if get(root) != known:
                return False
        for root, get, pack, at in self._numbers:
            pack(self.bytes, at, *get(root))
        try:
            for root, get, memory in self._arrays:
                memory[:] = get(root)
        except ValueError:
            return False  # another length
        return True

    def places(self) -> dict[str, slice]:
        """Where the numbers of lists are, by the name of the field."""
        return {path.removeprefix('_'): slice(at, end) for _, path, _, at, end in self._places}

    def _add_fields(self, root: Any, names: Sequence[str]) -> None:
        """Append fields of a message; numbers without a string or list in between are one run."""
        texts: list[str] = []
        run: list[tuple[str, str]] = []
        for path, kind, value in _flat(root, names):
            if kind in CODES:
                run.append((path, CODES[kind]))
                continue
            self._add_numbers(root, run)
            run = []
            if isinstance(value, array) and value:
                self._add_count(len(value))
                self._align(value.itemsize)
                at = len(self.bytes)
                self.bytes += value.tobytes()
                self._places.append((root, path, value.typecode, at, len(self.bytes)))
            else:
                texts.append(path)
                self._add_text_or_list(kind, value)
        self._add_numbers(root, run)
        if texts:
            known = tuple(copy(attrgetter(path)(root)) for path in texts)
            self._texts.append((root, _getter(texts), known))

    def _add_numbers(self, root: Any, run: Sequence[tuple[str, str]]) -> None:
        if not run:
            return
        code, at = '=', len(self.bytes)
        for _, number in run:
            size = struct.calcsize('=' + number)
            filled = self._align(size)
            code += f'{filled}x{number}'
            self.bytes += bytes(size)
        get = _getter([path for path, _ in run])
        self._numbers.append((root, get, struct.Struct(code).pack_into, at))

    def _add_text_or_list(self, kind: str, value: Any) -> None:
        if kind == TEXT:
            self._align(COUNT.size)
            self._add_fixed(text_bytes(value))
            return
        if not kind.startswith('sequence<'):
            raise TypeError(f'a field of type {kind} is not handled')
        self._add_count(len(value))
        for entry in value:
            if kind == f'sequence<{TEXT}>':
                self._add_text_or_list(TEXT, entry)
            elif hasattr(entry, 'get_fields_and_field_types'):
                self._add_fields(entry, list(entry.get_fields_and_field_types()))
            else:
                raise TypeError(f'a field of type {kind} is not handled')

    def _add_count(self, count: int) -> None:
        self._align(COUNT.size)
        self._add_fixed(COUNT.pack(count))

    def _add_fixed(self, data: bytes) -> None:
        at = len(self.bytes)
        self.bytes += data
        if self.fixed and self.fixed[-1].stop == at:
            at = self.fixed.pop().start
        self.fixed.append(slice(at, len(self.bytes)))

    def _align(self, size: int) -> int:
        """Fill up to a multiple of a size; return by how many bytes."""
        filled = -(self._begin + len(self.bytes)) % size
        self.bytes += bytes(filled)
        return filled


def _flat(
    msg: Any, names: Sequence[str] | None = None, prefix: str = ''
) -> Iterator[tuple[str, str, Any]]:
    """Path, type and value of fields; those of a message within the message one by one.

    Paths are those of the slots behind the properties, which are read in a third of the time.
    """
    kinds = msg.get_fields_and_field_types()
    for name in kinds if names is None else names:
        value, slot = getattr(msg, name), f'{prefix}_{name}'
        if hasattr(value, 'get_fields_and_field_types'):
            yield from _flat(value, prefix=f'{slot}.')
        else:
            yield slot, kinds[name], value


def _getter(paths: Sequence[str]) -> Read:
    """Make what reads one field or more of a message, always as a tuple."""
    get = attrgetter(*paths)
    return get if len(paths) > 1 else lambda msg: (get(msg),)
