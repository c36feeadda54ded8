"""Where the controlled frames have been."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable

import numpy as np
import viser

from tp_controller.robot import Robot
from tp_controller.view.palette import color

POINTS = 150
"""Points of a path."""
SPACING = 0.008
"""Least way between two of them, as a share of the arm's extent."""


class Paths:
    """Draws the last way of some frames.

    Parameters
    ----------
    scene
        Where it is drawn.
    extent
        Size of the arm [m].
    """

    def __init__(self, scene: viser.SceneApi, extent: float) -> None:
        self._scene, self._extent = scene, extent
        self._points: dict[str, deque[np.ndarray]] = {}
        self._lines: dict[str, viser.LineSegmentsHandle] = {}
        self._shown = True
        self._changed: set[str] = set()

    def see(self, robot: Robot, frames: Iterable[str]) -> None:
        """Note where frames are now."""
        for frame in frames:
            place = np.array(robot.frame(frame).position)
            points = self._points.setdefault(frame, deque(maxlen=POINTS))
            if not points or np.linalg.norm(place - points[-1]) > SPACING * self._extent:
                points.append(place)
                self._changed.add(frame)

    def draw(self) -> None:
        """Bring what is drawn up to date."""
        for frame in self._changed:
            points = np.array(self._points[frame])
            if len(points) < 2:
                continue
            segments = np.stack([points[:-1], points[1:]], axis=1).astype(np.float32)
            line = self._lines.get(frame)
            if line is None:
                self._lines[frame] = self._scene.add_line_segments(
                    f'/path/{len(self._lines)}',
                    segments,
                    color(list(self._points).index(frame)),
                    thickness=2.5,
                    thickness_units='screen',
                    visible=self._shown,
                )
            else:
                line.points = segments
        self._changed.clear()

    def show(self, visible: bool) -> None:
        """Choose whether they are shown."""
        self._shown = visible
        for line in self._lines.values():
            line.visible = visible

    def clear(self) -> None:
        """Forget all ways so far."""
        for line in self._lines.values():
            line.remove()
        self._points.clear()
        self._lines.clear()
        self._changed.clear()
