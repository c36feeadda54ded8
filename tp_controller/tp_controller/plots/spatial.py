"""A spatial arm with its obstacles, as it stands at some moments."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d import Axes3D  # type: ignore[import-untyped]
from mpl_toolkits.mplot3d.art3d import Poly3DCollection  # type: ignore[import-untyped]
from numpy.typing import NDArray

from tp_controller.plots.moments import Scene
from tp_controller.plots.solids import lit, triangles
from tp_controller.plots.style import color, dash, styled
from tp_controller.robot import Shape

Array = NDArray[np.float64]
STILLS = 4
SIDE = 3.7
"""Width of a picture [in]."""
STEEL = (0.66, 0.70, 0.75)
OBSTACLE = (0.86, 0.36, 0.30)
TABLE = (0.80, 0.72, 0.60)
ELEVATION = 24.0
"""Of the camera [deg]."""
AZIMUTHS = (-52, -22, -82, 8, -112, 38, -142, 68, -172, 98, 158, 128)
"""Of the camera [deg], the usual one first."""
LINK = 0.1
"""How thick a link is at most, as a share of the arm's extent."""
EDGE = 0.35
"""Width [points] of edges, which close the cracks between triangles."""


def pictures(scene: Scene, count: int = STILLS) -> Figure:
    """Draw the arm at some moments, each with the way so far and the targets then."""
    with styled():
        # At the start nothing has happened yet.
        stills = scene.stills(count + 1)
        stills = stills[1:] if len(stills) > count else stills
        columns = min(2, len(stills))
        rows = math.ceil(len(stills) / columns)
        figure = Figure(figsize=(SIDE * columns, SIDE * rows + 0.7), layout='constrained')
        # Labels of z stand outside of what the layout knows of.
        layout: Any = figure.get_layout_engine()
        layout.set(rect=(0.0, 0.0, 0.96, 1.0), wspace=0.06)
        box = box_of(scene)
        azimuth = best_azimuth(scene, stills)
        for i, cycle in enumerate(stills):
            axes = figure.add_subplot(rows, columns, i + 1, projection='3d')
            draw_arm(axes, scene, cycle, box, azimuth)
            axes.set_title(f't = {scene.run.time[cycle]:.2f} s', y=1.0, pad=0)
        handles, labels = figure.axes[-1].get_legend_handles_labels()
        if handles:
            figure.legend(handles, labels, loc='outside lower center', ncols=3)
        figure.suptitle('Arm (shapes of its links), obstacles, paths (lines), targets (crosses)')
        return figure


def box_of(scene: Scene) -> tuple[Array, Array]:
    """Corners (3,) [m] of a cube that all pictures of a run show."""
    last = len(scene.run.time) - 1
    cycles = np.unique(np.linspace(0, last, 20, dtype=int))
    points = [scene.skeleton(int(i)).reshape(-1, 3) for i in cycles] + list(scene.paths.values())
    for i in cycles:
        for shape in scene.obstacles(int(i)).values():
            hull, radius = shape.hull()
            if math.isfinite(radius):
                points += [hull - radius, hull + radius]
    found = np.concatenate(points)
    low, high = found.min(axis=0), found.max(axis=0)
    half = 0.5 * float(np.max(high - low)) * 1.04
    middle = 0.5 * (low + high)
    return middle - half, middle + half


def best_azimuth(scene: Scene, cycles: Sequence[int]) -> float:
    """Azimuth [deg] of a camera from which obstacles hide least of arm and paths."""

    def hidden(azimuth: float) -> int:
        toward = _toward(azimuth)
        return sum(_hidden(scene, cycle, toward) for cycle in cycles)

    return min(AZIMUTHS, key=hidden)


def _toward(azimuth: float) -> Array:
    """Direction (3,) to a camera at an azimuth [deg]."""
    turn, rise = math.radians(azimuth), math.radians(ELEVATION)
    flat = math.cos(rise)
    return np.array([flat * math.cos(turn), flat * math.sin(turn), math.sin(rise)])


def _hidden(scene: Scene, cycle: int, toward: Array) -> int:
    """How many points of the arm and the paths are behind an obstacle, for a far camera."""
    ends = scene.skeleton(cycle)
    share = np.linspace(0.0, 1.0, 8)[:, None, None]
    points = ((1.0 - share) * ends[:, 0] + share * ends[:, 1]).reshape(-1, 3)
    points = np.concatenate([points, *(way[::8] for way in scene.paths_until(cycle).values())])
    found = np.zeros(len(points), dtype=bool)
    for shape in scene.obstacles(cycle).values():
        hull, radius = shape.hull()
        if not math.isfinite(radius):
            continue
        # Distance of each sight line from the nearest line between two balls of the shape.
        middle = hull.mean(axis=0)
        behind = (points - middle) @ toward < 0.0
        size = radius + 0.5 * float(np.ptp(hull, axis=0).min(initial=0.0))
        size += LINK * scene.extent
        along = np.linspace(0.0, 1.0, 9)[:, None]
        low, high = hull[np.argmin(hull[:, 2])], hull[np.argmax(hull[:, 2])]
        axis = middle + (along - 0.5) * np.array([0.0, 0.0, high[2] - low[2]])
        way = points[:, None] - axis
        aside = way - (way @ toward)[..., None] * toward
        found |= behind & (np.linalg.norm(aside, axis=2).min(axis=1) < size)
    return int(found.sum())


def draw_arm(
    axes: Axes3D, scene: Scene, cycle: int, box: tuple[Array, Array], azimuth: float
) -> None:
    """Draw one moment in a cube, seen from an azimuth [deg]."""
    low, high = box
    half = 0.5 * float(np.max(high - low))
    solids = [triangles(shape) for shape in scene.links(cycle)]
    paints = [lit(found, STEEL) for found in solids]
    for shape in scene.obstacles(cycle).values():
        if shape.kind == 'half_space':
            # What lies outside the cube would be drawn over its axes.
            wall = triangles(shape, half) + _aside(shape, 0.5 * (low + high))
            # All else is in front of it, for a camera that is.
            _add(axes, np.clip(wall, low, high), lit(wall, TABLE), 1)
        else:
            solids.append(triangles(shape))
            paints.append(lit(solids[-1], OBSTACLE))
    _add(axes, np.concatenate(solids), np.concatenate(paints), 2)
    for segment in scene.skeleton(cycle):
        # What an obstacle hides is seen as a thin line.
        axes.plot(*segment.T, color='0.1', linewidth=0.8, linestyle=':', zorder=3)
    axes.computed_zorder = False
    for i, (frame, way) in enumerate(scene.paths_until(cycle).items()):
        axes.plot(
            *way.T, color=color(i + 1), linestyle=dash(i), linewidth=1.5, zorder=4,
            label=f'path of {frame}',
        )  # fmt: skip
    for i, target in enumerate(scene.targets(cycle)):
        if np.all(np.isfinite(target.place)):
            axes.plot(
                *target.place[:, None], 'x', color=color(i), markersize=9, markeredgewidth=2.4,
                zorder=5, label=f'target of {target.task}',
            )  # fmt: skip
    _frame(axes, low, high, azimuth)


def _add(axes: Axes3D, corners: Array, paints: Array, order: int) -> None:
    axes.add_collection3d(
        Poly3DCollection(
            corners, facecolors=paints, edgecolors=paints, linewidths=EDGE, zsort='average',
            zorder=order,
        )
    )  # fmt: skip


def _aside(shape: Shape, middle: Array) -> Array:
    """Way (3,) [m] that brings a half-space's square below the middle of a picture."""
    normal = shape.pose.rotation[:, 2]
    way = middle - shape.pose.translation
    return np.asarray(way - normal * (normal @ way))


def _frame(axes: Any, low: Array, high: Array, azimuth: float) -> None:
    axes.set(
        xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]),
        xlabel='x [m]', ylabel='y [m]', zlabel='z [m]',
    )  # fmt: skip
    axes.set_box_aspect((1, 1, 1), zoom=0.88)
    axes.view_init(ELEVATION, azimuth)
    axes.tick_params(labelsize=7, pad=0)
    axes.locator_params(nbins=5)
    for axis in (axes.xaxis, axes.yaxis, axes.zaxis):
        axis.labelpad = 1
        axis.pane.set_facecolor((0.97, 0.97, 0.98, 1.0))
        axis._axinfo['grid'].update(color=(0.85, 0.85, 0.87, 1.0), linewidth=0.6)
