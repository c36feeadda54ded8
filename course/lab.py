"""What the notebooks share: an arm in closed loop, with the library or without it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

import planar

try:
    from tp_controller import Robot, build_settings

    # Loads Pinocchio and numba too, or finds out that they are missing.
    Robot.from_dh(a=[1.0])
    LIBRARY = True
except ImportError:
    LIBRARY = False

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]

ARM = (0.75, 0.5, 0.5)
"""Lengths [m] of the links in experiments A and B."""


def planar_arm(*lengths: float, velocity: float | None = None, **limits: float) -> dict[str, Any]:
    """Block ``robot`` of a planar arm with revolute joints.

    Parameters
    ----------
    lengths
        Lengths of the links [m].
    velocity
        Limit of every joint's speed [rad/s]; none when left out.
    limits
        Others of the library: ``acceleration`` [rad/s²], ``position_min``, ``position_max``.
    """
    zeros = [0.0] * len(lengths)
    block: dict[str, Any] = {
        'joints': [f'joint_{i + 1}' for i in range(len(lengths))],
        'dh': {'theta': zeros, 'd': zeros, 'a': list(lengths), 'alpha': zeros}
        | {'types': ['revolute'] * len(lengths)},
    }
    if velocity is not None:
        limits['velocity'] = velocity
    if limits:
        block['limits'] = {name: [value] for name, value in limits.items()}
    return block


def stack(parameters: Mapping[str, Any]) -> Any:
    """Stack of tasks that parameters describe, from the library where it is there.

    Parameters
    ----------
    parameters
        The nested parameters of a parameter file. The laws of the textbooks alone are taken,
        ``solver.settle: false``, if the file does not say otherwise.
    """
    solver = {'settle': False, **parameters.get('solver', {})}
    parameters = {**parameters, 'solver': solver}
    return build_settings(parameters).stack if LIBRARY else planar.Stack(parameters)


def which() -> str:
    """One line that says what computes the commands."""
    if LIBRARY:
        return 'Commands come from the library tp_controller.'
    return 'The library tp_controller is missing: commands come from planar.py, in plain numpy.'


class Run(NamedTuple):
    """A closed loop, step by step."""

    time: Vector
    """(N,) [s]."""
    q: Matrix
    """Positions (N, n) [rad, m]."""
    command: Matrix
    """Joint velocities (N, n) [rad/s, m/s]."""
    scale: Vector
    """What the limits cost (N,), 1 where none was reached."""
    error: Mapping[str, Vector]
    """Norm of every task's error (N,), by name."""
    distance: Mapping[str, Vector]
    """Least distance of every set-based task (N,), by name."""
    active: Mapping[str, NDArray[np.bool_]]
    """Whether every set-based task acts (N,), by name."""


def run(
    stack: Any,
    q: ArrayLike,
    seconds: float,
    rate: float,
    before: Callable[[float], None] | None = None,
) -> Run:
    """Move an ideal arm by the commands of a stack.

    Parameters
    ----------
    stack
        Answers configurations, see `stack`.
    q
        Positions (n,) at the start.
    seconds, rate
        How long [s], and steps per second [Hz].
    before
        Called with the time [s] before every step, to move targets.
    """
    q = np.array(q, dtype=float)
    tasks = list(stack.tasks.values())
    steps = round(seconds * rate) + 1
    positions, commands = np.zeros((2, steps, q.size))
    scale = np.ones(steps)
    error = {task.name: np.zeros(steps) for task in tasks if not task.set_based}
    distance = {task.name: np.zeros(steps) for task in tasks if task.set_based}
    active = {name: np.zeros(steps, dtype=bool) for name in distance}
    for i in range(steps):
        if before is not None:
            before(i / rate)
        answer = stack.step(q)
        positions[i], commands[i], scale[i] = q, answer.command, answer.scale
        for task in tasks:
            if task.set_based:
                distance[task.name][i] = min(task.distance)
                active[task.name][i] = task.active
            else:
                error[task.name][i] = np.sqrt(task.error @ task.error)
        q += answer.command / rate
    time = np.arange(steps) / rate
    return Run(time, positions, commands, scale, error, distance, active)


def points(lengths: Sequence[float], q: ArrayLike) -> Matrix:
    """Base, joints and tip (n + 1, 2) [m] of a planar arm; (N, n + 1, 2) for q (N, n)."""
    angles = np.cumsum(q, axis=-1)
    ways = np.stack([np.cos(angles), np.sin(angles)], axis=-1) * np.reshape(lengths, (-1, 1))
    ends = np.cumsum(ways, axis=-2)
    return np.concatenate([np.zeros_like(ends[..., :1, :]), ends], axis=-2)


def tip(lengths: Sequence[float], q: ArrayLike) -> Matrix:
    """Tip (2,) [m] of a planar arm; (N, 2) for q (N, n)."""
    return points(lengths, q)[..., -1, :]


def jacobian(lengths: Sequence[float], q: ArrayLike) -> Matrix:
    """Jacobian (3, n) of x, y [m] and angle [rad] of the last link of a planar arm."""
    places = points(lengths, q)
    ways = places[-1] - places[:-1]
    return np.array([-ways[:, 1], ways[:, 0], np.ones(len(ways))])


def round_path(centre: ArrayLike, radius: float, period: float) -> Callable[[float], Any]:
    """Circle as a function of time: position (2,) [m] and velocity (2,) [m/s]."""

    def at(time: float) -> tuple[Vector, Vector]:
        angle = 2.0 * np.pi * time / period
        arm = radius * np.array([np.cos(angle), np.sin(angle)])
        return np.asarray(centre) + arm, np.array([-arm[1], arm[0]]) * 2.0 * np.pi / period

    return at


def table(head: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
    """Print rows under a head; numbers with four significant digits."""

    def text(value: object) -> str:
        if isinstance(value, str):
            return value
        return f'{value:.0e}' if 0.0 < abs(value) < 1e-4 else f'{value:.4g}'  # type: ignore

    lines = [list(head), *([text(value) for value in row] for row in rows)]
    widths = [max(len(line[i]) for line in lines) for i in range(len(head))]
    for number, line in enumerate(lines):
        first = line[0].ljust(widths[0])
        rest = (value.rjust(width) for value, width in zip(line[1:], widths[1:], strict=True))
        print('  '.join([first, *rest]).rstrip())
        if number == 0:
            print('  '.join('-' * width for width in widths))


COMPARED: list[tuple[str, float, str, bool]] = []
"""All figures that notebooks have compared with expected ones, and whether they are the same."""


def compare(rows: Iterable[tuple[str, float, str]]) -> None:
    """Print figures beside expected ones, and whether they are the same to the last digit.

    Parameters
    ----------
    rows
        What the figure is, its value, and the expected one as it is printed: ``0.135717``; with
        ``~0.381`` one unit of the last digit more or less is the same; or ``< 1e-4``.
    """
    shown = []
    for what, value, expected in rows:
        number = float(expected.lstrip('<~ '))
        decimals = len(expected.partition('.')[2])
        text = f'{value:.{decimals}f}'
        if expected.startswith('<'):
            text, fits = f'{value:.0e}', value < number
        else:
            unit = 1.01 if expected.startswith('~') else 0.5
            fits = abs(value - number) <= unit * 10.0**-decimals
        COMPARED.append((what, float(value), expected, fits))
        shown.append((what, text, expected, 'same' if fits else 'differs'))
    table(['', 'here', 'expected', ''], shown)
