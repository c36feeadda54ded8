"""Trajectory messages: checked, and made to paths of tasks."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from builtin_interfaces.msg import Duration
from geometry_msgs.msg import Quaternion, Twist
from numpy.typing import NDArray

from tp_controller.errors import InvalidValue, listed, plural, shown
from tp_controller.robot import Frame
from tp_controller.rotations import rotation_from_quaternion
from tp_controller.tasks import FrameTask, JointTask, PositionTask
from tp_controller.tasks.base import LARGEST
from tp_controller.trajectory import (
    FramePath,
    JointPath,
    RotationPath,
    Straight,
    TaskPath,
    VectorPath,
    check_times,
)

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]

MOST = 1000
"""Points of one trajectory: more would hold up the cycle."""


class Begin(NamedTuple):
    """Where a trajectory begins."""

    time: float
    """Time [s] of the trajectory at its next joint state; negative if it begins later."""
    path: TaskPath | None
    """Path that the task is on, None if it is on none."""
    at: float
    """Time [s] of that path,"""
    speed: float
    """and the share of its speed that it has."""
    longest: float
    """Time [s] for which a point alone goes on at its velocity."""


def joint_path(task: JointTask, msg: Any, begin: Begin) -> TaskPath:
    """Path of a joint task from a JointTrajectory.

    Raises
    ------
    InvalidValue
        If the message cannot be used.
    """
    names, points = msg.joint_names, msg.points
    # Checks the names.
    task.with_joints(np.zeros(task.k), names, [0.0] * len(names))
    columns = [task.components.index(name) for name in names]
    times = _times(points)
    if any(len(point.effort) for point in points):
        raise InvalidValue('points.effort', 'values', 'none: velocities are commanded')
    words = f'{len(names)}, one for each of joint_names'
    given = {
        key: _numbers(key, [getattr(point, key) for point in points], len(names), words)
        for key in ('positions', 'velocities', 'accelerations')
    }
    if given['positions'] is None:
        raise InvalidValue('points.positions', 'none', words)
    value, rate = task.current, np.zeros(task.k)
    if isinstance(begin.path, JointPath):
        value, rate = begin.path.path.at(begin.at)
        rate = begin.speed * rate
    positions = np.tile(value, (len(points), 1))
    positions[:, columns] = given['positions']
    for row in task.wrapping:
        # The first point by the shortest way, the others as far from it as they were given.
        positions[:, row] -= math.tau * np.round((positions[0, row] - value[row]) / math.tau)
    rates = _spread(given['velocities'], columns, task.k)
    bends = _spread(given['accelerations'], columns, task.k)
    alone = _goes_on(times, rates, begin)
    kept = _kept(times, begin, alone)
    times, (positions, rates, bends) = _cut(
        times, kept, begin, (value, rate), (positions, rates, bends)
    )
    path = JointPath(VectorPath(times, positions, rates, bends, rate if len(times) > 1 else None))
    if alone and rates is not None:
        return Straight(path, rates[-1], begin.longest)
    return path


def frame_path(task: FrameTask, msg: Any, source: Frame, begin: Begin) -> TaskPath:
    """Path of a task on a frame from a MultiDOFJointTrajectory.

    Parameters
    ----------
    task
        The task.
    msg
        The message.
    source
        Frame of its header.
    begin
        Where it begins.

    Raises
    ------
    InvalidValue
        If the message cannot be used.
    """
    points = msg.points
    known = (task.frame_name, task.name)
    if len(msg.joint_names) > 1 or not set(msg.joint_names) <= set(known):
        accepts = f'none, or one of {listed(known)}'
        raise InvalidValue('joint_names', shown(list(msg.joint_names)), accepts)
    times = _times(points)
    for point in points:
        if len(point.transforms) != 1:
            got = plural(len(point.transforms), 'value')
            raise InvalidValue('points.transforms', got, '1 for each point')
    transforms = [point.transforms[0] for point in points]
    places = _checked(
        'points.transforms.translation',
        [[t.translation.x, t.translation.y, t.translation.z] for t in transforms],
    )
    turns = np.tile(np.eye(3), (len(points), 1, 1))
    if not isinstance(task, PositionTask):
        turns = np.stack([_rotation(t.rotation) for t in transforms])
    rates = _twists('velocities', points)
    bends = _twists('accelerations', points)
    seen = task.reference
    if source is not seen:
        A = seen.rotation.T @ source.rotation
        places = places @ A.T + seen.rotation.T @ (source.position - seen.position)
        turns = A @ turns
        rates, bends = _turned(rates, A), _turned(bends, A)
    place, turn = task.pose
    rate = np.zeros(6)
    if isinstance(begin.path, FramePath):
        place, turn, rate = begin.path.pose(begin.at)
        rate = begin.speed * rate
    if isinstance(task, PositionTask):
        turn = np.eye(3)
    alone = _goes_on(times, rates, begin)
    kept = _kept(times, begin, alone)
    times, (places, rates, bends) = _cut(times, kept, begin, (place, rate), (places, rates, bends))
    turns = turns[kept]
    if len(times) > len(turns):
        turns = np.concatenate([turn[None], turns])
    v, w = _halves(rates)
    dv, dw = _halves(bends)
    path = FramePath(
        VectorPath(times, places, v, dv, rate[:3]), RotationPath(times, turns, w, dw, rate[3:])
    )
    if alone and rates is not None:
        return Straight(path, rates[-1], begin.longest)
    return path


def _times(points: Sequence[Any]) -> Vector:
    if len(points) > MOST:
        raise InvalidValue('points', f'{len(points)}', f'up to {MOST}')
    times = np.array([_seconds(point.time_from_start) for point in points])
    check_times(times)
    return times


def _seconds(duration: Duration) -> float:
    return float(duration.sec + 1e-9 * duration.nanosec)


def _checked(key: str, rows: Sequence[Sequence[float]]) -> Matrix:
    values = np.array(rows, dtype=float)
    wrong = ~(np.abs(values) <= LARGEST).all(axis=1)
    if wrong.any():
        i = int(np.flatnonzero(wrong)[0])
        got = f'{shown(values[i])} for point {i + 1}'
        raise InvalidValue(key, got, f'finite numbers up to {LARGEST:g} in size')
    return values


def _numbers(key: str, rows: Sequence[Sequence[float]], size: int, words: str) -> Matrix | None:
    """Values (m, size) of all points, None if none has them."""
    if not any(len(row) for row in rows):
        return None
    for i, row in enumerate(rows):
        if len(row) != size:
            got = f'{plural(len(row), "value")} for point {i + 1}'
            raise InvalidValue(f'points.{key}', got, f'{words}, for all points or none')
    return _checked(f'points.{key}', rows)


def _twists(key: str, points: Sequence[Any]) -> Matrix | None:
    """Velocities or accelerations (m, 6) of all points, None if none has them."""
    rows = [[value for twist in getattr(point, key) for value in _six(twist)] for point in points]
    return _numbers(key, rows, 6, 'one twist for each point')


def _six(twist: Twist) -> tuple[float, ...]:
    v, w = twist.linear, twist.angular
    return v.x, v.y, v.z, w.x, w.y, w.z


def _rotation(quaternion: Quaternion) -> Matrix:
    xyzw = np.array([quaternion.x, quaternion.y, quaternion.z, quaternion.w])
    largest = np.abs(xyzw).max()
    if not 0.0 < largest < math.inf:
        accepts = 'a quaternion that is finite and not zero'
        raise InvalidValue('points.transforms.rotation', shown(xyzw), accepts)
    return rotation_from_quaternion(xyzw / largest)


def _spread(values: Matrix | None, columns: Sequence[int], k: int) -> Matrix | None:
    """Values of all joints (m, k); those without are zero."""
    if values is None:
        return None
    spread = np.zeros((len(values), k))
    spread[:, columns] = values
    return spread


def _turned(twists: Matrix | None, A: Matrix) -> Matrix | None:
    return None if twists is None else np.hstack([twists[:, :3] @ A.T, twists[:, 3:] @ A.T])


def _halves(twists: Matrix | None) -> tuple[Matrix | None, Matrix | None]:
    return (None, None) if twists is None else (twists[:, :3], twists[:, 3:])


def _goes_on(times: Vector, rates: Matrix | None, begin: Begin) -> bool:
    """Whether it is a point alone that goes on at its velocity.

    Raises
    ------
    InvalidValue
        If a trajectory of more points ends with a velocity.
    """
    if rates is None or not rates[-1].any():
        return False
    if len(times) > 1:
        accepts = 'zero at the last point; a point alone may go on with one'
        raise InvalidValue('points.velocities', f'{shown(rates[-1])} at the last point', accepts)
    return True


def _kept(times: Vector, begin: Begin, alone: bool) -> NDArray[np.bool_]:
    """Which points (m,) are not over.

    Raises
    ------
    InvalidValue
        If all are.
    """
    end = float(times[-1]) + (begin.longest if alone else 0.0)
    if end < begin.time:
        got = f'one with which the trajectory ended {begin.time - end:.3g} s ago'
        raise InvalidValue('header.stamp', got, '0 for now, or a later one')
    kept: NDArray[np.bool_] = times > begin.time
    kept[-1] = True
    return kept | (begin.time <= 0.0)


def _cut(
    times: Vector,
    kept: NDArray[np.bool_],
    begin: Begin,
    state: tuple[Vector, Vector],
    columns: tuple[Matrix, Matrix | None, Matrix | None],
) -> tuple[Vector, tuple[Matrix, Matrix | None, Matrix | None]]:
    """Points that are not over, behind the state of the task if they begin later.

    Parameters
    ----------
    times, kept
        Of all points (m,).
    begin
        Where it begins.
    state
        Value and velocity of the task.
    columns
        Values, velocities and accelerations (m, k).
    """
    now = max(0.0, begin.time)
    times, (values, rates, bends) = times[kept], columns
    values = values[kept]
    rates = None if rates is None else rates[kept]
    bends = None if bends is None else bends[kept]
    if times[0] > now:
        times = np.concatenate([[now], times])
        values = np.vstack([state[0], values])
        rates = None if rates is None else np.vstack([state[1], rates])
        bends = None if bends is None else np.vstack([np.zeros(bends.shape[1]), bends])
    return times, (values, rates, bends)
