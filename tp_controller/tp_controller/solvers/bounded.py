"""The compiled recursion with the bounds of a robot."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tp_controller.prepared import Prepared
from tp_controller.solvers.codes import BENT, BRIEF, FAILED, LOSES, PLAIN, SIMPLE, UNKNOWN
from tp_controller.solvers.problem import Bounds, Curvature
from tp_controller.solvers.workspace import FREE, NEEDED, SLOWED, VERDICTS, workspace

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]

SETTLING, WANTED, LOW, STEP, QD = 4, 5, 13, 19, 23
"""Places among the arguments of `kernel.resolve`; the other bounds follow ``low``."""


class BoundedRecursion:
    """Resolves levels inside bounds by the compiled recursion, see `kernel.resolve`.

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
        Whether all limits are bounds of the resolution; else only the joints' ranges, and the
        whole answer is scaled to the velocity limits.

    Attributes
    ----------
    stops
        First level that each joint's range (n,) stopped, -1 if none.
    row_stops
        Level counted from 1 that each one-sided row (K,) stopped first, -1 for all others.
    acts
        Which rows decided on the last answer (K,); all that are not one-sided.
    shares
        What bounds left to each level (levels,).
    scale
        What uniform scaling left of the last answer.
    settling
        Whether the last answer was settled, and with second derivatives, see `kernel.resolve`.
    free, slowed
        The answer (n,) without bounds, and the rows' desired velocities (K,) of it, where these
        were wanted.
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
        self._kernel, self._tolerance = kernel, tolerance
        self._metric = np.array([basis, np.linalg.inv(basis.T @ basis)])
        self._holds_joints = holds_joints
        self._n = n
        # Rows of the joints come first, as a level above all others that asks for nothing.
        self._rows = np.vstack([np.eye(n), np.zeros((rows, n))])
        self._values = np.zeros((3, n + rows))
        self._starts = np.concatenate([[0], n + starts])
        self._rules = np.vstack([[0.0, np.inf], rules])
        self._flags = np.zeros((2, n + rows), dtype=np.bool_)
        self._always, sided = self._flags
        sided[n + one_sided] = True
        self._always[n:] = ~sided[n:]
        self._shares = np.ones(len(starts))
        self._stops = np.full(n + rows, -1, dtype=np.int64)
        self.row_stops = self._stops[n:]
        self._work = workspace(n + rows, n)
        self.shares = self._shares[1:]
        self._verdicts = self._work[VERDICTS][1 : len(starts)]
        self._needed = self._work[NEEDED]
        self.free, self.slowed = self._work[FREE][:n], self._work[SLOWED][:rows]
        self.settling: int = PLAIN
        self.scale = 1.0
        self._before, self._still, unused = np.zeros((3, n))
        self._unlimited = np.full(n, np.inf)
        self._limited: NDArray[np.bool_] | None = None
        self._flat = Curvature.none(n)
        self._given: tuple[object, ...] = (None,) * 5
        self._call = Prepared(
            kernel.resolve,
            self._rows[n:],
            np.zeros(rows),
            self._flat.rows,
            self._flat.hessians,
            self.settling,
            BRIEF,
            self._rows,
            self._values,
            self._flags,
            self._starts,
            self._rules,
            self._metric,
            self._tolerance,
            unused,
            unused,
            unused,
            unused,
            self._still,
            self._unlimited,
            math.inf,
            self._work,
            self._shares,
            self._stops,
            unused,
        )

    @property
    def stops(self) -> NDArray[np.int64]:
        """First level that each joint's range stopped (n,), -1 if none; a copy."""
        return np.maximum(self._stops[: self._n] - 1, -1)

    @property
    def loser(self) -> int:
        """First level whose answer settling changed, as it loses, -1 if there is none.

        Whether a level `LEAVES` depends on whether there is one below: that does not count.
        """
        verdicts, loses = self._verdicts.tolist(), LOSES
        return verdicts.index(loses) if loses in verdicts else -1

    @property
    def acts(self) -> NDArray[np.bool_]:
        """Which rows decided on the last answer (K,); a copy."""
        acts: NDArray[np.bool_] = self._always | (self._stops >= 0)
        return acts[self._n :]

    def resolve(
        self,
        J: Matrix,
        velocity: Vector,
        bounds: Bounds,
        qd: Vector,
        curvature: Curvature | None = None,
        settles: bool = True,
        wanted: int = 0,
    ) -> float:
        """Write the answer (n,) to ``qd``; parameters and result as `Solver.solve`.

        What is ``wanted`` beside it is told by `kernel.resolve`.
        """
        kernel = self._kernel
        known = curvature or self._flat
        self.settling = PLAIN
        if settles and curvature is not None:
            # Second derivatives that counted in the last step will mostly count again.
            self.settling = BENT if self._needed[0] else SIMPLE
            if self.settling == BENT:
                known.fill()
        result = self._recur(J, velocity, bounds, known, wanted, qd)
        if result == UNKNOWN:
            known.fill()
            self.settling = BENT
            result = self._recur(J, velocity, bounds, known, wanted, qd)
        if result == FAILED:
            raise np.linalg.LinAlgError('a Jacobian or a velocity beyond the range of floats')
        if self._holds_joints:
            return min(self._shares.tolist())
        self.scale = kernel.shorten(qd, bounds.speed)
        return self.scale

    def _recur(
        self,
        J: Matrix,
        velocity: Vector,
        bounds: Bounds,
        known: Curvature,
        wanted: int,
        qd: Vector,
    ) -> int:
        given = self._given
        if not (
            bounds is given[2]
            and J is given[0]
            and velocity is given[1]
            and known is given[3]
            and qd is given[4]
        ):
            self._take(J, velocity, bounds, known, qd)
        if self._limited is not None and bounds.before is not None:
            np.multiply(bounds.before, self._limited, out=self._before)
        call = self._call
        call.put(SETTLING, self.settling)
        call.put(WANTED, wanted)
        result: int = call.run()
        return result

    def _take(
        self, J: Matrix, velocity: Vector, bounds: Bounds, known: Curvature, qd: Vector
    ) -> None:
        """Let the recursion read from these arrays, and write to them, from now on."""
        self._given = J, velocity, bounds, known, qd
        low, high = bounds.range_lower, bounds.range_upper
        if self._holds_joints:
            low, high = bounds.soon_lower, bounds.soon_upper
        before, change, step = self._still, self._unlimited, math.inf
        self._limited = None
        if bounds.before is not None:
            starts = bounds.onward
            if bounds.change is not None:
                change = bounds.change
                limited = np.isfinite(change)
                starts = starts or bool(limited.all())
                if self._holds_joints and not starts:
                    # Joints without such a limit start from standstill.
                    before, self._limited = self._before, limited
                if known is not self._flat:
                    step = bounds.step
            if self._holds_joints and starts:
                before = bounds.before
        arrays = {
            0: J,
            1: velocity,
            2: known.rows,
            3: known.hessians,
            LOW: low,
            LOW + 1: high,
            LOW + 2: bounds.range_lower,
            LOW + 3: bounds.range_upper,
            LOW + 4: before,
            LOW + 5: change,
            QD: qd,
        }
        for i, array in arrays.items():
            self._call.replace(i, array)
        self._call.put(STEP, step)
