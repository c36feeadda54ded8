"""The arm as a moving picture."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.animation import AbstractMovieWriter, FFMpegWriter, PillowWriter
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from tp_controller.errors import InvalidValue, shown
from tp_controller.plots import planar, spatial
from tp_controller.plots.moments import Scene
from tp_controller.plots.style import styled
from tp_controller.recording import Run
from tp_controller.stack import Stack

RATE = 10
"""Pictures per second; a GIF counts hundredths of a second."""
COLORS = 64
"""Of a GIF, so that its file is small."""
MOST = 300
"""Pictures of an animation; one of a longer run goes faster."""
RESOLUTION = 90
SIDE = 4.6
"""[in]."""
SUFFIXES = ('.gif', '.mp4')


class _GifWriter(PillowWriter):
    """Writes all pictures with the colours of the last one, which has the whole path."""

    _frames: list[Any]

    def finish(self) -> None:
        # Maximum coverage, which keeps white.
        palette = self._frames[-1].quantize(COLORS, method=1)
        self._frames = [one.quantize(palette=palette, dither=0) for one in self._frames]
        super().finish()


def check_animation(path: Path) -> None:
    """Check that an animation can be written to a path.

    Raises
    ------
    InvalidValue
        For another ending than those of `SUFFIXES`, or ``.mp4`` without ffmpeg.
    """
    if path.suffix not in SUFFIXES:
        raise InvalidValue('animation', shown(str(path)), 'a file that ends in .gif or .mp4')
    if path.suffix == '.mp4' and shutil.which('ffmpeg') is None:
        got = f'{shown(str(path))}, but there is no ffmpeg on this machine'
        raise InvalidValue('animation', got, 'a .gif, or an .mp4 once ffmpeg is installed')


def draw_animation(run: Run, stack: Stack, path: Path, seconds: float | None = None) -> None:
    """Draw the arm as it moves.

    Parameters
    ----------
    run, stack
        The run, and the stack that it was made with.
    path
        A ``.gif`` or, where ffmpeg is installed, an ``.mp4``.
    seconds
        How long [s] it takes; as the run, but no more than `MOST` pictures, if None.

    Raises
    ------
    InvalidValue
        As `check_animation`; if the file cannot be written.
    """
    check_animation(path)
    scene = Scene(run, stack)
    length = float(run.time[-1]) if seconds is None else seconds
    count = int(min(max(length * RATE, 2), MOST, len(run.time)))
    moments = np.linspace(0.0, float(run.time[-1]), count)
    cycles = [int(np.searchsorted(run.time, moment, 'right')) - 1 for moment in moments]
    # Of a run that is longer than pictures are drawn of, time passes quicker.
    kind: type[AbstractMovieWriter] = _GifWriter if path.suffix == '.gif' else FFMpegWriter
    writer = kind(fps=RATE)
    try:
        with styled():
            figure = Figure(figsize=(SIDE, SIDE), layout='constrained')
            FigureCanvasAgg(figure)
            draw = _planar(figure, scene) if scene.planar else _spatial(figure, scene)
            with writer.saving(figure, str(path), RESOLUTION):
                for cycle in cycles:
                    draw(cycle)
                    writer.grab_frame()
    except OSError as error:
        got = f'{shown(str(path))}: {error.strerror}'
        raise InvalidValue('animation', got, 'a file that can be written') from None


def _planar(figure: Figure, scene: Scene) -> Callable[[int], None]:
    axes = figure.add_subplot()
    low, high = planar.frame_of(scene)

    def draw(cycle: int) -> None:
        axes.clear()
        planar.draw_arm(axes, scene, cycle)
        axes.set(
            xlim=(low[0], high[0]), ylim=(low[1], high[1]), xlabel='x [m]', ylabel='y [m]',
            title=f't = {scene.run.time[cycle]:.2f} s',
        )  # fmt: skip

    return draw


def _spatial(figure: Figure, scene: Scene) -> Callable[[int], None]:
    axes = figure.add_subplot(projection='3d')
    box = spatial.box_of(scene)
    azimuth = spatial.best_azimuth(scene, scene.stills(spatial.STILLS))

    def draw(cycle: int) -> None:
        axes.clear()
        spatial.draw_arm(axes, scene, cycle, box, azimuth)
        axes.set_title(f't = {scene.run.time[cycle]:.2f} s', y=1.0, pad=0)

    return draw
