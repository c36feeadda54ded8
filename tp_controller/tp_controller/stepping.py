"""One step: from a measured state to the command that answers it."""

from __future__ import annotations

import math
from contextlib import nullcontext
from itertools import chain
from typing import NoReturn

import numpy as np
from numpy.typing import NDArray

from tp_controller.aims import Aims
from tp_controller.errors import UnusableState, shown
from tp_controller.problem import Problem, joined
from tp_controller.robot import Robot, State
from tp_controller.safety_filter import SafetyFilter
from tp_controller.snapshot import unchanged
from tp_controller.solvers import Bounds, Solver
from tp_controller.stacked_rows import StackedRows
from tp_controller.step_results import System, read_only

Vector = NDArray[np.float64]

KEPT = 1e-7
"""A row of a set-based task [m/s, rad/s] that is missed by less is kept."""
NOTHING = nullcontext()
"""What compiled code needs, which does not warn."""
ENDLESS = 1e12
"""Speed [rad/s, m/s] that stands for any."""


class Stepper:
    """Computes commands for the rows and by the solver that it has at the time.

    Parameters
    ----------
    robot
        The robot.
    safety_filter
        Knows the arm and makes commands of the solver's answers.
    aims
        Tasks that wait for a target.
    rows, solver, settle
        As `use`, and as `Stack`.

    Attributes
    ----------
    rows
        The rows of the tasks, with the command of the last step.
    answer
        Joint velocity (n,) that the solver gave in the last step.
    braking
        Whether the last command brakes, or keeps the arm at rest, whatever tasks ask for.
    """

    def __init__(
        self,
        robot: Robot,
        safety_filter: SafetyFilter,
        aims: Aims,
        rows: StackedRows,
        solver: Solver,
        settle: bool,
    ) -> None:
        self._robot, self._filter, self._aims = robot, safety_filter, aims
        self.settle, self.braking = settle, False
        self.answer, self._fastest = np.zeros((2, robot.n))
        self.use(rows, solver)

    def use(self, rows: StackedRows, solver: Solver) -> None:
        """Tell the solver of the rows, and step with both from now on."""
        self.rows, self._solver = rows, solver
        self._command = read_only(rows.command)
        solver.prepare(rows.levels, rows.jacobian_at)
        self._warns = rows.own or not solver.compiled
        for task in rows.bounding:
            acting = solver.acting[rows.parts[task.name]]
            # Who stays goes on as it is until the next step.
            acting[:] = task.acting
            task.acting = acting

    @property
    def resting(self) -> bool:
        """Whether steps bring the arm to rest: it is held, or there is no level."""
        return self._aims.targets is not None or not self.rows.levels

    def step(self, q: Vector, elapsed: float | None, qd: Vector | None) -> float:
        """Compute the command that answers a measured state, in `StackedRows.command`.

        Parameters and errors are those of `Stack.step_in_place`.

        Returns
        -------
        float
            What the velocity limits cost, see `Solver.solve`.
        """
        safety_filter, rows, aims, answer = self._filter, self.rows, self._aims, self.answer
        # The sum of what is finite may overflow: it is only quicker.
        if not (math.isfinite(sum(q.tolist())) or np.isfinite(q).all()):
            self._refuse(q)
        self.braking = True
        if not safety_filter.take(q, elapsed, qd):
            answer[:] = 0.0
            safety_filter.brake(rows.command)
            rows.achieve()
            raise UnusableState(safety_filter.arm.notice, self._command)
        self._robot.update(safety_filter.arm.reference)
        if aims.waiting:
            aims.take()
        if self.resting:
            self._answer_with_braking()
            return 1.0
        try:
            # What overflows is not finite and refused in the end.
            with np.errstate(over='ignore', invalid='ignore') if self._warns else NOTHING:
                bounds = safety_filter.bounds()
                if rows.bounding:
                    self._expect(safety_filter.last_bounds)
                rows.fill()
                curvature = rows.curvature if self.settle else None
                scale = self._solver.solve(rows.J, rows.requested, bounds, answer, curvature)
                if safety_filter.transition.under_way:
                    self._keep_distances()
        except np.linalg.LinAlgError:
            self._refuse(q)
        if aims.waiting:
            aims.settle()
        self.braking = not safety_filter.arm.following
        if self.braking:
            answer[:] = 0.0
            safety_filter.transition.give_way()
            safety_filter.let_rest()
        rows.command[:] = answer
        safety_filter.pass_on(rows.command)
        rows.achieve()
        return scale

    def _expect(self, bounds: Bounds) -> None:
        """Tell set-based tasks which speeds the next step can have."""
        fastest = self._fastest
        np.negative(bounds.soon_lower, out=fastest)
        np.maximum(fastest, bounds.soon_upper, out=fastest)
        np.minimum(fastest, ENDLESS, out=fastest)
        for task in self.rows.bounding:
            task.expect(fastest)

    def _keep_distances(self) -> None:
        """In a transition, brake beyond its bounds as far as set-based tasks need it.

        At rest no distance shrinks, and the velocities that keep distances are a convex set: the
        answer goes towards braking as far as needed. Where a distance has to grow, it is enough
        that it shrinks no more.
        """
        guarded, safety_filter = self.rows.guarded, self._filter
        if not guarded.stop:
            return
        J, command = self.rows.J[guarded], self.answer.copy()
        safety_filter.approach(command)
        least, rates = np.minimum(self.rows.requested[guarded], 0.0), J @ command
        broken = rates < least - KEPT
        if not broken.any():
            return
        stop = np.zeros(self._robot.n)
        safety_filter.slow_down(stop)
        gained = J @ stop - rates
        broken &= gained > 0.0
        shares = np.minimum((least - rates)[broken] / gained[broken], 1.0)
        if shares.size:
            safety_filter.transition.give_way()
            self.answer[:] = command + shares.max() * (stop - command)

    def _answer_with_braking(self) -> None:
        """Answer the state that was taken with braking."""
        rows, safety_filter = self.rows, self._filter
        if rows.levels:
            rows.fill()
        self._aims.settle()
        self.answer[:] = 0.0
        if safety_filter.transition.under_way and self._aims.targets is None:
            # Without a level, rest is what the hierarchy has come to.
            safety_filter.bounds()
            safety_filter.let_rest()
            rows.command[:] = 0.0
            safety_filter.pass_on(rows.command)
        else:
            safety_filter.brake(rows.command)
        rows.achieve()

    def _refuse(self, q: Vector) -> NoReturn:
        self.rows.command[:] = self.answer[:] = 0.0
        self._aims.take_back()
        message = f'no finite command follows from the position {shown(q)}'
        if not np.isfinite(q).all():
            raise UnusableState(message)
        self._filter.bounds()
        self._filter.transition.give_way()
        self._filter.let_rest()
        self._filter.pass_on(self.rows.command)
        raise UnusableState(message, self._command)

    def brake(self, elapsed: float | None, q: Vector | None, qd: Vector | None) -> Vector:
        """Compute the next command (n,) of braking to rest; as `Stack.brake`."""
        self.answer[:] = 0.0
        self.braking = True
        if q is not None:
            self._filter.take(q, elapsed, qd)
        self._filter.brake(self.rows.command, elapsed if q is None else None)
        self.rows.achieve()
        return self._command

    def stay(self) -> None:
        """Turn the command of the last step into rest: the arm has not moved yet."""
        self.rows.command[:] = self.rows.achieved[:] = 0.0
        self.braking = True
        self._filter.rest()

    def problem(self, state: State, elapsed: float | None, qd: Vector | None) -> Problem:
        """Return what the next step would resolve; as `Stack.problem`."""
        state.check(self._robot)
        safety_filter, rows = self._filter, self.rows
        memory: chain[object] = chain.from_iterable(task.memory for task in rows.tasks)
        with unchanged(*safety_filter.memory, *memory):
            # A copy: what cannot be written to is another type to compiled code.
            if not safety_filter.take(state.q.copy(), elapsed, qd):
                raise UnusableState(safety_filter.arm.notice)
            reference = safety_filter.arm.reference
            if not np.array_equal(reference, state.q):
                state = self._robot.state(reference)
            bounds = safety_filter.bounds()
            if rows.bounding:
                self._expect(safety_filter.last_bounds)
            levels = [joined([task.rows(state) for task in tasks]) for tasks in rows.levels]
            return Problem(
                tuple(levels),
                bounds.soon_lower.copy(),
                bounds.soon_upper.copy(),
                bounds.range_lower.copy(),
                bounds.range_upper.copy(),
                bounds.start,
                self._robot.joints,
            )

    def systems(self) -> list[System]:
        """What every level was in the last step."""
        rows, answered = self.rows, self.rows.J @ self.answer
        counts = ~rows.one_sided
        found = []
        for tasks in rows.levels:
            part = rows.of_level(tasks)
            found.append(
                System(
                    rows.J[part].copy(),
                    counts[part] | self._solver.acting[part],
                    rows.requested[part].copy(),
                    answered[part],
                    rows.achieved[part].copy(),
                )
            )
        return found
