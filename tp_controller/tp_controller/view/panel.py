"""The panel beside the scene: status, buttons, the hierarchy, what is shown, plots."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import viser

from tp_controller import state_words as words
from tp_controller.view import hierarchy
from tp_controller.view.plots import Plot, error, nearest, split
from tp_controller.view.task_folder import Range, TaskFolder
from tp_controller.view.wishes import Hold, Record, Reset, Save, Wish

LIGHTS = {0: '#e6a700', 1: '#0a9e5a', 2: '#d51e1e', 3: '#e67700', 4: '#e6a700'}
"""Color of every status of ControllerState."""

RECORD, STOP = 'Start recording', 'Stop recording'


class Panel:
    """Everything beside the scene.

    Parameters
    ----------
    gui
        Where it is.
    file
        Proposed for the stack to be saved to.
    ask
        Called with what is asked for, by another thread; None if nothing can be.
    """

    def __init__(self, gui: viser.GuiApi, file: str, ask: Callable[[Wish], None] | None) -> None:
        self._gui, self._ask = gui, ask
        self._state: Any = None
        self._message = ''
        self._recorded = ''
        self._record: Any = None
        self._where: Any = None
        self._status = gui.add_markdown('', order=0.0)
        # Below what one presses: nothing moves away under the mouse.
        self._messages = gui.add_markdown('', order=24.0)
        if ask is not None:
            self._add_buttons(file, ask)
        self._tasks = gui.add_folder('Hierarchy, highest first', order=10.0)
        self._add_choices()
        self._folders: dict[str, TaskFolder] = {}
        self._plot_folder: viser.GuiFolderHandle | None = None
        self._plots: list[Plot] = []
        self._ranges: Mapping[str, Mapping[str, Range]] = {}

    def wait(self, text: str) -> None:
        """Show what is waited for, beside the last state; empty if nothing is."""
        self._message = text

    def show_simulator(self, there: bool) -> None:
        """Offer the reset of a simulated robot, if there is one."""
        if self._ask is not None:
            self._reset.visible = there

    def show_recording(self, path: str) -> None:
        """Offer to end the recording into a file, or to begin one if it is empty."""
        if self._ask is None or path == self._recorded:
            return
        self._recorded = path
        self._record.label = STOP if path else RECORD
        self._record.color = 'red' if path else None
        self._where.content = f'into `{path}`' if path else ''

    def set_tasks(
        self,
        tasks: Sequence[Any],
        ranges: Mapping[str, Mapping[str, Range]],
        units: Mapping[str, str],
    ) -> None:
        """Make folders and plots for these tasks.

        Parameters
        ----------
        tasks
            The tasks as ``~/state`` tells them.
        ranges
            Least and largest value by task and joint.
        units
            Unit of the error by task.
        """
        for folder in self._folders.values():
            folder.folder.remove()
        with self._tasks:
            self._folders = {
                task.name: TaskFolder(
                    self._gui,
                    task,
                    units[task.name],
                    ranges.get(task.name, {}),
                    self._ask,
                    self._levels,
                )
                for task in sorted(tasks, key=words.rank)
            }
        self._numbers = split(tasks)
        self._make_plots()

    def follow(self, state: Any, rate: float, parameters: Mapping[str, Any]) -> None:
        """Show a new state; states of other tasks than those of `set_tasks` show nothing of them.

        Parameters
        ----------
        state
            The controller's state, None before the first.
        rate
            Commands per second [Hz], not a number if unknown.
        parameters
            The controller's parameters by dotted key, as far as they are known.
        """
        self._state = state
        self._status.content = '  \n'.join(self._lines(state, rate))
        if state is None:
            return
        self._messages.content = '  \n'.join(_messages(state))
        if self._ask is not None:
            self._resume.visible = bool(state.held)
        told: set[int] = set()
        for i, task in enumerate(sorted(state.tasks, key=words.rank)):
            if task.name in self._folders:
                first = task.level not in told
                self._folders[task.name].follow(state, task, first, parameters, i)
                told.add(task.level)

    def see(self, seconds: float, state: Any) -> None:
        """Keep the errors of a state at a time [s] for the plots."""
        tasks = {task.name: task for task in state.tasks}
        for plot in self._plots:
            plot.see(seconds, tasks)

    def forget(self) -> None:
        """Forget what plots have kept."""
        for plot in self._plots:
            plot.forget()

    def draw_plots(self) -> None:
        """Bring the plots up to date."""
        for plot in self._plots:
            plot.draw()

    def _lines(self, state: Any, rate: float) -> list[str]:
        lines = [f'{_light("#999999")} **{self._message}**'] if self._message else []
        if state is not None:
            lines.append(_state_line(state, rate))
        if self._ask is None:
            lines.append('*read-only: nothing can be asked for here*')
        return lines

    def _levels(self) -> hierarchy.Levels:
        return hierarchy.levels_of(() if self._state is None else self._state.tasks)

    def _add_buttons(self, file: str, ask: Callable[[Wish], None]) -> None:
        gui = self._gui
        # Two buttons: who presses Hold twice, or together with others, does not resume.
        hold = gui.add_button('Hold', color='red', order=1.0, hint='to rest, and stay there')
        self._resume = gui.add_button('Resume', color='green', visible=False, order=1.5)
        self._reset = gui.add_button('Reset the simulator', visible=False, order=2.0)

        async def begin(_: viser.GuiEvent[Any]) -> None:
            ask(Hold(True))

        async def end(_: viser.GuiEvent[Any]) -> None:
            ask(Hold(False))

        async def reset(_: viser.GuiEvent[Any]) -> None:
            ask(Reset())

        async def save(_: viser.GuiEvent[Any]) -> None:
            ask(Save(str(path.value), bool(replace.value)))

        hold.on_click(begin)
        self._resume.on_click(end)
        self._reset.on_click(reset)
        with gui.add_folder('Record', order=21.0, expand_by_default=False):
            name = gui.add_text('name', 'run', hint="a new file on the page's machine, .mcap")
            self._record = gui.add_button(RECORD)
            self._where = gui.add_markdown('')

        async def record(_: viser.GuiEvent[Any]) -> None:
            ask(Record('' if self._recorded else str(name.value) or ' '))

        self._record.on_click(record)
        with gui.add_folder('Save the stack', order=22.0, expand_by_default=False):
            path = gui.add_text('file', file, hint="on the controller's machine")
            replace = gui.add_checkbox('replace', False, hint='a file that is there already')
            gui.add_button('Save').on_click(save)

    def _add_choices(self) -> None:
        gui = self._gui
        with gui.add_folder('Show', order=20.0, expand_by_default=False):
            self.meshes = gui.add_checkbox('meshes', True, hint='else the skeleton')
            self.fine = gui.add_checkbox(
                'fine meshes', False, hint='all triangles, for a fast graphics card'
            )
            self.targets = gui.add_checkbox('targets', True)
            self.paths = gui.add_checkbox('paths', True)
            self.shapes = gui.add_checkbox('link shapes', False, hint='that keep their distances')
            self.distances = gui.add_checkbox('distances', False)
            self.obstacles = gui.add_checkbox('obstacles', False, hint='handles that move them')
            self.obstacles.visible = self._ask is not None
            self.shadows = gui.add_checkbox('shadows', False, hint='for a fast graphics card')
            self._logarithmic = gui.add_checkbox(
                'log errors', False, hint='on a logarithmic scale'
            )

        async def change_scale(_: viser.GuiEvent[Any]) -> None:
            self._rescale = True

        self._rescale = False
        self._logarithmic.on_update(change_scale)

    def refresh(self) -> None:
        """Do what a check box has asked for that takes new plots."""
        if self._rescale:
            self._rescale = False
            self._make_plots()

    def _make_plots(self) -> None:
        if self._plot_folder is not None:
            self._plot_folder.remove()
        self._plot_folder = self._gui.add_folder('Plots', order=25.0)
        with_error, with_distance = self._numbers
        self._plots = []
        with self._plot_folder:
            if with_error:
                title = 'error [m, rad] over time [s]'
                log = bool(self._logarithmic.value)
                self._plots.append(Plot(self._gui, title, with_error, error, log))
            if with_distance:
                title = 'least distance [m, rad] over time [s]'
                self._plots.append(Plot(self._gui, title, with_distance, nearest, False))


def _state_line(state: Any, rate: float) -> str:
    name = words.STATUS.get(state.status, str(state.status))
    facts = [f'**{name}**']
    if math.isfinite(rate):
        facts.append(f'{rate:.0f} Hz')
    facts.append(f'age {words.milliseconds(state.command_age)}')
    if words.brakes(state):
        facts.append('braking')
    if state.scale < 1.0:
        facts.append(f'scale {state.scale:.2f}')
    return _light(LIGHTS.get(state.status, '#999999')) + ' ' + ' · '.join(facts)


def _messages(state: Any) -> list[str]:
    lines = []
    if words.explained(state) and state.active_limits:
        lines.append(f'limits met: {", ".join(state.active_limits)}')
    return lines + [f'⚠ {text}' for text in state.message.split('; ') if text]


def _light(color: str) -> str:
    return f'<span style="color:{color}">●</span>'
