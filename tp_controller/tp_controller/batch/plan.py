"""What a batch is: which loops are run, checked before the first one."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from tp_controller.batch.draws import Draws
from tp_controller.config import Settings, build_settings
from tp_controller.errors import NO_VALUE, InvalidValue, listed, plural, shown
from tp_controller.parameters import Flat, flatten
from tp_controller.solvers import SOLVER_TYPES
from tp_controller.stack import Stack

SECONDS, TOLERANCE = 10.0, 0.01
"""Default length of a run [s] and error norm [m, rad] of a goal that is reached."""
MOST_STEPS = 10_000_000
"""Longest run [steps]; its trace is held in memory."""


@dataclass(frozen=True)
class Batch:
    """A checked batch; made by `plan_batch`.

    Attributes
    ----------
    values
        Parameters of the controller by dotted key.
    schemes
        Values of ``solver.type``; every run is made under each.
    runs
        Number of draws of start, goals and gain.
    seed
        Seed of the draws.
    steps
        Steps of one run.
    period
        Time [s] of one step.
    goals
        Tasks that get random goals.
    errors
        Tasks whose final errors are reported: all with an error, in the order of the hierarchy.
    gain
        Least and largest factor on the gains of the tasks in ``goals``.
    tolerance
        Error norm [m, rad] up to which a goal is reached.
    start
        First configuration (nq,) [rad, m] of every run; None for random ones.
    """

    values: Flat
    schemes: tuple[str, ...]
    runs: int
    seed: int
    steps: int
    period: float
    goals: tuple[str, ...]
    errors: tuple[str, ...]
    gain: tuple[float, float]
    tolerance: float
    start: tuple[float, ...] | None

    def settings(self, scheme: str) -> Settings:
        """Build the controller for a scheme."""
        return build_settings(self.values | {'solver.type': scheme})

    @property
    def cycles(self) -> int:
        """Steps of all runs under all schemes."""
        return self.runs * len(self.schemes) * self.steps


def plan_batch(
    parameters: Mapping[str, Any],
    schemes: Sequence[str] | None = None,
    runs: int = 100,
    seed: int = 0,
    seconds: float = SECONDS,
    goals: Sequence[str] | None = None,
    gain: tuple[float, float] = (1.0, 1.0),
    tolerance: float = TOLERANCE,
    start: Sequence[float] | None = None,
) -> Batch:
    """Check a batch before anything is run.

    Parameters
    ----------
    parameters
        Parameters of the controller, nested or with dotted keys.
    schemes
        Values of ``solver.type``; that of the parameters when left out.
    runs
        Number of draws, at least 1.
    seed
        Seed of the draws, at least 0.
    seconds
        Length of each run [s], at least one step.
    goals
        Tasks of the hierarchy that get random goals. When left out: those that control a frame,
        or all with a target if there is none.
    gain
        Least and largest factor on the gains of these tasks; drawn uniformly.
    tolerance
        Error norm [m, rad] up to which a goal is reached, above 0.
    start
        First configuration (nq,) [rad, m] of every run; random inside the ranges when left out.

    Raises
    ------
    InvalidValue
        If the controller cannot be built for a scheme, has no rate, or describes an arm that is
        not ideal; for any other argument that cannot be used.
    """
    values = flatten(parameters)
    _check_whole('runs', runs, 1)
    _check_whole('seed', seed, 0)
    _check_above('seconds', seconds)
    _check_above('tolerance', tolerance)
    names = _schemes(schemes)
    settings = build_settings(values | ({'solver.type': names[0]} if names else {}))
    names = names or (settings.values['solver.type'],)
    stack = settings.stack
    period = stack.safety_filter.period
    if not math.isfinite(period):
        raise InvalidValue('rate', NO_VALUE, 'a number above 0')
    if not stack.robot.response.ideal:
        raise InvalidValue(
            'robot.delay, lag, noise or hold',
            'an arm that is not ideal',
            'none of them: the joints of a batch carry out every command exactly',
        )
    steps = round(seconds / period) + 1
    if not 1 < steps <= MOST_STEPS:
        accepts = f'times from {period:g}, one step, to {MOST_STEPS * period:g}'
        raise InvalidValue('seconds', shown(seconds), accepts)
    batch = Batch(
        values,
        names,
        runs,
        seed,
        steps,
        period,
        _goals(stack, goals),
        tuple(task.name for level in stack.members for task in level if not task.set_based),
        _gain(gain),
        tolerance,
        None if start is None else _start(stack, start),
    )
    for name in names:
        _try_out(batch, name)
    return batch


def _check_whole(key: str, value: Any, least: int) -> None:
    if isinstance(value, bool) or not isinstance(value, int) or value < least:
        raise InvalidValue(key, shown(value), f'a whole number of at least {least}')


def _check_above(key: str, value: Any) -> None:
    if not isinstance(value, int | float) or not 0.0 < value < math.inf:
        raise InvalidValue(key, shown(value), 'a finite number above 0')


def _schemes(schemes: Sequence[str] | None) -> tuple[str, ...]:
    for i, name in enumerate(schemes or ()):
        if name not in SOLVER_TYPES:
            raise InvalidValue('schemes', shown(name), f'some of {listed(SOLVER_TYPES)}')
        if name in (schemes or ())[:i]:
            raise InvalidValue('schemes', f'{shown(name)} twice', 'every scheme once')
    return tuple(schemes or ())


def _goals(stack: Stack, goals: Sequence[str] | None) -> tuple[str, ...]:
    able = [
        task
        for level in stack.members
        for task in level
        if not task.set_based and task.target_size
    ]
    names = [task.name for task in able]
    if not names:
        raise InvalidValue('hierarchy', 'no task with a target', 'one that gets random goals')
    if goals is None:
        return tuple(task.name for task in able if task.frame_name) or tuple(names)
    for name in goals:
        if name not in names:
            raise InvalidValue('goals', shown(name), f'some of {listed(names)}')
    return tuple(name for name in names if name in goals)


def _gain(gain: tuple[float, float]) -> tuple[float, float]:
    low, high = gain
    if not 0.0 < low <= high < math.inf:
        raise InvalidValue('gain', shown(list(gain)), 'two numbers above 0, the lesser one first')
    return float(low), float(high)


def _start(stack: Stack, start: Sequence[float]) -> tuple[float, ...]:
    robot = stack.robot
    q = np.array(start, dtype=float)
    if q.shape != (robot.nq,):
        whose = 'one per joint of robot.joints'
        if robot.space.blocks:
            whose = f'those of {listed(robot.coordinates)}'
        raise InvalidValue('start', plural(q.size, 'value'), f'{robot.nq} values, {whose}')
    low, high, positions = (
        robot.limits.position_min,
        robot.limits.position_max,
        robot.space.positions(q),
    )
    if not (np.isfinite(q).all() and np.all((low <= positions) & (positions <= high))):
        raise InvalidValue('start', shown(q), 'finite numbers inside robot.limits.position_…')
    return tuple(float(value) for value in q)


def _try_out(batch: Batch, scheme: str) -> None:
    """Build the controller for a scheme, draw the first run and set its largest gains."""
    try:
        settings = batch.settings(scheme)
    except InvalidValue as error:
        raise error.within(f'with solver.type {scheme}') from None
    draws = Draws(batch, settings)
    draw = draws.draw(0)
    try:
        draws.apply(draw._replace(gain=batch.gain[1]), settings.stack)
    except InvalidValue as error:
        raise InvalidValue('gain', f'{error.got} as {error.key}', error.accepts) from None
