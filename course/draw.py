"""Pictures of the notebooks: the arm, errors over time, sliders."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from numpy.typing import ArrayLike

import lab

BLUE, ORANGE, GREEN, RED, PURPLE, GREY = (
    '#0072B2', '#E69F00', '#009E73', '#D55E00', '#CC79A7', '0.55',
)  # fmt: skip
COLORS = (BLUE, ORANGE, GREEN, RED, PURPLE, GREY)
"""Colours that the colour-blind can tell apart (Okabe and Ito)."""
STYLES = ('-', '--', '-.', ':', '-', '--')
"""Line styles, for prints without colour."""


def plane(reach: float, title: str = '', axes: Axes | None = None) -> Axes:
    """Axes of the plane of an arm that reaches so far [m]."""
    if axes is None:
        axes = plt.subplots(figsize=(5.2, 5.0), layout='constrained')[1]
    axes.set(xlim=(-reach, reach), ylim=(-reach, reach), xlabel='x [m]', ylabel='y [m]')
    axes.set_aspect('equal')
    axes.grid(alpha=0.3)
    axes.set_title(title, fontsize=10)
    return axes


def arm(
    axes: Axes,
    lengths: Sequence[float],
    q: ArrayLike,
    color: str = BLUE,
    alpha: float = 1.0,
    label: str | None = None,
) -> None:
    """Draw a planar arm: links, joints and tip."""
    places = lab.points(lengths, q)
    axes.plot(*places.T, color=color, linewidth=4.0, alpha=0.6 * alpha, solid_capstyle='round')
    axes.plot(
        *places[:-1].T, 'o', color=color, markersize=7.0, markeredgecolor='white', alpha=alpha
    )
    axes.plot(*places[-1], 's', color=color, markersize=6.0, alpha=alpha, label=label)


def target(axes: Axes, point: ArrayLike, label: str = 'target') -> None:
    """Draw a target as a cross."""
    axes.plot(
        *np.asarray(point), 'x', color='black', markersize=9.0, markeredgewidth=2.0, label=label
    )


def circles(axes: Axes, obstacles: Mapping[str, Mapping[str, Any]], beyond: float = 0.0) -> None:
    """Draw obstacles, and around them a dashed line at some distance [m]."""
    for obstacle in obstacles.values():
        axes.add_patch(plt.Circle(obstacle['center'], obstacle['radius'], color=RED, alpha=0.25))
        if beyond:
            radius = obstacle['radius'] + beyond
            axes.add_patch(plt.Circle(obstacle['center'], radius, fill=False, ec=RED, ls='--'))


def motion(
    axes: Axes, lengths: Sequence[float], q: ArrayLike, poses: int = 5, color: str = BLUE
) -> None:
    """Draw an arm at some moments of a run (N, n), from pale to dark, and the path of its tip."""
    q = np.asarray(q)
    axes.plot(*lab.tip(lengths, q).T, color=color, linewidth=1.2)
    for share in np.linspace(0.0, 1.0, poses):
        arm(axes, lengths, q[round(share * (len(q) - 1))], color, 0.2 + 0.8 * share)


def lines(
    time: ArrayLike,
    values: Mapping[str, ArrayLike],
    ylabel: str,
    log: bool = False,
    title: str = '',
    axes: Axes | None = None,
    levels: Iterable[float] = (),
) -> Axes:
    """Draw values over time; ``levels`` are dashed lines, such as limits."""
    if axes is None:
        axes = plt.subplots(figsize=(7.0, 3.2), layout='constrained')[1]
    for i, (name, value) in enumerate(values.items()):
        style = {'color': COLORS[i % 6], 'linestyle': STYLES[i % 6], 'linewidth': 1.8}
        axes.plot(time, value, label=name, **style)
    for level in levels:
        axes.axhline(level, color=RED, linestyle='--', linewidth=1.0)
    if log:
        axes.set_yscale('log')
    axes.set(xlabel='time [s]', ylabel=ylabel)
    axes.set_title(title, fontsize=10)
    axes.grid(alpha=0.3)
    if len(values) > 1:
        axes.legend(fontsize=9)
    return axes


def show(axes: Axes | None = None) -> None:
    """Show the present figure, with a legend if anything has a label."""
    if axes is not None and axes.get_legend_handles_labels()[0]:
        axes.legend(fontsize=9)
    plt.show()


def interact(draw: Callable[..., None], **sliders: tuple[float, float, float]) -> None:
    """Call a function with values of sliders, again and again; once where there are none.

    Parameters
    ----------
    draw
        Draws a figure from keyword arguments and shows it.
    sliders
        Least value, largest value and first value of each argument. Whole numbers give steps
        of one.
    """
    try:
        from IPython import get_ipython
        from IPython.display import display
        from ipywidgets import FloatSlider, IntSlider, interactive
    except ImportError:
        display = None
    if display is None or get_ipython() is None:
        draw(**{name: first for name, (_, _, first) in sliders.items()})
        return
    widgets = {}
    for name, (low, high, first) in sliders.items():
        kind = IntSlider if all(isinstance(x, int) for x in (low, high, first)) else FloatSlider
        step = 1 if kind is IntSlider else (high - low) / 100.0
        widgets[name] = kind(
            first, min=low, max=high, step=step, description=name, continuous_update=False
        )
    display(interactive(draw, **widgets))
