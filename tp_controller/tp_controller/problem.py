"""Levels of rows and bounds of joints, as values; anybody's Jacobians will do."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tp_controller.errors import InvalidValue, shown
from tp_controller.solvers.inverses import Inverse

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]


class Level(NamedTuple):
    """One level of a problem: rows ``J qd = velocity`` and rows ``C qd >= least``.

    Either kind may be left out. An upper bound ``C qd <= most`` is ``-C qd >= -most``.
    """

    J: ArrayLike | None = None
    """Jacobian of the equality rows (k, n); one row may be given as (n,)."""
    velocity: ArrayLike | None = None
    """Desired velocity of these rows (k,)."""
    C: ArrayLike | None = None
    """Jacobian of the inequality rows (m, n)."""
    least: ArrayLike | None = None
    """Least velocity of these rows (m,)."""
    weight: ArrayLike = 1.0
    """Weight in the scheme ``weighted``: one value, or one per row, equality rows first (k + m,).
    """
    inverse: Inverse = Inverse()
    """How the level is inverted; what is left open is taken from the arguments of `solve`."""
    tasks: Sequence[str] = ()
    """Names of the tasks that the rows belong to, for explanations."""
    row_names: Sequence[str] = ()
    """Names of the rows (k + m,), equality rows first, for explanations."""


class Problem(NamedTuple):
    """Levels and the bounds of the joints: all that `solve` needs for one step.

    `Stack.problem` makes one of a stack; levels and bounds of any other origin will do as well.
    Everything but the levels may be left out.
    """

    levels: Sequence[Level | tuple[ArrayLike, ArrayLike]]
    """Levels, highest priority first; a pair stands for ``Level(J, velocity)``."""
    low: ArrayLike | None = None
    """Lower bounds of the joint velocities (n,) [rad/s, m/s], one value or one per joint."""
    high: ArrayLike | None = None
    """Upper bounds of the joint velocities (n,)."""
    range_low: ArrayLike | None = None
    """Lower bounds (n,) that the ranges of the joints set, without those of speed and
    acceleration. A level that meets one slides along it instead of becoming slower."""
    range_high: ArrayLike | None = None
    """Upper bounds (n,) that the ranges of the joints set."""
    start: ArrayLike | None = None
    """Joint velocity (n,) that the scheme ``recursive`` starts from, within the bounds: the last
    command of joints with an acceleration limit; zero when left out."""
    joints: Sequence[str] = ()
    """Names of the joints (n,), for explanations."""

    def arrays(self) -> ProblemArrays:
        """Copies of all values as arrays.

        Raises
        ------
        InvalidValue
            For arrays of a wrong shape, numbers that are not finite, or bounds that exclude each
            other.
        """
        levels = [_checked(f'levels[{i}]', level) for i, level in enumerate(self.levels)]
        if not levels:
            raise InvalidValue('levels', 'no level', 'one or more')
        n = levels[0].n
        for i, level in enumerate(levels):
            if level.n != n:
                got = f'{level.n} columns, levels[0] has {n}'
                raise InvalidValue(f'levels[{i}]', got, 'as many columns on every level')
        if len(self.joints) not in (0, n):
            raise InvalidValue('joints', f'{len(self.joints)} names', f'{n} names, or none')
        low, high = _bounds('low', self.low, 'high', self.high, n)
        firm = _bounds('range_low', self.range_low, 'range_high', self.range_high, n)
        start = None if self.start is None else checked_array('start', self.start, (n,))
        names = tuple(self.joints) or tuple(f'joint {i}' for i in range(n))
        return ProblemArrays(tuple(levels), low, high, *firm, start, names)


class LevelArrays(NamedTuple):
    """A level whose values were checked and copied; see `Level`."""

    J: Matrix
    """(k, n)."""
    velocity: Vector
    """(k,)."""
    C: Matrix
    """(m, n)."""
    least: Vector
    """(m,)."""
    weight: Vector
    """(k + m,)."""
    inverse: Inverse
    tasks: tuple[str, ...]
    """Names of the tasks; of a level without any its index, as ``level 0``."""
    row_names: tuple[str, ...]
    """(k + m,)."""

    @property
    def n(self) -> int:
        """Number of joints."""
        return self.J.shape[1]


class ProblemArrays(NamedTuple):
    """A problem whose values were checked and copied; see `Problem`."""

    levels: tuple[LevelArrays, ...]
    low: Vector
    high: Vector
    range_low: Vector
    range_high: Vector
    start: Vector | None
    joints: tuple[str, ...]


def joined(levels: Sequence[Level]) -> Level:
    """One level of the rows of several.

    Parameters
    ----------
    levels
        The levels, with arrays (k, n) and (k,) and names for all rows. Their inverses are the
        same; those of levels with inequality rows alone do not count beside others.
    """
    if len(levels) == 1:
        return levels[0]
    equal = [level for level in levels if level.J is not None]
    sided = [level for level in levels if level.C is not None]
    rows = [(level, len(np.asarray(level.velocity))) for level in equal]
    rows += [(level, len(np.asarray(level.least))) for level in sided]
    return Level(
        np.vstack([np.asarray(level.J) for level in equal]) if equal else None,
        np.concatenate([np.asarray(level.velocity) for level in equal]) if equal else None,
        np.vstack([np.asarray(level.C) for level in sided]) if sided else None,
        np.concatenate([np.asarray(level.least) for level in sided]) if sided else None,
        np.concatenate([np.broadcast_to(np.asarray(level.weight), (k,)) for level, k in rows]),
        (equal or sided)[0].inverse,
        tuple(name for level in levels for name in level.tasks),
        tuple(name for level, _ in rows for name in level.row_names),
    )


def _checked(key: str, level: Level | tuple[ArrayLike, ArrayLike]) -> LevelArrays:
    J, velocity, C, least, weight, inverse, tasks, names = Level(*level)
    first, asked = _rows(f'{key}.J', J, f'{key}.velocity', velocity)
    second, rates = _rows(f'{key}.C', C, f'{key}.least', least)
    k = asked.size + rates.size
    if not k:
        raise InvalidValue(key, 'no rows', 'J with velocity, C with least, or both')
    if first.shape[1] != second.shape[1]:
        if asked.size and rates.size:
            got = f'{second.shape[1]} columns, J has {first.shape[1]}'
            raise InvalidValue(f'{key}.C', got, 'as many')
        n = (first if asked.size else second).shape[1]
        first, second = first.reshape(-1, n), second.reshape(-1, n)
    weights = numbers(f'{key}.weight', weight)
    if weights.shape not in ((), (1,), (k,)):
        raise InvalidValue(f'{key}.weight', f'shape {weights.shape}', f'one value or shape ({k},)')
    if not ((weights > 0.0) & (weights < math.inf)).all():
        raise InvalidValue(f'{key}.weight', shown(weight), 'a number above 0')
    try:
        inverse.check(key)
    except AttributeError:
        raise InvalidValue(f'{key}.inverse', shown(inverse), 'an Inverse') from None
    if len(names) not in (0, k):
        raise InvalidValue(f'{key}.row_names', f'{len(names)} names', f'{k} names, or none')
    return LevelArrays(
        first,
        asked,
        second,
        rates,
        np.broadcast_to(weights, (k,)).copy(),
        inverse,
        tuple(tasks) or (key.replace('levels[', 'level ').rstrip(']'),),
        tuple(names) or tuple(f'row {i}' for i in range(k)),
    )


def _rows(
    key: str, J: ArrayLike | None, name: str, velocity: ArrayLike | None
) -> tuple[Matrix, Vector]:
    """Copies of a Jacobian (k, n) and of one velocity per row (k,)."""
    if J is None and velocity is None:
        return np.zeros((0, 0)), np.zeros(0)
    if J is None or velocity is None:
        missing = key if J is None else name
        raise InvalidValue(missing, 'no value', f'{key} and {name} together')
    jacobian = checked_array(key, J)
    if jacobian.ndim == 1:
        jacobian = jacobian[None]
    if jacobian.ndim != 2 or not jacobian.shape[1]:
        raise InvalidValue(key, f'shape {jacobian.shape}', 'shape (rows, joints)')
    asked = np.atleast_1d(checked_array(name, velocity))
    if asked.shape != jacobian.shape[:1]:
        got = f'shape {asked.shape} with {key} of shape {jacobian.shape}'
        raise InvalidValue(name, got, f'shape ({jacobian.shape[0]},)')
    return np.ascontiguousarray(jacobian), asked


def checked_array(key: str, values: ArrayLike, shape: tuple[int, ...] | None = None) -> Vector:
    """Copy of finite numbers.

    Raises
    ------
    InvalidValue
        For anything else, or for another shape.
    """
    array = numbers(key, values)
    if not np.isfinite(array).all():
        raise InvalidValue(key, shown(array), 'finite numbers')
    if shape is not None and array.shape != shape:
        raise InvalidValue(key, f'shape {array.shape}', f'shape {shape}')
    return array


def numbers(key: str, values: ArrayLike) -> Vector:
    """Copy of numbers; errors as `checked_array`."""
    try:
        return np.array(values, dtype=float)
    except (TypeError, ValueError):
        raise InvalidValue(key, shown(values), 'an array of numbers') from None


def _bounds(
    low_key: str, low: ArrayLike | None, high_key: str, high: ArrayLike | None, n: int
) -> tuple[Vector, Vector]:
    """Lower and upper bounds (n,), infinite if they are left out."""
    found = []
    for key, values, absent in ((low_key, low, -np.inf), (high_key, high, np.inf)):
        bound = numbers(key, absent if values is None else values)
        if bound.shape not in ((), (1,), (n,)):
            raise InvalidValue(key, f'shape {bound.shape}', f'one value or shape ({n},)')
        if np.isnan(bound).any():
            raise InvalidValue(key, shown(bound), 'numbers')
        found.append(np.broadcast_to(bound, (n,)).copy())
    lower, upper = found
    if not ((lower <= upper) & (lower < np.inf) & (upper > -np.inf)).all():
        got = f'{shown(lower)} with {high_key} {shown(upper)}'
        raise InvalidValue(low_key, got, f'values up to {high_key}')
    return lower, upper
