"""Ways to resolve a hierarchy of task velocities into joint velocities."""

from functools import partial
from typing import Any

from tp_controller.errors import InvalidValue, listed, shown
from tp_controller.plugins import Registry, check_class
from tp_controller.solvers.augmented import AugmentedSolver
from tp_controller.solvers.base import SATURATIONS, Solver
from tp_controller.solvers.extended_jacobian import ExtendedJacobianSolver
from tp_controller.solvers.findings import Findings
from tp_controller.solvers.hqp import HQPSolver
from tp_controller.solvers.inverses import DEFAULT, INVERSES, Inverse
from tp_controller.solvers.problem import Bounds, Curvature, Levels, Rows
from tp_controller.solvers.projected_gradient import ProjectedGradientSolver
from tp_controller.solvers.recursive import RecursiveSolver
from tp_controller.solvers.weighted import WeightedSolver

_OWN: tuple[type[Solver], ...] = (
    RecursiveSolver,
    AugmentedSolver,
    ExtendedJacobianSolver,
    WeightedSolver,
    ProjectedGradientSolver,
    HQPSolver,
)

SOLVER_TYPES: Registry[type[Solver]] = Registry(
    'tp_controller.solvers', {solver.type: solver for solver in _OWN}, partial(check_class, Solver)
)
"""Solver classes by the ``solver.type`` of parameter files; other packages may add some."""


def solver_of(scheme: str, n: int, **settings: Any) -> Solver:
    """Make the solver of a scheme.

    Parameters
    ----------
    scheme
        One of `SOLVER_TYPES`.
    n
        Number of joints.
    settings
        As `Solver`.

    Raises
    ------
    InvalidValue
        If there is no such scheme, or as `Solver`.
    """
    if scheme not in SOLVER_TYPES:
        raise InvalidValue('scheme', shown(scheme), f'one of {listed(SOLVER_TYPES)}')
    return SOLVER_TYPES[scheme](n, **settings)


__all__ = [
    'DEFAULT',
    'INVERSES',
    'SATURATIONS',
    'SOLVER_TYPES',
    'AugmentedSolver',
    'Bounds',
    'Curvature',
    'ExtendedJacobianSolver',
    'Findings',
    'HQPSolver',
    'Inverse',
    'Levels',
    'ProjectedGradientSolver',
    'RecursiveSolver',
    'Rows',
    'Solver',
    'WeightedSolver',
    'solver_of',
]
