"""One task in the panel: how it does, and what one can change about it."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import viser

from tp_controller import state_words as words
from tp_controller.units import speed
from tp_controller.view import hierarchy
from tp_controller.view.wishes import Change, Goal, Wish

PAUSE = 1.0
"""Time [s] in which something that was just changed here is not changed back."""
MOVES: Mapping[str, Callable[..., hierarchy.Levels]] = {
    'up': hierarchy.raised,
    'down': hierarchy.lowered,
    'join': hierarchy.joined,
    'out': hierarchy.left_out,
    'in': hierarchy.listed,
}
Range = tuple[float, float]


class TaskFolder:
    """Folder of a task.

    Parameters
    ----------
    gui
        Where it is, in the present container.
    task
        The task as ``~/state`` tells it.
    unit
        Unit of its error.
    ranges
        Least and largest value by joint, for the sliders of a task on joints that takes goals;
        empty if it takes none.
    ask
        Called with what is asked for, by another thread; None if nothing can be.
    levels
        Tells the present levels.
    """

    def __init__(
        self,
        gui: viser.GuiApi,
        task: Any,
        unit: str,
        ranges: Mapping[str, Range],
        ask: Callable[[Wish], None] | None,
        levels: Callable[[], hierarchy.Levels],
    ) -> None:
        self._gui, self._name, self._levels, self._unit = gui, task.name, levels, unit
        self._busy = 0.0
        self._desired = list(task.desired)
        self._shown_gain: list[float] = []
        self._sliders: list[Any] = []
        self._controls = ask is not None
        self.folder = gui.add_folder(task.name, expand_by_default=False)
        with self.folder:
            if ask is not None:
                self._add_controls(task, ranges, ask)
            # Below what one presses: nothing moves away under the mouse.
            self._text = gui.add_markdown('')

    def follow(
        self, state: Any, task: Any, first: bool, parameters: Mapping[str, Any], number: int
    ) -> None:
        """Show a new state.

        Parameters
        ----------
        state, task
            The controller's state, and the part of it about this task.
        first
            Whether what is known of its level is told here.
        parameters
            The controller's parameters by dotted key, as far as they are known.
        number
            Place of the folder among the others.
        """
        self.folder.label = _label(task, self._unit)
        self.folder.order = 100.0 + number
        gain = parameters.get(f'tasks.{self._name}.gain')
        shown_gain = None if self._controls else gain
        self._text.content = _text(state, task, self._unit, first, shown_gain)
        if not self._controls:
            return
        listed = task.level >= 0
        self._moves.visible, self._come.visible = listed, not listed
        if time.monotonic() < self._busy:
            return
        self._desired = list(task.desired)
        key = f'tasks.{self._name}.enabled'
        on = bool(task.enabled if listed else parameters.get(key, True))
        if self._on.value != on:
            self._on.value = on
        if gain is not None and self._shown_gain != list(gain):
            self._shown_gain = list(gain)
            self._gain.value = _numbers(gain)
        for slider, value in zip(self._sliders, task.desired, strict=False):
            if math.isfinite(value) and abs(slider.value - value) > 0.5 * slider.step:
                slider.value = min(max(round(value, 4), slider.min), slider.max)

    def _add_controls(
        self, task: Any, ranges: Mapping[str, Range], ask: Callable[[Wish], None]
    ) -> None:
        gui, name = self._gui, self._name

        async def switch(event: viser.GuiEvent[Any]) -> None:
            if event.client_id is not None:
                self._pause()
                ask(Change(f'tasks.{name}.enabled', bool(event.target.value)))

        async def move(event: viser.GuiEvent[Any]) -> None:
            self._pause()
            levels = MOVES[event.target.value](self._levels(), name)
            ask(Change('hierarchy', hierarchy.parameter(levels)))

        async def set_gain(event: viser.GuiEvent[Any]) -> None:
            values = read_numbers(self._gain.value)
            if values:
                self._pause()
                ask(Change(f'tasks.{name}.gain', values))
            else:
                self._shown_gain = []

        async def slide(event: viser.GuiEvent[Any]) -> None:
            if event.client_id is None or not all(map(math.isfinite, self._desired)):
                return
            self._pause()
            # The other joints stay where they are to be, whatever their sliders show.
            self._desired[self._sliders.index(event.target)] = float(event.target.value)
            ask(Goal(name, tuple(self._desired)))

        self._on: Any = gui.add_checkbox('on', bool(task.enabled or task.level < 0))
        self._on.on_update(switch)
        self._moves = gui.add_button_group('move', ('up', 'down', 'join', 'out'))
        self._moves.hint = 'join: on the level above; out: idle'
        self._moves.on_click(move)
        self._come = gui.add_button_group('hierarchy', ('in',), visible=False)
        self._come.hint = 'as the lowest level'
        self._come.on_click(move)
        with gui.add_form(None) as form:
            self._gain: Any = gui.add_text('gain [1/s]', '', hint='Enter sets it')
        form.on_submit(set_gain)
        for joint in task.target_components if ranges else ():
            least, most = ranges[joint]
            middle = min(max(0.0, least), most)
            slider = gui.add_slider(joint, least, most, round((most - least) / 500, 6), middle)
            slider.on_update(slide)
            self._sliders.append(slider)

    def _pause(self) -> None:
        self._busy = time.monotonic() + PAUSE


def _label(task: Any, unit: str) -> str:
    level = 'idle' if task.level < 0 else str(task.level)
    if len(task.distance):
        acts = ', acts' if task.active else ''
        value = f'{words.number(min(task.distance))} {unit} away{acts}'
    else:
        value = f'error {words.number(task.error_norm)} {unit}'
    return f'{level} · {task.name} · {value if task.enabled or task.level < 0 else "off"}'


def _text(state: Any, task: Any, unit: str, first: bool, gain: Sequence[float] | None) -> str:
    lines = [f'*{task.type}*' + (f' of `{task.frame}`' if task.frame else '')]
    if not len(task.distance) and len(task.error):
        parts = ', '.join(
            f'{name} {words.number(value)}'
            for name, value in zip(task.components, task.error, strict=True)
        )
        lines.append(f'error {parts} [{unit}]')
    if task.level >= 0 and (task.active or not len(task.distance)):
        asks, gets = words.norm(task.requested_velocity), words.norm(task.achieved_velocity)
        lines.append(f'asks {asks}, gets {gets} [{speed(unit)}]')
    if gain is not None:
        lines.append(f'gain {_numbers(gain)} 1/s')
    lines += list(words.why(state, task, first))
    if task.message:
        lines.append(f'refused: {task.message}')
    return '  \n'.join(lines)


def _numbers(values: Sequence[float]) -> str:
    return ' '.join(f'{value:g}' for value in values)


def read_numbers(text: str) -> list[float]:
    """Numbers of a text, apart by spaces or commas; none if anything else is in it."""
    try:
        return [float(word) for word in text.replace(',', ' ').split()]
    except ValueError:
        return []
