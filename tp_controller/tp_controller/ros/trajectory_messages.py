"""Trajectory messages: checked, and made to paths of tasks."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tp_controller.errors import InvalidValue, listed, plural, shown
from tp_controller.interpolation import RotationPath, VectorPath, check_times
from tp_controller.robot import Frame
from tp_controller.ros.trajectory_bytes import PointValues, trajectory_message
from tp_controller.rotations import rotations_from_quaternions
from tp_controller.tasks import FrameTask, JointTask, PositionTask
from tp_controller.tasks.checks import LARGEST
from tp_controller.trajectory import FramePath, JointPath, Straight, TaskPath

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]

POSE = 7
"""Numbers of a transform: a place and a quaternion."""


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
    points, names = _points(msg), msg.joint_names
    # Checks the names.
    task.with_joints(np.zeros(task.k), names, [0.0] * len(names))
    columns = [task.components.index(name) for name in names]
    times = points.times
    check_times(times)
    if points.sizes['effort'] or (points.unlike and points.unlike[1]['effort']):
        raise InvalidValue('points.effort', 'values', 'none: velocities are commanded')
    words = f'{len(names)}, one for each of joint_names'
    given = {
        key: _numbers(points, key, len(names), words)
        for key in ('positions', 'velocities', 'accelerations')
    }
    if given['positions'] is None:
        raise InvalidValue('points.positions', 'none', words)
    value, rate = task.current, np.zeros(task.k)
    if isinstance(begin.path, JointPath):
        value, rate = begin.path.path.at(begin.at)
        rate = begin.speed * rate
    positions = np.tile(value, (len(times), 1))
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
    points = _points(msg)
    known = (task.frame_name, task.name)
    if len(msg.joint_names) > 1 or not set(msg.joint_names) <= set(known):
        accepts = f'none, or one of {listed(known)}'
        raise InvalidValue('joint_names', shown(list(msg.joint_names)), accepts)
    times = points.times
    check_times(times)
    poses = _poses(points)
    places = _checked('points.transforms.translation', poses[:, :3])
    turns = np.tile(np.eye(3), (len(times), 1, 1))
    if not isinstance(task, PositionTask):
        turns = _rotations(poses[:, 3:])
    rates, bends = (_twists(points, key) for key in ('velocities', 'accelerations'))
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
    turning = RotationPath(times, turns, w, dw, rate[3:])
    if isinstance(task, PositionTask):
        # It does not turn: one segment serves all.
        turning = RotationPath(times[[0, -1]], turns[[0, -1]])
    path = FramePath(VectorPath(times, places, v, dv, rate[:3]), turning)
    if alone and rates is not None:
        return Straight(path, rates[-1], begin.longest)
    return path


def _points(msg: Any) -> PointValues:
    """Numbers of the points of a message."""
    values: PointValues = trajectory_message(msg, type(msg)).values
    return values


def _poses(points: PointValues) -> Matrix:
    """Places and quaternions (m, 7) of the points."""
    count = points.sizes['transforms']
    if count == POSE and points.unlike:
        count = points.unlike[1]['transforms']
    if count != POSE:
        got = plural(count // POSE, 'value')
        raise InvalidValue('points.transforms', got, '1 for each point')
    return points.columns['transforms']


def _checked(key: str, values: Matrix) -> Matrix:
    wrong = ~(np.abs(values) <= LARGEST).all(axis=1)
    if wrong.any():
        i = int(np.flatnonzero(wrong)[0])
        got = f'{shown(values[i])} for point {i + 1}'
        raise InvalidValue(key, got, f'finite numbers up to {LARGEST:g} in size')
    return values


def _numbers(points: PointValues, key: str, size: int, words: str) -> Matrix | None:
    """Values (m, size) of all points, None if none has them."""
    first, other = points.sizes[key], points.unlike
    if not first and not (other and other[1][key]):
        return None
    wrong = None if first == size else (0, first)
    if wrong is None and other and other[1][key] != size:
        wrong = (other[0], other[1][key])
    if wrong is not None:
        i, count = wrong
        got = f'{plural(count, "value")} for point {i + 1}'
        raise InvalidValue(f'points.{key}', got, f'{words}, for all points or none')
    return _checked(f'points.{key}', points.columns[key])


def _twists(points: PointValues, key: str) -> Matrix | None:
    """Velocities or accelerations (m, 6) of all points, None if none has them."""
    return _numbers(points, key, 6, 'one twist for each point')


def _rotations(quaternions: Matrix) -> Matrix:
    """Rotations (m, 3, 3) of quaternions (m, 4) of any length."""
    largest = np.abs(quaternions).max(axis=1)
    wrong = np.flatnonzero(~((largest > 0.0) & (largest < math.inf)))
    if wrong.size:
        accepts = 'a quaternion that is finite and not zero'
        got = shown(quaternions[wrong[0]])
        raise InvalidValue('points.transforms.rotation', got, accepts)
    return rotations_from_quaternions(quaternions / largest[:, None])


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
