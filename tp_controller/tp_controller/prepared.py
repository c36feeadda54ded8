"""Compiled functions that are called again and again with the same arrays.

To find out what an array is, where it is and how long, takes 0.2 µs for each argument at every
call: more than small matrices take. So a function that is called in every cycle gets one array of
whole numbers, its words: for every array the address and the lengths, for every number its bits.
They are written when the arguments are chosen; a call hands over one array.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from types import BuiltinFunctionType
from typing import Any

import numpy as np

KINDS = {np.dtype(np.float64): 'f', np.dtype(np.int64): 'i', np.dtype(np.bool_): 'b'}
"""Letters for what arrays consist of."""


def key(kinds: Iterable[str]) -> int:
    """First of the words: it tells that arguments are of the kinds that a function takes.

    Parameters
    ----------
    kinds
        A letter of `KINDS` for every number; for every array with its number of dimensions.
    """
    return zlib.crc32(' '.join(kinds).encode())


class Prepared:
    """A compiled function with its arguments.

    Parameters
    ----------
    function
        A function decorated with ``njit(..., prepared=True)``.
    arguments
        Arrays, without gaps and in the order of rows, and numbers. Arrays are read and written to
        where they are.

    Raises
    ------
    TypeError
        If an argument is none of these. If it is, but the function takes another kind, `run`
        raises the error.

    Attributes
    ----------
    arguments
        The present arguments; numbers that were `put` later are not among them.
    run
        Calls the function with them.
    """

    def __init__(self, function: Callable[..., Any], *arguments: Any) -> None:
        self._function = function
        self.arguments = list(arguments)
        self.run: Callable[[], Any] = self._run
        # Without the library numba finds out itself what it gets.
        self._words: Any = None
        if isinstance(function, BuiltinFunctionType):
            self._write()

    def _write(self) -> None:
        kinds, words = [], [0]
        self._places: list[int] = []
        for argument in self.arguments:
            self._places.append(len(words))
            kind, found = _words(argument)
            kinds.append(kind)
            words.extend(found)
        words[0] = key(kinds)
        self._words = np.array(words, dtype=np.int64)
        numbers = self._words.view(np.float64)
        self._views = [numbers if kind == 'f' else self._words for kind in kinds]
        self.run = partial(self._function, self._words)

    def _run(self) -> Any:
        return self._function(*self.arguments)

    def put(self, i: int, value: float) -> None:
        """Give the argument of that index another number of the same kind."""
        if self._words is None:
            self.arguments[i] = value
        else:
            self._views[i][self._places[i]] = value

    def replace(self, i: int, array: Any) -> None:
        """Put another array of the same kind in the place of that index.

        Raises
        ------
        TypeError
            For one of another kind, or with gaps.
        """
        given = self.arguments[i]
        if array is given:
            return
        kind, words = _words(array)
        if self._words is not None:
            if array.dtype != given.dtype or array.ndim != given.ndim:
                raise TypeError(f'{kind}, of another kind than the array before')
            place = self._places[i]
            self._words[place : place + len(words)] = words
        self.arguments[i] = array


def _words(argument: Any) -> tuple[str, Sequence[int]]:
    """Kind and words of an argument."""
    if isinstance(argument, np.ndarray):
        if not argument.flags.c_contiguous:
            raise TypeError('an array with gaps, or not in the order of rows')
        if argument.dtype not in KINDS:
            raise TypeError(f'an array of {argument.dtype}')
        kind = f'{KINDS[argument.dtype]}{argument.ndim}'
        return kind, (argument.__array_interface__['data'][0], *argument.shape)
    if isinstance(argument, (bool, np.bool_)):
        return 'b', (int(argument),)
    if isinstance(argument, (int, np.integer)):
        return 'i', (int(argument),)
    return 'f', (int(np.float64(argument).view(np.int64)),)
