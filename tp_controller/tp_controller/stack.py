"""The stack of tasks: one step from a configuration to a joint velocity."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import chain

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tp_controller.aims import Aims
from tp_controller.arm import Arm
from tp_controller.errors import InvalidValue, UnusableState, shown
from tp_controller.hierarchy import named_tasks
from tp_controller.problem import Problem
from tp_controller.robot import Limits, Robot, State
from tp_controller.safety_filter import SafetyFilter
from tp_controller.solvers import Solver, solver_of
from tp_controller.stacked_rows import StackedRows
from tp_controller.step_results import Rows, Step, System, read_only
from tp_controller.stepping import Stepper
from tp_controller.task_levels import TaskLevels
from tp_controller.tasks import Task

Vector = NDArray[np.float64]


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
        self._solver = solver_of(solver, robot.n) if isinstance(solver, str) else solver
        self.tasks = named_tasks(robot, chain(tasks, *members), period)
        self._aims = Aims(self.tasks.values())
        self.safety_filter = SafetyFilter(robot, period)
        self._levels = TaskLevels(self.tasks)
        names = [' + '.join(task.name for task in level) for level in members]
        acting = self._levels.checked(names, self._solver)
        self._levels.adopt(names)
        rows = self._placed(acting, (), np.zeros(robot.n))
        self._stepper = Stepper(robot, self.safety_filter, self._aims, rows, self._solver, settle)
        self.safety_filter.watch(rows.kept)
        for task in self.tasks.values():
            task.changed = self._follow_task
        self.transition_time = transition_time

    @property
    def settle(self) -> bool:
        """Whether levels that cannot get what they ask for come to rest."""
        return self._stepper.settle

    @settle.setter
    def settle(self, settle: bool) -> None:
        self._stepper.settle = settle

    @property
    def members(self) -> Sequence[Sequence[Task]]:
        """Tasks by level, highest first, without those that are off."""
        return tuple(tuple(tasks) for tasks in self._stepper.rows.levels)

    @property
    def hierarchy(self) -> Sequence[str]:
        """Task names by level, highest first, ``a + b`` for two on one level.

        Tasks that are not `Task.enabled` keep their place, as if they were not listed; a level
        without any other is left out, and without a level the arm rests.
        """
        return self._levels.hierarchy

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
        self._levels.adopt(hierarchy)
        self._arrange(self._levels.acting(members))

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
        before, self._levels.stand_in = self._levels.stand_in, (task, tuple(names))
        try:
            members = self._levels.acting(self.check_hierarchy(self.hierarchy))
            self.solver.check(members, None)
        except InvalidValue:
            self._levels.stand_in = before
            raise
        if task.period != self.safety_filter.period:
            task.know_period(self.safety_filter.period)
        if task.target is None:
            self._aims.add(task)
        self._arrange(members)

    def give_back(self) -> None:
        """Let the levels act again that a task took the place of, as a transition."""
        task = self.stand_in
        if task is not None:
            self._levels.stand_in = None
            self._aims.remove(task)
            task.leave()
            self.rearrange()

    @property
    def stand_in(self) -> Task | None:
        """Task that acts in place of levels, None if there is none."""
        return None if self._levels.stand_in is None else self._levels.stand_in[0]

    def _follow_task(self) -> None:
        """Follow a task whose gain has changed, or which was switched on or off."""
        if self._levels.stand_in or list(self._levels.on) != self._stepper.rows.tasks:
            self.rearrange()
        else:
            self.begin_transition()

    def _arrange(self, members: Sequence[Sequence[Task]]) -> None:
        """Step with levels, which pass `check_hierarchy`, from now on; as a transition."""
        before = self._stepper.rows
        rows = self._placed(members, before.tasks, before.command)
        self._stepper.use(rows, self._solver)
        self.safety_filter.watch(rows.kept)
        self.begin_transition()

    def _placed(
        self, members: Sequence[Sequence[Task]], before: Iterable[Task], command: Vector
    ) -> StackedRows:
        """Rows of levels; tasks that were not in the levels before begin anew."""
        new = list(chain.from_iterable(members))
        # Who stays goes on as it is: rows that are in stay in.
        stays = set(before) & set(new)
        for task in (self.tasks | {task.name: task for task in new}).values():
            if task not in stays:
                task.leave()
                task.place(np.zeros_like(task.J), np.zeros(task.k))
        return StackedRows(self.robot, members, command)

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

    def forget_targets(self, known: Mapping[str, Vector] | None = None) -> None:
        """Let the tasks of the hierarchy take their values at the next step as targets.

        Obstacles stay where they are.

        Parameters
        ----------
        known
            Targets by name, as `Task.settings` has them; tasks that have another one by now
            keep it. When left out none does.
        """
        for task in self._stepper.rows.tasks:
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
        self._aims.add(task)

    @property
    def held(self) -> bool:
        """Whether `hold` keeps the arm at rest."""
        return self._aims.targets is not None

    def hold(self) -> None:
        """Bring the arm to rest inside its limits from the next step on, and keep it there.

        Every step then answers with the next command of the braking trajectory, and with zero
        once that has ended. Targets, settings, limits and the hierarchy may change meanwhile.
        """
        self._aims.hold(self.tasks)

    def resume(self, targets: bool = False) -> None:
        """Let the tasks move the arm again, from the velocity that it has by then.

        Parameters
        ----------
        targets
            Whether the targets from before count. If not, the tasks of the hierarchy take their
            values at the next step, obstacles excepted. Targets set since `hold` always count.
        """
        if self._aims.targets is not None and not targets:
            self.forget_targets(self._aims.targets)
        self._aims.resume()

    @property
    def resting(self) -> bool:
        """Whether steps bring the arm to rest: it is `held`, or there is no level."""
        return self._stepper.resting

    @property
    def at_rest(self) -> bool:
        """Whether the last command is zero, and the arm has nothing left of earlier ones."""
        return not self._stepper.rows.command.any() and self.arm.settled

    def add(self, task: Task) -> None:
        """Load a task of a new name, outside the hierarchy."""
        self.tasks[task.name] = task
        task.changed = self._follow_task
        self._aims.add(task)

    def remove(self, name: str) -> None:
        """Forget a task outside the hierarchy."""
        task = self.tasks.pop(name)
        task.changed = _nothing
        self._aims.remove(task)

    def prepare_solver(self) -> None:
        """Tell the solver of the levels, and of their tasks' weights and inverses."""
        self._stepper.use(self._stepper.rows, self._solver)

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
        return self._levels.checked(hierarchy, solver or self._solver, damping, tasks, enabled)

    @property
    def rows(self) -> Rows:
        """Rows of the last step, to be read."""
        return self._stepper.rows.told

    def systems(self) -> list[System]:
        """What every level was in the last step."""
        return self._stepper.systems()

    @property
    def answer(self) -> Vector:
        """Joint velocity (n,) that the solver gave in the last step; a copy.

        The safety filter makes the command of it.
        """
        return self._stepper.answer.copy()

    @property
    def at_bound(self) -> NDArray[np.bool_]:
        """Which joints were at a bound of their velocity (n,) in the last step's answer."""
        return self.safety_filter.last_bounds.met(self._stepper.answer) != 0

    def level_of(self, name: str) -> int:
        """Level of a task, 0 is the highest; -1 if it is off or outside the hierarchy."""
        return self.place_of(name) if name in self._stepper.rows.parts else -1

    def place_of(self, name: str) -> int:
        """List position of a task in the hierarchy, on or off; -1 outside it."""
        return self._levels.place_of(name)

    def is_listed(self, name: str) -> bool:
        """Whether a task is on and in the hierarchy, though another may act in its place."""
        return self.place_of(name) >= 0 and self.tasks[name].enabled

    def velocities_of(self, name: str) -> tuple[Vector, Vector]:
        """Views of the requested and achieved velocity (k,) of a task in the hierarchy.

        They are the ones that steps write to until the hierarchy changes.
        """
        rows = self._stepper.rows
        part = rows.parts[name]
        return read_only(rows.requested[part]), read_only(rows.achieved[part])

    @property
    def arm(self) -> Arm:
        """What the arm makes of the commands, and whether it follows them."""
        return self.safety_filter.arm

    def step(self, q: ArrayLike, elapsed: float | None = None, qd: Vector | None = None) -> Step:
        """Compute the command that answers a measured state.

        Parameters, result and errors are those of `step_in_place`; the arrays of the result are
        the caller's own.
        """
        stepper = self._stepper
        try:
            scale = stepper.step(np.asarray(q, dtype=float), elapsed, qd)
        except UnusableState as error:
            if error.command is not None:
                error.command = error.command.copy()
            raise
        rows = stepper.rows
        return Step(rows.answers.copy(), self.robot.n, scale, rows.layout)

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
        return self._stepper.problem(state, elapsed, qd)

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
        stepper = self._stepper
        scale = stepper.step(q, elapsed, qd)
        return Step(stepper.rows.shown, self.robot.n, scale, stepper.rows.layout)

    def know_period(self, period: float) -> None:
        """Take over the time [s] of one step, which was unknown so far."""
        self.safety_filter.know_period(period)
        self.safety_filter.watch(self._stepper.rows.kept)
        for task in self.tasks.values():
            task.know_period(period)

    @property
    def braking(self) -> bool:
        """Whether the last command brakes, or keeps the arm at rest, whatever tasks ask for."""
        return self._stepper.braking

    def stay(self) -> None:
        """Turn the command of the last `step_in_place` into rest: the arm has not moved yet."""
        self._stepper.stay()

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
        return self._stepper.brake(elapsed, q, qd)

    def rest(self) -> None:
        """Go on from standstill: the last command was not carried out."""
        self.safety_filter.rest()

    def undo(self) -> None:
        """Take the last step back: its configuration comes again, no time has passed."""
        self.safety_filter.undo()


def _nothing() -> None:
    """Follow no task."""
