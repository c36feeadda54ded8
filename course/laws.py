"""The laws of the course in plain numpy: inverses, the recursion over levels, bounds.

A level is a pair ``(J, v)``: a Jacobian (k, n) and the task velocity (k,) that the level asks
for. Levels are listed with the highest priority first.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]
Levels = Sequence[tuple[Matrix, Vector]]

RANK = 1e-8
"""Singular values below this share of ‖J‖ count as zero."""


def damped(s: Vector, damping: float, region: float = np.inf) -> Vector:
    """Factors that take the place of 1 / s in the inverse of a Jacobian.

    ``s / (s² + λ² max(0, 1 - (s/ε)²))``: the pseudo-inverse for λ = 0, constant damping for an
    infinite ε, damping near singularities alone for a finite one (Nakamura and Hanafusa 1986,
    Wampler 1986, Maciejewski and Klein 1988).

    Parameters
    ----------
    s
        Singular values above zero.
    damping, region
        λ and ε, in the units of s.
    """
    if not damping:
        return 1.0 / s
    return s / (s**2 + damping**2 * np.maximum(0.0, 1.0 - (s / region) ** 2))


def inverse(J: Matrix, damping: float = 0.0, region: float = np.inf) -> Matrix:
    """Pseudo-inverse (n, k) of a Jacobian (k, n), damped if λ is above 0; see `damped`."""
    U, s, Vt = np.linalg.svd(J, full_matrices=False)
    clear = s > RANK * np.linalg.norm(J)
    return (Vt[clear].T * damped(s[clear], damping, region)) @ U[:, clear].T


def recursion(
    levels: Levels, damping: float = 0.0, region: float = np.inf, n: int | None = None
) -> Vector:
    """Joint velocity (n,) of levels in strict order (Siciliano and Slotine 1991).

    From ``P = I`` and ``qd = 0``, for every level::

        J_bar = J P
        qd += J_bar† (v - J qd)
        P -= J_bar⁺ J_bar

    P is kept as ``N Nᵀ`` with an orthonormal basis N of the freedom that is left.
    """
    n = levels[0][0].shape[1] if n is None else n
    qd, N = np.zeros(n), np.eye(n)
    for J, v in levels:
        if not N.shape[1]:
            break
        U, s, Vt = np.linalg.svd(J @ N)
        rank = int((s > RANK * np.sqrt(np.vdot(J, J))).sum())
        if rank:
            gap = U[:, :rank].T @ (v - J @ qd)
            qd = qd + N @ (Vt[:rank].T @ (damped(s[:rank], damping, region) * gap))
            N = N @ Vt[rank:].T
    return qd


def stacked(levels: Levels, damping: float = 0.0, region: float = np.inf) -> Vector:
    """Joint velocity (n,) of all levels inverted at once: the augmented Jacobian."""
    J = np.vstack([level[0] for level in levels])
    return inverse(J, damping, region) @ np.concatenate([level[1] for level in levels])


def optimum_level(
    q: Vector,
    jacobian: Callable[[Vector], Matrix],
    gradient: Callable[[Vector], Vector],
    gain: float,
    step: float = 1e-6,
) -> tuple[Matrix, Vector]:
    """Level that brings an objective H to its optimum in the null space of J (Baillieul 1985).

    The condition is ``g(q) = Zᵀ ∇H = 0`` with ``J Z = 0``; its derivative
    ``Zᵀ ∂(∇H - Jᵀ μ)/∂q``, with ``μ = (J⁺)ᵀ ∇H`` held, comes from central differences.
    """
    J, slope = jacobian(q), gradient(q)
    Z = np.linalg.svd(J)[2][len(J) :]
    mu = inverse(J).T @ slope
    columns = []
    for move in step * np.eye(q.size):
        ahead = gradient(q + move) - mu @ jacobian(q + move)
        behind = gradient(q - move) - mu @ jacobian(q - move)
        columns.append((ahead - behind) / (2.0 * step))
    return Z @ np.array(columns).T, -gain * (Z @ slope)


def scaled(qd: Vector, limit: Vector) -> tuple[Vector, float]:
    """Scale a joint velocity (n,) until no component exceeds its limit (n,); and the factor."""
    scale = 1.0 / max(1.0, float(np.max(np.abs(qd) / limit)))
    return np.clip(qd * scale, -limit, limit), scale


def with_rows(
    rows: Levels, levels: Levels, solve: Callable[[Levels], Vector]
) -> tuple[Vector, list[int]]:
    """Joint velocity (n,) that keeps inequality rows ``C qd >= least`` above the levels.

    The levels are solved without the rows. As long as a row is broken, the row that is broken
    most becomes an equality above the levels.

    Returns
    -------
    Vector, list[int]
        The joint velocity, and the rows that decide.
    """
    active: list[int] = []
    if not rows:
        return solve(levels), active
    while True:
        qd = solve([*(rows[i] for i in active), *levels])
        gaps = [float((least - C @ qd)[0]) / np.linalg.norm(C) for C, least in rows]
        left = [i for i in range(len(rows)) if i not in active and gaps[i] > 1e-9]
        if not left:
            return qd, active
        active.append(max(left, key=gaps.__getitem__))


def best_in_bounds(levels: Levels, low: Vector, high: Vector) -> Vector:
    """Joint velocity (n,) in bounds that loses as little as possible, level by level.

    The hierarchical quadratic program of `solver.type: hqp` (Escande, Mansard and Wieber 2014),
    solved by trying every set of joints at their bounds: 3ⁿ of them. Only small arms can afford
    that.
    """
    n = low.size
    free = recursion(levels)
    if np.all((free >= low - 1e-12) & (free <= high + 1e-12)):
        return free
    best, cost = free, None
    for sides in itertools.product((0, -1, 1), repeat=n):
        held = np.array(sides) != 0
        qd = np.where(np.array(sides) < 0, low, np.where(held, high, 0.0))
        if not held.all():
            inside = [(J[:, ~held], v - J[:, held] @ qd[held]) for J, v in levels]
            qd[~held] = recursion(inside)
        if np.any((qd < low - 1e-9) | (qd > high + 1e-9)):
            continue
        losses = [float(np.linalg.norm(v - J @ qd)) for J, v in levels]
        losses.append(float(np.linalg.norm(qd)))
        if cost is None or _less(losses, cost):
            best, cost = qd, losses
    return np.clip(best, low, high)


def _less(first: Sequence[float], second: Sequence[float]) -> bool:
    """Whether the first losses come before the second ones, level by level."""
    for one, other in zip(first, second, strict=True):
        if abs(one - other) > 1e-9:
            return one < other
    return False
