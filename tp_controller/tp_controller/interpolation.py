r"""Paths in time for tasks: interpolation between points, with the velocity that goes with it.

Between two points ``h`` apart in time every value is a polynomial of the time since the first: of
third degree from positions and velocities at both ends, of fifth degree with accelerations too.
Where no velocities are given they are those of the cubic spline, which has continuous
accelerations; it begins with the velocity that the task has and ends at rest.

Rotations are interpolated in the same way, as rotation vectors from the first point of the two,
``R(t) = R_0 exp(phi(t))``, with the angular velocity ``R(t) J_r(phi) dphi/dt``; without velocities
those at a point are from the parabola through it and its neighbours.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from tp_controller.errors import InvalidValue, shown

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]

BLOCK = 16
"""Velocities of a spline are computed for so many points at once,"""
MARGIN = 24
"""with so many more on both sides: what is farther away changes them by less than 1e-13."""
SMALL = 1e-6
"""Step of a finite difference."""


class VectorPath:
    """Values between points in time.

    Parameters
    ----------
    times
        Increasing times (m,) [s].
    values
        Values (m, k) there.
    velocities, accelerations
        Derivatives (m, k) there; a spline without velocities, and no use of accelerations then.
    start
        Velocity (k,) of the spline at the first point; zero when left out.
    """

    def __init__(
        self,
        times: Vector,
        values: Matrix,
        velocities: Matrix | None = None,
        accelerations: Matrix | None = None,
        start: Vector | None = None,
    ) -> None:
        self.times, self.values = times, values
        self._given = velocities
        self._accelerations = None if velocities is None else accelerations
        self._start = np.zeros(values.shape[1]) if start is None else start
        self._blocks, self._polynomials = dict[int, Matrix](), dict[int, Matrix]()

    def at(self, time: float) -> tuple[Vector, Vector]:
        """Values and velocities (k,) at a time [s]; at rest before and after the points."""
        last = len(self.times) - 1
        if time >= self.times[last]:
            return self.values[last].copy(), np.zeros(self.values.shape[1])
        if time < self.times[0]:
            return self.values[0].copy(), np.zeros(self.values.shape[1])
        i = segment_of(self.times, time)
        coefficients = kept(self._polynomials, i, self._polynomial)
        return evaluated(coefficients, time - self.times[i])

    def _polynomial(self, i: int) -> Matrix:
        h = float(self.times[i + 1] - self.times[i])
        step = self.values[i + 1] - self.values[i]
        v0, v1 = self._velocity(i), self._velocity(i + 1)
        if self._accelerations is None:
            return polynomial(h, self.values[i], step, v0, v1)
        return polynomial(
            h, self.values[i], step, v0, v1, self._accelerations[i], self._accelerations[i + 1]
        )

    def _velocity(self, i: int) -> Vector:
        """Velocity (k,) at a point."""
        if self._given is not None:
            return np.asarray(self._given[i])
        number, place = divmod(i, BLOCK)
        return np.asarray(kept(self._blocks, number, self._spline)[place])

    def _spline(self, number: int) -> Matrix:
        """Velocities (b, k) of the points of a block."""
        first = number * BLOCK
        end = min(first + BLOCK, len(self.times))
        low, high = max(0, first - MARGIN), min(len(self.times), end + MARGIN)
        times, values = self.times[low:high], self.values[low:high]
        n = high - low
        # At cut ends the difference of neighbours: what it is wrong by has faded at the block.
        A, b = np.eye(n), np.zeros(values.shape)
        if low == 0:
            b[0] = self._start
        else:
            b[0] = (values[1] - values[0]) / (times[1] - times[0])
        if high < len(self.times):
            b[-1] = (values[-1] - values[-2]) / (times[-1] - times[-2])
        h = np.diff(times)
        slopes = np.diff(values, axis=0) / h[:, None]
        inner = np.arange(1, n - 1)
        A[inner, inner - 1] = 1.0 / h[:-1]
        A[inner, inner] = 2.0 / h[:-1] + 2.0 / h[1:]
        A[inner, inner + 1] = 1.0 / h[1:]
        b[1:-1] = 3.0 * (slopes[:-1] / h[:-1, None] + slopes[1:] / h[1:, None])
        return np.asarray(np.linalg.solve(A, b)[first - low : end - low], dtype=float)


class RotationPath:
    """Rotations between points in time.

    Parameters
    ----------
    times
        Increasing times (m,) [s].
    rotations
        Rotations (m, 3, 3) there.
    velocities, accelerations
        Angular ones (m, 3) there, along the axes that the rotations are seen from.
    start
        Angular velocity (3,) at the first point without velocities; zero when left out.
    """

    def __init__(
        self,
        times: Vector,
        rotations: Matrix,
        velocities: Matrix | None = None,
        accelerations: Matrix | None = None,
        start: Vector | None = None,
    ) -> None:
        self.times, self._rotations = times, rotations
        self._given = velocities
        self._accelerations = None if velocities is None else accelerations
        self._start = np.zeros(3) if start is None else start
        self._polynomials = dict[int, Matrix]()

    def at(self, time: float) -> tuple[Matrix, Vector]:
        """Rotation (3, 3) and angular velocity (3,) at a time [s], as `VectorPath.at`."""
        last = len(self.times) - 1
        if time >= self.times[last] or time < self.times[0]:
            R = self._rotations[last if time >= self.times[last] else 0]
            return R.copy(), np.zeros(3)
        i = segment_of(self.times, time)
        coefficients = kept(self._polynomials, i, self._polynomial)
        phi, rate = evaluated(coefficients, time - self.times[i])
        R = np.asarray(self._rotations[i] @ pin.exp3(phi))
        return R, R @ (pin.Jexp3(phi) @ rate)

    def _polynomial(self, i: int) -> Matrix:
        R0, R1 = self._rotations[i], self._rotations[i + 1]
        turn = R0.T @ R1
        phi, inverse = pin.log3(turn), pin.Jlog3(turn)
        h = float(self.times[i + 1] - self.times[i])
        v0 = R0.T @ self._velocity(i)
        v1 = inverse @ (R1.T @ self._velocity(i + 1))
        if self._accelerations is None:
            return polynomial(h, np.zeros(3), phi, v0, v1)
        bent = pin.Jexp3(phi + SMALL * v1) - pin.Jexp3(phi - SMALL * v1)
        a1 = inverse @ (R1.T @ self._accelerations[i + 1] - bent @ v1 / (2.0 * SMALL))
        return polynomial(h, np.zeros(3), phi, v0, v1, R0.T @ self._accelerations[i], a1)

    def _velocity(self, i: int) -> Vector:
        """Angular velocity (3,) at a point."""
        if self._given is not None:
            return np.asarray(self._given[i])
        if i == 0:
            return self._start
        if i + 1 == len(self.times):
            return np.zeros(3)
        R, (before, after) = self._rotations[i], np.diff(self.times[i - 1 : i + 2])
        to = -pin.log3(R.T @ self._rotations[i - 1]) / before
        on = pin.log3(R.T @ self._rotations[i + 1]) / after
        found: Vector = R @ ((after * to + before * on) / (before + after))
        return found


def kept(cache: dict[int, Matrix], i: int, compute: Callable[[int], Matrix]) -> Matrix:
    """Value of a number, which is computed if it is not one of the last two.

    A cycle looks at its beginning and its end, which may be in two segments, and the next one
    begins at that end.
    """
    if i not in cache:
        if len(cache) == 2:
            del cache[next(iter(cache))]
        cache[i] = compute(i)
    return cache[i]


def segment_of(times: Vector, time: float) -> int:
    """Number of the segment that a time within the points is in."""
    return int(np.searchsorted(times, time, side='right')) - 1


def polynomial(
    h: float,
    value: Vector,
    step: Vector,
    v0: Vector,
    v1: Vector,
    a0: Vector | None = None,
    a1: Vector | None = None,
) -> Matrix:
    """Coefficients (4 or 6, k), constant first, from values and derivatives at two points.

    Parameters
    ----------
    h
        Time [s] between them.
    value, step
        Value (k,) at the first point, and what it changes by.
    v0, v1, a0, a1
        Velocities and accelerations (k,) at both.
    """
    if a0 is None or a1 is None:
        c2 = (3.0 * step - (2.0 * v0 + v1) * h) / h**2
        c3 = (-2.0 * step + (v0 + v1) * h) / h**3
        return np.stack([value, v0, c2, c3])
    c3 = (20.0 * step - (8.0 * v1 + 12.0 * v0) * h - (3.0 * a0 - a1) * h**2) / (2.0 * h**3)
    c4 = (-30.0 * step + (14.0 * v1 + 16.0 * v0) * h + (3.0 * a0 - 2.0 * a1) * h**2) / (2.0 * h**4)
    c5 = (12.0 * step - 6.0 * (v1 + v0) * h - (a0 - a1) * h**2) / (2.0 * h**5)
    return np.stack([value, v0, 0.5 * a0, c3, c4, c5])


def evaluated(coefficients: Matrix, time: float) -> tuple[Vector, Vector]:
    """Value and derivative (k,) of a polynomial at a time [s]."""
    value, rate = np.zeros((2, coefficients.shape[1]))
    for c in coefficients[::-1]:
        rate = rate * time + value
        value = value * time + c
    return value, rate


def check_times(times: Vector) -> None:
    """Check the times of points.

    Raises
    ------
    InvalidValue
        If one is negative or not finite, or they do not increase.
    """
    key = 'points.time_from_start'
    if not (np.isfinite(times).all() and times.min(initial=0.0) >= 0.0):
        raise InvalidValue(key, shown(times), 'times of at least 0')
    late = np.flatnonzero(np.diff(times) <= 0.0)
    if late.size:
        i = int(late[0])
        got = f'{times[i + 1]:g} s for point {i + 2}, after {times[i]:g} s'
        raise InvalidValue(key, got, 'times that increase from point to point')
