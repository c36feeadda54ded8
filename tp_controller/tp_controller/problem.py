"""Levels of anybody's Jacobians, resolved in one call, without a robot or tasks."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import chain
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tp_controller.errors import InvalidValue, shown
from tp_controller.objectives import Objective
from tp_controller.robot import Robot
from tp_controller.solvers import DEFAULT, SATURATIONS, Bounds, Inverse, solver_of

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]

AT_BOUND = 1e-9
"""A joint [rad/s, m/s] or a row of unit length this near to its bound is at it."""


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
    weight: float = 1.0
    """Weight in the scheme ``weighted``."""
    inverse: Inverse = Inverse()
    """How the level is inverted; what is left open is taken from the arguments of `solve`."""


class LevelSolution(NamedTuple):
    """What one level asked for and got."""

    requested: Vector
    """Desired velocity of the equality rows (k,)."""
    achieved: Vector
    """Their velocity ``J qd`` (k,)."""
    share: float
    """``v·Jqd / v·v`` of the equality rows, from 0 to 1: how far they get along v; 1 if v is 0."""
    rates: Vector
    """Velocity ``C qd`` of the inequality rows (m,)."""
    active: NDArray[np.bool_]
    """Which inequality rows are at their least velocity or below (m,)."""


class Solution(NamedTuple):
    """Answer to a problem; its arrays are the caller's own."""

    velocity: Vector
    """Joint velocity (n,)."""
    levels: tuple[LevelSolution, ...]
    """One per level, highest first."""
    active_joints: NDArray[np.int64]
    """-1 for joints at ``low``, 1 at ``high``, 0 in between (n,)."""
    scale: float
    """What the bounds cost, from 0 to 1, see `Solver.solve`."""
    proven: bool
    """False if the scheme ``hqp`` found no proof of its optimum."""


def solve(
    levels: Sequence[Level | tuple[ArrayLike, ArrayLike]],
    low: ArrayLike | None = None,
    high: ArrayLike | None = None,
    scheme: str = 'recursive',
    *,
    inverse: str = 'dls',
    damping: float = 0.1,
    singular_region: float = 0.1,
    joint_weights: Sequence[float] | None = None,
    saturation: str = SATURATIONS[0],
    gradient: ArrayLike | None = None,
) -> Solution:
    """Resolve levels of velocities into one joint velocity.

    By the scheme ``recursive``, for every level, with ``P = I`` and ``qd = 0`` at first
    (Siciliano and Slotine 1991)::

        J_bar = J P
        qd += J_barᵀ (J_bar J_barᵀ + λ² I)⁻¹ (velocity - J qd)
        P -= J_bar⁺ J_bar

    inside the bounds, see `RecursiveSolver`; docs/schemes.md describes the others.

    Parameters
    ----------
    levels
        Levels, highest priority first, in any consistent units; a pair stands for
        ``Level(J, velocity)``.
    low, high
        Bounds of the joint velocities (n,), one value or one per joint; infinite when left out.
    scheme
        A key of `SOLVER_TYPES`.
    inverse, damping, singular_region
        ``dls``, ``pinv`` or ``adaptive``, λ and ε, see `Inverse`. The default, ``dls`` with 0.1,
        falls short of what is asked for by about ``λ² / s²`` for a singular value s; ``pinv``
        does not.
    joint_weights, saturation
        As `Solver`. ``uniform`` needs bounds with ``low = -high``.
    gradient
        Joint velocity (n,) that the scheme ``projected_gradient`` approaches in the freedom that
        all levels leave.

    Returns
    -------
    Solution
        The joint velocity, and what every level got.

    Raises
    ------
    InvalidValue
        For arrays of a wrong shape, numbers that are not finite or leave the range of floats,
        bounds that exclude each other, an unknown scheme, or levels that it cannot resolve.
    """
    parts = [_checked(f'levels[{i}]', level) for i, level in enumerate(levels)]
    if not parts:
        raise InvalidValue('levels', 'no level', 'one or more')
    n = parts[0].n
    for i, part in enumerate(parts):
        if part.n != n:
            got = f'{part.n} columns, levels[0] has {n}'
            raise InvalidValue(f'levels[{i}]', got, 'as many columns on every level')
    lower, upper = _bounds(low, high, n)
    if saturation == 'uniform' and not np.array_equal(lower, -upper):
        got = f'low {shown(lower)}, high {shown(upper)}'
        raise InvalidValue('low', got, 'low = -high, with saturation uniform')
    objective = None if gradient is None else _Slope(_array('gradient', gradient, (n,)))
    solver = solver_of(
        scheme,
        n,
        inverse=Inverse(inverse, damping, singular_region).over(DEFAULT),
        joint_weights=joint_weights,
        objective=objective,
        saturation=saturation,
    )
    rows = [part.rows(f'level_{i}') for i, part in enumerate(parts)]
    solver.check(rows)
    if objective is not None and scheme == 'extended_jacobian':
        raise InvalidValue('gradient', 'a value', f'none, with the scheme {scheme}')
    solver.prepare(rows)
    J = np.vstack(list(chain.from_iterable((part.J, part.C) for part in parts)))
    asked = np.concatenate(list(chain.from_iterable((p.velocity, p.least) for p in parts)))
    qd = np.zeros(n)
    endless = np.full(n, np.inf)
    bounds = Bounds(np.maximum(np.abs(lower), np.abs(upper)), -endless, endless, lower, upper)
    try:
        with np.errstate(over='ignore', invalid='ignore'):
            scale = solver.solve(J, asked, bounds._replace(ranged=False), qd)
    except np.linalg.LinAlgError:
        raise InvalidValue('levels', 'numbers beyond the range of floats', 'others') from None
    return Solution(
        qd,
        tuple(part.solution(qd) for part in parts),
        (qd >= upper - AT_BOUND).astype(np.int64) - (qd <= lower + AT_BOUND),
        scale,
        solver.proven,
    )


class _Part(NamedTuple):
    """A level whose arrays were checked and copied."""

    J: Matrix
    velocity: Vector
    C: Matrix
    least: Vector
    weight: float
    inverse: Inverse

    @property
    def n(self) -> int:
        return self.J.shape[1]

    def rows(self, name: str) -> list[_Equalities]:
        """What a solver has to know, one entry for each kind of rows that the level has."""
        kinds = ((_Equalities, self.velocity.size), (_Inequalities, self.least.size))
        return [kind(name, k, self.inverse, self.weight) for kind, k in kinds if k]

    def solution(self, qd: Vector) -> LevelSolution:
        achieved, rates = self.J @ qd, self.C @ qd
        square = float(self.velocity @ self.velocity)
        share = float(self.velocity @ achieved) / square if square > 0.0 else 1.0
        slack = AT_BOUND * np.maximum(1.0, np.sqrt((self.C * self.C).sum(axis=1)))
        return LevelSolution(
            self.velocity, achieved, min(max(share, 0.0), 1.0), rates, rates <= self.least + slack
        )


class _Equalities:
    """Rows with a desired velocity, as a solver sees them."""

    set_based: ClassVar[bool] = False
    one_sided: bool = False

    def __init__(self, name: str, k: int, inverse: Inverse, weight: float) -> None:
        self.name, self.k, self.inverse, self.weight = name, k, inverse, weight


class _Inequalities(_Equalities):
    """Rows with a least velocity."""

    set_based = True
    one_sided = True


class _Slope(Objective):
    """An objective of which only the gradient is known."""

    type = 'gradient'
    parameters: ClassVar[Mapping[str, Any]] = {}

    def __init__(self, gradient: Vector) -> None:
        self._gradient, self.gain = gradient, 1.0

    @classmethod
    def from_parameters(cls, robot: Robot, values: Mapping[str, Any]) -> _Slope:
        raise NotImplementedError

    @property
    def value(self) -> float:
        return math.nan

    def gradient(self, out: Vector) -> None:
        out[:] = self._gradient


def _checked(key: str, level: Level | tuple[ArrayLike, ArrayLike]) -> _Part:
    J, velocity, C, least, weight, inverse = Level(*level)
    first, asked = _rows(f'{key}.J', J, f'{key}.velocity', velocity)
    second, rates = _rows(f'{key}.C', C, f'{key}.least', least)
    if not asked.size + rates.size:
        raise InvalidValue(key, 'no rows', 'J with velocity, C with least, or both')
    if first.shape[1] != second.shape[1]:
        if asked.size and rates.size:
            got = f'{second.shape[1]} columns, J has {first.shape[1]}'
            raise InvalidValue(f'{key}.C', got, 'as many')
        n = (first if asked.size else second).shape[1]
        first, second = first.reshape(-1, n), second.reshape(-1, n)
    if not 0.0 < weight < math.inf:
        raise InvalidValue(f'{key}.weight', shown(weight), 'a number above 0')
    try:
        inverse.check(key)
    except AttributeError:
        raise InvalidValue(f'{key}.inverse', shown(inverse), 'an Inverse') from None
    return _Part(first, asked, second, rates, weight, inverse)


def _rows(
    key: str, J: ArrayLike | None, name: str, velocity: ArrayLike | None
) -> tuple[Matrix, Vector]:
    """Copies of a Jacobian (k, n) and of one velocity per row (k,)."""
    if J is None and velocity is None:
        return np.zeros((0, 0)), np.zeros(0)
    if J is None or velocity is None:
        missing = key if J is None else name
        raise InvalidValue(missing, 'no value', f'{key} and {name} together')
    jacobian = _array(key, J)
    if jacobian.ndim == 1:
        jacobian = jacobian[None]
    if jacobian.ndim != 2 or not jacobian.shape[1]:
        raise InvalidValue(key, f'shape {jacobian.shape}', 'shape (rows, joints)')
    asked = np.atleast_1d(_array(name, velocity))
    if asked.shape != jacobian.shape[:1]:
        got = f'shape {asked.shape} with {key} of shape {jacobian.shape}'
        raise InvalidValue(name, got, f'shape ({jacobian.shape[0]},)')
    return np.ascontiguousarray(jacobian), asked


def _array(key: str, values: ArrayLike, shape: tuple[int, ...] | None = None) -> Vector:
    """Copy of finite numbers."""
    array = _numbers(key, values)
    if not np.isfinite(array).all():
        raise InvalidValue(key, shown(array), 'finite numbers')
    if shape is not None and array.shape != shape:
        raise InvalidValue(key, f'shape {array.shape}', f'shape {shape}')
    return array


def _numbers(key: str, values: ArrayLike) -> Vector:
    try:
        return np.array(values, dtype=float)
    except (TypeError, ValueError):
        raise InvalidValue(key, shown(values), 'an array of numbers') from None


def _bounds(low: ArrayLike | None, high: ArrayLike | None, n: int) -> tuple[Vector, Vector]:
    """Lower and upper bounds (n,)."""
    found = []
    for key, values, absent in (('low', low, -np.inf), ('high', high, np.inf)):
        bound = _numbers(key, absent if values is None else values)
        if bound.shape not in ((), (1,), (n,)):
            raise InvalidValue(key, f'shape {bound.shape}', f'one value or shape ({n},)')
        if np.isnan(bound).any():
            raise InvalidValue(key, shown(bound), 'numbers')
        found.append(np.broadcast_to(bound, (n,)).copy())
    lower, upper = found
    if not ((lower <= upper) & (lower < np.inf) & (upper > -np.inf)).all():
        raise InvalidValue('low', f'{shown(lower)} with high {shown(upper)}', 'values up to high')
    return lower, upper
