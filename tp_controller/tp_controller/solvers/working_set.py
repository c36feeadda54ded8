"""Levels resolved with the bounds that decide, and without the others."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from tp_controller.solvers.problem import Bounds, Curvature

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]

BROKEN = 1e-9
"""A bound that is missed by less than this, per length of its row, is not broken."""

TRIES = 2
"""A bound that has come in so often stays: two that take turns would go on for ever."""


class WorkingSet:
    """Resolves levels by the compiled recursion, with the bounds that are needed.

    Least rates of one-sided rows and the ranges of the joints are first left out. The one that
    the answer breaks most comes in as a row like any other, in the level where it stands or,
    for a joint's range, above all levels, and those that it has made needless go out again; until
    none is broken. An answer that just meets a bound is the same with its
    row and without it, so the command changes without a step when a row comes in.

    Parameters
    ----------
    kernel
        The module `tp_controller.solvers.kernel`, which is loaded late.
    starts
        First row of every level, then K (levels + 1,).
    rules
        λ and ε of every level (levels, 2).
    one_sided
        Indices of the rows whose velocities are the least ones allowed.
    basis, tolerance
        As `kernel.resolve`.
    holds_joints
        Whether joints are held at their velocity limits; else the whole answer is scaled.

    Attributes
    ----------
    acts
        Which rows decided on the last answer (K,); all that are not one-sided.
    held
        Which joints are at the bound that their range sets (n,).
    shares
        What held joints left to each level (levels,).
    scale
        What uniform scaling left of the last answer.
    """

    def __init__(
        self,
        kernel: Any,
        starts: NDArray[np.int64],
        rules: Matrix,
        one_sided: NDArray[np.int64],
        basis: Matrix,
        tolerance: float,
        holds_joints: bool,
    ) -> None:
        n, rows = len(basis), int(starts[-1])
        self._kernel, self._basis, self._tolerance = kernel, basis, tolerance
        self._holds_joints = holds_joints
        self._n = n
        # Joints at the ends of their ranges are a level above all others.
        self._J = np.vstack([np.eye(n), np.zeros((rows, n))])
        self._velocity = np.zeros(n + rows)
        self._starts = np.concatenate([[0], n + starts])
        self._rules = np.vstack([[0.0, np.inf], rules])
        self._acts = np.ones(n + rows, dtype=np.bool_)
        self._shares = np.ones(len(starts))
        self._work = kernel.workspace(n + rows, n)
        self._one_sided = n + one_sided
        self._joints = np.arange(n)
        self._endless = np.full(n, np.inf)
        self.held, self.acts = self._acts[:n], self._acts[n:]
        self.shares = self._shares[1:]
        self.scale = 1.0
        self._flat = self._curvature = Curvature.none(n)
        self._settling = kernel.PLAIN

    def resolve(
        self,
        J: Matrix,
        velocity: Vector,
        bounds: Bounds,
        qd: Vector,
        curvature: Curvature | None = None,
    ) -> float:
        """Write the answer (n,) to ``qd``; parameters and result as `Solver.solve`."""
        n = self._n
        self._curvature = curvature or self._flat
        self._settling = self._kernel.PLAIN if curvature is None else self._kernel.SIMPLE
        self._J[n:], self._velocity[n:] = J, velocity
        self._acts[:n] = False
        self._acts[self._one_sided] = False
        scale = self._answer(bounds, qd)
        near = self._one_sided
        if near.size:
            near = near[self._J[near].any(axis=1)]
        if near.size or (bounds.ranged and self._outside(qd, bounds) > BROKEN):
            scale = self._bring_in(near, bounds, qd, scale)
        return scale

    def _outside(self, qd: Vector, bounds: Bounds) -> float:
        return self._kernel.outside(qd, bounds.range_lower, bounds.range_upper)

    def _bring_in(
        self, near: NDArray[np.int64], bounds: Bounds, qd: Vector, scale: float
    ) -> float:
        acts, joints = self._acts, self._joints
        slopes, least = self._J[near], self._velocity[near]
        lengths = np.sqrt(np.einsum('ij,ij->i', slopes, slopes))
        candidates = np.concatenate([joints, near])
        broken = np.empty(candidates.size)

        def look() -> None:
            """Fill by how much the answer breaks every bound that does not act."""
            np.maximum(qd - bounds.range_upper, bounds.range_lower - qd, out=broken[: self._n])
            broken[self._n :] = (least - slopes @ qd) / lengths
            broken[acts[candidates]] = -np.inf

        came: list[int] = []
        tries = np.zeros(candidates.size, dtype=int)
        while True:
            look()
            worst = int(broken.argmax())
            if not broken[worst] > BROKEN:
                return scale
            if worst < self._n:
                end = bounds.range_upper if qd[worst] > 0.0 else bounds.range_lower
                self._velocity[worst] = end[worst]
            acts[candidates[worst]] = True
            tries[worst] += 1
            scale = self._answer(bounds, qd)
            # Those that came before may have become needless.
            for place in [place for place in came if tries[place] < TRIES]:
                acts[candidates[place]] = False
                scale = self._answer(bounds, qd)
                look()
                if broken[place] > BROKEN:
                    acts[candidates[place]] = True
                    scale = self._answer(bounds, qd)
                else:
                    came.remove(place)
            came.append(worst)

    def _answer(self, bounds: Bounds, qd: Vector) -> float:
        kernel, curvature = self._kernel, self._curvature
        result = self._recur(bounds, qd)
        if result == kernel.UNKNOWN:
            curvature.fill()
            self._settling = kernel.BENT
            result = self._recur(bounds, qd)
        if result == kernel.FAILED:
            raise np.linalg.LinAlgError('a Jacobian or a velocity beyond the range of floats')
        if self._holds_joints:
            return float(self.shares.min(initial=1.0))
        self.scale = kernel.shorten(qd, bounds.speed)
        return self.scale

    def _recur(self, bounds: Bounds, qd: Vector) -> int:
        errors, bends, hessians, _ = self._curvature
        return self._kernel.resolve(
            self._J,
            self._velocity,
            self._acts,
            self._starts,
            self._rules,
            self._basis,
            self._tolerance,
            bounds.speed if self._holds_joints else self._endless,
            self._work,
            self._shares,
            self._settling,
            self._n,
            errors,
            hessians,
            bends,
            qd,
        )
