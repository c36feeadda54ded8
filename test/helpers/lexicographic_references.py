"""Random problems of levels in a box, and a cascade of quadratic programs that solves them."""

from itertools import pairwise
from typing import NamedTuple

import numpy as np
import quadprog

ROOM = 1e-11
"""What each level below leaves to the rounding of the ones above."""
PULL = 1e-6
"""Weight of the distance from the last iterate, which makes programs strictly convex."""


class Problem(NamedTuple):
    """Levels of rows in a box; see `LexicographicProblem`."""

    J: np.ndarray
    velocity: np.ndarray
    starts: np.ndarray
    one_sided: np.ndarray
    lower: np.ndarray
    upper: np.ndarray


def random_problem(seed):
    """Up to 9 joints and 6 levels with duplicate, dependent, contradicting and zero rows.

    Numbers are multiples of 1/64, so that what depends on each other does so exactly. Boxes may
    be tight, endless, beside zero or without room.
    """
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 10))
    rows, velocity, starts = [], [], [0]
    for _ in range(int(rng.integers(1, 7))):
        for _ in range(int(rng.integers(1, 6))):
            kind, follows = rng.random(), rng.random() < 0.5
            wish = int(rng.integers(-128, 129)) / 64
            row = rng.integers(-64, 65, size=n) / 64
            if rows and kind < 0.22:
                i, j = rng.integers(len(rows), size=2)
                a, b = (rng.choice([1, -1, 2]), 0) if kind < 0.12 else rng.integers(-2, 3, size=2)
                row = a * rows[i] + b * rows[j]
                wish = a * velocity[i] + b * velocity[j] if follows else wish
            elif kind < 0.28:
                row, wish = np.zeros(n), float(follows)
            elif kind < 0.4:
                row = np.eye(n)[rng.integers(n)] * rng.choice([1.0, -1.0])
            rows.append(row)
            velocity.append(wish)
        starts.append(len(rows))
    one_sided = rng.random(len(rows)) < rng.choice([0.0, 0.3, 0.6, 1.0])
    size = rng.choice([0.2, 0.5, 1.0, 3.0])
    upper = np.ceil(64 * size * rng.uniform(0.2, 1.0, n)) / 64
    lower = -np.ceil(64 * size * rng.uniform(0.2, 1.0, n)) / 64
    kind = rng.random(n)
    lower[kind < 0.1] = -np.inf
    upper[(kind > 0.05) & (kind < 0.15)] = np.inf
    beside = (kind > 0.85) & (kind < 0.9)
    lower[beside] = np.minimum(upper[beside], 1 / 32)
    lower[kind > 0.97] = upper[kind > 0.97]
    return Problem(np.array(rows), np.array(velocity), np.array(starts), one_sided, lower, upper)


def violation(problem, x):
    """By how much every row is missed (K,)."""
    missed = problem.velocity - problem.J @ x
    return np.where(problem.one_sided, np.maximum(missed, 0.0), missed)


def level_norms(problem, x):
    """Norm of the violation of every level."""
    return [
        float(np.linalg.norm(rows))
        for rows in np.split(violation(problem, x), problem.starts[1:-1])
    ]


def cascade(problem, metric=None):
    """Answer (n,) by one quadratic program after the other, each in a null space.

    Goldfarb and Idnani's method as in quadprog. Equalities and violated rows of the levels
    above are taken out of the variables, their satisfied one-sided rows are constraints.
    """
    J, velocity, starts, one_sided, lower, upper = problem
    n = J.shape[1]
    T = np.eye(n) if metric is None else metric
    fixed = lower == upper
    x = np.clip(np.zeros(n), lower, upper)
    N = np.eye(n)[:, ~fixed]
    sides = np.vstack([np.eye(n), -np.eye(n)])
    bounds = np.concatenate([lower, -upper])
    used = np.isfinite(bounds) & ~np.tile(fixed, 2)
    G, h = sides[used], bounds[used]
    for level, (start, stop) in enumerate(pairwise(starts)):
        A, v, sided = J[start:stop], velocity[start:stop], one_sided[start:stop]
        x = x + N @ _level(A @ N, v - A @ x, sided, G @ N, h - G @ x - ROOM * (level + 1))
        missed = v - A @ x
        settled = ~sided | (missed > 1e-6)
        N = N @ _null_space(A[settled] @ N)
        G = np.vstack([G, A[~settled]])
        h = np.concatenate([h, np.minimum(v, A @ x)[~settled]])
    N, x0 = np.linalg.solve(T, N), np.linalg.solve(T, x)
    z = _program(N.T @ N, -N.T @ x0, G @ T @ N, h - G @ x - ROOM * (len(starts) + 1))
    return T @ (x0 + N @ z)


def _level(A, v, sided, G, h):
    """Some z that minimises the squared violations of a level's rows while G z >= h."""
    m, slacks = A.shape[1], int(sided.sum())
    z = np.zeros(m)
    E, C = A[~sided], A[sided]
    H = np.zeros((m + slacks, m + slacks))
    H[:m, :m] = E.T @ E + PULL * np.eye(m)
    H[m:, m:] = np.eye(slacks)
    rows = np.vstack([np.hstack([G, np.zeros((len(G), slacks))]), np.hstack([C, np.eye(slacks)])])
    bounds = np.concatenate([h, v[sided]])
    for _ in range(200):
        pull = np.concatenate([E.T @ v[~sided] + PULL * z, np.zeros(slacks)])
        before, z = z, _program(H, pull, rows, bounds)[:m]
        if np.abs(z - before).max(initial=0.0) < 1e-12:
            break
    return z


def _program(H, pull, rows, bounds):
    """Minimise ``½ zᵀ H z - pullᵀ z`` while ``rows z >= bounds``."""
    clear = np.abs(rows).max(axis=1, initial=0.0) > 1e-10
    if not len(H):
        return np.zeros(0)
    if not clear.any():
        return np.linalg.solve(H, pull)
    return quadprog.solve_qp(H, pull, np.ascontiguousarray(rows[clear].T), bounds[clear])[0]


def _null_space(A):
    """Orthonormal columns that A takes to zero."""
    if not A.size:
        return np.eye(A.shape[1])
    _, s, Vt = np.linalg.svd(A)
    return Vt[int((s > 1e-9 * max(1.0, s[0])).sum()) :].T
