"""The stack of tasks: one step from a configuration to a joint velocity."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from functools import partial
from itertools import chain
from typing import TYPE_CHECKING, NamedTuple, NoReturn

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tp_controller.arm import Arm
from tp_controller.errors import InvalidValue, UnusableState, shown
from tp_controller.hierarchy import all_set_based, named_tasks, split_hierarchy
from tp_controller.problem import Problem, joined
from tp_controller.robot import Limits, Robot, State
from tp_controller.safety_filter import SafetyFilter
from tp_controller.snapshot import unchanged
from tp_controller.solvers import Bounds, Curvature, Solver, solver_of
from tp_controller.tasks import SetBasedTask, Task

if TYPE_CHECKING:
    from tp_controller.tasks.compiled import CompiledRows

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]

KEPT = 1e-7
"""A row of a set-based task [m/s, rad/s] that is missed by less is kept."""
ENDLESS = 1e12
"""Speed [rad/s, m/s] that stands for any."""


class LevelResult(NamedTuple):
    """What one level asked for and got in the last step."""

    tasks: tuple[str, ...]
    """Names of the level's tasks, in the order of their rows."""
    requested: Vector
    """Desired task velocity (k,) [m/s, rad/s]."""
    achieved: Vector
    """Task velocity of the command (k,) [m/s, rad/s]."""


class Rows(NamedTuple):
    """All rows of the hierarchy; arrays that steps write to until the hierarchy changes."""

    parts: Mapping[str, slice]
    """Which rows belong to each task, by name."""
    J: Matrix
    """Jacobian (K, n)."""
    requested: Vector
    """Desired task velocity (K,)."""


class System(NamedTuple):
    """One level of the last step, row by row."""

    J: Matrix
    """Jacobian (k, n)."""
    counts: NDArray[np.bool_]
    """Whether each row was resolved (k,); bounds that nothing breaks are not."""
    requested: Vector
    """Desired task velocity (k,)."""
    answered: Vector
    """Task velocity of the solver's answer (k,)."""
    achieved: Vector
    """Task velocity of the command (k,), which the safety filter may have changed."""


Layout = list[tuple[tuple[str, ...], slice, slice]]
"""Names of the tasks of every level, and where a step has what it asked for and got."""


class Step:
    """Result of one step.

    Attributes
    ----------
    command
        Joint velocity (n,) [rad/s, m/s].
    scale
        What the velocity limits cost, see `Solver.solve`; 1 if none was reached.
    """

    __slots__ = ('_answers', '_layout', 'command', 'scale')

    def __init__(self, answers: Vector, n: int, scale: float, layout: Layout) -> None:
        self._answers, self._layout = answers, layout
        self.command, self.scale = answers[:n], scale

    @property
    def levels(self) -> tuple[LevelResult, ...]:
        """One result per level, highest first."""
        found = self._answers
        levels = [
            LevelResult(names, found[asked], found[got]) for names, asked, got in self._layout
        ]
        return tuple(levels)


class Stack:
    """Tasks in levels of priority, a solver and the robot's limits.

    Parameters
    ----------
    robot
        The robot that carries the tasks out.
    levels
        Tasks by level, highest priority first: one task or several that share the level. Without
        any the arm rests.
    solver
        Resolves the levels: a solver, or the name of a scheme with its default settings.
    rate
        Steps per second [Hz], which limits of position and acceleration and the safety filter
        need; tasks without a period take it over.
    tasks
        All tasks in the order in which they are told, those outside the levels included; those
        of the levels when left out.
    settle
        Whether levels that cannot get what they ask for come to rest, with a solver that can
        do that; else the published laws alone.
    transition_time
        Time [s] of transitions; 0 lets every change act at once. It needs ``rate``.

    Raises
    ------
    InvalidValue
        If a task stands twice, two have one name, one is another robot's or not made for this
        rate, or there is no such scheme; as `SafetyFilter` and `Solver.check`.
    """

    def __init__(
        self,
        robot: Robot,
        levels: Sequence[Task | Sequence[Task]],
        solver: Solver | str = 'recursive',
        rate: float | None = None,
        tasks: Iterable[Task] = (),
        settle: bool = True,
        transition_time: float = 0.0,
    ) -> None:
        if rate is not None and not 0.0 < rate < math.inf:
            raise InvalidValue('rate', shown(rate), 'a number above 0')
        period = math.inf if rate is None else 1.0 / rate
        members = [[level] if isinstance(level, Task) else list(level) for level in levels]
        self.robot = robot
        self.settle = settle
        self._solver = solver_of(solver, robot.n) if isinstance(solver, str) else solver
        self.tasks = named_tasks(robot, chain(tasks, *members), period)
        self._unaimed = [task for task in self.tasks.values() if task.target_size]
        self._just_aimed: list[Task] = []
        self._targets: dict[str, Vector] | None = None
        self.safety_filter = SafetyFilter(robot, period)
        self._qd, self._wish, self._fastest = np.zeros((3, robot.n))
        self.braking = False
        """Whether the last command brakes, or keeps the arm at rest, whatever tasks ask for."""
        self._members: list[list[Task]] = []
        self._listed: list[list[str]] = []
        self._stand_in: tuple[Task, tuple[str, ...]] | None = None
        self._transition_time = 0.0
        for task in self.tasks.values():
            task.changed = self._follow_task
        self.hierarchy = [' + '.join(task.name for task in level) for level in members]
        self.transition_time = transition_time

    @property
    def members(self) -> Sequence[Sequence[Task]]:
        """Tasks by level, highest first, without those that are off."""
        return tuple(tuple(tasks) for tasks in self._members)

    @property
    def hierarchy(self) -> Sequence[str]:
        """Task names by level, highest first, ``a + b`` for two on one level.

        Tasks that are not `Task.enabled` keep their place, as if they were not listed; a level
        without any other is left out, and without a level the arm rests.
        """
        return tuple(' + '.join(names) for names in self._listed)

    @hierarchy.setter
    def hierarchy(self, hierarchy: Sequence[str]) -> None:
        self.rearrange(hierarchy)

    @property
    def solver(self) -> Solver:
        """What resolves the levels."""
        return self._solver

    @solver.setter
    def solver(self, solver: Solver | str) -> None:
        new = solver_of(solver, self.robot.n) if isinstance(solver, str) else solver
        self.rearrange(solver=new)

    def rearrange(
        self,
        hierarchy: Sequence[str] | None = None,
        enabled: Mapping[str, bool] | None = None,
        solver: Solver | None = None,
    ) -> None:
        """Change hierarchy, tasks that are on and solver in one, as a transition.

        Parameters
        ----------
        hierarchy
            Task names by level, highest first.
        enabled
            Whether tasks take part, by name; the others stay as they are.
        solver
            Resolves the levels from now on.

        Raises
        ------
        InvalidValue
            As `check_hierarchy`; nothing has changed then.
        """
        hierarchy = self.hierarchy if hierarchy is None else hierarchy
        members = self.check_hierarchy(hierarchy, enabled=enabled, solver=solver)
        for name, on in (enabled or {}).items():
            self.tasks[name].switch(on)
        self._solver = self._solver if solver is None else solver
        self._listed = split_hierarchy(hierarchy, self.tasks)
        self._arrange(self._taken_over(members))
        self.begin_transition()

    def take_over(self, task: Task, names: Sequence[str]) -> None:
        """Let a task act in place of some levels, as a transition, until `give_back`.

        It takes the place of the first level that has one of the named tasks, and of all levels
        below. Their set-based tasks go on to act, on a level of their own above it.
        `hierarchy` stays as it is, and so does the place of all tasks in it.

        Parameters
        ----------
        task
            A task of the robot that is not in `tasks`.
        names
            Names of tasks.

        Raises
        ------
        InvalidValue
            If its name is that of a task, or the solver cannot resolve the levels; nothing has
            changed then.
        """
        if task.name in self.tasks:
            raise InvalidValue('task', f'{shown(task.name)}, which the stack has', 'a new name')
        before, self._stand_in = self._stand_in, (task, tuple(names))
        try:
            members = self._taken_over(self.check_hierarchy(self.hierarchy))
            self.solver.check(members, None)
        except InvalidValue:
            self._stand_in = before
            raise
        if task.period != self.safety_filter.period:
            task.know_period(self.safety_filter.period)
        if task.target is None and task not in self._unaimed:
            self._unaimed.append(task)
        self._arrange(members)
        self.begin_transition()

    def give_back(self) -> None:
        """Let the levels act again that a task took the place of, as a transition."""
        if self._stand_in is not None:
            task = self._stand_in[0]
            self._stand_in = None
            self._unaimed = [other for other in self._unaimed if other is not task]
            task.leave()
            self.rearrange()

    @property
    def stand_in(self) -> Task | None:
        """Task that acts in place of levels, None if there is none."""
        return None if self._stand_in is None else self._stand_in[0]

    def _taken_over(self, members: list[list[Task]]) -> list[list[Task]]:
        """Levels with the stand-in, if there is one, in the place of those that it stands for."""
        if self._stand_in is None:
            return members
        task, names = self._stand_in
        first = min(
            (i for i, level in enumerate(members) if any(one.name in names for one in level)),
            default=len(members),
        )
        left = [one for level in members[first:] for one in level if one.set_based]
        return [*members[:first], *([left] if left else []), [task]]

    def _follow_task(self) -> None:
        """Follow a task whose gain has changed, or which was switched on or off."""
        on = [task for task in self._in_order() if task.enabled]
        if self._stand_in or on != list(chain.from_iterable(self._members)):
            self.rearrange()
        else:
            self.begin_transition()

    def _in_order(self) -> Iterator[Task]:
        return (self.tasks[name] for name in chain.from_iterable(self._listed))

    @property
    def transition_time(self) -> float:
        """Time [s] of transitions; 0 lets every change act at once."""
        return self._transition_time

    @transition_time.setter
    def transition_time(self, value: float) -> None:
        if not 0.0 <= value < math.inf:
            raise InvalidValue('transition_time', shown(value), 'a number of at least 0')
        self._transition_time = float(value)

    def begin_transition(self) -> None:
        """Bound the change of the command from the next step on, for `transition_time`.

        Changes of hierarchy, tasks that are on, solver, gains and limits begin one by themselves.
        """
        period = self.safety_filter.period
        transition = self.safety_filter.transition
        transition.begin(self.robot.limits, period, self._transition_time)

    @property
    def in_transition(self) -> bool:
        """Whether a transition is under way."""
        return self.safety_filter.transition.under_way

    def _arrange(self, members: list[list[Task]]) -> None:
        """Take over levels, which pass `check_hierarchy`."""
        # Who stays goes on as it is: rows that are in stay in.
        stays = set(chain.from_iterable(self._members)) & set(chain.from_iterable(members))
        new = {task.name: task for task in chain.from_iterable(members)}
        for task in {**self.tasks, **new}.values():
            if task not in stays:
                task.leave()
                task.place(np.zeros_like(task.J), np.zeros(task.k))
        self._members = members
        self._rows: dict[str, slice] = {}
        k = 0
        for task in chain.from_iterable(members):
            self._rows[task.name] = slice(k, k + task.k)
            k += task.k
        # Tasks write their rows of the whole system themselves; nothing is copied per cycle.
        self._J = np.zeros((k, self.robot.n))
        # One array of all that a step answers with: results of their own are one copy.
        n = self.robot.n
        self._answers = np.concatenate([self._qd, np.zeros(2 * k)])
        self._qd, self._command = self._answers[:n], _read_only(self._answers[:n])
        self._velocity, self._achieved = self._answers[n : n + k], self._answers[n + k :]
        known = np.zeros((3, k))
        self._errors, self._feedforward = known[:2]
        self._ranked = list(chain.from_iterable(members))
        self._own: list[tuple[Task, Vector, Vector]] = []
        for task in self._ranked:
            rows = self._rows[task.name]
            # Rows that come and go have no error that anything converges to.
            task.place(self._J[rows], np.zeros(task.k) if task.set_based else self._errors[rows])
            if not task.parts:
                self._own.append((task, self._velocity[rows], self._feedforward[rows]))
        self._compiled: CompiledRows | None = None
        self._bent = [
            (task, self._rows[task.name])
            for task in self._ranked
            if not (task.parts or task.set_based)
        ]
        self._layout: Layout = []
        for tasks in members:
            rows = self._level_rows(tasks)
            asked = slice(n + rows.start, n + rows.stop)
            got = slice(asked.start + k, asked.stop + k)
            self._layout.append((tuple(task.name for task in tasks), asked, got))
        self._bounding = [task for task in self._ranked if isinstance(task, SetBasedTask)]
        above = next((i for i, level in enumerate(members) if not all_set_based(level)), k)
        guarded = [self._level_rows(level) for level in members[:above]]
        # Rows that are to keep distances whatever else is asked for.
        self._guarded = slice(0, guarded[-1].stop if guarded else 0)
        bends = [np.zeros(task.k) if task.set_based else task.bend for task in self._ranked]
        known[2] = np.concatenate([*bends, np.zeros(0)])
        self._curvature = Curvature(known, np.zeros((k, n, n)), self._fill_hessians)
        self.rows = Rows(self._rows, self._J, self._velocity)
        """Rows of the last step, to be read."""
        self._shown = _read_only(self._answers)
        self.prepare_solver()
        self.safety_filter.watch(self._kept())

    def _kept(self) -> Iterator[SetBasedTask]:
        """Tasks whose distances are kept whatever happens: those above all that always act."""
        for members in self._members:
            bounds = [task for task in members if isinstance(task, SetBasedTask)]
            if len(bounds) < len(members) or not all(task.one_sided for task in bounds):
                return
            yield from bounds

    def _level_rows(self, tasks: Sequence[Task]) -> slice:
        return slice(self._rows[tasks[0].name].start, self._rows[tasks[-1].name].stop)

    def forget_targets(self, known: Mapping[str, Vector] | None = None) -> None:
        """Let the tasks of the hierarchy take their values at the next step as targets.

        Obstacles stay where they are.

        Parameters
        ----------
        known
            Targets by name, as `Task.settings` has them; tasks that have another one by now
            keep it. When left out none does.
        """
        for task in self._ranked:
            if task.set_based or not task.target_size:
                continue
            if known is None or task.settings[0] is known.get(task.name):
                self.aim_at_present(task)

    def aim_at_present(self, task: Task) -> None:
        """Let a task take its value at the next step as its target.

        One outside the hierarchy takes its value as of the last update.
        """
        if self.level_of(task.name) < 0:
            task.hold()
            return
        task.forget_target()
        if task not in self._unaimed:
            self._unaimed.append(task)

    @property
    def held(self) -> bool:
        """Whether `hold` keeps the arm at rest."""
        return self._targets is not None

    def hold(self) -> None:
        """Bring the arm to rest inside its limits from the next step on, and keep it there.

        Every step then answers with the next command of the braking trajectory, and with zero
        once that has ended. Targets, settings, limits and the hierarchy may change meanwhile.
        """
        if self._targets is None:
            self._targets = {name: task.settings[0] for name, task in self.tasks.items()}

    def resume(self, targets: bool = False) -> None:
        """Let the tasks move the arm again, from the velocity that it has by then.

        Parameters
        ----------
        targets
            Whether the targets from before count. If not, the tasks of the hierarchy take their
            values at the next step, obstacles excepted. Targets set since `hold` always count.
        """
        if self._targets is not None and not targets:
            self.forget_targets(self._targets)
        self._targets = None

    @property
    def resting(self) -> bool:
        """Whether steps bring the arm to rest: it is `held`, or there is no level."""
        return self.held or not self._members

    @property
    def at_rest(self) -> bool:
        """Whether the last command is zero, and the arm has nothing left of earlier ones."""
        return not self._qd.any() and self.arm.settled

    def add(self, task: Task) -> None:
        """Load a task of a new name, outside the hierarchy."""
        self.tasks[task.name] = task
        task.changed = self._follow_task
        if task.target_size:
            self._unaimed.append(task)

    def remove(self, name: str) -> None:
        """Forget a task outside the hierarchy."""
        task = self.tasks.pop(name)
        task.changed = _nothing
        self._unaimed = [other for other in self._unaimed if other is not task]

    def prepare_solver(self) -> None:
        """Tell the solver of the levels, and of their tasks' weights and inverses."""
        self.solver.prepare(self._members, self._jacobian_at)
        # What overflows is not finite and refused in the end. Compiled code does not warn.
        self._quiet: Callable[[], AbstractContextManager[None]] = (
            nullcontext
            if self.solver.compiled and not self._own
            else partial(np.errstate, over='ignore', invalid='ignore')
        )
        for task in self._ranked:
            if isinstance(task, SetBasedTask):
                acting = self.solver.acting[self._rows[task.name]]
                # Who stays goes on as it is until the next step.
                acting[:] = task.acting
                task.acting = acting

    def prepare_limits(self, limits: Limits) -> Callable[[], None]:
        """Check limits that the robot is to have; nothing has changed yet.

        Returns
        -------
        callable
            Gives them to the robot and lets every task follow; it cannot fail.

        Raises
        ------
        InvalidValue
            If they cannot be enforced, or a task could not be made with them.
        """
        self.safety_filter.check_limits(limits)
        followers = []
        for task in self.tasks.values():
            try:
                followers.append(task.prepare_limits(limits))
            except InvalidValue as error:
                raise error.under(f'tasks.{task.name}') from None

        def apply() -> None:
            self.robot.limits = limits
            for follow in followers:
                follow()
            self.begin_transition()

        return apply

    def _jacobian_at(self, q: Vector) -> Matrix:
        """Stacked Jacobian (K, n) after the robot was moved to ``q`` (nq,)."""
        self.robot.update(q)
        self._fill()
        return self._J

    def _fill_hessians(self) -> None:
        hessians = self._curvature.hessians
        if self._compiled is not None:
            self._compiled.fill_hessians(hessians)
        for task, rows in self._bent:
            task.hessian(hessians[rows])

    def check_hierarchy(
        self,
        hierarchy: Sequence[str],
        damping: float | None = None,
        tasks: Mapping[str, Task] | None = None,
        enabled: Mapping[str, bool] | None = None,
        solver: Solver | None = None,
    ) -> list[list[Task]]:
        """Tasks of every level, without those that are off.

        Parameters
        ----------
        hierarchy
            Task names by level, highest first.
        damping
            λ that the solver is to have; the present one when left out.
        tasks
            Tasks by name that it may have; the present ones when left out.
        enabled
            Whether tasks are to take part, by name, where that changes.
        solver
            What is to resolve the levels; the present one when left out.

        Raises
        ------
        InvalidValue
            If a name is unknown, a task stands twice or the solver cannot resolve the levels.
        """
        tasks = self.tasks if tasks is None else tasks
        on = {name: task.enabled for name, task in tasks.items()} | dict(enabled or {})
        levels = split_hierarchy(hierarchy, tasks)
        members = [[tasks[name] for name in names if on[name]] for names in levels]
        members = [level for level in members if level]
        if members:
            (solver or self.solver).check(members, damping)
        return members

    def systems(self) -> list[System]:
        """What every level was in the last step."""
        counts = np.repeat(
            [not task.one_sided for task in self._ranked],
            [task.k for task in self._ranked],
        )
        answered = self._J @ self._wish
        found = []
        for tasks in self._members:
            rows = self._level_rows(tasks)
            found.append(
                System(
                    self._J[rows].copy(),
                    counts[rows] | self.solver.acting[rows],
                    self._velocity[rows].copy(),
                    answered[rows],
                    self._achieved[rows].copy(),
                )
            )
        return found

    @property
    def answer(self) -> Vector:
        """Joint velocity (n,) that the solver gave in the last step; a copy.

        The safety filter makes the command of it.
        """
        return self._wish.copy()

    @property
    def at_bound(self) -> NDArray[np.bool_]:
        """Which joints were at a bound of their velocity (n,) in the last step's answer."""
        return self.safety_filter.last_bounds.met(self._wish) != 0

    def level_of(self, name: str) -> int:
        """Level of a task, 0 is the highest; -1 if it is off or outside the hierarchy."""
        return self.place_of(name) if name in self._rows else -1

    def place_of(self, name: str) -> int:
        """List position of a task in the hierarchy, on or off; -1 outside it."""
        for i, names in enumerate(self._listed):
            if name in names:
                return i
        return -1

    def is_listed(self, name: str) -> bool:
        """Whether a task is on and in the hierarchy, though another may act in its place."""
        return self.place_of(name) >= 0 and self.tasks[name].enabled

    def velocities_of(self, name: str) -> tuple[Vector, Vector]:
        """Views of the requested and achieved velocity (k,) of a task in the hierarchy.

        They are the ones that steps write to until the hierarchy changes.
        """
        rows = self._rows[name]
        return _read_only(self._velocity[rows]), _read_only(self._achieved[rows])

    @property
    def arm(self) -> Arm:
        """What the arm makes of the commands, and whether it follows them."""
        return self.safety_filter.arm

    def step(self, q: ArrayLike, elapsed: float | None = None, qd: Vector | None = None) -> Step:
        """Compute the command that answers a measured state.

        Parameters, result and errors are those of `step_in_place`; the arrays of the result are
        the caller's own.
        """
        try:
            step = self.step_in_place(np.asarray(q, dtype=float), elapsed, qd)
            return Step(self._answers.copy(), self.robot.n, step.scale, self._layout)
        except UnusableState as error:
            if error.command is not None:
                error.command = error.command.copy()
            raise

    def problem(
        self, q: Vector | State, elapsed: float | None = None, qd: Vector | None = None
    ) -> Problem:
        """Return what the next step would resolve, as a value; the stack stays as it is.

        ``solve(stack.problem(q), **stack.solver.settings)`` answers as the stack does before the
        safety filter, where ``settle`` is off. What a stack does on top of it, the approach to
        targets within limits of acceleration and the rest of levels that cannot get what they
        ask for, is no part of the problem.

        Parameters
        ----------
        q
            Measured configuration (nq,) [rad, m], or a state of the robot.
        elapsed, qd
            As `step`.

        Returns
        -------
        Problem
            The levels in order; as bounds what ranges, speeds and accelerations allow after the
            last command. Its arrays are the caller's own.

        Raises
        ------
        InvalidValue
            If the configuration has a wrong shape or is not finite, or the state is another
            robot's.
        UnusableState
            If no joint can have moved so.
        """
        state = q if isinstance(q, State) else self.robot.state(q)
        state.check(self.robot)
        memory = chain.from_iterable(task.memory for task in self._ranked)
        with unchanged(*self.safety_filter.memory, *memory):
            # A copy: what cannot be written to is another type to compiled code.
            if not self.safety_filter.take(state.q.copy(), elapsed, qd):
                raise UnusableState(self.arm.notice)
            reference = self.arm.reference
            if not np.array_equal(reference, state.q):
                state = self.robot.state(reference)
            bounds = self.safety_filter.bounds()
            self._expect(self.safety_filter.last_bounds)
            levels = [joined([task.rows(state) for task in tasks]) for tasks in self._members]
            return Problem(
                tuple(levels),
                bounds.soon_lower.copy(),
                bounds.soon_upper.copy(),
                bounds.range_lower.copy(),
                bounds.range_upper.copy(),
                bounds.start,
                self.robot.joints,
            )

    def step_in_place(
        self, q: Vector, elapsed: float | None = None, qd: Vector | None = None
    ) -> Step:
        """Compute the command that answers a measured state.

        A task without a target takes its value at this configuration as the target. The arm
        brakes while it is `resting`, or does not follow its commands, see `Arm.following` and
        `Arm.notice`.

        Parameters
        ----------
        q
            Measured configuration (nq,) [rad, m].
        elapsed
            Time [s] since the state that the last command answered. When left out it is one
            period, and whether an ideal arm follows is not judged: any configuration may be
            asked about.
        qd
            Measured velocities (n,) [rad/s, m/s]: the start of an arm that moves already, and
            what counts when positions jump. Zero is taken, and only positions count, when left
            out.

        Returns
        -------
        Step
            Its arrays are read-only views that the next step overwrites.

        Raises
        ------
        UnusableState
            If no finite command follows from the state, or no joint can have moved so. If the
            positions are finite the error has a command: braking.
        """
        # The sum of what is finite may overflow: it is only quicker.
        if not (math.isfinite(sum(q.tolist())) or np.isfinite(q).all()):
            self._refuse(q)
        self.braking = True
        if not self.safety_filter.take(q, elapsed, qd):
            self._wish[:] = 0.0
            self.safety_filter.brake(self._qd)
            self._J.dot(self._qd, out=self._achieved)
            raise UnusableState(self.arm.notice, self._command)
        self.robot.update(self.arm.reference)
        for task in self._unaimed:
            if task.target is None:
                task.hold()
                self._just_aimed.append(task)
                if self._targets is not None:
                    self._targets[task.name] = task.settings[0]
        if self.resting:
            return self._answer_with_braking()
        try:
            with self._quiet():
                bounds = self.safety_filter.bounds()
                self._expect(self.safety_filter.last_bounds)
                self._fill()
                scale = self._solver.solve(
                    self._J,
                    self._velocity,
                    bounds,
                    self._wish,
                    self._curvature if self.settle else None,
                )
                if self.safety_filter.transition.under_way:
                    self._keep_distances()
        except np.linalg.LinAlgError:
            self._refuse(q)
        if self._unaimed:
            self._unaimed, self._just_aimed = [], []
        self.braking = not self.arm.following
        if self.braking:
            self._wish[:] = 0.0
            self.safety_filter.transition.give_way()
        self._qd[:] = self._wish
        self.safety_filter.pass_on(self._qd)
        self._J.dot(self._qd, out=self._achieved)
        return Step(self._shown, self.robot.n, scale, self._layout)

    def _keep_distances(self) -> None:
        """In a transition, brake beyond its bounds as far as set-based tasks need it.

        At rest no distance shrinks, and the velocities that keep distances are a convex set: the
        answer goes towards braking as far as needed. Where a distance has to grow, it is enough
        that it shrinks no more.
        """
        rows, safety_filter = self._guarded, self.safety_filter
        if not rows.stop:
            return
        J, command = self._J[rows], self._wish.copy()
        safety_filter.approach(command)
        least, rates = np.minimum(self._velocity[rows], 0.0), J @ command
        broken = rates < least - KEPT
        if not broken.any():
            return
        stop = np.zeros(self.robot.n)
        safety_filter.slow_down(stop)
        gained = J @ stop - rates
        broken &= gained > 0.0
        shares = np.minimum((least - rates)[broken] / gained[broken], 1.0)
        if shares.size:
            safety_filter.transition.give_way()
            self._wish[:] = command + shares.max() * (stop - command)

    def _answer_with_braking(self) -> Step:
        """Answer the state that was taken with braking."""
        if self._members:
            self._fill()
        self._unaimed, self._just_aimed = [], []
        self._wish[:] = 0.0
        if self.in_transition and not self.held:
            # Without a level, rest is what the hierarchy has come to.
            self.safety_filter.bounds()
            self._qd[:] = 0.0
            self.safety_filter.pass_on(self._qd)
        else:
            self.safety_filter.brake(self._qd)
        self._J.dot(self._qd, out=self._achieved)
        return Step(self._shown, self.robot.n, 1.0, self._layout)

    def _fill(self) -> None:
        """Fill the rows of all tasks at the robot's present configuration."""
        if self._compiled is None:
            from tp_controller.tasks.compiled import CompiledRows

            self._compiled = CompiledRows(
                self.robot,
                [(task, self._rows[task.name].start) for task in self._ranked],
                self._J,
                self._errors,
                self._feedforward,
                self._velocity,
            )
        self._compiled.fill()
        for task, velocity, feedforward in self._own:
            task.update()
            task.desired_velocity(velocity)
            # Of rows without an error there is nothing to approach.
            feedforward[:] = velocity if task.set_based else task.settings[1]

    def _expect(self, bounds: Bounds) -> None:
        """Tell tasks which speeds the next step can have."""
        if not self._bounding:
            return
        fastest = self._fastest
        np.negative(bounds.soon_lower, out=fastest)
        np.maximum(fastest, bounds.soon_upper, out=fastest)
        np.minimum(fastest, ENDLESS, out=fastest)
        for task in self._bounding:
            task.expect(fastest)

    def know_period(self, period: float) -> None:
        """Take over the time [s] of one step, which was unknown so far."""
        self.safety_filter.know_period(period)
        self.safety_filter.watch(self._kept())
        for task in self.tasks.values():
            task.know_period(period)

    def stay(self) -> None:
        """Turn the command of the last `step_in_place` into rest: the arm has not moved yet."""
        self._qd[:] = self._achieved[:] = 0.0
        self.braking = True
        self.rest()

    def brake(
        self, elapsed: float | None, q: Vector | None = None, qd: Vector | None = None
    ) -> Vector:
        """Compute the next command of braking to rest.

        Parameters
        ----------
        elapsed, q, qd
            As `step`, for a state that there was no time to answer. Without one, ``elapsed``
            is the time [s] since the last command.

        Returns
        -------
        Vector
            Joint velocity (n,) [rad/s, m/s]; a read-only view that the next step overwrites.
        """
        self._wish[:] = 0.0
        self.braking = True
        if q is not None:
            self.safety_filter.take(q, elapsed, qd)
        self.safety_filter.brake(self._qd, elapsed if q is None else None)
        self._J.dot(self._qd, out=self._achieved)
        return self._command

    def rest(self) -> None:
        """Go on from standstill: the last command was not carried out."""
        self.safety_filter.rest()

    def undo(self) -> None:
        """Take the last step back: its configuration comes again, no time has passed."""
        self.safety_filter.undo()

    def _refuse(self, q: Vector) -> NoReturn:
        self._qd[:] = self._wish[:] = 0.0
        for task in self._just_aimed:
            task.forget_target()
        self._just_aimed = []
        message = f'no finite command follows from the position {shown(q)}'
        if not np.isfinite(q).all():
            raise UnusableState(message)
        self.safety_filter.bounds()
        self.safety_filter.transition.give_way()
        self.safety_filter.pass_on(self._qd)
        raise UnusableState(message, self._command)


def _nothing() -> None:
    """Follow no task."""


def _read_only(array: Vector) -> Vector:
    view = array.view()
    view.flags.writeable = False
    return view
