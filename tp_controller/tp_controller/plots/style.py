"""How pictures look: told apart by the colour-blind and in print, units on every axis."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from tp_controller.view.palette import COLORS

Array = NDArray[np.float64]

DASHES: Sequence[Any] = ('-', '--', '-.', (0, (1, 1)), (0, (5, 1, 1, 1, 1, 1)))
"""Lines that are told apart without color too."""
RED = '#c1121f'
"""What should not be."""
LIMIT = '#333333'
ACTIVE = '0.87'
"""Background of times at which a task acts."""
RESOLUTION = 130
"""Pixels per inch of pictures made of pixels."""
FORMATS = ('png', 'svg', 'pdf')
STYLE: dict[Any, Any] = {
    'font.size': 9.0,
    'axes.grid': True,
    'grid.alpha': 0.35,
    'grid.linewidth': 0.6,
    'lines.linewidth': 1.4,
    'axes.spines.top': False,
    'axes.spines.right': False,
    'legend.frameon': False,
    'svg.hashsalt': 'tp_controller',
}


def color(number: int) -> tuple[float, float, float]:
    """Color of the thing with that number."""
    red, green, blue = COLORS[number % len(COLORS)]
    return red / 255.0, green / 255.0, blue / 255.0


def dash(number: int) -> Any:
    """Kind of line of the thing with that number."""
    return DASHES[number % len(DASHES)]


@contextmanager
def styled() -> Iterator[None]:
    """Give pictures that are made within their style."""
    with mpl.rc_context(STYLE):
        yield


def panels(
    count: int, height: float = 1.9, width: float = 7.5, columns: int = 1
) -> tuple[Figure, NDArray[Any]]:
    """Make a figure with rows of axes (count, columns) over one time, heights in inches."""
    figure = Figure(figsize=(width, 0.7 + height * count), layout='constrained')
    return figure, figure.subplots(count, columns, sharex=True, squeeze=False)


def shade(axes: Axes, time: Array, where: NDArray[np.bool_], **options: Any) -> None:
    """Shade the background at times (N,) [s] where something holds (N,)."""
    axes.fill_between(
        time,
        0.0,
        1.0,
        where=where,
        transform=axes.get_xaxis_transform(),
        linewidth=0.0,
        **{'color': ACTIVE, 'step': 'post', 'zorder': 0, **options},
    )


def end_time(figure: Figure, time: Array) -> None:
    """Label the time of the lowest axes, which all share it."""
    last = [axes for axes in figure.axes if axes.get_subplotspec() is not None]
    lowest = max(axes.get_subplotspec().rowspan.stop for axes in last)  # type: ignore[union-attr]
    for axes in last:
        if axes.get_subplotspec().rowspan.stop == lowest:  # type: ignore[union-attr]
            axes.set_xlabel('time [s]')
    last[0].set_xlim(float(time[0]), float(max(time[-1], time[0] + 1e-3)))


def save(figure: Figure, path: Path) -> None:
    """Write a figure; the ending of the path says the format."""
    with styled():
        # Two runs of one command give the same file.
        facts = {'Date': None} if path.suffix == '.svg' else None
        facts = {'CreationDate': None} if path.suffix == '.pdf' else facts
        figure.savefig(path, dpi=RESOLUTION, metadata=facts)
