"""What each level asked for, what it got, and where the rest went."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tp_controller.solvers import HQPSolver, RecursiveSolver
from tp_controller.solvers.base import RANK_TOLERANCE
from tp_controller.stack import Stack

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]

NAMED = 0.01
"""A level above that blocks less than this share of what a level lost is not named."""
SETTLED = 1e-3
"""Share of the length of the rows up to which a singular value counts as lost by settling."""
TOLD = 1e-6
"""Losses [m/s, rad/s] up to this one are not put into words."""


class Explanation(NamedTuple):
    """Why a level did not get all that it asked for in the last step.

    ``requested - achieved`` is the sum of five vectors; their norms are given here, in the
    units of the task.
    """

    tasks: tuple[str, ...]
    """Names of the level's tasks."""
    rows: int
    """How many of its rows act."""
    rank: int
    """In how many directions the freedom that was left can move them."""
    smallest_singular_value: float
    """Of these directions; infinite if there is none."""
    shortfall: float
    """``‖requested - achieved‖``."""
    lost_to_levels: Mapping[str, float]
    """To levels above, by their tasks' names, and to joints at their bounds: what would need
    freedom that they have taken."""
    lost_to_singularity: float
    """What no joint could move, even without levels above."""
    lost_to_damping: float
    """What the damped inverse held back."""
    lost_to_saturation: float
    """What the velocity limits cost."""
    lost_to_guard: float
    """What acceleration limits and the safety filter cost."""

    @property
    def text(self) -> str:
        """The losses in words, the largest first; empty if there is none to speak of."""
        losses = [(amount, name) for name, amount in self.lost_to_levels.items()]
        losses += [
            (self.lost_to_singularity, 'a singularity'),
            (self.lost_to_damping, 'damping'),
            (self.lost_to_saturation, 'velocity limits'),
            (self.lost_to_guard, 'acceleration limits or braking'),
        ]
        told = sorted((loss for loss in losses if loss[0] > TOLD), reverse=True)
        return ', '.join(f'{amount:.3g} to {cause}' for amount, cause in told)


def explain(stack: Stack) -> tuple[Explanation, ...]:
    """Explain the last step, level by level, highest first.

    For telling people, not for control: it costs two singular value decompositions a level.

    Returns
    -------
    tuple
        One entry per level; none with a solver that does not resolve levels one by one, or
        while the stack is `Stack.resting`.
    """
    return tuple(explanations(stack))


def explanations(stack: Stack) -> Iterator[Explanation]:
    """Explain the last step as `explain`, one level at a time; further steps do not matter."""
    solver = stack.solver
    if stack.resting or not isinstance(solver, RecursiveSolver | HQPSolver):
        return
    # Loaded by the solver already; at the top it would be loaded to refuse a parameter file.
    from tp_controller.solvers.directions import STILL

    # A level that settles stays near the singularity that it has lost a direction to.
    settles = stack.settle and solver.settles
    tolerance = SETTLED if settles else RANK_TOLERANCE
    T = solver.metric
    size = float(np.linalg.norm(T, 2))
    free = np.eye(T.shape[0])
    above: list[tuple[str, Matrix]] = []
    ends = np.where(solver.held, 'range', 'limits')
    stops, scale = solver.stops.copy(), solver.scale
    rows = list(
        zip(
            list(solver.groups),
            solver.shares.copy(),
            solver.rules.copy(),
            stack.systems(),
            strict=True,
        )
    )
    for level, (group, share, (damping, region), system) in enumerate(rows):
        for joint in np.flatnonzero(stops == level):
            # A joint at its bound takes one direction, from this level on.
            _, _, Vt = np.linalg.svd(T[joint : joint + 1] @ free)
            above.append((f'the {ends[joint]} of {stack.robot.joints[joint]}', Vt[:1] @ free.T))
            free = free @ Vt[1:].T
        # Rows of a set-based task that are out have no Jacobian and ask for nothing.
        moved = np.linalg.norm(system.J, axis=1) > STILL
        acts = system.counts & (moved | (system.requested != 0.0))
        J = (system.J * moved[:, None])[acts] @ T
        answered = system.answered[acts]
        lost = system.requested[acts] - answered
        guarded = answered - system.achieved[acts]
        U, s, Vt = np.linalg.svd(J @ free)
        rank = int(np.count_nonzero(s > tolerance * size * np.linalg.norm(J)))
        U, s = U[:, :rank], s[:rank]
        passed = s * s / (s * s + damping**2 * np.maximum(0.0, 1.0 - (s / region) ** 2))
        # Scaling shortened everything alike after the last level.
        shortened = answered / scale - answered
        # Of each direction's wish the level got its share, less what damping held back.
        missed = U.T @ (lost - shortened)
        wish = np.zeros(rank)
        np.divide(missed, 1.0 - share * passed, out=wish, where=share * passed < 1.0)
        saturated = U @ ((1.0 - share) * wish)
        damped = U @ missed - saturated
        saturated += shortened
        blocked = lost - damped - saturated
        reach = _range(J, size)
        reachable = reach @ (reach.T @ blocked)
        name = ' + '.join(task.name for task in group)
        yield Explanation(
            tuple(task.name for task in group),
            int(acts.sum()),
            rank,
            float(s[-1]) if rank else np.inf,
            float(np.linalg.norm(lost + guarded)),
            _shares_of(above, J.T @ reachable, float(np.linalg.norm(reachable))),
            float(np.linalg.norm(blocked - reachable)),
            float(np.linalg.norm(damped)),
            float(np.linalg.norm(saturated)),
            float(np.linalg.norm(guarded)),
        )
        above.append((name, Vt[:rank] @ free.T))
        free = free @ Vt[rank:].T


def _range(J: Matrix, size: float) -> Matrix:
    """Orthonormal columns that span what the joints could move without levels above."""
    U, s, _ = np.linalg.svd(J, full_matrices=False)
    return U[:, s > RANK_TOLERANCE * size * np.linalg.norm(J)]


def _shares_of(
    above: Sequence[tuple[str, Matrix]], wanted: Vector, amount: float
) -> dict[str, float]:
    """Split an amount among the levels above by how much of a joint motion they have taken."""
    taken = {name: float(np.sum((rows @ wanted) ** 2)) for name, rows in above}
    total = sum(taken.values())
    if amount <= TOLD or total == 0.0:
        return {}
    shares = {name: part / total for name, part in taken.items()}
    return {name: amount * part**0.5 for name, part in shares.items() if part >= NAMED}
