"""Checks of the values that a user gives a task; each returns a copy in its normal form.

All raise `InvalidValue` for values that cannot be used; the message says which are accepted.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NoReturn

import numpy as np
from numpy.typing import NDArray

from tp_controller.errors import InvalidValue, plural, shown

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]

LARGEST = 1e9
"""Size of a value of a target, feedforward or gain up to which nothing is lost to rounding."""
OSCILLATING, OVERSHOOTING = 2.0, 1.0
"""Gains times the period from which on an error grows, or changes its sign, at every step."""


def checked_target(
    values: Sequence[float] | Vector, size: int, words: str, sized: slice = slice(None)
) -> Vector:
    """Target (size,) of finite numbers; those of ``sized`` are at most `LARGEST`.

    The ``words`` say what the values are.
    """
    if len(values) != size:
        refuse_number('target', values, f'{plural(size, "value")} ({words})')
    target = _finite('target', values)
    if np.abs(target[sized]).max(initial=0.0) > LARGEST:
        raise InvalidValue('target', shown(target), f'numbers up to {LARGEST:g} in size')
    return target


def checked_feedforward(values: Sequence[float] | Vector, components: Sequence[str]) -> Vector:
    """Task velocity (k,) with one value for each component."""
    k = len(components)
    if len(values) != k:
        refuse_number('feedforward', values, f'{plural(k, "value")} ({", ".join(components)})')
    velocity = _finite('feedforward', values)
    if np.abs(velocity).max(initial=0.0) > LARGEST:
        raise InvalidValue('feedforward', shown(velocity), f'numbers up to {LARGEST:g} in size')
    return velocity


def checked_gain(values: Sequence[float], k: int, period: float) -> Matrix:
    """Gain matrix (k, k) of one value, k values or k*k values row by row.

    A gain that drives a task away from its target is refused: a negative value, a matrix whose
    symmetric part has a negative eigenvalue, and one that makes the error grow from step to step,
    ``K·dt`` of 2 or more. The period may be infinite.
    """
    if len(values) not in (1, k, k * k):
        accepts = '1 value' if k == 1 else f'1, {k} or {k * k} values'
        words = '' if k == 1 else f' (for all rows, one per row, a {k}x{k} matrix row by row)'
        refuse_number('gain', values, accepts + words)
    K = _finite('gain', values)
    K = K.reshape(k, k) if K.size == k * k else np.diag(np.broadcast_to(K, (k,)))
    if np.abs(K).max(initial=0.0) > LARGEST:
        raise InvalidValue('gain', shown(K), f'numbers up to {LARGEST:g}')
    if np.linalg.eigvalsh(K + K.T).min() < -1e-9 * np.abs(K).max(initial=0.0):
        raise InvalidValue(
            'gain', shown(list(values)), 'values of at least 0, or a positive matrix'
        )
    if (share := gain_share(K, period)) >= OSCILLATING:
        rate = 1.0 / period
        raise InvalidValue(
            'gain',
            f'{shown(list(values))}, which makes K·dt = {share:.3g} at rate {rate:g}',
            f'gains below {OSCILLATING * rate:g}; the largest sensible one is {rate:g}',
        )
    return K


def gain_share(K: Matrix, period: float) -> float:
    """Largest eigenvalue of a gain matrix (k, k) times the period, ``K·dt``; 0 without a period.

    A step leaves the part ``1 - K dt`` of the error, which is larger than before from 2 on.
    """
    if not np.isfinite(period):
        return 0.0
    return float(np.abs(np.linalg.eigvals(K)).max(initial=0.0) * period)


def checked_speeds(values: Sequence[float] | Vector, groups: int) -> Vector:
    """Largest speeds (groups,) from one value or one per group."""
    if len(values) not in (1, groups):
        refuse_number('max_speed', values, '1 value' if groups == 1 else f'1 or {groups} values')
    speeds = np.array(values, dtype=float)
    if not np.all((speeds > 0.0) & (speeds <= LARGEST)):
        raise InvalidValue('max_speed', shown(speeds), f'numbers above 0 and up to {LARGEST:g}')
    return np.broadcast_to(speeds, groups).copy()


def refuse_number(key: str, values: Sequence[float] | Vector, accepts: str) -> NoReturn:
    """Refuse values because of their number."""
    raise InvalidValue(key, f'{plural(len(values), "value")} {shown(values)}', accepts)


def _finite(key: str, values: Sequence[float] | Vector) -> Vector:
    array = np.array(values, dtype=float)
    if not np.all(np.isfinite(array)):
        raise InvalidValue(key, shown(array), 'finite numbers')
    return array
