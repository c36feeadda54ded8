"""The part that all sides of the comparison share: blocks of steps on request.

A side is a process with an environment of its own. It reads the scenario whose path is its only
argument, then one request a line, and answers each with one line. This file needs numpy alone.
"""

import gc
import json
import math
import os
import sys
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple, Protocol

import numpy as np

LOWER = 0.1
"""Weight of a level over that of the level above it, for sides without strict priority."""

STILL, STEPS_STILL = 1e-5, 50
"""A pursuit ends that is slower [rad/s] than this in so many steps."""


class CannotDo(Exception):
    """The library has no such task, limit or shape; the message says which."""


class Problem(Protocol):
    """One stack of tasks with its limits."""

    def aim(self, goals: Mapping[str, Any], q: Any) -> None:
        """Take goals by task: position (3,), quaternion (4,) x y z w or joints (n,)."""

    def begin(self, qd: Any) -> None:
        """Take the velocity (n,) [rad/s] of the last step."""

    def step(self, q: Any) -> Any:
        """Compute the joint velocity (n,) [rad/s] at a configuration (n,)."""


class Hand(NamedTuple):
    """A frame that has a position, an orientation or both."""

    frame: str
    levels: dict[str, int]
    """Level by kind, ``position`` and ``orientation``."""
    names: dict[str, str]
    """Name of the task by kind."""

    def costs(self, scenario: Mapping[str, Any], kind: str) -> Any:
        """Cost (3,) of the axes x y z; 0 where the task leaves an axis free."""
        if kind not in self.levels:
            return np.zeros(3)
        axes = axes_of(scenario, self.names[kind])
        return cost_of(self.levels[kind]) * np.array([axis in axes for axis in 'xyz'], float)


def cost_of(level: int) -> float:
    """Cost of a level in a library that squares costs: weights are 1, 0.1, 0.01 and so on."""
    return math.sqrt(LOWER) ** level


def hands(scenario: Mapping[str, Any], problem: Mapping[str, Any]) -> list[Hand]:
    """Position and orientation tasks by frame, those of a frame together.

    Libraries that weigh tasks need one task for both, which is faster than two. A problem that
    is ``separate`` has them apart, so that one does not change what the other asks for.
    """
    found: dict[Any, Hand] = {}
    for level, names in enumerate(problem['levels']):
        for name in names:
            task = scenario['tasks'][name]
            if task['type'] == 'posture':
                continue
            key = (task['frame'], task['type'] if problem.get('separate') else '')
            hand = found.setdefault(key, Hand(task['frame'], {}, {}))
            hand.levels[task['type']] = level
            hand.names[task['type']] = name
    return list(found.values())


def posture_of(scenario: Mapping[str, Any], levels: list[list[str]]) -> tuple[int, str] | None:
    """Level and name of the posture task."""
    for level, names in enumerate(levels):
        for name in names:
            if scenario['tasks'][name]['type'] == 'posture':
                return level, name
    return None


def axes_of(scenario: Mapping[str, Any], name: str) -> str:
    """Axes that a task controls."""
    return scenario['tasks'][name].get('axes', 'xyz')


class Server:
    """Answers requests.

    Parameters
    ----------
    make
        Makes a problem of a scenario, the name of a variant and the problem's description.
    """

    def __init__(self, make: Callable[[dict[str, Any], str, dict[str, Any]], Problem]) -> None:
        self._scenario = json.loads(Path(sys.argv[1]).read_text(encoding='utf-8'))
        with np.load(self._scenario['arrays']) as arrays:
            self._arrays = dict(arrays)
        self._make = make
        self._made: dict[tuple[str, str], Problem] = {}

    def run(self) -> None:
        """Answer until the requests end."""
        # Libraries may print; answers have a way of their own.
        answers = os.fdopen(os.dup(1), 'w')
        os.dup2(2, 1)
        gc.disable()
        for line in sys.stdin:
            request = json.loads(line)
            try:
                answer = self._answer(**request)
            except CannotDo as error:
                answer = {'cannot': str(error)}
            print(json.dumps(answer), file=answers, flush=True)
            gc.collect()

    def _answer(
        self, kind: str, variant: str, problem: str, start: int, stop: int
    ) -> dict[str, Any]:
        key = (variant, problem)
        if key not in self._made:
            described = self._scenario['problems'][problem]
            self._made[key] = self._make(self._scenario, variant, described)
        goals = {
            name[5:]: values for name, values in self._arrays.items() if name.startswith('goal_')
        }
        wanted = self._scenario['problems'][problem]['levels']
        goals = {name: goals[name] for names in wanted for name in names}
        if kind == 'pursuit':
            return self._pursue(self._made[key], goals, range(start, stop))
        return self._run(self._made[key], goals, range(start, stop), kind == 'velocities')

    def _pursue(self, problem: Problem, goals: dict[str, Any], draws: range) -> dict[str, Any]:
        """Let joints follow from state i to goal i; where they are in the end, and what failed.

        They have the velocities of the steps at once, inside their ranges and speeds, and no
        velocity where a step fails.
        """
        closed, period = self._scenario['pursuit'], self._scenario['period']
        low, high, fastest = (np.array(closed[name]) for name in ('low', 'high', 'velocity'))
        ends, failed, reason = [], 0, ''
        for i in draws:
            q, qd, still = self._arrays['states'][i].copy(), np.zeros(low.size), 0
            for _ in range(closed['steps']):
                problem.aim({name: values[i] for name, values in goals.items()}, q)
                problem.begin(qd)
                try:
                    qd = np.clip(problem.step(q), -fastest, fastest)
                except Exception as error:  # every library has errors of its own
                    qd, reason = np.zeros(low.size), f'{type(error).__name__}: {error}'
                    failed += 1
                q = np.clip(q + period * qd, low, high)
                still = still + 1 if np.abs(qd).max() < STILL else 0
                if still == STEPS_STILL:
                    break
            ends.append([float(x) for x in q])
        return {'ends': ends, 'failed': failed, 'reason': reason}

    def _run(
        self, problem: Problem, goals: dict[str, Any], steps: range, tell: bool
    ) -> dict[str, Any]:
        """Durations [ns] of steps, how many failed and, if wanted, their velocities."""
        states, before = self._arrays['states'], self._arrays['velocities']
        durations, velocities, failed, reason = [], [], 0, ''
        for i in steps:
            q = states[i].copy()
            problem.aim({name: values[i % len(values)] for name, values in goals.items()}, q)
            problem.begin(before[i % len(before)])
            begin = time.process_time_ns()
            try:
                qd = problem.step(q)
            except Exception as error:  # every library has errors of its own
                qd, reason = None, f'{type(error).__name__}: {error}'
            durations.append(time.process_time_ns() - begin)
            failed += qd is None
            if tell:
                velocities.append(None if qd is None else [float(x) for x in qd])
        answer = {'durations': durations, 'failed': failed, 'reason': reason}
        return answer | ({'velocities': velocities} if tell else {})
