"""Levels of equalities and inequalities in strict order, inside a box: a hierarchical QP."""

from __future__ import annotations

from itertools import pairwise

import daqp
import numpy as np
from numpy.typing import NDArray

from tp_controller.solvers import lexicographic_arrange, lexicographic_proof
from tp_controller.solvers.base import RANK_TOLERANCE

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]
Problem = tuple[Matrix, Vector, NDArray[np.int64], NDArray[np.bool_], Vector, Vector]
"""Rows, their velocities, the levels' first rows, which are one-sided, and the box."""

SETTINGS = ((1e-8, 1e-9), (1e-10, 1e-10), (1e-12, 1e-11), (1e-7, 1e-9), (1e-6, 1e-9))
"""DAQP's ``rho_soft`` and ``primal_tol``, one after the other until an answer is proven."""
PIVOT = 1e-3
"""DAQP's ``pivot_tol``: it refines more often than by default, and fails on fewer problems."""
SOFT = 8
"""DAQP's mark of a row that may be broken."""
UNEXPLAINED = 10.0
"""Share of a level's pull, in units of ``rho_soft``, that a proof may leave unexplained."""


class LexicographicProblem:
    """Levels of rows, each at its best among what the levels above leave, inside a box.

    Level by level, highest first, the sum of squared violations of the level's rows is
    minimised: of equalities ``J x = v`` and of one-sided rows ``J x >= v``. What a level got
    stays: its equalities and the rows that it has to violate keep their values, the other
    one-sided rows stay satisfied. The box ``lower <= x <= upper`` is above all levels. Of all
    answers the shortest is taken (Kanoun, Lamiraux and Wieber 2011; Escande, Mansard and
    Wieber 2014).

    The active set comes from DAQP's hierarchical mode (Arnström, Bemporad and Axehill 2022).
    By itself that mode answers another question: it divides every row by its length, which
    weighs violations inside a level, and adds a little ``‖x‖²`` to every level. So levels are
    turned until their rows are equally long, and the answer serves as a guess: each level is
    proven to be at its best there, and solved again by least squares, exact to rounding. From
    the first level that is not proven on, DAQP is asked anew in the freedom that is left.

    Parameters
    ----------
    n
        Number of joints.
    starts
        First row of every level, then the number of rows K (levels + 1,).
    one_sided
        Which rows (K,) are one-sided.
    metric
        T (n, n) with ``x = T y`` and the norm of y to be small; that of x when left out.

    Attributes
    ----------
    stopped_joints
        First level that had to stop at each joint's bound (n,), -1 if none had to. The number
        of levels stands for the smallest norm, which comes last.
    stopped_rows
        First level below that had to stop at each one-sided row (K,), in the same way.
    calls
        How often DAQP was called for the last answer.
    """

    def __init__(
        self,
        n: int,
        starts: NDArray[np.int64],
        one_sided: NDArray[np.bool_],
        metric: Matrix | None = None,
    ) -> None:
        T = np.eye(n) if metric is None else np.asarray(metric, dtype=float)
        k = int(starts[-1])
        rows = k + n
        self._k = k
        # The smallest norm is a last level, ‖T⁻¹ x‖.
        self._J = np.vstack([np.zeros((k, n)), np.linalg.inv(T)])
        self._velocity = np.zeros(rows)
        self._starts = np.append(starts, rows).astype(np.int64)
        self._one_sided = np.concatenate([one_sided, np.zeros(n, dtype=np.bool_)])
        self._levels = len(starts) - 1
        self._basis = np.ascontiguousarray(T.T)
        self._tolerance = RANK_TOLERANCE * float(np.linalg.norm(T, 2))
        size = max(2 * n + rows, 3)
        self._work = np.zeros((14, size, size))
        self._state = np.zeros(4, dtype=np.int64)
        # At most: the box, every row with a violation of its own, and those violations.
        most = n + 2 * rows
        # Twice that, with the rows that make room, see `_make_room`.
        self._A = np.zeros(2 * most * (n + rows))
        self._least, self._most = np.zeros((2, 2 * most))
        self._sense = np.zeros(2 * most, dtype=np.intc)
        self._breaks = np.zeros(self._levels + 2, dtype=np.intc)
        self.stopped_joints: NDArray[np.int64] = np.full(n, -1, dtype=np.int64)
        self._stopped_rows: NDArray[np.int64] = np.full(rows, -1, dtype=np.int64)
        self.stopped_rows = self._stopped_rows[:k]
        self.calls = 0

    def solve(self, J: Matrix, velocity: Vector, lower: Vector, upper: Vector, x: Vector) -> bool:
        """Write the answer (n,) to ``x``.

        Parameters
        ----------
        J
            Rows of all levels (K, n), highest first; rows of zeros are as if they were not.
        velocity
            What the rows are to be (K,), or at least to be where they are one-sided.
        lower, upper
            The box (n,), ``lower <= upper``; entries may be infinite.

        Returns
        -------
        bool
            Whether the answer is proven. One that is not is inside the box, and exact in the
            levels down to the first that is not proven.

        Raises
        ------
        numpy.linalg.LinAlgError
            If J or the velocity is not finite.
        """
        self._J[: self._k], self._velocity[: self._k] = J, velocity
        problem = (self._J, self._velocity, self._starts, self._one_sided, lower, upper)
        self.calls = 0
        self._begin()
        state = self._state
        for rho, tolerance in SETTINGS:
            first = -1
            while first < state[1] <= self._levels:
                first = int(state[1])
                z = self._guess(problem, rho, tolerance)
                if lexicographic_proof.settle(
                    *problem,
                    z,
                    self._tolerance,
                    UNEXPLAINED * rho,
                    self._work,
                    state,
                    self.stopped_joints,
                    self._stopped_rows,
                    x,
                ):
                    return True
            if state[1] > self._levels:
                # Every level was at its best, and yet the exact answer leaves the box.
                self._begin()
        np.nan_to_num(x, copy=False)
        np.clip(x, lower, upper, out=x)
        return False

    def take(self, J: Matrix, velocity: Vector) -> None:
        """Note a problem, see `solve`, that was solved elsewhere without being stopped."""
        self._J[: self._k], self._velocity[: self._k] = J, velocity
        self.stopped_joints[:] = -1
        self._stopped_rows[:] = -1
        self.calls = 0

    def violation(self, x: Vector) -> Vector:
        """By how much every row of the last problem is missed (K,) at ``x`` (n,); a copy.

        ``velocity - J x``, of one-sided rows the positive part.
        """
        missed: Vector = self._velocity[: self._k] - self._J[: self._k] @ x
        satisfied = self._one_sided[: self._k] & (missed < 0.0)
        missed[satisfied] = 0.0
        return missed

    def _begin(self) -> None:
        if not lexicographic_proof.begin(
            self._J,
            self._velocity,
            self._basis,
            self._work,
            self._state,
            self.stopped_joints,
            self._stopped_rows,
        ):
            raise np.linalg.LinAlgError('a Jacobian or a velocity beyond the range of floats')

    def _guess(self, problem: Problem, rho: float, tolerance: float) -> Vector:
        """DAQP's answer (variables,) to what is not settled yet."""
        rows = lexicographic_arrange.arrange(
            *problem, self._work, self._state, self._A, self._least, self._most, self._breaks
        )
        _, _, variables, ends = self._state.tolist()
        if rows == 0:
            return np.zeros(variables)
        self.calls += 1
        # With hard rows only there is no hierarchy.
        breaks = self._breaks[: ends if ends > 1 else 0]
        rows = self._make_room(rows, variables, breaks)
        guess: Vector = daqp.solve(
            None,
            None,
            self._A[: rows * variables].reshape(rows, variables),
            self._most[:rows],
            self._least[:rows],
            self._sense[:rows],
            breaks,
            rho_soft=rho,
            primal_tol=tolerance,
            pivot_tol=PIVOT,
        )[0]
        return guess

    def _make_room(self, rows: int, variables: int, breaks: NDArray[np.intc]) -> int:
        """Add rows of zeros, which nothing breaks, so that DAQP has room for all rows as active.

        DAQP 0.11.0 has room for as many active rows as there are variables and rows in the
        largest level, or soft rows where there are no levels. With rows that depend on each other
        it takes in more and writes beyond its memory, which ends the process.

        Returns
        -------
        int
            Number of rows with these.
        """
        ends = breaks.tolist()
        sizes = [end - start for start, end in pairwise([0, *ends])]
        self._sense[:rows] = 0
        if rows <= variables + max(sizes, default=0):
            return rows
        # All of them in the last level.
        more = rows - variables - (sizes[-1] if sizes else 0)
        if sizes:
            breaks[-1] += more
        end = rows + more
        self._A[rows * variables : end * variables] = 0.0
        endless = lexicographic_arrange.ENDLESS
        self._least[rows:end], self._most[rows:end] = -endless, endless
        self._sense[rows:end] = 0 if sizes else SOFT
        return end
