"""Checks of notebook 1: kinematics, Jacobian, inverses."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

import lab
import laws
from checks.judge import Wrong, exercise, same

ARMS = [
    ((0.75, 0.5, 0.5), (0.0, 0.6, 0.3)),
    ((1.0, 0.7), (0.4, -1.1)),
    ((0.5, 0.4, 0.3, 0.2), (2.0, 0.3, -0.7, 1.4)),
]


@exercise('1.1')
def tip(answer: Callable[..., Any]) -> None:
    """Position (2,) of the tip of any planar arm."""
    for lengths, angles in ARMS:
        a, q = np.array(lengths), np.array(angles)
        single = [a @ np.cos(q), a @ np.sin(q)]
        hint = 'every link has the angle of its own joint only; add the angles of all before it.'
        swapped = lab.tip(a, q)[::-1]
        mistakes = [(single, hint), (swapped, 'x and y are exchanged.')]
        same(answer(a, q), lab.tip(a, q), f'the tip at q = {q}', mistakes)


@exercise('1.2')
def jacobian(answer: Callable[..., Any]) -> None:
    """Jacobian (2, n) of the tip of any planar arm."""
    for lengths, angles in ARMS:
        a, q = np.array(lengths), np.array(angles)
        J = lab.jacobian(a, q)[:2]
        ways = np.diff(lab.points(a, q), axis=0)
        own = np.array([-ways[:, 1], ways[:, 0]])
        from_base = np.array([-1.0, 1.0])[:, None] * lab.tip(a, q)[::-1, None]
        mistakes = [
            (-J, 'the sign is wrong in all columns: joints turn counter-clockwise.'),
            (own, 'each joint moves all links after it, not its own link alone.'),
            (
                np.broadcast_to(from_base, J.shape),
                'the vector begins at joint i, not at the base.',
            ),
            (J[::-1], 'the rows are exchanged: first x, then y.'),
        ]
        same(answer(a, q), J, f'the Jacobian at q = {q}', mistakes)


@exercise('1.3')
def damped_inverse(answer: Callable[..., Any]) -> None:
    """Damped least-squares inverse (n, m)."""
    rng = np.random.default_rng(3)
    for shape, damping in (((2, 3), 0.1), ((3, 2), 0.3), ((2, 2), 0.7)):
        J = rng.normal(size=shape)
        square = J @ J.T
        mistakes = [
            (J.T @ np.linalg.inv(square + damping * np.eye(shape[0])), 'λ has to be squared.'),
            (laws.inverse(J), 'this is the pseudo-inverse: λ² is not added.'),
        ]
        same(answer(J, damping), laws.inverse(J, damping), f'the inverse of a {shape} J', mistakes)
    singular = np.array([[1.0, 1.0], [1.0, 1.0]])
    same(answer(singular, 0.1), laws.inverse(singular, 0.1), 'the inverse of a singular J')


@exercise('1.4')
def least_damping(answer: float) -> None:
    """Least damping that keeps the joint speed below a bound."""
    mistakes = [
        (0.5 / 2.0, 'the largest factor of damped least squares is 1/(2λ), not 1/λ.'),
        (2.0 / (2.0 * 0.5), 'factor times 0.5 m/s has to be 2 rad/s, not 0.5 rad/s.'),
    ]
    same(answer, 0.125, 'the damping', mistakes, tolerance=1e-3)


@exercise('1.5')
def seconds_to_a_tenth(answer: float) -> None:
    """Time until an error is a tenth."""
    if np.ndim(answer) == 0 and float(answer) <= 0.0:
        raise Wrong('a time is above zero.')
    mistakes = [
        (2.0, '1/η is the time in which the error falls to 1/e = 0.37, not to a tenth.'),
        (0.5 * math.log(10.0), 'the exponent is η t: divide by η.'),
    ]
    same(answer, math.log(10.0) / 0.5, 'the time [s]', mistakes, tolerance=5e-3)
