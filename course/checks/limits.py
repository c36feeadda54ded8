"""Checks of notebook 6: saturation, joints at their limits, braking."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from checks.judge import exercise, same


@exercise('6.1')
def largest_share(answer: Callable[..., Any]) -> None:
    """Largest share of a way inside bounds."""
    low, high = np.array([-1.0, -1.0, -0.5]), np.array([1.0, 2.0, 0.5])
    cases = [
        ([0.0, 0.0, 0.0], [2.0, 1.0, 0.1], 0.5),
        ([0.0, 0.0, 0.0], [0.5, 0.5, 0.1], 1.0),
        ([0.5, 0.0, 0.2], [-3.0, 1.0, 0.1], 0.5),
        ([0.5, 1.0, 0.2], [0.5, 0.0, -1.4], 0.5),
        ([0.0, 0.0, 0.5], [0.2, 0.2, 0.1], 0.0),
    ]
    for start, way, expected in cases:
        at, to = np.array(start), np.array(way)
        with np.errstate(divide='ignore', invalid='ignore'):
            ahead = np.where(to > 0.0, (high - at) / to, np.inf)
            unbounded = np.where(to != 0.0, np.where(to > 0.0, high - at, low - at) / to, np.inf)
        mistakes = [
            (float(min(1.0, ahead.min())), 'a joint that goes backwards meets its lower bound.'),
            (float(unbounded.min()), 's is at most 1.'),
        ]
        same(answer(at, to, low, high), expected, f'the share for the way {way}', mistakes)


@exercise('6.2')
def answer_with_the_rest(answer: Callable[..., Any]) -> None:
    """Joint velocity with one joint held."""
    rng = np.random.default_rng(9)
    for held, value in ((0, 0.4), (2, -0.3)):
        J, v = rng.normal(size=(2, 4)), rng.normal(size=2)
        others = [i for i in range(4) if i != held]

        def with_rest(
            rest: Any, J: Any = J, others: Any = others, held: int = held, value: float = value
        ) -> Any:
            qd = np.full(4, value)
            qd[others] = np.linalg.pinv(J[:, others]) @ rest
            assert qd[held] == value
            return qd

        unchanged = np.linalg.pinv(J) @ v
        unchanged[held] = value
        mistakes = [
            (with_rest(v), 'the held joint moves the task, too: subtract its part from v.'),
            (unchanged, 'the others have to answer anew, without the column of the held joint.'),
        ]
        expected = with_rest(v - J[:, held] * value)
        same(answer(J, v, held, value), expected, 'the joint velocity', mistakes)


@exercise('6.3')
def braking_distance(answer: Callable[..., Any]) -> None:
    """Braking distance in discrete time."""
    for v, a, T in ((1.0, 3.0, 0.02), (0.05, 5.0, 0.02), (2.0, 4.0, 0.01)):
        k = math.ceil(v / (a * T) - 1e-9)
        D = T * (k * v - 0.5 * k * (k - 1) * a * T)
        mistakes = [
            (
                v * v / (2.0 * a),
                'this is continuous time; here speeds change in steps.',
            ),
            (D - T * v, 'the step with the speed v itself is missing.'),
            (T * (k * v - 0.5 * k * (k + 1) * a * T), 'the first step still has the speed v.'),
        ]
        same(answer(v, a, T), D, f'the distance from {v} rad/s', mistakes, tolerance=1e-6)
