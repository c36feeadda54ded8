"""One step of rigid-body joints with velocity servos; compiled by numba."""

from __future__ import annotations

import math

import numpy as np
from numba import float64, njit, void

PASSES = 3
"""So often it is found out anew in a step which motors are at their limit."""

COLUMN = float64[::1]
TABLE = float64[:, ::1]


@njit(void(TABLE, COLUMN), cache=True)
def solve(A, x):  # type: ignore[no-untyped-def]
    """Solve ``A x = b`` for a symmetric positive definite matrix, by Cholesky.

    Parameters
    ----------
    A
        The matrix (n, n), of which only the lower half is read; overwritten.
    x
        The right side (n,), and then the answer.
    """
    n = x.size
    for j in range(n):
        for k in range(j):
            A[j, j] -= A[j, k] ** 2
        A[j, j] = math.sqrt(A[j, j])
        for i in range(j + 1, n):
            for k in range(j):
                A[i, j] -= A[i, k] * A[j, k]
            A[i, j] /= A[j, j]
    for i in range(n):
        for k in range(i):
            x[i] -= A[i, k] * x[k]
        x[i] /= A[i, i]
    for i in range(n - 1, -1, -1):
        for k in range(i + 1, n):
            x[i] -= A[k, i] * x[k]
        x[i] /= A[i, i]


@njit(
    void(
        TABLE, COLUMN, COLUMN, float64, float64, COLUMN, COLUMN, COLUMN, float64, float64, COLUMN,
        COLUMN,
    ),
    cache=True,
)  # fmt: skip
def drive(  # type: ignore[no-untyped-def]
    M, h, aim, bandwidth, integral, viscous, coulomb, effort, sticking, dt, wanting, qd
):
    """Change velocities by one semi-implicit step, see `tp_sim.rigid_body.RigidBodies`.

    Parameters
    ----------
    M
        Mass matrix (n, n), its lower half.
    h
        Torques of gravity and of Coriolis and centrifugal forces (n,), which the servos know.
    aim
        Commanded velocities (n,).
    bandwidth, integral
        Of the servos [1/s].
    viscous, coulomb
        Friction (n,).
    effort
        Largest torques (n,), infinite if there is no limit.
    sticking
        Speed below which Coulomb friction becomes smaller.
    dt
        Time [s] of the step.
    wanting
        Integral of what the velocities lack (n,); written to.
    qd
        Velocities (n,); written to.
    """
    n = qd.size
    A = np.empty((n, n))
    stiff, rub, pull, end = np.empty(n), np.empty(n), np.empty(n), np.empty(n)
    momentum = np.zeros(n)
    limited = np.zeros(n, dtype=np.bool_)
    for i in range(n):
        gain = bandwidth * M[i, i]
        # With the integral at the end of the step: wanting + dt (aim - end).
        stiff[i] = gain * (1.0 + integral * dt)
        pull[i] = stiff[i] * aim[i] + gain * integral * wanting[i] + h[i]
        speed = max(abs(qd[i]), sticking)
        rub[i] = viscous[i] + coulomb[i] * math.tanh(speed / sticking) / speed
        for j in range(i + 1):
            momentum[i] += M[i, j] * qd[j]
            if j < i:
                momentum[j] += M[i, j] * qd[i]
    for _ in range(PASSES):
        for i in range(n):
            A[i, :] = M[i, :]
            A[i, i] += dt * (rub[i] if limited[i] else rub[i] + stiff[i])
            end[i] = momentum[i] + dt * (pull[i] - h[i])
        solve(A, end)
        more = False
        for i in range(n):
            torque = pull[i] if limited[i] else pull[i] - stiff[i] * end[i]
            if abs(torque) > effort[i]:
                pull[i] = math.copysign(effort[i], torque)
                limited[i] = more = True
        if not more:
            break
    for i in range(n):
        qd[i] = end[i]
        if not limited[i]:
            wanting[i] += dt * (aim[i] - end[i])
