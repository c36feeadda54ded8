"""Transitions from one problem to another."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tp_controller.errors import InvalidValue, shown
from tp_controller.problem import Problem
from tp_controller.solution import Solution, solve

Vector = NDArray[np.float64]


class Blend(NamedTuple):
    """A velocity between the answers to two problems; its arrays are the caller's own."""

    velocity: Vector
    """Joint velocity (n,) [rad/s, m/s]."""
    first: Solution
    """Answer to the first problem."""
    second: Solution
    """Answer to the second one."""


def blend(
    first: Problem, second: Problem, share: float, scheme: str = 'recursive', **settings: Any
) -> Blend:
    """Go a share of the way from the answer to one problem to that of another.

    With the answers ``qd_1`` and ``qd_2``::

        qd = (1 - share) qd_1 + share qd_2

    A joint bound or an inequality row that both problems have, and both answers keep, is kept by
    every velocity in between: the velocities that keep it are a convex set. Where the two differ
    in the value of a bound, the blend keeps the value that is the same share between both. An
    equality row of both problems that both answers meet is met, too. To change from one hierarchy
    to another without a step in the command, let the share grow from 0 to 1 within the time of
    the transition, and pass the velocity through the safety filter.

    Parameters
    ----------
    first, second
        Two problems of one robot, at one state.
    share
        From 0, which gives the first answer exactly, to 1, which gives the second.
    scheme, settings
        As `solve`, for both problems.

    Raises
    ------
    InvalidValue
        For a share outside 0 to 1, problems of different joints, or as `solve`.
    """
    if not 0.0 <= share <= 1.0:
        raise InvalidValue('share', shown(share), 'a number from 0 to 1')
    names = [tuple(problem.joints) for problem in (first, second)]
    if all(names) and names[0] != names[1]:
        raise InvalidValue(
            'second', f'joints {shown(names[1])}', f'those of first, {shown(names[0])}'
        )
    answers = [solve(problem, scheme=scheme, **settings) for problem in (first, second)]
    one, other = (answer.velocity for answer in answers)
    if one.shape != other.shape:
        raise InvalidValue('second', f'{other.size} joints', f'{one.size}, as first')
    # Of this form the ends are exact, and so are components that are equal in both.
    velocity = (
        one + share * (other - one) if share < 0.5 else other - (1.0 - share) * (other - one)
    )
    low, high = np.minimum(one, other), np.maximum(one, other)
    return Blend(np.clip(velocity, low, high), *answers)
