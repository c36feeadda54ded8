"""The interface of every solver, and what all of them share."""

from __future__ import annotations

from abc import ABC
from collections.abc import Callable, Sequence
from itertools import chain
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from tp_controller.errors import InvalidValue, listed, plural, shown
from tp_controller.objectives import Objective
from tp_controller.solvers.bounded import BoundedRecursion
from tp_controller.solvers.findings import Findings
from tp_controller.solvers.inverses import DEFAULT, ONE_SIDED, Inverse
from tp_controller.solvers.problem import Bounds, Curvature, Levels, Rows

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]

SATURATIONS = ('null_space', 'uniform')

RANK_TOLERANCE = 1e-8
"""Singular values below this share of ‖J‖ (Frobenius) do not count towards the rank."""


class Solver(ABC):
    """Resolves levels of task velocities into one joint velocity.

    A solver arranges the rows of the levels in groups and inverts each group in the null
    space of those before it. The schemes differ in the arrangement only.

    Parameters
    ----------
    n
        Number of joints.
    inverse
        How Jacobians are inverted; what it leaves open is that of `DEFAULT`.
    joint_weights
        Symmetric positive matrix W (n, n) row by row, its diagonal (n,) or one value: among
        all answers the one with the smallest ``qdᵀ W qd`` is taken. Singular values are
        then those of ``J L⁻ᵀ`` with ``W = L Lᵀ`` (Whitney 1969; Siciliano et al. 2009,
        section 3.5.1).
    objective
        Function of the configuration to be made large, for the schemes that use one.
    saturation
        What is done at the velocity limits. ``null_space``: joints are held at their limits,
        others make up for them, and only what is infeasible is scaled, the lowest levels first.
        ``uniform``: the whole velocity is scaled, so its direction is kept, and every level
        pays for what any of them asks. At the ends of their ranges joints are held with both.

    Raises
    ------
    InvalidValue
        For an inverse, weights, an objective or a saturation that cannot be used.
    """

    type: ClassVar[str]
    """Name of the solver in parameter files."""
    settles: ClassVar[bool] = False
    """Whether levels that cannot get what they ask for are settled, see `settling`."""
    one_by_one: ClassVar[bool] = False
    """Whether levels are resolved one by one, each in the freedom that those above leave."""
    compiled: ClassVar[bool] = False
    """Whether compiled code alone computes the answer, which does not warn of overflows."""
    proven: bool = True
    """Whether the last answer is known to be what the scheme promises."""

    def __init__(
        self,
        n: int,
        inverse: Inverse = DEFAULT,
        joint_weights: Sequence[float] | None = None,
        objective: Objective | None = None,
        saturation: str = SATURATIONS[0],
    ) -> None:
        self.n = n
        self.objective = objective
        inverse.check('solver')
        self._inverse = inverse.over(DEFAULT)
        self._joint_weights, self._saturation = joint_weights, saturation
        self._basis = _basis(n, joint_weights)
        self._tolerance = RANK_TOLERANCE * float(np.linalg.norm(self._basis, 2))
        self._groups: Levels = ()
        if saturation not in SATURATIONS:
            accepts = f'one of {listed(SATURATIONS)}'
            raise InvalidValue('solver.saturation', shown(saturation), accepts)
        self.holds_joints = saturation == 'null_space'

    @property
    def inverse(self) -> Inverse:
        """How Jacobians are inverted, unless a task has its own way."""
        return self._inverse

    @property
    def settings(self) -> dict[str, Any]:
        """Arguments with which `tp_controller.solve` resolves by the same scheme.

        The objective is missing: `solve` takes its gradient.
        """
        return {
            'scheme': self.type,
            'inverse': self._inverse.type,
            'damping': self._inverse.damping,
            'singular_region': self._inverse.region,
            'joint_weights': self._joint_weights,
            'saturation': self._saturation,
        }

    def findings(self) -> Findings | None:
        """What is known of the last answer; None unless levels are resolved one by one."""
        if not self.one_by_one:
            return None
        return Findings(
            self.metric,
            self.rules,
            self.shares,
            self.stops.copy(),
            self.held.copy(),
            self.acting.copy(),
            self.scale,
        )

    @property
    def groups(self) -> Levels:
        """Tasks that are inverted together, in the order in which that is done."""
        return self._groups

    @property
    def shares(self) -> Vector:
        """What held joints left to each group (groups,) in the last step; a copy."""
        assert self._set is not None
        return self._set.shares[: len(self._groups)].copy()

    @property
    def held(self) -> NDArray[np.bool_]:
        """Which joints the last step held at the bound that their range sets (n,); a copy."""
        return self.stops >= 0

    @property
    def stops(self) -> NDArray[np.int64]:
        """First level that the last step kept each joint at a bound for (n,), -1 if none."""
        assert self._set is not None
        return self._set.stops

    @property
    def scale(self) -> float:
        """What uniform scaling left of the last step's velocity."""
        assert self._set is not None
        return self._set.scale

    @property
    def metric(self) -> Matrix:
        """T (n, n) with ``qd = T y`` and the norm of y to be minimised; a copy."""
        return self._basis.T.copy()

    @property
    def damping(self) -> float:
        """λ of the damped least squares, at least 0.

        A new value is not checked against the levels; `check` does that beforehand.
        """
        assert self._inverse.damping is not None
        return self._inverse.damping

    @damping.setter
    def damping(self, value: float) -> None:
        inverse = self._inverse._replace(damping=float(value))
        inverse.check('solver')
        self._inverse = inverse
        self._set_rules()

    def check(self, levels: Levels, damping: float | None = None) -> None:
        """Check that the levels can be resolved.

        Parameters
        ----------
        levels
            Tasks by level, highest first.
        damping
            λ that the solver is to have; the present one when left out.

        Raises
        ------
        InvalidValue
            If tasks that are inverted together are to be inverted in different ways, or
            the number of rows does not suit the scheme.
        """
        shared = self._inverse if damping is None else self._inverse._replace(damping=damping)
        for group in self.arrange(levels):
            leading = _leading(group)
            for task in group:
                own = task.inverse != Inverse() or not task.one_sided
                if own and task.inverse.over(shared).rule != leading.inverse.over(shared).rule:
                    raise InvalidValue(
                        'hierarchy',
                        f'{task.name} with another inverse, damping or singular_region than '
                        f'{leading.name}',
                        f'the same for both: solver.type {self.type} inverts them together',
                    )

    def prepare(
        self, levels: Levels, jacobian_at: Callable[[Vector], Matrix] | None = None
    ) -> None:
        """Get ready for levels.

        Parameters
        ----------
        levels
            Tasks by level, highest first; they pass `check`. None while the hierarchy is empty:
            nothing is to be solved then.
        jacobian_at
            Stacked Jacobian (K, n) of all levels at a configuration (n,), for schemes that
            need its derivative.
        """
        # Compiled, or loaded, when levels are there that can be resolved: nobody waits for a
        # compiler to be told of a mistake, and a simulator never needs it.
        from tp_controller.solvers import kernel

        self._kernel = kernel
        self._groups = self.arrange(levels)
        self._jacobian_at = jacobian_at
        sizes = [sum(task.k for task in group) for group in self._groups]
        self._starts = np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64)
        self.k = int(self._starts[-1])
        tasks = [task for group in self._groups for task in group]
        sides = [np.full(task.k, task.one_sided) for task in tasks]
        self._one_sided = np.flatnonzero(np.concatenate([*sides, np.zeros(0, dtype=bool)]))
        self.acting: NDArray[np.bool_] = np.zeros(self.k, dtype=np.bool_)
        self._equal = np.ones(self.k, dtype=np.bool_)
        self._equal[self._one_sided] = False
        self._set_rules()

    def _set_rules(self) -> None:
        rules = [self._rule(group) for group in self._groups]
        self._rules = np.array(rules, dtype=float).reshape(-1, 2)
        # Made at the next step: a scheme may add levels of its own until then.
        self._set: BoundedRecursion | None = None

    def _rule(self, group: Sequence[Rows]) -> tuple[float, float]:
        task = _leading(group)
        return task.inverse.over(ONE_SIDED if task.one_sided else self._inverse).rule

    @property
    def rules(self) -> Matrix:
        """λ and ε of every group (groups, 2), see `Inverse.rule`; a copy."""
        return self._rules[: len(self._groups)].copy()

    def arrange(self, levels: Levels) -> Levels:
        """Groups of tasks that are inverted together; all of them unless overridden."""
        return [list(chain.from_iterable(levels))] if levels else []

    def solve(
        self,
        J: Matrix,
        velocity: Vector,
        bounds: Bounds,
        qd: Vector,
        curvature: Curvature | None = None,
    ) -> float:
        """Write the joint velocity (n,) that answers the levels to ``qd``.

        Which rows of one-sided tasks decide on it is then in ``acting`` (K,).

        Parameters
        ----------
        J
            Task Jacobians of all levels (K, n), highest first; rows of zeros ask for nothing.
        velocity
            Desired task velocities (K,), of one-sided tasks the least ones. Gain terms are made
            smaller where joints could not brake at their targets.
        bounds
            Between what the joints may move.
        curvature
            What the approach to targets within limits of acceleration needs, and, for schemes
            that settle levels which cannot get what they ask for, second derivatives; left out,
            there are the published laws alone.

        Returns
        -------
        float
            The factor from 0 to 1 that the limits cost: of the whole velocity, or with
            saturation in the null space of the level that lost most.

        Raises
        ------
        numpy.linalg.LinAlgError
            If a Jacobian is not finite or leaves the range of floats.
        """
        return self._resolve(J, velocity, bounds, qd, curvature)

    def _resolve(
        self,
        J: Matrix,
        velocity: Vector,
        bounds: Bounds,
        qd: Vector,
        curvature: Curvature | None = None,
    ) -> float:
        if self._set is None:
            self._set = self._recursion_inside_bounds(self.holds_joints)
        scale = self._set.resolve(J, velocity, bounds, qd, curvature, self.settles)
        if self._one_sided.size:
            # Nothing but one-sided rows, and joints, can have stopped a level.
            np.greater_equal(self._set.row_stops[: self.k], 0, out=self.acting)
        return scale

    def _recursion_inside_bounds(self, holds_joints: bool) -> BoundedRecursion:
        return BoundedRecursion(
            self._kernel,
            self._starts,
            self._rules,
            self._one_sided,
            self._basis,
            self._tolerance,
            holds_joints,
        )


def _leading(group: Sequence[Rows]) -> Rows:
    """Task whose inverse is that of all: the first that always acts, if there is one."""
    return next((task for task in group if not task.one_sided), group[0])


def _basis(n: int, joint_weights: Sequence[float] | None) -> Matrix:
    """Rows (n, n) of L⁻¹ with W = L Lᵀ: joint velocities of unit size in the metric W."""
    if joint_weights is None:
        return np.eye(n)
    key, W = 'solver.joint_weights', np.array(joint_weights, dtype=float)
    if W.size not in (1, n, n * n):
        accepts = '1 value' if n == 1 else f'1, {n} or {n * n} values'
        raise InvalidValue(
            key,
            f'{plural(W.size, "value")} {shown(W)}',
            f'{accepts} (for all joints, per joint, a matrix)',
        )
    W = W.reshape(n, n) if W.size == n * n else np.diag(np.broadcast_to(W, (n,)))
    accepts = 'values above 0, or a symmetric positive definite matrix'
    if not np.isfinite(W).all() or not np.array_equal(W, W.T):
        raise InvalidValue(key, shown(joint_weights), accepts)
    try:
        return np.ascontiguousarray(np.linalg.inv(np.linalg.cholesky(W)))
    except np.linalg.LinAlgError:
        raise InvalidValue(key, shown(joint_weights), accepts) from None
