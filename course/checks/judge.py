"""How the checks of all exercises work."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray


class Wrong(Exception):
    """What is wrong with an answer, in words."""


RESULTS: dict[str, bool] = {}
"""Whether the last answer to each exercise was right."""


def exercise(number: str) -> Callable[[Callable[[Any], None]], Callable[[Any], bool]]:
    """Make a check of an exercise from a function that raises `Wrong`.

    The check prints that the answer is right, or what is wrong with it, and says which as a
    boolean. An error inside the answer is part of what is wrong.
    """

    def make(judge: Callable[[Any], None]) -> Callable[[Any], bool]:
        @functools.wraps(judge)
        def check(answer: Any) -> bool:
            said = 'right.'
            try:
                if answer is None or answer is Ellipsis:
                    raise Wrong('there is no answer yet.')
                judge(answer)
            except Wrong as wrong:
                said = f'not yet: {wrong}'
            except Exception as error:
                said = f'not yet: your answer stops with {type(error).__name__}: {error}'
            print(f'Exercise {number}: {said}')
            RESULTS[number] = said == 'right.'
            return RESULTS[number]

        return check

    return make


def values(got: Any) -> NDArray[np.float64]:
    """Answer as an array of numbers; `Wrong` if it is none."""
    if got is None or got is Ellipsis:
        raise Wrong('there is no answer yet.')
    try:
        return np.asarray(got, dtype=float)
    except (TypeError, ValueError):
        raise Wrong(f'the answer has to be numbers; it is {got!r}.') from None


def same(
    got: Any,
    expected: ArrayLike,
    what: str,
    mistakes: Iterable[tuple[ArrayLike, str]] = (),
    tolerance: float = 1e-8,
) -> None:
    """Raise `Wrong` if an answer is not the expected value.

    Parameters
    ----------
    got
        What the answer gave.
    expected
        What is right.
    what
        What the value is, such as ``the Jacobian at q = [0. 1.]``.
    mistakes
        Values that well-known mistakes give, and what to say of each.
    tolerance
        Largest difference that counts as the same.
    """
    expected, value = np.asarray(expected, dtype=float), values(got)
    if value.shape != expected.shape:
        raise Wrong(f'{what} has the shape {value.shape}; it should be {expected.shape}.')
    if np.allclose(value, expected, rtol=tolerance, atol=tolerance):
        return
    for mistake, hint in mistakes:
        wrong = np.asarray(mistake, dtype=float)
        if wrong.shape == value.shape and np.allclose(value, wrong, rtol=1e-6, atol=1e-9):
            raise Wrong(hint)
    raise Wrong(f'{what} is {_shown(value)}; it should be {_shown(expected)}.')


def _shown(value: Any) -> str:
    return np.array2string(np.asarray(value), precision=4, suppress_small=True, separator=', ')
