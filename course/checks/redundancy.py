"""Checks of notebook 2: two tasks at once and one below the other, the extended Jacobian."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

import laws
from checks.judge import Wrong, exercise, same, values

Array = NDArray[np.float64]


def _pairs() -> Iterator[tuple[Array, Array, Array, Array]]:
    """Two tasks of random numbers; the second of the last pair is part of the first."""
    rng = np.random.default_rng(2)
    for rows in (1, 2):
        J1, v1 = rng.normal(size=(2, 4)), rng.normal(size=2)
        yield J1, v1, rng.normal(size=(rows, 4)), rng.normal(size=rows)
    J = rng.normal(size=(2, 4))
    yield J, rng.normal(size=2), J[:1] - J[1:], rng.normal(size=1)


@exercise('2.1')
def augmented_step(answer: Callable[..., Any]) -> None:
    """Joint velocity of both tasks at once."""
    for J1, v1, J2, v2 in _pairs():
        expected = laws.stacked([(J1, v1), (J2, v2)], 0.1)
        apart = laws.inverse(J1, 0.1) @ v1 + laws.inverse(J2, 0.1) @ v2
        mistakes = [
            (laws.recursion([(J1, v1), (J2, v2)], 0.1), 'this is task priority, exercise 2.2.'),
            (apart, 'the sum of two inverses: each task disturbs the other; stack them first.'),
            (laws.stacked([(J1, v1), (J2, v2)]), 'there is no damping: λ² is missing.'),
        ]
        same(answer(J1, v1, J2, v2, 0.1), expected, 'the joint velocity', mistakes)


@exercise('2.2')
def priority_step(answer: Callable[..., Any]) -> None:
    """Joint velocity of two tasks in strict order."""
    for J1, v1, J2, v2 in _pairs():
        first = laws.inverse(J1, 0.1) @ v1
        P = np.eye(4) - laws.inverse(J1) @ J1
        leaky = np.eye(4) - laws.inverse(J1, 0.1) @ J1
        mistakes = [
            (
                first + laws.inverse(J2 @ P, 0.1) @ v2,
                'task 1 moves task 2 already: subtract J₂ q̇₁ from v₂.',
            ),
            (
                first + laws.inverse(J2 @ leaky, 0.1) @ (v2 - J2 @ first),
                'the projector has damping in it: task 2 leaks into task 1. Use the '
                'pseudo-inverse there.',
            ),
            (
                first + P @ laws.inverse(J2, 0.1) @ (v2 - J2 @ first),
                'this inverts J₂ and projects afterwards; invert J₂ P.',
            ),
            (
                first + P @ laws.inverse(J2, 0.1) @ v2,
                'this inverts J₂ and projects afterwards; invert J₂ P.',
            ),
            (laws.stacked([(J1, v1), (J2, v2)], 0.1), 'this is the augmented step, exercise 2.1.'),
        ]
        expected = laws.recursion([(J1, v1), (J2, v2)], 0.1)
        same(answer(J1, v1, J2, v2, 0.1), expected, 'the joint velocity', mistakes)


@exercise('2.3')
def null_vector(answer: Callable[..., Any]) -> None:
    """Null-space vector of length 1."""
    rng = np.random.default_rng(5)
    for _ in range(3):
        J = rng.normal(size=(2, 3))
        z = values(answer(J))
        if z.shape != (3,):
            raise Wrong(f'the vector has the shape {z.shape}; it should be (3,).')
        if np.abs(J @ z).max() > 1e-9:
            raise Wrong(f'J z is {J @ z}; it should be zero.')
        if abs(np.linalg.norm(z) - 1.0) > 1e-9:
            raise Wrong(f'its length is {np.linalg.norm(z):.4f}; it should be 1.')


@exercise('2.4')
def condition(answer: Callable[..., Any]) -> None:
    """Condition for an optimum in the null space, up to its sign."""
    rng = np.random.default_rng(6)
    for _ in range(3):
        J, q, q0 = rng.normal(size=(2, 3)), rng.normal(size=3), rng.normal(size=3)
        z = np.linalg.svd(J)[2][2]
        g = values(answer(J, q, q0))
        if np.size(g) == 3:
            raise Wrong('g is one number: the gradient times the null-space vector.')
        hint = 'the gradient of H is q₀ - q.'
        mistakes = [(abs(float(z @ q)), hint), (abs(float(z @ q0)), hint)]
        same(np.abs(g).reshape(()), abs(float(z @ (q0 - q))), 'the size of g', mistakes)
