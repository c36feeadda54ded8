"""A recording on the page: a slider of time, play and pause."""

from __future__ import annotations

import math
import time
from collections.abc import Collection
from typing import Any

import viser

from tp_controller.config import describe_robot, read_parameters, robot_source
from tp_controller.recording import Moments, Recording
from tp_controller.view.page import Page
from tp_controller.view.view import View
from tp_controller.view.visuals import visuals

PERIOD = 0.045
"""Time [s] between two pictures."""
STEP = 0.001
"""Step [s] of the slider."""
SPEEDS = {'1/4': 0.25, '1/2': 0.5, '1': 1.0, '2': 2.0, '5': 5.0, '20': 20.0}
JUMP = 1.0
"""Time [s] forward, or any backward, after which plots and paths are made anew."""
GRAIN = 0.1
"""Time [s] between two states that plots and paths are made of: plots keep no more."""
PLAY, PAUSE = 'Play', 'Pause'


class Playback:
    """Shows a recording; everybody who looks sees the same moment of it.

    Parameters
    ----------
    page
        The page.
    recording
        The recording.
    types
        Types of tasks that have targets.

    Raises
    ------
    InvalidValue
        If there is no cycle in it, or its robot cannot be built.
    """

    def __init__(self, page: Page, recording: Recording, types: Collection[str]) -> None:
        self._moments = Moments(recording)
        self._parameters = recording.parameters
        self._view = View(page, types, read_only=True)
        self._view.set_stack(recording.stack())
        if not (robot_source(self._parameters) or '').startswith('robot.dh.'):
            values = read_parameters(self._parameters)
            for visual in visuals(describe_robot(values, recording.description)):
                self._view.add_visual(visual)
        gui = page.server.gui
        with gui.add_folder(recording.path.name, order=-1.0):
            end = max(math.ceil(self._moments.seconds / STEP) * STEP, STEP)
            self._slider: Any = gui.add_slider('time [s]', 0.0, end, STEP, 0.0)
            self._button = gui.add_button(PLAY)
            self._speed = gui.add_dropdown('speed', tuple(SPEEDS), initial_value='1')
        self._slider.on_update(self._seek)
        self._button.on_click(self._toggle)
        self._playing = self._stopped = False
        self._time, self._shown = 0.0, math.nan

    def run(self) -> None:
        """Show until `stop` is called."""
        before = time.monotonic()
        while not self._stopped:
            begin = time.monotonic()
            self.work(begin - before)
            before = begin
            time.sleep(max(0.0, PERIOD - (time.monotonic() - begin)))

    def stop(self, *_: object) -> None:
        """Let `run` end after the present picture; may be the handler of a signal."""
        self._stopped = True

    def work(self, passed: float) -> None:
        """Make one picture, a time [s] after the last one."""
        end = self._moments.seconds
        if self._playing:
            self._time = min(self._time + passed * SPEEDS[str(self._speed.value)], end)
            self._slider.value = round(self._time, 3)
            if self._time >= end:
                self._play(False)
        moment = self._time
        if not 0.0 <= moment - self._shown < JUMP:
            self._recall(moment)
        self._shown = moment
        self._view.show(self._moments.at(moment).state, math.nan, self._parameters, moment)

    def _recall(self, moment: float) -> None:
        """Fill plots and paths with what was before a time [s]."""
        self._view.forget()
        for time_, state in self._moments.before(moment, self._view.memory, GRAIN):
            self._view.see(state, time_)

    def _play(self, on: bool) -> None:
        self._playing = on
        self._button.label = PAUSE if on else PLAY

    async def _toggle(self, _: viser.GuiEvent[Any]) -> None:
        if not self._playing and self._time >= self._moments.seconds:
            self._time = 0.0
        self._play(not self._playing)

    async def _seek(self, event: viser.GuiEvent[Any]) -> None:
        # What is set here comes back without a client.
        if event.client_id is not None:
            self._time = float(event.target.value)
