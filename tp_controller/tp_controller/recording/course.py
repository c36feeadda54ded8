"""What a controller did, as arrays over time."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]


class TaskCourse(NamedTuple):
    """One task over N cycles; NaN where it was not there."""

    name: str
    type: str
    """As in a parameter file."""
    frame: str
    """Frame that it controls, empty without one."""
    relative_to: str
    """Frame that this one is seen from, empty for the base."""
    components: tuple[str, ...]
    """Name of each row (k)."""
    target_components: tuple[str, ...]
    """Name of each desired value (m)."""
    level: NDArray[np.int_]
    """Place in the hierarchy (N,), -1 outside."""
    enabled: Flags
    """Whether it takes part (N,)."""
    active: Flags
    """Whether it acts (N,)."""
    desired: Array
    """Desired values (N, m) [m, rad]."""
    current: Array
    """Present values (N, m) [m, rad]."""
    error: Array
    """Errors (N, k) [m, rad], desired less current."""
    error_norm: Array
    """Norms of the errors (N,)."""
    distance: Array
    """Distances of a set-based task from its boundary (N, k) [m, rad], else (N, 0)."""
    requested: Array
    """Task velocities asked for (N, k) [m/s, rad/s]."""
    achieved: Array
    """Task velocities of the commands (N, k) [m/s, rad/s]."""

    @property
    def place(self) -> int:
        """Its last place in the hierarchy, -1 if it was never in it."""
        listed = self.level[self.level >= 0]
        return int(listed[-1]) if listed.size else -1


class LevelCourse(NamedTuple):
    """One level of the hierarchy as it was explained at M moments; NaN where it was not there."""

    tasks: tuple[str, ...]
    """Names of its tasks, the last ones if they changed."""
    rows: Array
    """Rows that act (M,)."""
    rank: Array
    """Directions in which higher levels leave freedom (M,)."""
    smallest_singular_value: Array
    """Of these directions (M,), infinite without one."""


class Run(NamedTuple):
    """N cycles of a robot of n joints."""

    start: int
    """Stamp [ns] of the joint state of the first cycle."""
    time: Array
    """Time of the joint state that each cycle answered (N,) [s], from 0."""
    joints: tuple[str, ...]
    """Names of the velocities (n)."""
    coordinates: tuple[str, ...]
    """Names of the positions."""
    q: Array
    """Configurations (N, nq) [rad, m]."""
    command: Array
    """Commanded velocities (N, n) [rad/s, m/s]."""
    scale: Array
    """What velocity limits left of the command (N,)."""
    braking: NDArray[np.bool_]
    """Whether each command braked, or kept the arm at rest, whatever the tasks asked for (N,)."""
    age: Array
    """Age of each command when it was sent (N,) [s]."""
    solve_time: Array
    """Time of each computation (N,) [s]."""
    tasks: tuple[TaskCourse, ...]
    """Tasks by the hierarchy, highest first, idle ones last."""
    level_time: Array
    """Moments (M,) [s] at which levels were explained."""
    levels: tuple[LevelCourse, ...]
    """Levels, highest first."""

    def task(self, name: str) -> TaskCourse:
        """Course of a task by its name."""
        return next(task for task in self.tasks if task.name == name)


def states_of_cycles(states: Iterable[Any]) -> dict[int, Any]:
    """States by the stamps [ns] of the joint states that they answer, in their order.

    Of several about one joint state the last one counts; those before the first cycle and those
    of a controller that brakes without joint states are left out.
    """
    found: dict[int, Any] = {}
    cycles = -1
    for state in states:
        if state.cycles > 0 and state.cycles != cycles:
            found[nanoseconds(state.header.stamp)] = state
        cycles = state.cycles
    return dict(sorted(found.items()))


def run_of(states: Iterable[Any]) -> Run:
    """Arrays of a controller's states, objects with the fields of ``ControllerState``.

    Raises
    ------
    ValueError
        If there is no cycle among them.
    """
    by_stamp = states_of_cycles(states)
    if not by_stamp:
        raise ValueError('no cycle')
    stamps = np.array(list(by_stamp), dtype=np.int64)
    kept = list(by_stamp.values())
    last = kept[-1]
    start = int(stamps[0])
    names = dict.fromkeys(task.name for state in kept for task in state.tasks)
    courses = [_task_course(kept, name) for name in names]
    courses.sort(key=lambda course: course.place if course.place >= 0 else len(kept))
    level_time, levels = _levels(kept, start)
    return Run(
        start=start,
        time=_seconds(stamps - start),
        joints=tuple(last.joint_names),
        coordinates=tuple(last.position_names),
        q=np.array([state.position for state in kept]),
        command=np.array([state.command for state in kept]),
        scale=np.array([state.scale for state in kept]),
        # Older recordings do not tell.
        braking=np.array([getattr(state, 'braking', False) for state in kept]),
        age=np.array([state.command_age for state in kept]),
        solve_time=np.array([state.solve_time for state in kept]),
        tasks=tuple(courses),
        level_time=level_time,
        levels=levels,
    )


def nanoseconds(stamp: Any) -> int:
    """Stamp of a message as one number [ns]."""
    return int(stamp.sec * 1_000_000_000 + stamp.nanosec)


def _task_course(states: Sequence[Any], name: str) -> TaskCourse:
    found = [next((t for t in state.tasks if t.name == name), None) for state in states]
    sample = next(task for task in reversed(found) if task is not None)

    def each(field: str, missing: Any) -> Any:
        return np.array([missing if task is None else getattr(task, field) for task in found])

    def rows(field: str) -> Array:
        size = len(getattr(sample, field))
        gap = [math.nan] * size
        values = [
            gap if task is None or len(getattr(task, field)) != size else getattr(task, field)
            for task in found
        ]
        return np.array(values, dtype=float).reshape(len(found), size)

    return TaskCourse(
        name=name,
        type=sample.type,
        frame=sample.frame,
        relative_to=sample.relative_to,
        components=tuple(sample.components),
        target_components=tuple(sample.target_components),
        level=each('level', -1),
        enabled=each('enabled', False),
        active=each('active', False),
        desired=rows('desired'),
        current=rows('current'),
        error=rows('error'),
        error_norm=each('error_norm', math.nan),
        distance=rows('distance'),
        requested=rows('requested_velocity'),
        achieved=rows('achieved_velocity'),
    )


def _levels(states: Sequence[Any], start: int) -> tuple[Array, tuple[LevelCourse, ...]]:
    moments = {nanoseconds(s.levels_stamp): s.levels for s in states if s.levels}
    stamps = np.array(list(moments), dtype=np.int64)
    count = max((len(levels) for levels in moments.values()), default=0)
    found = []
    for i in range(count):
        values = [levels[i] if i < len(levels) else None for levels in moments.values()]

        def each(field: str, values: Sequence[Any] = values) -> Array:
            return np.array(
                [math.nan if level is None else float(getattr(level, field)) for level in values]
            )

        tasks = next(tuple(level.tasks) for level in reversed(values) if level is not None)
        found.append(
            LevelCourse(tasks, each('rows'), each('rank'), each('smallest_singular_value'))
        )
    return _seconds(stamps - start), tuple(found)


def _seconds(nanoseconds: NDArray[np.int64]) -> Array:
    return np.multiply(nanoseconds, 1e-9, dtype=np.float64)
