"""Checks of a controller's parameters before anything moves; no ROS is needed."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from tp_controller.checks import levels, places, settings
from tp_controller.checks.findings import ERROR, NOTE, SEVERITIES, WARNING, Finding
from tp_controller.checks.mistakes import Reading, read
from tp_controller.checks.samples import Samples
from tp_controller.config import Settings

__all__ = [
    'ERROR',
    'NOTE',
    'SEVERITIES',
    'WARNING',
    'Finding',
    'Reading',
    'Samples',
    'check_parameters',
    'check_settings',
    'levels',
    'places',
    'read',
    'settings',
]


def check_parameters(
    parameters: Mapping[str, Any],
    description: str | None = None,
    start: ArrayLike | None = None,
) -> list[Finding]:
    """Find errors of parameters or, if there are none, what will hardly work as meant.

    Parameters
    ----------
    parameters
        The dictionary under ``ros__parameters``, nested or with dotted keys.
    description
        URDF of the robot for parameters that name none.
    start
        First configuration (nq,) [rad, m], for which overlaps are looked for.

    Returns
    -------
    list
        The findings, errors first.
    """
    reading = read(parameters, description)
    if reading.settings is None:
        return [Finding.of(error) for error in reading.errors]
    found = list(check_settings(reading.settings, start))
    return sorted(found, key=lambda finding: SEVERITIES.index(finding.severity))


def check_settings(given: Settings, start: ArrayLike | None = None) -> Iterator[Finding]:
    """Find what will hardly work as meant, in no order; see `check_parameters`.

    Every check is a function of its own in `levels`, `settings` and `places`.
    """
    stack = given.stack
    samples = Samples(stack)
    yield from settings.hierarchy(stack)
    yield from settings.rate(stack)
    yield from settings.timeouts(given)
    yield from settings.limits(stack)
    yield from settings.told_by_tasks(stack)
    yield from settings.gain_and_acceleration(stack)
    yield from settings.gain_and_delay(stack)
    yield from levels.guard_order(samples)
    yield from levels.idle_guards(samples)
    yield from levels.same_axes(samples)
    yield from levels.dead_rows(samples)
    yield from levels.rank_of_levels(samples)
    yield from places.always_touching(samples)
    if start is not None:
        yield from places.start(stack, np.array(start, dtype=float))
    yield from places.targets(samples)
