"""Rows of the tasks on frames and joints, compiled by numba: no allocation.

One call fills the Jacobians, errors and desired velocities of all of them from what Pinocchio
found: the twist of every joint and the pose of every frame. With the Jacobian of the frame f
``[v; ω]`` and its position p, both in the base frame, and the reference frame r, whose rotation is
R, a task sees

    position      Rᵀ (p - p_r)       Jacobian  Rᵀ (v - v_r + (p - p_r) × ω_r)
    rotation      Rᵀ R_f             Jacobian  Rᵀ (ω - ω_r)

and, with axes A of its own, the error along them: ``Aᵀ error``. The error of a rotation is the
logarithm of ``R_des Rᵀ``, or less of it: its `tilt`, or the angle of its heading.
"""

from __future__ import annotations

import math

from tp_controller.array_types import COLUMN, CUBE, FIXED, ROWS
from tp_controller.compiled import boolean, inner, int64, njit, void
from tp_controller.tasks.parts import (
    AXES,
    AXIS,
    CARRIED,
    COUNT,
    FIRST,
    FRAME,
    HEADING,
    JOINTS,
    KIND,
    POSITION,
    REFERENCE,
    REFERENCES,
    ROTATION,
)

STRAIGHT = 1e-12
"""Square of an image's length in the plane below which a heading has no derivative."""


@inner
def rotation_vector(Q, out):  # type: ignore[no-untyped-def]
    """Fill the rotation vector (3,) [rad] of a rotation (3, 3), its logarithm of length up to pi.

    By the unit quaternion, which is exact near half a turn, too.
    """
    trace = Q[0, 0] + Q[1, 1] + Q[2, 2]
    # The largest component first: the others are divided by it (Shepperd 1978).
    if trace > 0.0:
        w = 0.5 * math.sqrt(1.0 + trace)
        out[0] = (Q[2, 1] - Q[1, 2]) / (4.0 * w)
        out[1] = (Q[0, 2] - Q[2, 0]) / (4.0 * w)
        out[2] = (Q[1, 0] - Q[0, 1]) / (4.0 * w)
    else:
        i = 0
        if Q[1, 1] > Q[0, 0]:
            i = 1
        if Q[2, 2] > Q[i, i]:
            i = 2
        j, k = (i + 1) % 3, (i + 2) % 3
        size = 0.5 * math.sqrt(max(1.0 + Q[i, i] - Q[j, j] - Q[k, k], 0.0))
        w = (Q[k, j] - Q[j, k]) / (4.0 * size)
        out[i] = size
        out[j] = (Q[j, i] + Q[i, j]) / (4.0 * size)
        out[k] = (Q[k, i] + Q[i, k]) / (4.0 * size)
    length = math.sqrt(out[0] ** 2 + out[1] ** 2 + out[2] ** 2)
    if w < 0.0:
        w, length = -w, -length
    scale = 2.0
    if length != 0.0:
        scale = 2.0 * math.atan2(abs(length), w) / length
    for i in range(3):
        out[i] *= scale


@inner
def tilt(Q, axis, carried, out):  # type: ignore[no-untyped-def]
    """Fill the shortest rotation that leaves of a rotation error only a turn about one axis.

    The swing of the swing-twist decomposition (Dobrowolski 2015, "Swing-twist decomposition
    in Clifford algebra", arXiv:1506.05481) of the rotation error ``Q = R_des Rᵀ`` with
    respect to the unit vector c of an axis: ``Q = T S`` with a turn T about c where c stands
    still, ``Q = S T`` where the frame that is turned carries c along. The rotation vector of S is

        e = θ / sin θ (a × b),   θ = atan2(|a × b|, a · b)

    with ``a = Qᵀ c, b = c`` (still) or ``a = c, b = Q c`` (carried). It has no component along
    c and does not depend on turns of R about c, and the rate of its size is ``-e · ω / θ``, the
    angular velocity along it. Half a turn away, where every axis across c is as good, it is
    about the next axis in cyclic order.

    Parameters
    ----------
    Q
        ``R_des Rᵀ`` (3, 3), along axes of which c is one.
    axis
        Which of them c is: 0, 1, 2.
    carried
        Whether c moves with R.
    out
        Result: rotation vector (3,) [rad], along the axes of ``Q``.
    """
    i, j = (axis + 1) % 3, (axis + 2) % 3
    x, y = (-Q[j, axis], Q[i, axis]) if carried else (Q[axis, j], -Q[axis, i])
    sine, cosine = math.hypot(x, y), Q[axis, axis]
    out[0] = out[1] = out[2] = 0.0
    if sine > 0.0:
        scale = math.atan2(sine, cosine) / sine
        out[i], out[j] = scale * x, scale * y
    elif cosine < 0.0:
        out[i] = math.pi


@inner
def heading_row(R, axis, out):  # type: ignore[no-untyped-def]
    """Fill the row (3,) that maps the angular velocity of a rotation (3, 3) to its heading's rate.

    The heading is the angle, in the plane normal to the axis, of the image of the next axis in
    cyclic order. Where that image is normal to the plane the heading has no derivative; the unit
    row is filled in there.
    """
    i, j = (axis + 1) % 3, (axis + 2) % 3
    a, b, c = R[i, i], R[j, i], R[axis, i]
    square = a * a + b * b
    out[axis], out[i], out[j] = 1.0, 0.0, 0.0
    if square > STRAIGHT:
        out[i], out[j] = -c * a / square, -c * b / square


@inner
def _wrapped(angle):  # type: ignore[no-untyped-def]
    """Angle [rad] moved by whole turns into [-pi, pi]; one that is there stays as it is."""
    if -math.pi <= angle <= math.pi:
        return angle
    # Beyond one turn rounding of the division does not count.
    return angle - 2.0 * math.pi * round(angle / (2.0 * math.pi))


@inner
def frame_jacobian(twists, S, moves, position, out):  # type: ignore[no-untyped-def]
    """Fill the Jacobian (6, n) of a frame from the twists (m, 6) of the model's joints."""
    n = out.shape[1]
    for r in range(6):
        for c in range(n):
            out[r, c] = 0.0
    x, y, z = position[0], position[1], position[2]
    for j in range(moves.size):
        if not moves[j]:
            continue
        a, b, c = twists[j, 3], twists[j, 4], twists[j, 5]
        u = twists[j, 0] + b * z - c * y
        v = twists[j, 1] + c * x - a * z
        w = twists[j, 2] + a * y - b * x
        if S.size == 0:
            out[0, j], out[1, j], out[2, j] = u, v, w
            out[3, j], out[4, j], out[5, j] = a, b, c
            continue
        for i in range(n):
            share = S[j, i]
            if share != 0.0:
                out[0, i] += share * u
                out[1, i] += share * v
                out[2, i] += share * w
                out[3, i] += share * a
                out[4, i] += share * b
                out[5, i] += share * c


@inner
def _seen(jac, own, frame, reference, R, way, turns):  # type: ignore[no-untyped-def]
    """Fill the Jacobian (3, n) of a frame's position or rotation as seen from a reference.

    Parameters
    ----------
    jac
        Jacobians (F, 6, n) of the frames.
    own
        Result: the Jacobian (3, n).
    frame, reference
        Which of them are meant; -1 is the base.
    R, way
        Rotation (3, 3) of the reference, and the way (3,) from there to the frame.
    turns
        Whether the rotation is meant.
    """
    first = 3 if turns else 0
    for c in range(jac.shape[2]):
        x, y, z = 0.0, 0.0, 0.0
        if frame >= 0:
            x, y, z = jac[frame, first, c], jac[frame, first + 1, c], jac[frame, first + 2, c]
        if reference < 0:
            own[0, c], own[1, c], own[2, c] = x, y, z
            continue
        x -= jac[reference, first, c]
        y -= jac[reference, first + 1, c]
        z -= jac[reference, first + 2, c]
        if not turns:
            # The reference turns under the way to the frame.
            i, j, k = jac[reference, 3, c], jac[reference, 4, c], jac[reference, 5, c]
            x += way[1] * k - way[2] * j
            y += way[2] * i - way[0] * k
            z += way[0] * j - way[1] * i
        for row in range(3):
            own[row, c] = R[0, row] * x + R[1, row] * y + R[2, row] * z


@inner
def pose(poses, index, R, p):  # type: ignore[no-untyped-def]
    """Fill rotation (3, 3) and position (3,) of a frame, of the base if there is none."""
    for i in range(3):
        p[i] = poses[index, 3, i] if index >= 0 else 0.0
        for j in range(3):
            # Pinocchio keeps the columns of a rotation one after the other.
            R[i, j] = poses[index, j, i] if index >= 0 else (1.0 if i == j else 0.0)


@inner
def product(A, transposed, B, out):  # type: ignore[no-untyped-def]
    """Fill the product (3, 3) of two matrices, of which the first may be meant transposed."""
    for i in range(3):
        for j in range(3):
            total = 0.0
            for k in range(3):
                total += (A[k, i] if transposed else A[i, k]) * B[k, j]
            out[i, j] = total


@inner
def _fill_part(poses, frames, jac, part, places, values, work, J, errors):  # type: ignore[no-untyped-def]
    """Fill the rows of one part on a frame."""
    kind, first, k = part[KIND], part[FIRST], part[COUNT]
    frame, reference, axes = part[FRAME], part[REFERENCE], part[AXES]
    n = J.shape[1]
    R, A, Q, own, other = work[0, :3], work[1, :3], work[2, :3], work[3, :3], work[4, :3]
    Rf, seen, error, p = work[5, :3], work[6, :3], work[7, 0], work[7, 1]
    p_ref, unused, way, side = work[7, 2], work[7, 3], work[7, 4], work[7, 5]
    turns = kind != POSITION
    pose(poses, frames[frame], Rf, p)
    pose(poses, frames[reference] if reference >= 0 else -1, R, p_ref)
    for i in range(3):
        way[i] = p[i] - p_ref[i]
    own_axes = axes != REFERENCES
    if own_axes:
        pose(poses, frames[axes] if axes >= 0 else -1, Q, unused)
        product(R, True, Q, A)
    _seen(jac, own, frame, reference, R, way, turns)
    if turns:
        product(R, True, Rf, seen)
    if kind == HEADING:
        axis = part[AXIS]
        i, j = (axis + 1) % 3, (axis + 2) % 3
        errors[first] = _wrapped(values[0] - math.atan2(seen[j, i], seen[i, i]))
        heading_row(seen, axis, side)
        for c in range(n):
            J[first, c] = side[0] * own[0, c] + side[1] * own[1, c] + side[2] * own[2, c]
        return
    if kind == POSITION:
        for i in range(3):
            seen_way = way[i]
            if reference >= 0:
                seen_way = R[0, i] * way[0] + R[1, i] * way[1] + R[2, i] * way[2]
            error[i] = values[i] - seen_way
        if own_axes:
            # The axes turn under the way to the target.
            _seen(jac, other, axes, reference, R, way, True)
            for c in range(n):
                x, y, z = other[0, c], other[1, c], other[2, c]
                own[0, c] -= error[1] * z - error[2] * y
                own[1, c] -= error[2] * x - error[0] * z
                own[2, c] -= error[0] * y - error[1] * x
    else:
        # Q = R_des Rᵀ; the target is kept row by row.
        for i in range(3):
            for j in range(3):
                Q[i, j] = 0.0
                for m in range(3):
                    Q[i, j] += values[3 * i + m] * seen[j, m]
        if kind == ROTATION:
            rotation_vector(Q, error)
        elif not own_axes:
            tilt(Q, part[AXIS], part[CARRIED] != 0, error)
        else:
            product(A, True, Q, seen)
            product(seen, False, A, Q)
            tilt(Q, part[AXIS], part[CARRIED] != 0, side)
            for i in range(3):
                error[i] = A[i, 0] * side[0] + A[i, 1] * side[1] + A[i, 2] * side[2]
    for row in range(k):
        i = places[row] % 3
        r = first + row
        if not own_axes:
            errors[r] = error[i]
            for c in range(n):
                J[r, c] = own[i, c]
            continue
        errors[r] = A[0, i] * error[0] + A[1, i] * error[1] + A[2, i] * error[2]
        for c in range(n):
            J[r, c] = A[0, i] * own[0, c] + A[1, i] * own[1, c] + A[2, i] * own[2, c]


@njit(
    void(
        FIXED, ROWS, CUBE, ROWS, int64[::1], boolean[:, ::1], CUBE, int64[:, ::1], int64[:, ::1],
        boolean[:, ::1], ROWS, int64[:, ::1], CUBE, FIXED, int64[:, ::1], FIXED, CUBE, ROWS,
        COLUMN, COLUMN, COLUMN,
    ),
    cache=True,
    prepared=True,
)  # fmt: skip
def fill(  # type: ignore[no-untyped-def]
    q, twists, poses, S, frames, moves, jac, plan, places, wraps, values, tasks, gains, added,
    groups, speeds, work, J, errors, feedforward, velocity,
):  # fmt: skip
    """Fill Jacobians, errors and desired velocities of tasks.

    Parameters
    ----------
    q
        Configuration (n,) [rad, m].
    twists
        Twist (m, 6) of every joint of the model per unit of its speed, in the base frame.
    poses
        Pose (nf, 4, 3) of every frame: the columns of its rotation, then its position.
    S
        Speeds of the model's joints per speed of the controlled ones (m, n); no entries if they
        are the same.
    frames, moves, jac
        Indices (F,) of the frames that count, which joints of the model move each (F, m), and
        their Jacobians (F, 6, n), to be filled.
    plan, places, wraps, values
        Parts, see `tp_controller.tasks.parts` (P, 8); which axes or joints their rows are
        (P, w), which rows wrap (P, w), and their targets (P, w).
    tasks, gains, added
        First row and number of rows of every task (T, 2), its gain (T, k, k), and the velocities
        (K,) that are added to the gain terms.
    groups, speeds
        First row and number of rows that have a largest speed together (G, 2), and that (G,).
    work
        Space to work in (8, 6, n), at least 3 columns.
    J, errors
        Results: Jacobian (K, n) and error (K,) of every row.
    feedforward, velocity
        Results: desired velocities (K,), and the part of them (K,) that is no gain term.
    """
    for f in range(frames.size):
        frame_jacobian(twists, S, moves[f], poses[frames[f], 3], jac[f])
    for i in range(plan.shape[0]):
        if plan[i, KIND] != JOINTS:
            _fill_part(poses, frames, jac, plan[i], places[i], values[i], work, J, errors)
            continue
        first = plan[i, FIRST]
        for row in range(plan[i, COUNT]):
            error = values[i, row] - q[places[i, row]]
            errors[first + row] = _wrapped(error) if wraps[i, row] else error
    for t in range(tasks.shape[0]):
        first, k = tasks[t, 0], tasks[t, 1]
        for i in range(k):
            total = added[first + i]
            feedforward[first + i] = total
            for j in range(k):
                total += gains[t, i, j] * errors[first + j]
            velocity[first + i] = total
    for g in range(speeds.size):
        if not speeds[g] < math.inf:
            continue
        first, end = groups[g, 0], groups[g, 0] + groups[g, 1]
        square = 0.0
        for r in range(first, end):
            square += velocity[r] * velocity[r]
        if not square > speeds[g] * speeds[g]:
            continue
        share = speeds[g] / math.sqrt(square)
        for r in range(first, end):
            velocity[r] *= share
            feedforward[r] *= share
