"""Hierarchical quadratic programming."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tp_controller.solvers.base import Solver
from tp_controller.solvers.codes import ALONE, BENT, WHOLE
from tp_controller.solvers.problem import Bounds, Curvature, Levels
from tp_controller.solvers.workspace import workspace

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]

BROKEN = 1e-9
"""A bound that is missed by less than this is not broken."""
KEPT = 1e-8
"""A level that misses its velocity by a smaller share of it, or of 1, gets all it asks for."""
BINDING = 1e-6
"""A one-sided row [m/s, rad/s] this near to its least rate is at it."""


class HQPSolver(Solver):
    """Strict levels inside the joints' bounds, which are part of the problem.

    Level by level, highest first, the squared violations of the level's rows are minimised
    inside the bounds of the joints, keeping what the levels above got; one-sided tasks are
    inequalities (Kanoun, Lamiraux and Wieber 2011; Escande, Mansard and Wieber 2014). See
    `LexicographicProblem`. The bounds are all limits together, so ``saturation`` is without
    effect: no level loses more than the bounds and the levels above it cost.

    First the recursion of `RecursiveSolver` answers the equalities alone, without bounds, by
    the levels' own inverses. If that breaks no bound and no one-sided row, it is the answer.
    Else the levels compete inside the bounds. Damping acts on what they ask for: where there is
    any, the equalities ask for ``J qd_r`` with the recursion's qd_r, which is all that they
    would get near a singularity, otherwise for their velocities themselves. What stops a level
    may make it singular in the freedom that is left, so with damping there is a second pass:
    every level then asks for what the recursion gives it together with the one-sided rows and
    the ends of ranges that stopped it, or a level above, in the first.

    Levels that cannot get what they ask for are settled, see `settling`: where the recursion
    inside the bounds finds one that loses, and the levels above it get all they ask for, its
    answer stands in place of the program's. Nothing below a level decides on that, so the
    priorities stay strict.

    Attributes
    ----------
    proven
        Whether the last answer is known to be the optimum, or is a settled one; one that is
        neither is inside the bounds.
    problem
        The levels as a `LexicographicProblem`, which tells what stopped them.
    """

    type = 'hqp'
    settles = True
    one_by_one = True

    def arrange(self, levels: Levels) -> Levels:
        """Groups of tasks that are resolved together: every level by itself."""
        return levels

    def prepare(
        self, levels: Levels, jacobian_at: Callable[[Vector], Matrix] | None = None
    ) -> None:
        """Get ready for levels; see `Solver.prepare`."""
        super().prepare(levels, jacobian_at)
        from tp_controller.solvers import hqp_kernel
        from tp_controller.solvers.lexicographic import LexicographicProblem

        self._second: Any = hqp_kernel
        n, k = self.n, self.k
        sided = np.zeros(k, dtype=np.bool_)
        sided[self._one_sided] = True
        self._equal = ~sided
        self.problem = LexicographicProblem(n, self._starts, sided, self.metric)
        # The second pass's levels, and above them joints at the ends of their ranges.
        self._work = workspace(n + k, n)
        self._rows = np.vstack([np.eye(n), np.zeros((k, n))])
        self._values = np.zeros((3, n + k))
        self._wish, _, self._slowed = self._values
        self._flags = np.zeros((2, n + k), dtype=np.bool_)
        self._firsts = np.concatenate([[0], n + self._starts])
        self._was_rows = np.zeros(k, dtype=np.int64)
        self._was_joints, self._joints = np.zeros((2, n), dtype=np.int64)
        self._endless = np.array([np.full(n, -np.inf), np.full(n, np.inf)])
        self._unused = np.ones(len(self._groups) + 1)
        self._unstopped = np.full(n + k, -1, dtype=np.int64)
        self._metric = np.array([self._basis, np.linalg.inv(self._basis.T @ self._basis)])
        self._asked, self._again, self._moved, self._inside = np.zeros((4, k))
        self._free, self._still = np.zeros((2, n))
        self._lower, self._upper = np.zeros(n), np.zeros(n)
        self._flat = Curvature.none(n)
        self._bounds: Bounds | None = None
        self.proven = True
        self._shares = np.ones(len(self._groups))
        self._settled = False

    def _set_rules(self) -> None:
        super()._set_rules()
        always = [not all(task.one_sided for task in group) for group in self._groups]
        self._damped = bool(self._rules[always, 0].any())
        self._all_rules = np.vstack([[0.0, np.inf], self._rules])

    @property
    def shares(self) -> Vector:
        """What held joints left to each group (groups,); all, unless levels were settled.

        Otherwise joints that held a level up are told by `stops`.
        """
        return super().shares if self._settled else np.ones(len(self._groups))

    @property
    def held(self) -> NDArray[np.bool_]:
        """Which joints the last step held at the bound that their range sets (n,); a copy."""
        if self._settled:
            return super().held
        if self._bounds is None:
            return np.zeros(self.n, dtype=np.bool_)
        held: NDArray[np.bool_] = self._at_end(self._bounds, self._qd)
        return held & (self.problem.stopped_joints >= 0)

    def _at_end(self, bounds: Bounds, qd: Vector) -> NDArray[np.bool_]:
        """Whether each joint is at the bound that its range sets (n,)."""
        if not bounds.ranged:
            return np.zeros(self.n, dtype=np.bool_)
        lower, upper = bounds.range_lower + BROKEN, bounds.range_upper - BROKEN
        at_end: NDArray[np.bool_] = (qd <= lower) | (qd >= upper)
        return at_end

    @property
    def stops(self) -> NDArray[np.int64]:
        """First level that had to stop at each joint's bound (n,), -1 if none had to."""
        if self._settled:
            return super().stops
        stopped = self.problem.stopped_joints
        return np.where(stopped < len(self._groups), stopped, -1)

    @property
    def scale(self) -> float:
        """What uniform scaling left of the last step's velocity: all of it."""
        return 1.0

    def solve(
        self,
        J: Matrix,
        velocity: Vector,
        bounds: Bounds,
        qd: Vector,
        curvature: Curvature | None = None,
    ) -> float:
        """Write the joint velocity (n,) to ``qd``; see `Solver.solve`.

        Returns
        -------
        float
            1 where no joint's bound stopped a level. Else the least share of what is asked for
            that any level of equalities gets, levels above and bounds taken together.
        """
        if self._set is None:
            self._set = self._recursion_inside_bounds(True)
        recursion = self._set
        # Whether a level loses inside the bounds counts where levels are settled.
        wanted = ALONE if curvature is None else WHOLE
        self._inside[:] = velocity
        recursion.resolve(J, self._inside, bounds, qd, curvature, True, wanted)
        self._free[:], self._slowed[self.n :] = recursion.free, recursion.slowed
        J.dot(self._free, out=self._moved)
        velocity[:] = recursion.slowed
        asked = self._asked
        asked[:] = velocity
        if self._damped:
            np.copyto(asked, self._moved, where=self._equal)
        self._qd, self._bounds = qd, bounds
        self._shares[:] = 1.0
        self._settled = False
        suits = self._suits(J, velocity, bounds)
        # Where a level loses, that all levels together are inside the bounds says little: those
        # below may have led back.
        sure = suits and len(self._groups) == 1
        loser = recursion.loser if curvature and not sure else -1
        if loser >= 0 and self._settle(J, velocity, qd, loser):
            self.proven = True
            return float(self.shares.min(initial=1.0))
        if suits and loser < 0:
            qd[:] = self._free
            self.problem.take(J, asked)
            self.proven = True
            self.acting[self._one_sided] = False
            return 1.0
        # Copies: the robot's may not be written to, which makes them another type to numba.
        self._lower[:], self._upper[:] = bounds.soon_lower, bounds.soon_upper
        self.proven = self.problem.solve(J, asked, self._lower, self._upper, qd)
        problem, rows = self.problem, self._one_sided
        if not (self._damped and self._pass_again(J, velocity, bounds, qd, curvature, loser)):
            J.dot(qd, out=self._moved)
        if rows.size:
            stops = problem.stopped_rows[rows] >= 0
            self.acting[rows] = stops | (self._moved[rows] < velocity[rows] - BROKEN)
        # The smallest norm, a level below all, asks for nothing.
        count = len(self._groups)
        if any(0 <= level < count for level in problem.stopped_joints.tolist()):
            self._second.note_shares(asked, self._moved, self._equal, self._starts, self._shares)
        return min(self._shares.tolist(), default=1.0)

    def _settle(self, J: Matrix, velocity: Vector, qd: Vector, loser: int) -> bool:
        """Leave the recursion's answer inside bounds, in which a level loses.

        Levels above the first loser have to get all that they ask for, which is their optimum:
        then nothing below them decides on what they get. Otherwise that level and those below
        are to ask for what the recursion gave them, which brings them to rest.
        """
        recursion = self._set
        assert recursion is not None
        velocity[:] = self._inside
        above = self._starts[loser]
        if above:
            J.dot(qd, out=self._moved)
            missed = self._asked[:above] - self._moved[:above]
            missed[self._equal[:above]] = np.abs(missed[self._equal[:above]])
            if missed.max() > KEPT * max(1.0, float(np.abs(self._asked[:above]).max())):
                below = slice(above, None)
                np.copyto(self._asked[below], self._moved[below], where=self._equal[below])
                return False
        self.problem.take(J, self._asked)
        if self._one_sided.size:
            self.acting[self._one_sided] = recursion.acts[self._one_sided]
        self._settled = True
        return True

    def _ask_again(self, bounds: Bounds, qd: Vector, curvature: Curvature, settling: int) -> int:
        """Fill what the levels ask for together with what stopped them."""
        problem = self.problem
        self._wish[self.n :] = self._slowed[self.n :]
        self._joints[:], self._free[:], self._again[:] = problem.stopped_joints, qd, self._asked
        return self._second.ask_again(
            self._rows,
            self._values,
            self._flags,
            self._firsts,
            self._all_rules,
            self._metric,
            self._tolerance,
            self._endless,
            self._still,
            self._work,
            self._unused,
            self._unstopped,
            settling,
            curvature.rows,
            curvature.hessians,
            self._equal,
            self._was_rows,
            self._joints,
            bounds.range_lower,
            bounds.range_upper,
            self._again,
            self._free,
        )

    def _pass_again(
        self,
        J: Matrix,
        velocity: Vector,
        bounds: Bounds,
        qd: Vector,
        curvature: Curvature | None,
        loser: int,
    ) -> bool:
        """Let levels above the first loser ask for what they get together with what stopped them.

        Returns
        -------
        bool
            Whether anything had stopped one; the rows' velocities are then known.
        """
        problem, second = self.problem, self._second
        self._was_rows[:], self._was_joints[:] = problem.stopped_rows, problem.stopped_joints
        self._rows[self.n :] = J
        assert self._set is not None
        known, settling = curvature or self._flat, self._set.settling
        found = self._ask_again(bounds, qd, known, settling)
        if found == second.BENT:
            known.fill()
            found = self._ask_again(bounds, qd, known, BENT)
        if found == second.NOTHING:
            return False
        if found < 0:
            raise np.linalg.LinAlgError('a Jacobian or a velocity beyond the range of floats')
        if loser >= 0:
            first = self._starts[loser]
            self._again[first:] = self._asked[first:]
        J.dot(self._free, out=self._moved)
        if loser < 0 and found == second.ONE and self._suits(J, velocity - BROKEN, bounds):
            qd[:] = self._free
        else:
            self.proven = problem.solve(J, self._again, self._lower, self._upper, qd)
            J.dot(qd, out=self._moved)
        # What stopped the first pass is in what the second asks for, and stops nothing there.
        second.merge(
            problem.stopped_rows,
            problem.stopped_joints,
            self._was_rows,
            self._was_joints,
            self._moved,
            velocity,
            qd,
            self._lower,
            self._upper,
            BINDING,
        )
        return True

    def _suits(self, J: Matrix, velocity: Vector, bounds: Bounds) -> bool:
        """Whether the recursion's answer is inside the bounds and breaks no one-sided row."""
        # Asked this way round, what is not a number does not suit.
        if not self._kernel.outside(self._free, bounds.soon_lower, bounds.soon_upper) <= 0.0:
            return False
        rows = self._one_sided
        if not rows.size:
            return True
        broken = rows[~(self._moved[rows] >= velocity[rows])]
        return not (broken.size and J[broken].any())
