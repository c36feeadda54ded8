"""What each level asked for, what it got, and where the rest went."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tp_controller.errors import InvalidValue
from tp_controller.problem import Problem, checked_array
from tp_controller.solution import Solution
from tp_controller.solvers import Findings
from tp_controller.solvers.base import RANK_TOLERANCE

if TYPE_CHECKING:
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
    """Why a level did not get all that it asked for.

    Of the rows that act, ``requested - achieved`` is the sum of five vectors; their norms are
    given here, in the units of the task.
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
    requested: Vector
    """What every row asked for (k,): of equality rows the desired velocity, of inequality rows
    the least one. Equality rows come first if levels of a `Problem` are explained."""
    achieved: Vector
    """The velocity of every row (k,)."""
    active_rows: tuple[str, ...]
    """Names of the inequality rows that decided on the answer."""
    joints_at_bound: tuple[str, ...]
    """Names of the joints that this level moves and that are at a bound of their velocity."""
    singular_directions: Matrix
    """Unit vectors (d, k) of row velocities that no joint can move, even without levels above."""

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


class _Level(NamedTuple):
    """What is explained of a level; rows are in one order in all arrays."""

    tasks: tuple[str, ...]
    row_names: tuple[str, ...]
    """(k,)."""
    sided: NDArray[np.bool_]
    """Which rows are inequalities (k,)."""
    J: Matrix
    """(k, n)."""
    counts: NDArray[np.bool_]
    """Which rows were resolved (k,)."""
    requested: Vector
    answered: Vector
    """Velocity of the rows by the solver's answer (k,)."""
    achieved: Vector
    """Velocity of the rows by the command (k,)."""


def explain(
    problem: Problem, solution: Solution, command: ArrayLike | None = None
) -> tuple[Explanation, ...]:
    """Explain the answer to a problem, level by level, highest first.

    For telling people, not for control: it costs two singular value decompositions a level.

    Parameters
    ----------
    problem
        What was asked for.
    solution
        The answer of `solve` to it.
    command
        Joint velocity (n,) that was sent in its place, such as that of the safety filter; the
        answer itself when left out.

    Returns
    -------
    tuple
        One entry per level; none with a scheme that does not resolve levels one by one.

    Raises
    ------
    InvalidValue
        If the solution is that of another problem, or the command cannot be one.
    """
    arrays, findings = problem.arrays(), solution.findings
    n = arrays.low.size
    if findings is None:
        return ()
    rows = sum(level.velocity.size + level.least.size for level in arrays.levels)
    if findings.metric.shape[0] != n or findings.acting.size != rows:
        got = f'an answer for {findings.acting.size} rows and {findings.metric.shape[0]} joints'
        raise InvalidValue('solution', got, f"this problem's, {rows} rows and {n} joints")
    qd = solution.velocity
    sent = qd if command is None else checked_array('command', command, (n,))
    levels, first = [], 0
    for level in arrays.levels:
        J = np.vstack([level.J, level.C])
        sided = np.arange(len(J)) >= level.velocity.size
        acting = findings.acting[first : first + len(J)]
        requested = np.concatenate([level.velocity, level.least])
        levels.append(
            _Level(
                level.tasks,
                level.row_names,
                sided,
                J,
                ~sided | acting,
                requested,
                J @ qd,
                J @ sent,
            )
        )
        first += len(J)
    at_bound = solution.active_joints != 0
    return tuple(_explained(findings, levels, arrays.joints, at_bound, RANK_TOLERANCE))


def explain_step(stack: Stack) -> tuple[Explanation, ...]:
    """Explain the last step of a stack as `explain`, the safety filter included.

    There is nothing to explain while the stack is `Stack.resting`.
    """
    return tuple(explanations(stack))


def explanations(stack: Stack) -> Iterator[Explanation]:
    """Explain the last step of a stack, one level at a time; further steps do not matter."""
    solver = stack.solver
    findings = None if stack.resting else solver.findings()
    if findings is None:
        return
    levels = [
        _Level(
            tuple(task.name for task in tasks),
            tuple(f'{task.name} {name}' for task in tasks for name in task.components),
            np.repeat([task.one_sided for task in tasks], [task.k for task in tasks]),
            *system,
        )
        for tasks, system in zip(stack.members, stack.systems(), strict=True)
    ]
    # A level that settles stays near the singularity that it has lost a direction to.
    tolerance = SETTLED if stack.settle and solver.settles else RANK_TOLERANCE
    yield from _explained(findings, levels, stack.robot.joints, stack.at_bound, tolerance)


def _explained(
    findings: Findings,
    levels: Sequence[_Level],
    joints: Sequence[str],
    at_bound: NDArray[np.bool_],
    tolerance: float,
) -> Iterator[Explanation]:
    """Explain levels, highest first.

    Parameters
    ----------
    findings
        What the solver noted.
    levels
        The levels.
    joints
        Names of the joints (n,).
    at_bound
        Which joints are at a bound of their velocity (n,).
    tolerance
        Share of the size of the rows up to which a singular value counts as zero.
    """
    # Loaded by the solver already; at the top it would be loaded to refuse a parameter file.
    from tp_controller.solvers.directions import STILL

    T, scale = findings.metric, findings.scale
    size = float(np.linalg.norm(T, 2))
    free = np.eye(T.shape[0])
    above: list[tuple[str, Matrix]] = []
    ends = np.where(findings.held, 'range', 'limits')
    for i, level in enumerate(levels):
        share, (damping, region) = findings.shares[i], findings.rules[i]
        for joint in np.flatnonzero(findings.stops == i).tolist():
            # A joint at its bound takes one direction, from this level on.
            _, _, Vt = np.linalg.svd(T[joint : joint + 1] @ free)
            above.append((f'the {ends[joint]} of {joints[joint]}', Vt[:1] @ free.T))
            free = free @ Vt[1:].T
        # Rows of a set-based task that are out have no Jacobian and ask for nothing.
        moves = np.linalg.norm(level.J, axis=1) > STILL
        acts = level.counts & (moves | (level.requested != 0.0))
        J = (level.J * moves[:, None])[acts] @ T
        answered = level.answered[acts]
        lost = level.requested[acts] - answered
        guarded = answered - level.achieved[acts]
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
        reach, singular = _directions(J, size, tolerance)
        reachable = reach @ (reach.T @ blocked)
        unmoved = np.zeros((singular.shape[1], acts.size))
        unmoved[:, acts] = singular.T
        moved_joints = (np.abs(level.J[acts]) > STILL).any(axis=0)
        yield Explanation(
            level.tasks,
            int(acts.sum()),
            rank,
            float(s[-1]) if rank else np.inf,
            float(np.linalg.norm(lost + guarded)),
            _shares_of(above, J.T @ reachable, float(np.linalg.norm(reachable))),
            float(np.linalg.norm(blocked - reachable)),
            float(np.linalg.norm(damped)),
            float(np.linalg.norm(saturated)),
            float(np.linalg.norm(guarded)),
            level.requested,
            level.achieved,
            tuple(level.row_names[row] for row in np.flatnonzero(level.sided & acts).tolist()),
            tuple(joints[joint] for joint in np.flatnonzero(at_bound & moved_joints).tolist()),
            unmoved,
        )
        above.append((' + '.join(level.tasks), Vt[:rank] @ free.T))
        free = free @ Vt[rank:].T


def _directions(J: Matrix, size: float, tolerance: float) -> tuple[Matrix, Matrix]:
    """Orthonormal columns of what the joints can move without levels above, and of the rest."""
    U, s, _ = np.linalg.svd(J)
    rank = np.count_nonzero(s > tolerance * size * np.linalg.norm(J))
    return U[:, :rank], U[:, rank:]


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
