"""The whole question: straight, around, or not at all."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from enum import Enum
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tp_controller.config import START, Settings, build_settings, build_stack
from tp_controller.interpolation import VectorPath
from tp_controller.planning import ahead, search, way
from tp_controller.planning.ahead import Ahead, look_ahead
from tp_controller.planning.clear import Clear
from tp_controller.planning.conditions import Conditions, check_goals
from tp_controller.planning.search import Answer, Solution, solve
from tp_controller.planning.way import Way, find_way
from tp_controller.robot import Robot
from tp_controller.stack import Stack
from tp_controller.tasks import SetBasedTask

Vector = NDArray[np.float64]

SURE = 0.2
"""Share of the error from which on a task above is lost up to which it holds at any rate."""
COARSE, COARSE_CLEAR = 30.0, 50.0
"""Least rate [Hz] of a look ahead; with tasks that keep distances."""

FIRST = 1.5
"""Time [s] in which ways to the first solutions are looked for,"""
MANY, MANY_STARTS = 40, 400
"""before one more search for so many, from so many starts."""


class Phase(Enum):
    """What a planner is at."""

    AHEAD = 'looking ahead'
    SEARCHING = 'searching'
    PLANNING = 'planning'


class Kind(Enum):
    """What a plan is."""

    STRAIGHT = 'straight'
    AROUND = 'around'
    NONE = 'none'


class Plan(NamedTuple):
    """What to do about goals."""

    kind: Kind
    ahead: Ahead | None
    """What the straight way makes of them; None if that was not asked."""
    answer: Answer | None = None
    """Configurations that have them, where the straight way does not lead there."""
    way: Way | None = None
    """Way to one of these."""
    seconds: Mapping[str, float] = {}
    """Time [s] of every phase, by its value."""

    @property
    def text(self) -> str:
        """The plan in one line."""
        if self.kind is Kind.STRAIGHT:
            return 'the straight way leads there'
        if self.way is not None:
            how = 'planned' if self.way.planned else 'straight in joint space'
            return f'a way of {self.way.duration:.2g} s, {how}'
        if self.answer is not None and self.answer.solutions:
            took = self.seconds.get(Phase.PLANNING.value, 0.0)
            return f'{self.answer.text}, but no way to any was found in {took:.2g} s'
        return '' if self.answer is None else self.answer.text


class Planner:
    """Plans for a controller's parameters, on stacks of its own.

    Parameters
    ----------
    parameters
        As for `build_settings`; ``start`` does not count.
    description
        URDF of the robot for parameters that name none.

    Raises
    ------
    InvalidValue
        If the parameters cannot be used.

    Attributes
    ----------
    stack
        The stack of the parameters. Its targets, those of obstacles included, are the ones that
        a plan is made for.
    """

    def __init__(self, parameters: Mapping[str, Any], description: str | None = None) -> None:
        self._settings: Settings = build_settings(
            {**parameters, START: 'target'}, description, find_rate=True
        )
        self.stack: Stack = self._settings.stack
        self.robot: Robot = self.stack.robot
        self._coarse = self._slower()
        self._fine: Stack | None = None

    def _slower(self) -> Stack:
        """Stack of a lower rate for the look ahead, which keeps the same distances."""
        values, rate = dict(self._settings.values), self._settings.values['rate']
        guards = [task for task in self.stack.tasks.values() if isinstance(task, SetBasedTask)]
        steps = int((rate or 0.0) / (COARSE_CLEAR if guards else COARSE))
        if rate is None:
            # Any will do for a stack that is made for none.
            values['rate'] = COARSE_CLEAR
        elif steps > 1:
            values['rate'] = rate / steps
            for task in guards:
                if task.one_sided:
                    values[f'tasks.{task.name}.margin'] = task.margin
        return build_stack(self.robot, values)

    def plan(
        self,
        goals: Mapping[str, Sequence[float] | Vector],
        q: Vector,
        tolerances: Mapping[str, float] | None = None,
        straight: bool = True,
        tell: Callable[[Phase], object] = lambda _: None,
        stop: Callable[[], bool] = lambda: False,
    ) -> Plan:
        """Plan a way to goals for an arm at rest.

        Parameters
        ----------
        goals
            Target (target_size,) by task of the hierarchy.
        q
            Present configuration (nq,) [rad, m].
        tolerances
            Error norm [m, rad] by task that counts as reached.
        straight
            Whether the straight way is looked at first.
        tell
            Called at the beginning of every phase.
        stop
            Called at times; planning ends if it returns True.

        Raises
        ------
        InvalidValue
            If a goal or the configuration cannot be used.
        """
        check_goals(self.stack, goals)
        seconds: dict[str, float] = {}
        found: Ahead | None = None
        begin = time.monotonic()

        def end(phase: Phase) -> None:
            nonlocal begin
            now = time.monotonic()
            seconds[phase.value], begin = now - begin, now

        if straight:
            tell(Phase.AHEAD)
            found = self._look_ahead(goals, q, tolerances, stop)
            end(Phase.AHEAD)
            if found.reached:
                return Plan(Kind.STRAIGHT, found, seconds=seconds)
        tell(Phase.SEARCHING)
        answer = solve(self.stack, goals, q, search.SECONDS, stop=stop)
        end(Phase.SEARCHING)
        if not answer.solutions or stop():
            return Plan(Kind.NONE, found, answer, seconds=seconds)
        tell(Phase.PLANNING)
        path = self._find(goals, q, answer.solutions, FIRST, stop)
        if path is None and not stop():
            # Another of the configurations may be where a way leads.
            answer = solve(self.stack, goals, q, search.SECONDS, MANY, MANY_STARTS, stop=stop)
            path = self._find(goals, q, answer.solutions, way.SECONDS - FIRST, stop)
        end(Phase.PLANNING)
        return Plan(
            Kind.NONE if path is None else Kind.AROUND, found, answer, path, seconds=seconds
        )

    def is_clear(
        self,
        goals: Mapping[str, Sequence[float] | Vector],
        q: Vector,
        path: VectorPath,
        begin: float,
    ) -> bool:
        """Whether what is left of a way keeps all distances, with obstacles as they are now.

        Parameters
        ----------
        goals
            Target (target_size,) by task of the hierarchy.
        q
            Present configuration (nq,) [rad, m]; what is nearer than it has to be there may be
            as near on the way.
        path
            The way.
        begin
            Time [s] on it from which on it is looked at.

        Raises
        ------
        InvalidValue
            If a goal or the configuration cannot be used.
        """
        with Conditions(self.stack, goals, q) as conditions:
            return Clear(conditions).along(path, begin)

    def _find(
        self,
        goals: Mapping[str, Sequence[float] | Vector],
        q: Vector,
        solutions: Sequence[Solution],
        seconds: float,
        stop: Callable[[], bool],
    ) -> Way | None:
        with Conditions(self.stack, goals, q) as conditions:
            return find_way(conditions, solutions, seconds, stop)

    def _look_ahead(
        self,
        goals: Mapping[str, Sequence[float] | Vector],
        q: Vector,
        tolerances: Mapping[str, float] | None,
        stop: Callable[[], bool],
    ) -> Ahead:
        """Look ahead at a lower rate, and at the rate of the stack if something is lost by that.

        What a step misses of a task by its curvature grows with the square of the period. Where
        tasks above are disturbed, the safety filter brakes, and that is another motion at
        another rate.
        """
        self._copy_targets(self._coarse)
        found = look_ahead(self._coarse, goals, q, tolerances, ahead.LONGEST, stop)
        own = self.stack.safety_filter.period
        if found.disturbed < SURE or own >= self._coarse.safety_filter.period or stop():
            return found
        if self._fine is None:
            self._fine = build_stack(self.robot, self._settings.values)
        self._copy_targets(self._fine)
        return look_ahead(self._fine, goals, q, tolerances, ahead.LONGEST, stop)

    def _copy_targets(self, stack: Stack) -> None:
        """Give a stack of the look ahead the targets of the other."""
        for name, task in self.stack.tasks.items():
            other = stack.tasks[name]
            if task.target_size and task.target is not None:
                other.target = task.target
            elif task.target_size and not task.set_based:
                stack.aim_at_present(other)
