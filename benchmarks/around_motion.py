"""Goals gone as ``~/reach`` does with around, without nodes; all that has to be kept is judged."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from tp_controller.config import build_settings, read_parameter_file
from tp_controller.errors import UnusableState
from tp_controller.planning import Kind, Plan, Planner
from tp_controller.planning.excursion import Excursion
from tp_controller.stack import Stack
from tp_controller.tasks import PoseTask, Task

CONFIG = Path(__file__).resolve().parent.parent / 'config'
CLOSE = np.array([1e-3, math.radians(0.1)])
"""Largest distance [m] and angle [rad] of a goal that is reached."""
SECONDS = 30.0
"""Time [s] after the way, or from the start of a straight one, to be within tolerance."""
TRIES = 3
"""Plans for one goal, as the action `~/reach` has them."""
STUCK = 3.0
"""Time [s] without progress after which a straight way is given up."""
TOLERANCE = 1e-3
"""Error norm [m, rad] that the planner is told."""
HOLDS = 1e-3, math.radians(0.5)
"""Largest error [m], [rad] of a task that has to hold on the way."""


class Case(NamedTuple):
    """A stack to try."""

    name: str
    file: str
    goals: tuple[str, ...]
    """Tasks that have goals."""
    changes: tuple[tuple[str, Any], ...] = ()
    clear: bool = False
    """Whether starts and goals keep all distances."""
    upright: bool = False
    """Whether starts and goals have the hand down."""

    def values(self) -> dict[str, Any]:
        return read_parameter_file(CONFIG / f'{self.file}.yaml', 'tp_controller') | dict(
            self.changes
        )


class Outcome(NamedTuple):
    """What became of one draw."""

    reached: bool
    kind: str
    seconds: tuple[float, float, float]
    """Times [s] to look ahead, to search, to plan."""
    planned: bool
    length: float
    """Length [rad] of the motion in joint space,"""
    direct: float
    """and that of the straight line to where it ended."""
    duration: float
    """Time [s] of the motion."""
    broken: tuple[str, ...]
    text: str


made: dict[str, tuple[Planner, Stack]] = {}


def tools(case: Case) -> tuple[Planner, Stack]:
    """A planner and a stack of a case."""
    if case.name not in made:
        made[case.name] = Planner(case.values()), build_settings(case.values()).stack
    return made[case.name]


def errors(task: Task) -> np.ndarray:
    """Error [m] and [rad] of a task."""
    parts = np.split(task.error, [3]) if isinstance(task, PoseTask) else [task.error]
    return np.array([np.linalg.norm(part) for part in parts])


def close(task: Task) -> bool:
    limit = {'position': CLOSE[:1], 'orientation': CLOSE[1:]}.get(task.type, CLOSE)
    return bool(np.all(errors(task) <= limit))


class Motion:
    """A stack and joints that carry out every command exactly; everything kept is judged."""

    def __init__(self, stack: Stack, start: np.ndarray, holds: Sequence[str]) -> None:
        self.stack, self.q = stack, start.copy()
        self.dt = stack.safety_filter.period
        self.time = self.length = 0.0
        self.broken: set[str] = set()
        self._holds = [stack.tasks[name] for name in holds]
        self._last = np.zeros(stack.robot.n)
        self._count = 0
        stack.rest()

    def step(self) -> None:
        stack, limits = self.stack, self.stack.robot.limits
        try:
            command = stack.step_in_place(self.q).command
        except UnusableState as error:
            command = np.zeros(stack.robot.n) if error.command is None else error.command
        if np.any(np.abs(command) > limits.velocity * (1.0 + 1e-9)):
            self.broken.add('speed')
        rise = np.abs(command - self._last) / self.dt
        if np.any(rise > limits.acceleration * (1.0 + 1e-6) + 1e-6):
            self.broken.add('acceleration')
        if self._count % 5 == 0 and self._distance() <= 0.0:
            self.broken.add('distance')
        for task in self._holds:
            limit = HOLDS[0] if task.type == 'position' else HOLDS[1]
            if np.linalg.norm(task.error) > limit:
                self.broken.add(task.name)
        self._last = command.copy()
        way = self.dt * command
        self.length += math.sqrt(way @ way)
        self.q = stack.robot.integrate(self.q, way)
        if np.any(self.q < limits.position_min - 1e-9) or np.any(
            self.q > limits.position_max + 1e-9
        ):
            self.broken.add('range')
        self.time += self.dt
        self._count += 1

    def _distance(self) -> float:
        found = math.inf
        for level in self.stack.members:
            for task in level:
                if task.set_based:
                    distance = np.empty(task.k)
                    task.probe(distance)
                    found = min(found, float(distance.min()))
        return found


def pursue(
    case: Case, start: np.ndarray, goals: dict[str, np.ndarray], around: bool = True
) -> Outcome:
    """Go to goals as ``~/reach`` does with around."""
    planner, stack = tools(case)
    holds = ['down'] if case.upright else []
    for name, goal in goals.items():
        stack.tasks[name].target = goal
    motion = Motion(stack, start, holds)
    tasks = [stack.tasks[name] for name in goals]
    plan, first, straight = None, None, True
    for _ in range(TRIES):
        plan = planner.plan(goals, motion.q, dict.fromkeys(goals, TOLERANCE), straight)
        first = first or plan
        if plan.kind is Kind.NONE:
            break
        if plan.way is not None and not follow(motion, plan, list(goals)):
            continue
        if straight_on(motion, tasks):
            break
        straight = False
        rest(motion, list(goals))
    assert first is not None
    seconds = tuple(
        first.seconds.get(name, 0.0) for name in ('looking ahead', 'searching', 'planning')
    )
    direct = float(np.linalg.norm(stack.robot.difference(start, motion.q)))
    stack.robot.update(motion.q)
    for task in tasks:
        task.update()
    reached = all(close(task) for task in tasks)
    planned = first.way is not None and first.way.planned
    return Outcome(
        reached, first.kind.value, seconds, planned, motion.length, direct, motion.time,
        tuple(sorted(motion.broken)), '' if reached else plan.text if plan else '',
    )  # fmt: skip


def follow(motion: Motion, plan: Plan, names: list[str]) -> bool:
    """Follow a way to its end."""
    excursion = Excursion(motion.stack, names)
    excursion.follow(plan.way.path)
    while True:
        excursion.advance(motion.dt)
        if excursion.over or excursion.stuck:
            reached = excursion.over
            excursion.end()
            return reached
        motion.step()


def rest(motion: Motion, names: list[str]) -> None:
    """Bring the arm to rest."""
    excursion = Excursion(motion.stack, names)
    for _ in range(round(2.0 / motion.dt)):
        motion.step()
        if np.abs(motion.stack.answer).max() > 1e-3:
            excursion.stay()
    excursion.end()


def straight_on(motion: Motion, tasks: Sequence[Task]) -> bool:
    """Go on to the goals; whether they are reached."""
    end, best, since = motion.time + SECONDS, math.inf, motion.time
    while motion.time < end:
        motion.step()
        if all(close(task) for task in tasks):
            return True
        size = sum(float(np.linalg.norm(task.error)) for task in tasks)
        if size < 0.98 * best:
            best, since = size, motion.time
        elif motion.time - since > STUCK:
            return False
    return False
