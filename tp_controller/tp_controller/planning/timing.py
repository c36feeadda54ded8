"""Points of a way in time: as fast as the limits allow, round at the corners."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from tp_controller.interpolation import VectorPath
from tp_controller.robot import Limits

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]

SHARE = 0.9
"""Share of the limits of speed and acceleration that a way asks for: the rest is to follow it."""
SPEED, RISE = 1.0, 0.25
"""Speed [rad/s, m/s] of joints without a limit, and the time [s] to full speed without a limit of
acceleration."""
SHORT = 1e-9
LOOKS = 5
"""Points of a rounded corner that are looked at."""


def timed(
    points: Matrix,
    limits: Limits,
    is_clear: Callable[[Vector], bool] = lambda _: True,
    slower: float = 1.0,
) -> VectorPath:
    """Time a way through points, which begins and ends at rest.

    Every piece has a constant velocity, and at the points the velocities change at a constant
    acceleration (Kunz and Stilman 2012, Turning paths into trajectories using parabolic blends).
    A piece is slower where the blends at its ends would overlap. A corner whose blend is not
    clear is passed at rest.

    Parameters
    ----------
    points
        Positions (m, n) [rad, m].
    limits
        Limits of speed and acceleration.
    is_clear
        Whether positions (n,) of a rounded corner keep what has to be kept.
    slower
        How many times slower than the limits allow; the places are the same.

    Returns
    -------
    VectorPath
        Inside `SHARE` of the limits.
    """
    moves = np.abs(np.diff(points, axis=0)).max(axis=1) > SHORT
    points = points[np.concatenate([[True], moves])]
    if len(points) == 1:
        points = np.repeat(points, 2, axis=0)
    v, a = _limits(limits)
    v, a = v / slower, a / slower**2
    stops = np.zeros(len(points), dtype=bool)
    stops[[0, -1]] = True
    while True:
        way = _Way(points, v, a, stops)
        bad = [i for i in np.flatnonzero(~stops).tolist() if not all(map(is_clear, way.corner(i)))]
        if not bad:
            return way.path()
        stops[bad] = True


def _limits(limits: Limits) -> tuple[Vector, Vector]:
    v = np.where(np.isfinite(limits.velocity), limits.velocity, SPEED)
    a = np.where(np.isfinite(limits.acceleration), limits.acceleration, v / RISE)
    return SHARE * v, SHARE * a


class _Way:
    """Pieces between points with constant velocities, and blends at the points.

    Parameters
    ----------
    points
        Points (m, n).
    v, a
        Limits (n,) of speed and acceleration.
    stops
        Points (m,) that are passed at rest.
    """

    def __init__(self, points: Matrix, v: Vector, a: Vector, stops: NDArray[np.bool_]) -> None:
        self._points, self._a, self._stops = points, a, stops
        self._step = np.diff(points, axis=0)
        self._times = np.maximum((np.abs(self._step) / v).max(axis=1), SHORT)
        for _ in range(200):
            before, after = self._blends()
            # At a stop the whole blend is inside the piece; else a half of it.
            needed = before[1:] + after[:-1]
            short = needed > self._times * (1.0 + 1e-9)
            if not short.any():
                break
            self._times = np.where(short, np.maximum(needed, 1.05 * self._times), self._times)
        self._before, self._after = self._blends()

    def _blends(self) -> tuple[Vector, Vector]:
        """Times (m,) [s] of every point's blend before and after it."""
        velocity = self._step / self._times[:, None]
        zero = np.zeros((1, velocity.shape[1]))
        come, go = np.vstack([zero, velocity]), np.vstack([velocity, zero])
        change = (np.abs(go - come) / self._a).max(axis=1)
        before, after = 0.5 * change, 0.5 * change
        # To stop at a point exactly, the piece ends later by half the blend.
        halves = [(np.abs(one) / self._a).max(axis=1) for one in (come, go)]
        before = np.where(self._stops, 0.5 * halves[0], before)
        after = np.where(self._stops, 0.5 * halves[1], after)
        return before, after

    def corner(self, i: int) -> Matrix:
        """Points (LOOKS, n) of the blend at a point that is not passed at rest."""
        v0 = self._step[i - 1] / self._times[i - 1]
        v1 = self._step[i] / self._times[i]
        half = self._before[i]
        t = np.linspace(0.0, 2.0 * half, LOOKS)[:, None]
        start = self._points[i] - half * v0
        rise = (v1 - v0) / max(2.0 * half, SHORT)
        return np.asarray(start + t * v0 + 0.5 * t * t * rise)

    def path(self) -> VectorPath:
        """Knots where accelerations change: between them a cubic is the parabola or the line."""
        times, values, rates = [0.0], [self._points[0]], [np.zeros_like(self._points[0])]

        def add(time: float, value: Vector, rate: Vector) -> None:
            if time - times[-1] > SHORT:
                times.append(time)
                values.append(value)
                rates.append(rate)

        now, still = 0.0, np.zeros_like(self._points[0])
        last = len(self._points) - 1
        for i, step in enumerate(self._step):
            velocity = step / self._times[i]
            first, end = self._points[i], self._points[i + 1]
            if self._stops[i]:
                # From rest: the piece begins half a blend after the point's time.
                now += self._after[i]
                add(now + self._after[i], first + self._after[i] * velocity, velocity)
            else:
                add(now + self._after[i], first + self._after[i] * velocity, velocity)
            now += self._times[i]
            before = self._before[i + 1]
            add(now - before, end - before * velocity, velocity)
            if self._stops[i + 1]:
                now += before
                add(now, end, still)
                if i + 1 < last:
                    # The next piece starts at this time, at rest.
                    continue
        return VectorPath(np.array(times), np.array(values), np.array(rates))
