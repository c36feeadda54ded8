"""Task augmentation."""

from __future__ import annotations

from tp_controller.solvers.base import Solver


class AugmentedSolver(Solver):
    """All levels stacked and inverted at once, whatever their order.

    ``qd = [J₁; J₂; …]† [v₁; v₂; …]``. Where each level could be met but not all together (an
    algorithmic singularity) the damping spreads the error over all of them (Egeland 1987;
    Sciavicco and Siciliano 1988).
    """

    type = 'augmented'
