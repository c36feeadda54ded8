"""Problems resolved in one call, without a robot or tasks."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import chain
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tp_controller.errors import InvalidValue, shown
from tp_controller.objectives import Objective
from tp_controller.problem import Level, LevelArrays, Problem, ProblemArrays, checked_array
from tp_controller.robot import Robot
from tp_controller.solvers import DEFAULT, SATURATIONS, Bounds, Findings, Inverse, solver_of
from tp_controller.solvers.problem import AT_BOUND

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]


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
    """Which inequality rows are at their least velocity or below (m,); rows of zeros are not,
    unless they ask for more than zero."""

    @classmethod
    def of(cls, level: LevelArrays, qd: Vector) -> LevelSolution:
        """What a joint velocity (n,) gives a level."""
        achieved, rates = level.J @ qd, level.C @ qd
        square = float(level.velocity @ level.velocity)
        share = float(level.velocity @ achieved) / square if square > 0.0 else 1.0
        squares = (level.C * level.C).sum(axis=1)
        slack = AT_BOUND * np.maximum(1.0, np.sqrt(squares))
        counts = (squares > 0.0) | (level.least > 0.0)
        return cls(
            level.velocity,
            achieved,
            min(max(share, 0.0), 1.0),
            rates,
            counts & (rates <= level.least + slack),
        )


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
    findings: Findings | None = None
    """What the solver noted for `explain`; None with schemes that do not resolve levels one by
    one."""


def solve(
    levels: Problem | Sequence[Level | tuple[ArrayLike, ArrayLike]],
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
        A `Problem`; or its levels, highest priority first, in any consistent units: a pair
        stands for ``Level(J, velocity)``.
    low, high
        Bounds of the joint velocities (n,), one value or one per joint; infinite when left out.
        A `Problem` has its own.
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
    if isinstance(levels, Problem):
        for key, bound in (('low', low), ('high', high)):
            if bound is not None:
                raise InvalidValue(
                    key, shown(bound), 'no value beside a Problem, which has its own'
                )
        problem = levels.arrays()
    else:
        problem = Problem(levels, low, high).arrays()
    n = problem.low.size
    if saturation == 'uniform' and not np.array_equal(problem.low, -problem.high):
        got = f'low {shown(problem.low)}, high {shown(problem.high)}'
        raise InvalidValue('low', got, 'low = -high, with saturation uniform')
    objective = None if gradient is None else _Slope(checked_array('gradient', gradient, (n,)))
    solver = solver_of(
        scheme,
        n,
        inverse=Inverse(inverse, damping, singular_region).over(DEFAULT),
        joint_weights=joint_weights,
        objective=objective,
        saturation=saturation,
    )
    rows = [_solver_rows(f'level_{i}', level) for i, level in enumerate(problem.levels)]
    solver.check(rows)
    if objective is not None and scheme == 'extended_jacobian':
        raise InvalidValue('gradient', 'a value', f'none, with the scheme {scheme}')
    solver.prepare(rows)
    J = np.vstack(list(chain.from_iterable((level.J, level.C) for level in problem.levels)))
    pairs = ((level.velocity, level.least) for level in problem.levels)
    asked = np.concatenate(list(chain.from_iterable(pairs)))
    qd, bounds = np.zeros(n), _solver_bounds(problem)
    try:
        with np.errstate(over='ignore', invalid='ignore'):
            scale = solver.solve(J, asked, bounds, qd)
    except np.linalg.LinAlgError:
        raise InvalidValue('levels', 'numbers beyond the range of floats', 'others') from None
    return Solution(
        qd,
        tuple(LevelSolution.of(level, qd) for level in problem.levels),
        bounds.met(qd),
        scale,
        solver.proven,
        solver.findings(),
    )


def _solver_bounds(problem: ProblemArrays) -> Bounds:
    firm = problem.range_low, problem.range_high
    return Bounds(
        np.maximum(np.abs(problem.low), np.abs(problem.high)),
        *firm,
        problem.low,
        problem.high,
        bool(np.isfinite(firm).any()),
        # That it is finite says which joints start from the last command.
        None if problem.start is None else np.ones_like(problem.start),
        problem.start,
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


def _solver_rows(name: str, level: LevelArrays) -> list[_Equalities]:
    """What a solver has to know, one entry for rows of one kind and weight."""
    k = level.velocity.size
    found: list[_Equalities] = []
    for kind, weights in ((_Equalities, level.weight[:k]), (_Inequalities, level.weight[k:])):
        ends = [*(np.flatnonzero(np.diff(weights)) + 1).tolist(), weights.size]
        first = 0
        for end in ends if weights.size else ():
            found.append(kind(name, end - first, level.inverse, float(weights[first])))
            first = end
    return found


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
