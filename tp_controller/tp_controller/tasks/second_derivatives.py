"""Second derivatives of the tasks on frames, compiled by numba: no allocation.

The counterpart of `tp_controller.tasks.rows`, one order further. The variable of a row is what its
error is taken from: a coordinate of a position, or the angle about an axis. Second derivatives
are symmetric, and axes that turn with the robot are taken as they are now.
"""

from __future__ import annotations

import math

from tp_controller.array_types import COLUMN, CUBE, ROWS
from tp_controller.compiled import boolean, inner, int64, njit, void
from tp_controller.robot.curvature import PLACES, chain_hessian
from tp_controller.tasks.parts import (
    AXES,
    COUNT,
    FIRST,
    FRAME,
    JOINTS,
    KIND,
    REFERENCE,
    REFERENCES,
    ROTATION,
)
from tp_controller.tasks.rows import frame_jacobian, pose, product

SMALL = 1e-3
"""Angle [rad] up to which the logarithm counts as linear."""


@inner
def _relative(seen, own, R, way):  # type: ignore[no-untyped-def]
    """Turn the twist ``seen`` (6, m) of a frame into that as seen from a reference.

    Parameters
    ----------
    seen, own
        Twists of the frame and of the reference; the first one is changed.
    R, way
        Rotation (3, 3) of the reference, and the way (3,) from there to the frame.
    """
    for c in range(seen.shape[1]):
        for r in range(6):
            seen[r, c] -= own[r, c]
        for r in range(3):
            s, t = (r + 1) % 3, (r + 2) % 3
            seen[r, c] += way[s] * own[3 + t, c] - way[t] * own[3 + s, c]
        for first in (0, 3):
            x, y, z = seen[first, c], seen[first + 1, c], seen[first + 2, c]
            for r in range(3):
                seen[first + r, c] = R[0, r] * x + R[1, r] * y + R[2, r] * z


@inner
def _bend_rotation(first, J, errors, space, out):  # type: ignore[no-untyped-def]
    """Add what the second derivatives of ``log(R_des Rᵀ)`` have beyond those of the rotation.

    Of this error, e long, the half square bends less across e than ``JᵀJ`` says: by the factor
    ``e/2 cot(e/2)``.
    """
    n = J.shape[1]
    square = 0.0
    for r in range(first, first + 3):
        square += errors[r] * errors[r]
    angle = math.sqrt(square)
    if angle < SMALL:
        return
    for c in range(n):
        along = 0.0
        for r in range(3):
            along += errors[first + r] * J[first + r, c]
        for r in range(3):
            space[r, c] = J[first + r, c] - errors[first + r] * along / square
    less = (1.0 - 0.5 * angle / math.tan(0.5 * angle)) / square
    for i in range(n):
        for j in range(n):
            bent = 0.0
            for r in range(3):
                bent += space[r, i] * space[r, j]
            for r in range(3):
                out[first + r, i, j] += errors[first + r] * less * bent


@inner
def _along(bent, first, axis, out):  # type: ignore[no-untyped-def]
    """Fill the symmetric part (m, m), along an axis (3,), of derivatives from ``first`` on."""
    m = out.shape[0]
    for c in range(m):
        for d in range(c + 1):
            total = 0.0
            for r in range(3):
                if axis[r] != 0.0:
                    total += axis[r] * (bent[first + r, c, d] + bent[first + r, d, c])
            out[c, d] = out[d, c] = 0.5 * total


@inner
def _coupled(bent, S, out):  # type: ignore[no-untyped-def]
    """Fill ``Sᵀ bent S`` (n, n) from a second derivative (m, m); S without entries is the unit."""
    n, m = out.shape[0], bent.shape[0]
    for i in range(n):
        for j in range(n):
            if S.size == 0:
                out[i, j] = bent[i, j]
                continue
            total = 0.0
            for c in range(m):
                if S[c, i] != 0.0:
                    for d in range(m):
                        total += S[c, i] * bent[c, d] * S[d, j]
            out[i, j] = total


@njit(
    void(
        ROWS, CUBE, ROWS, PLACES, int64[::1], boolean[:, ::1], int64[:, ::1], int64[:, ::1],
        int64[:, ::1], int64[::1], CUBE, CUBE, CUBE, ROWS, COLUMN, CUBE,
    ),
    cache=True,
    prepared=True,
)  # fmt: skip
def fill(  # type: ignore[no-untyped-def]
    twists, poses, S, joint_of, frames, moves, plan, places, chains, counts, twist, bent, work,
    J, errors, out,
):  # fmt: skip
    """Fill the second derivatives of the variables of tasks on frames.

    Parameters
    ----------
    twists, poses, S, frames, moves, plan, places, J, errors
        As `tp_controller.tasks.rows.fill`, which was called for this configuration.
    joint_of
        Which joint each velocity (m,) of the model belongs to.
    chains, counts
        Velocities (P, m) of the model that move the frame of each part as seen from its
        reference, from there on, and how many these are (P,).
    twist, bent, work
        Space to work in: (2, 6, max(m, n)), (7, m, m) and (4, 3, 3).
    out
        Result (K, n, n): the rows of the parts; others stay as they are.
    """
    R, axes, A, places_of = work[0, :3], work[1, :3], work[2, :3], work[3]
    p, p_ref, way = places_of[0], places_of[1], places_of[2]
    whole, row_bent = S[:0], bent[6]
    for i in range(plan.shape[0]):
        part = plan[i]
        first, k = part[FIRST], part[COUNT]
        if part[KIND] == JOINTS:
            continue
        frame, reference = part[FRAME], part[REFERENCE]
        pose(poses, frames[reference] if reference >= 0 else -1, R, p_ref)
        twist[0] = 0.0
        if frame >= 0:
            frame_jacobian(twists, whole, moves[frame], poses[frames[frame], 3], twist[0])
        if reference >= 0:
            frame_jacobian(twists, whole, moves[reference], p_ref, twist[1])
            pose(poses, frames[frame] if frame >= 0 else -1, axes, p)
            for r in range(3):
                way[r] = p[r] - p_ref[r]
            _relative(twist[0], twist[1], R, way)
        chain_hessian(twist[0], chains[i, : counts[i]], joint_of, bent[:6])
        for r in range(3):
            for c in range(3):
                A[r, c] = 1.0 if r == c else 0.0
        if part[AXES] != REFERENCES:
            pose(poses, frames[part[AXES]] if part[AXES] >= 0 else -1, axes, p)
            product(R, True, axes, A)
        for row in range(k):
            column = places[i, row] % 3
            _along(bent, places[i, row] - column, A[:, column], row_bent)
            _coupled(row_bent, S, out[first + row])
        if part[KIND] == ROTATION and k == 3:
            _bend_rotation(first, J, errors, twist[1], out)
