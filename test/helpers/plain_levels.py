"""Levels of plain numbers for solvers, without a robot."""

from typing import NamedTuple

import numpy as np

from tp_controller.solvers import Bounds, Inverse


class Rows(NamedTuple):
    """Stands in for a task of a level."""

    name: str
    k: int
    inverse: Inverse = Inverse()
    weight: float = 1.0
    set_based: bool = False
    one_sided: bool = False


def resolve(solver, levels, limit=np.inf, **settings):
    """Joint velocity (n,) of a solver for levels (J, velocity), with a limit for every joint.

    Each of the settings of `Rows` has one value per level.
    """
    rows = [
        [Rows(f'level_{i}', len(velocity), **{key: values[i] for key, values in settings.items()})]
        for i, (_, velocity) in enumerate(levels)
    ]
    solver.check(rows)
    solver.prepare(rows)
    qd = np.full(solver.n, 7.0)
    solver.solve(
        np.vstack([J for J, _ in levels]),
        np.concatenate([velocity for _, velocity in levels]),
        Bounds.of_speed(np.broadcast_to(np.array(limit, dtype=float), qd.shape).copy()),
        qd,
    )
    return qd


def random_levels(seed, n, rows):
    """Levels of random numbers, with so many rows each."""
    rng = np.random.default_rng(seed)
    return [(rng.normal(size=(k, n)), rng.normal(size=k)) for k in rows]
