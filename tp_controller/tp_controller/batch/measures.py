"""What is reported of one run, from its trace."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tp_controller.batch.draws import Draws
from tp_controller.batch.loop import Trace, close_loop, fresh_stack
from tp_controller.config import Settings
from tp_controller.distances import least_distance
from tp_controller.robot import Robot
from tp_controller.stack import Stack
from tp_controller.tasks import JointLimitsTask, SetBasedTask

if TYPE_CHECKING:
    from tp_controller.batch.plan import Batch

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]
Row = dict[str, Any]

STILL = 1e-3
"""Share of a velocity limit below which a command has no sign."""


class Runner:
    """Makes runs of a batch under one scheme.

    Parameters
    ----------
    batch
        The batch.
    scheme
        One of its schemes.
    """

    def __init__(self, batch: Batch, scheme: str) -> None:
        self._batch, self._scheme = batch, scheme
        self._settings: Settings = batch.settings(scheme)
        self._draws = Draws(batch, self._settings)

    def run(self, run: int) -> Row:
        """Make run number ``run``; return its row, one value by column."""
        batch, robot = self._batch, self._settings.stack.robot
        draw = self._draws.draw(run)
        stack = fresh_stack(robot, self._settings.values)
        self._draws.apply(draw, stack)
        trace = close_loop(stack, draw.start, batch.steps, batch.errors)
        goals = [trace.errors[name] for name in batch.goals]
        reach = time_to_reach(np.max(goals, axis=0), batch.tolerance, batch.period)
        return {
            'seed': batch.seed,
            'run': run,
            'scheme': self._scheme,
            'gain': draw.gain,
            'start': draw.start.tolist(),
            'goal': np.concatenate(list(draw.goals.values())).tolist(),
            'reached': reach is not None,
            'time_to_reach': reach,
            **{f'error_{name}': float(trace.errors[name][-1]) for name in batch.errors},
            'clearance': clearance(stack, trace.q),
            **limit_use(trace, robot, batch.period),
            'braked': int(np.count_nonzero(trace.braked)),
            'refused': int(np.count_nonzero(trace.refused)),
            'reversals': most_reversals(trace.commands, robot.limits.velocity),
        }


def time_to_reach(errors: Vector, tolerance: float, period: float) -> float | None:
    """Time [s] from which on errors (m,) stay within a tolerance; None if they do not."""
    outside = np.flatnonzero(~(errors <= tolerance))
    first = 0 if not outside.size else int(outside[-1]) + 1
    return None if first == len(errors) else first * period


def clearance(stack: Stack, path: Matrix) -> float | None:
    """Least distance [m] from obstacles and between links on a path (m, n).

    Parameters
    ----------
    stack
        The stack that went along the path.
    path
        Configurations [rad, m].

    Returns
    -------
    float or None
        The distance; None if no task of the hierarchy keeps one. Distances of joints from the
        ends of their ranges do not count: ``range_use`` tells them.
    """
    tasks = [
        task
        for level in stack.members
        for task in level
        if isinstance(task, SetBasedTask) and not isinstance(task, JointLimitsTask)
    ]
    least = least_distance(stack.robot, tasks, path)
    return least if math.isfinite(least) else None


def limit_use(trace: Trace, robot: Robot, period: float) -> dict[str, float | None]:
    """Worst use of each kind of limit as a share of it; above 1 a limit is broken.

    Parameters
    ----------
    trace
        The run; before it the joints are at rest.
    robot
        The robot, with its limits.
    period
        Time [s] of one step.

    Returns
    -------
    dict
        ``velocity_use``: largest ``|qd_i| / limit``. ``range_use``: largest distance from the
        middle of a range over half the range, of joints with two ends. ``acceleration_use``:
        largest ``|qd_i(t) - qd_i(t - period)| / (limit period)``. None without such a limit.
    """
    limits = robot.limits
    change = np.diff(trace.commands, axis=0, prepend=0.0)
    half = 0.5 * (limits.position_max - limits.position_min)
    ends = np.isfinite(half)
    middle = limits.position_min[ends] + half[ends]
    return {
        'velocity_use': _largest(trace.commands, limits.velocity),
        'range_use': _largest(trace.q[:, robot.space.own[ends]] - middle, half[ends]),
        'acceleration_use': _largest(change, limits.acceleration * period),
    }


def _largest(values: Matrix, limit: Vector) -> float | None:
    limited = np.isfinite(limit)
    if not limited.any():
        return None
    return float(np.max(np.abs(values[:, limited]) / limit[limited]))


def most_reversals(commands: Matrix, limit: Vector) -> int:
    """Changes of sign of the joint velocity that changes its sign most often.

    Parameters
    ----------
    commands
        Joint velocities (m, n) [rad/s, m/s].
    limit
        Velocity limits (n,); speeds up to 1e-3 of them have no sign, or up to 1e-3 rad/s or m/s
        without a limit.
    """
    least = STILL * np.where(np.isfinite(limit), limit, 1.0)
    most = 0
    for course, still in zip(commands.T, least, strict=True):
        signs = np.sign(course[np.abs(course) > still])
        most = max(most, int(np.count_nonzero(signs[1:] != signs[:-1])))
    return most
