"""One closed loop: a stack and joints that carry out every command exactly."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tp_controller.config import build_stack
from tp_controller.errors import UnusableState
from tp_controller.parameters import Flat
from tp_controller.robot import Robot
from tp_controller.stack import Stack

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]


class Trace(NamedTuple):
    """What a closed loop of m steps did, step by step."""

    q: Matrix
    """Configuration (m, nq) [rad, m] that each step answered."""
    commands: Matrix
    """Command (m, n) [rad/s, m/s] of each step."""
    errors: dict[str, Vector]
    """Error norm (m,) [m, rad] by task, at the configurations ``q``."""
    braked: NDArray[np.bool_]
    """Steps (m,) in which the safety filter braked to keep a distance."""
    refused: NDArray[np.bool_]
    """Steps (m,) in which the stack found no command and braked, see `UnusableState`."""


def fresh_stack(robot: Robot, values: Flat) -> Stack:
    """Build a stack that has not made a step yet.

    A stack remembers its last steps. Every run needs a new one, so that its result does not
    depend on the runs before it; the robot, which takes longest to build, is used again.

    Parameters
    ----------
    robot
        The robot of the values.
    values
        Checked values by dotted key, as in `Settings.values`.
    """
    return build_stack(robot, values)


def answer(stack: Stack, q: Vector, period: float) -> tuple[Vector, bool, bool]:
    """Ask a stack for the command that answers a configuration.

    This is the only call of a batch to the controller.

    Parameters
    ----------
    stack
        The stack.
    q
        Configuration (nq,) [rad, m].
    period
        Time [s] since the last call.

    Returns
    -------
    Vector
        Joint velocity (n,) [rad/s, m/s]; the next call overwrites it.
    bool
        Whether the safety filter braked.
    bool
        Whether the stack refused the configuration. The command is then to brake.
    """
    try:
        command = stack.step(q, period).command
    except UnusableState as error:
        command = np.zeros(stack.robot.n) if error.command is None else error.command
        return command, True, True
    return command, bool(stack.safety_filter.stopped_by), False


def close_loop(stack: Stack, start: Vector, steps: int, tasks: Sequence[str]) -> Trace:
    """Let a stack move joints that carry out every command exactly.

    Step i answers the configuration ``q_i`` with the command ``qd_i``; then
    ``q_(i+1) = integrate(q_i, period qd_i)``.

    Parameters
    ----------
    stack
        The stack, before its first step.
    start
        First configuration (nq,) [rad, m]; the joints are at rest.
    steps
        Number m of steps.
    tasks
        Names of the tasks whose errors are recorded.

    Returns
    -------
    Trace
        Configurations, commands and errors of all steps.
    """
    period, n = stack.safety_filter.period, stack.robot.n
    robot = stack.robot
    q, commands = np.empty((steps + 1, robot.nq)), np.empty((steps, n))
    braked, refused = np.zeros((2, steps), dtype=bool)
    errors = [np.empty((steps, stack.tasks[name].k)) for name in tasks]
    watched = [(stack.tasks[name], rows) for name, rows in zip(tasks, errors, strict=True)]
    q[0] = start
    way = np.empty(n)
    for i in range(steps):
        here, command = q[i], commands[i]
        command[:], brakes, refuses = answer(stack, here, period)
        if brakes:
            braked[i], refused[i] = True, refuses
        for task, rows in watched:
            rows[i] = task.error
        np.multiply(period, command, out=way)
        q[i + 1] = robot.integrate(here, way)
    norms = {
        name: np.sqrt(np.sum(rows * rows, axis=1))
        for name, rows in zip(tasks, errors, strict=True)
    }
    return Trace(q[:-1], commands, norms, braked, refused)
