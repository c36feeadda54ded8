"""What a controller's state says of its tasks and levels, in words for people.

States, tasks and levels are objects with the fields of tp_interfaces' ControllerState, TaskState
and LevelState.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from typing import Any

STATUS = {0: 'WAITING', 1: 'RUNNING', 2: 'STALE', 3: 'HELD', 4: 'INACTIVE'}
"""Name of every status of ControllerState."""
RUNNING = 1
RECENT = 500_000_000
"""Time [ns] up to which an explanation counts as that of the present; it is renewed every
0.1 s."""
NONE = '–'


def rank(task: Any) -> tuple[bool, int]:
    """Sort key of a task: highest level first, idle tasks last."""
    return task.level < 0, task.level


def why(state: Any, task: Any, first: bool) -> Iterator[str]:
    """Why a task does not get more.

    Parameters
    ----------
    state
        The controller's state.
    task
        One of its tasks.
    first
        Whether what is known of its level belongs to it, the first one of several.
    """
    if task.level < 0:
        yield 'idle'
        return
    if task.distance:
        nearest = min(range(len(task.distance)), key=lambda i: task.distance[i])
        near = f'near {task.components[nearest]}' if len(task.distance) > 1 else ''
        if task.active or near:
            yield ', '.join(word for word in ('acts' if task.active else '', near) if word)
    level = level_of(state, task)
    if level is None or not first:
        return
    if level.rank < level.rows:
        yield f'{level.rank} of {level.rows} directions free'
    if level.text:
        yield f'loses {level.text}'


def explained(state: Any) -> bool:
    """Whether levels and limits are those of about now, not of a motion that is over."""
    age = _nanoseconds(state.header.stamp) - _nanoseconds(state.levels_stamp)
    return state.status == RUNNING and abs(age) < RECENT


def brakes(state: Any) -> bool:
    """Whether the controller brakes though it answers joint states and no hold asks for it."""
    return bool(state.status == RUNNING and state.braking)


def level_of(state: Any, task: Any) -> Any:
    """What is known of a task's level; it may be of a moment ago, when levels were others."""
    if not explained(state):
        return None
    return next((level for level in state.levels if task.name in level.tasks), None)


def norm(values: Iterable[float]) -> str:
    """Euclidean norm of some values."""
    return number(math.hypot(*values))


def number(value: float) -> str:
    """Number with four decimals."""
    if not math.isfinite(value):
        return NONE
    # No minus before a zero.
    return f'{round(value, 4) + 0.0:.4f}' if abs(value) < 1000.0 else f'{value:.3g}'


def milliseconds(seconds: float) -> str:
    """Time [s] in milliseconds."""
    return f'{1e3 * seconds:.2g} ms' if seconds < 0.1 else f'{1e3 * seconds:.0f} ms'


def _nanoseconds(stamp: Any) -> int:
    return int(stamp.sec * 1_000_000_000 + stamp.nanosec)
