"""Frames and joints of a robot as tables for people."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from rich import box
from rich.table import Table

from tp_controller.robot import Robot, moved

Vector = NDArray[np.float64]

NONE = '–'


def frames(robot: Robot, q: Vector) -> Table:
    """Names of the frames that tasks can control, with what moves them and where they are.

    Parameters
    ----------
    robot
        The robot, which stays as it is.
    q
        Configuration (nq,) [rad, m] for the positions.
    """
    table = _table(f'Frames, from {robot.base_frame}', 'frame', 'moved by')
    for axis in 'xyz':
        table.add_column(f'{axis} (m)', justify='right', no_wrap=True)
    with moved(robot, q):
        for name in robot.frames:
            frame = robot.frame(name)
            moves = np.flatnonzero(np.abs(frame.jacobian).max(axis=0) > 0.0)
            last = robot.joints[moves[-1]] if moves.size else NONE
            table.add_row(name, last, *(f'{value:.3f}' for value in frame.position))
    return table


def joints(robot: Robot, q: Vector) -> Table:
    """Names of the velocities in the order of commands, with their ranges and limits.

    Parameters
    ----------
    robot
        The robot.
    q
        Configuration (nq,) [rad, m] whose positions are told.
    """
    table = _table('Joints', 'joint', 'kind')
    for title in ('position', 'from', 'to', 'velocity', 'acceleration'):
        table.add_column(title, justify='right', no_wrap=True)
    limits, positions = robot.limits, robot.space.positions(q)
    for i, name in enumerate(robot.joints):
        ranged = bool(robot.space.ranged[i])
        table.add_row(
            name,
            _kind(robot, i),
            f'{positions[i]:.3f}' if ranged else NONE,
            *(_number(getattr(limits, key)[i]) for key in ('position_min', 'position_max')),
            *(_number(getattr(limits, key)[i]) for key in ('velocity', 'acceleration')),
        )
    return table


def _table(title: str, *columns: str) -> Table:
    table = Table(title=title, title_justify='left', box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
    for column in columns:
        table.add_column(column, overflow='fold')
    return table


def _kind(robot: Robot, i: int) -> str:
    if not robot.space.ranged[i]:
        return 'of the base'
    if robot.sliding[i]:
        return 'slides (m)'
    own = int(robot.space.own[i])
    return 'turns without end (rad)' if robot.wrapping[own] else 'turns (rad)'


def _number(value: float) -> str:
    return f'{value:.3f}' if math.isfinite(value) else NONE
