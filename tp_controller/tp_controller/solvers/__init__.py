"""Ways to resolve a hierarchy of task velocities into joint velocities."""

from tp_controller.solvers.base import Equations, Solver
from tp_controller.solvers.recursive import RecursiveSolver

SOLVER_TYPES: dict[str, type[Solver]] = {RecursiveSolver.type: RecursiveSolver}
"""Solver classes by the ``solver.type`` of parameter files."""

__all__ = ['SOLVER_TYPES', 'Equations', 'RecursiveSolver', 'Solver']
