"""Rows of set-based tasks with smooth switching, compiled by numba: no allocation."""

from __future__ import annotations

import math

from tp_controller.array_types import COLUMN, FIXED, FIXED_ROWS, ROWS
from tp_controller.compiled import boolean, float64, int64, njit, void


@njit(void(COLUMN, ROWS, COLUMN, float64, boolean[::1], COLUMN, ROWS), cache=True)
def switch(distance, slope, edge, margin, on, error, J):  # type: ignore[no-untyped-def]
    """Let rows in that are nearer than their edges.

    Parameters
    ----------
    distance, slope, edge
        Distances (k,), their derivative (k, n), and how near they come in (k,).
    margin
        Distance that is kept.
    on, error, J
        Results: which rows are in (k,), how deep each is inside the margin (k,), and the
        derivative of those that are in, for the others zero (k, n).
    """
    for i in range(distance.size):
        on[i] = distance[i] < edge[i]
        error[i] = max(margin - distance[i], 0.0)
        for c in range(J.shape[1]):
            J[i, c] = slope[i, c] if on[i] else 0.0


@njit(void(FIXED_ROWS, FIXED, FIXED, float64, float64, COLUMN), cache=True)
def narrow(reach, speed, feedforward, time, margin, edge):  # type: ignore[no-untyped-def]
    """Fill how near rows (k,) have to come in for joints up to some speeds (n,).

    Parameters
    ----------
    reach
        Bounds (k, n) on the derivatives of the distances.
    speed, feedforward
        Largest speeds (n,), and what is added to the least rates (k,).
    time, margin
        Time constant [s], and the distance that is kept.
    edge
        Result (k,).
    """
    for i in range(edge.size):
        rate = max(feedforward[i], 0.0)
        for j in range(speed.size):
            rate += reach[i, j] * speed[j]
        edge[i] = margin + time * rate


@njit(void(COLUMN, boolean[::1], COLUMN, FIXED_ROWS, COLUMN, float64, float64, COLUMN), cache=True)
def least_rates(distance, on, error, K, feedforward, margin, time, out):  # type: ignore[no-untyped-def]
    """Fill the least rates (k,) of the distances of rows that are in, for the others zero."""
    for i in range(out.size):
        out[i] = 0.0
        if not on[i]:
            continue
        rate = feedforward[i]
        for j in range(out.size):
            rate += K[i, j] * error[j]
        out[i] = rate - max(distance[i] - margin, 0.0) / time


@njit(void(FIXED, int64[::1], FIXED, FIXED, ROWS, COLUMN, ROWS), cache=True)
def ends(q, coordinates, lower, upper, rates, distance, slope):  # type: ignore[no-untyped-def]
    """Fill the distances (k,) of coordinates from the nearer ends and their derivative (k, n).

    Parameters
    ----------
    q, coordinates
        Configuration (nq,), and which of its coordinates count (k,).
    lower, upper
        Ends (k,) of their ranges.
    rates
        Derivative (k, n) of the coordinates by the joints.
    distance, slope
        Results.
    """
    for i in range(distance.size):
        below, above = q[coordinates[i]] - lower[i], upper[i] - q[coordinates[i]]
        distance[i], sign = (below, 1.0) if below < above else (above, -1.0)
        for c in range(slope.shape[1]):
            slope[i, c] = sign * rates[i, c] if rates[i, c] != 0.0 else 0.0


@njit(void(FIXED, int64[::1], COLUMN, float64, FIXED_ROWS, COLUMN, ROWS), cache=True)
def sphere(position, axes, center, radius, jacobian, distance, slope):  # type: ignore[no-untyped-def]
    """Fill the distance (1,) of a point from a sphere and its derivative (1, n).

    Parameters
    ----------
    position, jacobian
        Of the point: (3,) and its linear velocity by the joints, in the first rows (6, n).
    axes
        Which coordinates count.
    center, radius
        Of the sphere, along these axes.
    """
    square = 0.0
    for i in range(axes.size):
        square += (position[axes[i]] - center[i]) ** 2
    length = math.sqrt(square)
    distance[0] = length - radius
    for c in range(slope.shape[1]):
        slope[0, c] = 0.0
    for i in range(axes.size):
        # In the very centre every direction leads out.
        outward = 1.0 if i == 0 else 0.0
        if length > 0.0:
            outward = (position[axes[i]] - center[i]) / length
        for c in range(slope.shape[1]):
            slope[0, c] += outward * jacobian[axes[i], c]
