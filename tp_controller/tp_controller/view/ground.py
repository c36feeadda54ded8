"""The ground under the arm, the lights, and the axes of the base."""

from __future__ import annotations

import numpy as np
import viser
from numpy.typing import NDArray

from tp_controller.view.solids import add_axes

CELL, SECTION = 0.1, 0.5
"""Distances [m] between thin lines and between strong ones."""
CELL_COLOR, SECTION_COLOR = (245, 246, 247), (229, 231, 234)
WIDTH = 2.0
"""Width [pixels] of lines: thinner ones have gaps where edges are not smooth."""

Matrix = NDArray[np.float64]


class Ground:
    """Draws a grid; shadows fall on it on request.

    Without shadows the grid is made of lines. viser's own grid computes every pixel of the
    ground, which is much of the work of a browser without a graphics card.

    Parameters
    ----------
    scene
        Where it is drawn.
    side
        Side of the grid [m].
    height
        Its height [m].
    extent
        Size of the arm [m].
    """

    def __init__(self, scene: viser.SceneApi, side: float, height: float, extent: float) -> None:
        self._scene, self._shadows = scene, False
        place = (0.0, 0.0, height)
        half = SECTION * np.ceil(0.5 * side / SECTION)
        near = SECTION * np.ceil(0.25 * side / SECTION)
        self._lines = [
            scene.add_line_segments(
                f'/grid/{name}', points.astype(np.float32), color, thickness=WIDTH,
                thickness_units='screen', position=place,
            )
            for name, points, color in (
                ('cells', grid_lines(near, CELL, SECTION), CELL_COLOR),
                ('sections', grid_lines(half, SECTION), SECTION_COLOR),
            )
        ]  # fmt: skip
        self._plane = scene.add_grid(
            '/grid/plane', 2.0 * half, 2.0 * half, cell_size=CELL, section_size=SECTION,
            cell_color=CELL_COLOR, section_color=SECTION_COLOR, shadow_opacity=0.2,
            position=place, plane='xy', visible=False,
        )  # fmt: skip
        # Light from the sky and from where the camera is first, on what faces it.
        scene.add_light_hemisphere('/light/sky', ground_color=(205, 200, 195), intensity=1.6)
        scene.add_light_directional(
            '/light/front', intensity=0.8, position=(1.0, 0.4, 0.8), cast_shadow=False
        )
        add_axes(scene, '/base', 0.12 * extent)

    def show(self, shadows: bool) -> None:
        """Choose whether shadows fall."""
        if self._shadows == shadows:
            return
        self._shadows = shadows
        self._plane.visible = shadows
        for line in self._lines:
            line.visible = not shadows
        self._scene.configure_default_lights(cast_shadow=shadows)


def grid_lines(half: float, step: float, left_out: float | None = None) -> Matrix:
    """Lines (k, 2, 3) [m] of a square grid about the origin.

    Parameters
    ----------
    half
        Half its side [m].
    step
        Distance of neighbouring lines [m].
    left_out
        Distance [m] of lines that are left out, if any.
    """
    count = round(half / step)
    at = step * np.arange(-count, count + 1)
    if left_out is not None:
        at = at[np.abs(at / left_out - np.round(at / left_out)) > 1e-6]
    ends = np.array([[-half, 0.0], [half, 0.0]])
    lines = np.zeros((2, len(at), 2, 3))
    lines[0, :, :, 0], lines[0, :, :, 1] = ends[:, 0], at[:, None]
    lines[1, :, :, 1], lines[1, :, :, 0] = ends[:, 0], at[:, None]
    return lines.reshape(-1, 2, 3)
