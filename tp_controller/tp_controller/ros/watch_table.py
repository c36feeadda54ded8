"""A controller's state as text for a terminal: who does what, who blocks whom, what limits."""

from __future__ import annotations

import math
from typing import NamedTuple

from rich import box
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from tp_controller.state_words import (
    NONE,
    STATUS,
    brakes,
    explained,
    milliseconds,
    norm,
    number,
    rank,
    why,
)
from tp_interfaces.msg import ControllerState, TaskState

STYLES = {
    ControllerState.WAITING: 'bold yellow',
    ControllerState.RUNNING: 'bold green',
    ControllerState.STALE: 'bold red',
    ControllerState.HELD: 'bold yellow',
    ControllerState.INACTIVE: 'bold yellow',
}
"""How every status looks."""
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
    name = STATUS.get(state.status, str(state.status))
    style = STYLES.get(state.status, 'bold')
    text = Text(topic.removesuffix('/state')).append('  ').append(name, style)
    if brakes(state):
        text.append('  braking, tasks do not count', 'bold red')
    text.append('\n')
    if math.isfinite(rate):
        text.append(f'{rate:.0f} commands/s  ')
    text.append(f'cycle {milliseconds(state.solve_time)}  ')
    most = milliseconds(state.largest_command_age)
    text.append(f'age {milliseconds(state.command_age)}, at most {most}  ')
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
    for task in sorted(state.tasks, key=rank):
        level = NONE if task.level < 0 else str(task.level)
        first = task.level not in told
        told.add(task.level)
        table.add_row(
            level if first else '',
            task.name,
            *_numbers(task),
            Text('; '.join(why(state, task, first)), _style(task)),
            style='dim' if task.level < 0 else '',
        )
    return table


def _numbers(task: TaskState) -> tuple[str, str, str, str]:
    """Error, distance, and the norms of what the task asks for and gets."""
    asks, gets = norm(task.requested_velocity), norm(task.achieved_velocity)
    if task.level < 0:
        asks = gets = NONE
    if not task.distance:
        return number(task.error_norm), NONE, asks, gets
    distance = number(min(task.distance))
    # What a bound asks for is the least speed that it allows: nothing while it is out.
    return NONE, distance, *((asks, gets) if task.active else (NONE, NONE))


def _style(task: TaskState) -> str:
    return 'yellow' if task.distance and task.active else ''


def _ends(state: ControllerState) -> Table:
    """Limits that are met and the message, with their names beside them."""
    table = Table(box=None, show_header=False, pad_edge=False, padding=(0, 1), expand=True)
    table.add_column(no_wrap=True)
    table.add_column(overflow='fold', ratio=1)
    limits = ', '.join(state.active_limits if explained(state) else ())
    table.add_row('limits met', Text(limits or NONE, 'yellow' if limits else ''))
    messages = state.message.split('; ') if state.message else [NONE]
    table.add_row('message', Text('\n'.join(messages), 'yellow' if state.message else ''))
    return table
