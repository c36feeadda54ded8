"""A planar arm as a filmstrip."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Patch, Polygon
from numpy.typing import NDArray

from tp_controller.plots.moments import Scene
from tp_controller.plots.style import RED, color, dash, styled
from tp_controller.robot import Shape

Array = NDArray[np.float64]
STILLS = 6
GHOSTS = 4
"""Faint arms of the way between two pictures."""
SIDE = 2.5
"""Width of a picture [in]."""
OBSTACLE = '#cd3732'


def filmstrip(scene: Scene, count: int = STILLS) -> Figure:
    """Draw the arm at some moments, each with the way since the one before."""
    with styled():
        stills = scene.stills(count)
        columns = min(3, len(stills))
        rows = math.ceil(len(stills) / columns)
        low, high = frame_of(scene)
        tall = float((high - low)[1] / (high - low)[0])
        figure = Figure(
            figsize=(SIDE * columns + 0.5, (SIDE * min(max(tall, 0.3), 1.5) + 0.3) * rows + 0.6),
            layout='constrained',
        )
        axes = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False).ravel()
        before = 0
        for panel, cycle in zip(axes, stills, strict=False):
            draw_arm(panel, scene, cycle, before)
            panel.set_title(f't = {scene.run.time[cycle]:.2f} s')
            panel.set_xlim(low[0], high[0])
            panel.set_ylim(low[1], high[1])
            before = cycle
        for panel in axes[len(stills) :]:
            panel.set_visible(False)
        for panel in axes[: len(stills)]:
            spec = panel.get_subplotspec()
            if spec.is_first_col():
                panel.set_ylabel('y [m]')
            if spec.rowspan.stop == rows or spec.num1 + columns >= len(stills):
                panel.set_xlabel('x [m]')
                panel.tick_params(labelbottom=True)
        handles, labels = axes[len(stills) - 1].get_legend_handles_labels()
        if handles:
            figure.legend(handles, labels, loc='outside lower center', ncols=4)
        figure.suptitle('Arm, paths of the controlled frames (lines), targets (crosses)')
        return figure


def frame_of(scene: Scene) -> tuple[Array, Array]:
    """Corners (2,) [m] of what all pictures of a run show."""
    last = len(scene.run.time) - 1
    cycles = np.unique(np.linspace(0, last, 40, dtype=int))
    points = [scene.skeleton(int(i)).reshape(-1, 3)[:, :2] for i in cycles]
    points += [way[:, :2] for way in scene.paths.values()]
    points += [
        target.place[None, :2]
        for i in cycles
        for target in scene.targets(int(i))
        if np.all(np.isfinite(target.place[:2]))
    ]
    found = np.concatenate(points)
    low, high = found.min(axis=0), found.max(axis=0)
    reach = float(np.max(high - low))
    for shape in scene.obstacles(last).values():
        # An obstacle that is far larger than the arm does not make it small.
        hull, radius = shape.hull()
        if math.isfinite(radius):
            low = np.minimum(low, np.maximum(hull[:, :2].min(axis=0) - radius, low - 0.4 * reach))
            high = np.maximum(
                high, np.minimum(hull[:, :2].max(axis=0) + radius, high + 0.4 * reach)
            )
    margin = 0.06 * float(np.max(high - low))
    return low - margin, high + margin


def draw_arm(axes: Axes, scene: Scene, cycle: int, since: int | None = None) -> None:
    """Draw one moment; the way since a cycle with faint arms."""
    axes.set_aspect('equal')
    for name, shape in scene.obstacles(cycle).items():
        _draw_obstacle(axes, name, shape)
    if since is not None and since < cycle:
        for ghost in np.linspace(since, cycle, GHOSTS, endpoint=False, dtype=int):
            _draw_segments(axes, scene.skeleton(int(ghost)), color='0.78', linewidth=1.2, zorder=2)
    for i, (frame, way) in enumerate(scene.paths_until(cycle).items()):
        axes.plot(
            way[:, 0], way[:, 1], color=color(i + 1), linestyle=dash(i), linewidth=1.3,
            label=f'path of {frame}', zorder=4,
        )  # fmt: skip
    _draw_segments(
        axes, scene.skeleton(cycle), color='0.15', linewidth=3.2, zorder=3,
        marker='o', markersize=5, markerfacecolor='white',
    )  # fmt: skip
    for i, target in enumerate(scene.targets(cycle)):
        x, y = target.place[:2]
        look: dict[str, Any] = {
            'color': color(i),
            'zorder': 5,
            'label': f'target of {target.task}',
        }
        if np.isfinite(x) and np.isfinite(y):
            axes.plot(x, y, 'x', markersize=9, markeredgewidth=2.2, **look)
        elif np.isfinite(x):
            axes.axvline(x, linestyle=':', **look)
        elif np.isfinite(y):
            axes.axhline(y, linestyle=':', **look)


def _draw_segments(axes: Axes, segments: Array, **look: Any) -> None:
    gaps = np.full((len(segments), 1, 3), np.nan)
    points = np.concatenate([segments, gaps], axis=1).reshape(-1, 3)
    axes.plot(points[:, 0], points[:, 1], solid_capstyle='round', **look)


def _draw_obstacle(axes: Axes, name: str, shape: Shape) -> None:
    """Draw what an obstacle is in the plane z = 0, seen from above."""
    place = shape.pose.translation
    patch: Patch
    if shape.kind in ('sphere', 'cylinder', 'capsule'):
        patch = Circle((place[0], place[1]), shape.size[0])
    elif shape.kind == 'box':
        points, _ = shape.hull()
        patch = Polygon(_outline(points[:, :2]))
    else:
        normal = shape.pose.rotation[:2, 2]
        if np.linalg.norm(normal) < 1e-9:
            return
        along = np.array([-normal[1], normal[0]]) * 100.0
        deep = -100.0 * normal
        patch = Polygon(place[:2] + np.array([-along, along, along + deep, -along + deep]))
        place = place + 0.0
    patch.set(facecolor=OBSTACLE, alpha=0.28, edgecolor=RED, linewidth=1.0, zorder=1)
    axes.add_patch(patch)
    axes.annotate(
        name, (place[0], place[1]), ha='center', va='center', fontsize=7, color='0.25',
        clip_on=True, annotation_clip=True, zorder=2,
    )  # fmt: skip


def _outline(points: Array) -> Array:
    """Corners of the convex hull of points (p, 2), after Andrew (1979)."""
    found = sorted(map(tuple, points))

    def half(ordered: list[tuple[float, ...]]) -> list[tuple[float, ...]]:
        chain: list[tuple[float, ...]] = []
        for point in ordered:
            while len(chain) > 1 and _turn(chain[-2], chain[-1], point) <= 0.0:
                chain.pop()
            chain.append(point)
        return chain[:-1]

    return np.array(half(found) + half(found[::-1]))


def _turn(a: tuple[float, ...], b: tuple[float, ...], c: tuple[float, ...]) -> float:
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
