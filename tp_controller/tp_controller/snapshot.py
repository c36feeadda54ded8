"""Memory of objects that an evaluation must not change."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.typing import NDArray

Copies = list[tuple[NDArray[Any], NDArray[Any]]]


@contextmanager
def unchanged(*owners: object) -> Iterator[None]:
    """Give objects their present attributes back at the end.

    Arrays keep their place and get their numbers back, also those in tuples. Lists get their
    items back. Other objects among the attributes are not looked into.
    """
    attributes = [(owner, dict(vars(owner))) for owner in owners]
    copies: Copies = []
    lists: list[tuple[list[Any], list[Any]]] = []
    for _, values in attributes:
        for value in values.values():
            _copy(value, copies)
            if isinstance(value, list):
                lists.append((value, list(value)))
    try:
        yield
    finally:
        for owner, values in attributes:
            vars(owner).update(values)
        for items, saved in lists:
            items[:] = saved
        for array, numbers in copies:
            array[...] = numbers


def _copy(value: object, copies: Copies) -> None:
    """Add copies of the arrays that can be written to."""
    if isinstance(value, np.ndarray):
        if value.flags.writeable:
            copies.append((value, value.copy()))
    elif isinstance(value, tuple):
        for item in value:
            _copy(item, copies)
