"""A controller's state as text for a terminal: who does what, who blocks whom, what limits."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

from rich import box
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from tp_controller.ros.state_watch import nanoseconds
from tp_interfaces.msg import ControllerState, LevelState, TaskState

NAMES = {
    ControllerState.WAITING: ('WAITING', 'bold yellow'),
    ControllerState.RUNNING: ('RUNNING', 'bold green'),
    ControllerState.STALE: ('STALE', 'bold red'),
    ControllerState.HELD: ('HELD', 'bold yellow'),
    ControllerState.INACTIVE: ('INACTIVE', 'bold yellow'),
}
"""Name of every status, and how it looks."""
RECENT = 500_000_000
"""Time [ns] up to which an explanation counts as that of the present; it is renewed every
0.1 s."""
NONE = '–'
LONGEST_NAME = 20
"""Letters of a task's name on one line."""


class Sight(NamedTuple):
    """What there is to show."""

    topic: str
    """Full name of ``~/state``."""
    state: ControllerState | None
    """The newest state, None before the first."""
    rate: float
    """Joint states answered per second [Hz], not a number if unknown."""
    silence: str
    """Why nothing new comes, empty if something does."""


def render(sight: Sight) -> RenderableType:
    """Everything, one part below the other; lines fold inside their cells at any width."""
    state = sight.state
    parts: list[RenderableType] = []
    if sight.silence:
        parts.append(Text(sight.silence, 'bold red'))
    if state is not None:
        if sight.silence:
            parts.append(Text('the last state was:'))
        parts += [_head(sight.topic, state, sight.rate), _counters(state)]
        if state.tasks:
            parts += [Text(), _tasks(state)]
        parts += [Text(), _ends(state)]
    return Group(*parts)


def _head(topic: str, state: ControllerState, rate: float) -> Text:
    name, style = NAMES.get(state.status, (str(state.status), 'bold'))
    text = Text(topic.removesuffix('/state')).append('  ').append(name, style).append('\n')
    if math.isfinite(rate):
        text.append(f'{rate:.0f} commands/s  ')
    text.append(f'cycle {_ms(state.solve_time)}  ')
    text.append(f'age {_ms(state.command_age)}, at most {_ms(state.largest_command_age)}  ')
    return text.append(f'scale {state.scale:.2f}', 'yellow' if state.scale < 1.0 else '')


def _counters(state: ControllerState) -> Text:
    counts = {
        'answered': state.cycles,
        'late': state.overruns,
        'skipped': state.skipped,
        'overtaken': state.overtaken,
        'ignored': state.ignored_states,
        'goals refused': state.rejected_goals,
    }
    return Text('  '.join(f'{word} {count}' for word, count in counts.items()), 'dim')


def _tasks(state: ControllerState) -> Table:
    table = Table(
        box=box.SIMPLE_HEAD, pad_edge=False, padding=(0, 1, 0, 0), show_edge=False, expand=True
    )
    longest = max(len(task.name) for task in state.tasks)
    table.add_column('level', justify='right', no_wrap=True)
    table.add_column('task', overflow='fold', width=min(longest, LONGEST_NAME))
    table.add_column('error', justify='right', no_wrap=True)
    table.add_column('distance', justify='right', no_wrap=True)
    table.add_column('asks', justify='right', no_wrap=True)
    table.add_column('gets', justify='right', no_wrap=True)
    table.add_column('why not more', overflow='fold', ratio=1)
    told: set[int] = set()
    for task in sorted(state.tasks, key=_rank):
        level = NONE if task.level < 0 else str(task.level)
        first = task.level not in told
        told.add(task.level)
        table.add_row(
            level if first else '',
            task.name,
            *_numbers(task),
            Text('; '.join(_why(state, task, first)), _style(task)),
            style='dim' if task.level < 0 else '',
        )
    return table


def _rank(task: TaskState) -> tuple[bool, int]:
    """Idle tasks come last."""
    return task.level < 0, task.level


def _numbers(task: TaskState) -> tuple[str, str, str, str]:
    """Error, distance, and the norms of what the task asks for and gets."""
    asks, gets = _norm(task.requested_velocity), _norm(task.achieved_velocity)
    if task.level < 0:
        asks = gets = NONE
    if not task.distance:
        return _number(task.error_norm), NONE, asks, gets
    distance = _number(min(task.distance))
    # What a bound asks for is the least speed that it allows: nothing while it is out.
    return NONE, distance, *((asks, gets) if task.active else (NONE, NONE))


def _why(state: ControllerState, task: TaskState, first: bool) -> Iterator[str]:
    if task.level < 0:
        yield 'idle'
        return
    if task.distance:
        nearest = min(range(len(task.distance)), key=lambda i: task.distance[i])
        near = f'near {task.components[nearest]}' if len(task.distance) > 1 else ''
        if task.active or near:
            yield ', '.join(word for word in ('acts' if task.active else '', near) if word)
    level = _level_of(state, task)
    if level is None or not first:
        return
    if level.rank < level.rows:
        yield f'{level.rank} of {level.rows} directions free'
    if level.text:
        yield f'loses {level.text}'


def _explained(state: ControllerState) -> bool:
    """Whether levels and limits are those of about now, not of a motion that is over."""
    age = nanoseconds(state.header.stamp) - nanoseconds(state.levels_stamp)
    return state.status == ControllerState.RUNNING and abs(age) < RECENT


def _level_of(state: ControllerState, task: TaskState) -> LevelState | None:
    """What is known of a task's level; it may be of a moment ago, when levels were others."""
    if not _explained(state):
        return None
    return next((level for level in state.levels if task.name in level.tasks), None)


def _style(task: TaskState) -> str:
    return 'yellow' if task.distance and task.active else ''


def _ends(state: ControllerState) -> Table:
    """Limits that are met and the message, with their names beside them."""
    table = Table(box=None, show_header=False, pad_edge=False, padding=(0, 1), expand=True)
    table.add_column(no_wrap=True)
    table.add_column(overflow='fold', ratio=1)
    limits = ', '.join(state.active_limits if _explained(state) else ())
    table.add_row('limits met', Text(limits or NONE, 'yellow' if limits else ''))
    messages = state.message.split('; ') if state.message else [NONE]
    table.add_row('message', Text('\n'.join(messages), 'yellow' if state.message else ''))
    return table


def _norm(values: object) -> str:
    return _number(math.hypot(*values))  # type: ignore[misc]


def _number(value: float) -> str:
    if not math.isfinite(value):
        return NONE
    return f'{value:.4f}' if abs(value) < 1000.0 else f'{value:.3g}'


def _ms(seconds: float) -> str:
    return f'{1e3 * seconds:.2g} ms' if seconds < 0.1 else f'{1e3 * seconds:.0f} ms'
