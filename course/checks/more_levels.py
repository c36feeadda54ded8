"""Checks of notebook 4: recursion over levels, freedom, adaptive damping."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

import laws
from checks.judge import Wrong, exercise, same, values


@exercise('4.1')
def recursion(answer: Callable[..., Any]) -> None:
    """Joint velocity of three levels, and what a level does to those above it."""
    rng = np.random.default_rng(8)
    levels = [(rng.normal(size=(k, 6)), rng.normal(size=k)) for k in (2, 1, 2)]
    for damping in (0.1, 0.5):
        got = values(answer(levels, damping))
        if got.shape != (6,):
            raise Wrong(f'the joint velocity has the shape {got.shape}; it should be (6,).')
        upper = values(answer(levels[:1], damping))
        change = np.abs(levels[0][0] @ (got - upper)).max()
        if change > 1e-8:
            raise Wrong(
                f'the lower levels change the velocity of level 1 by {change:.2g}: the projector '
                'leaks. It needs the pseudo-inverse, without damping.'
            )
        hint = 'the bracket needs J times the whole q̇ so far, not times the last increment.'
        expected = laws.recursion(levels, damping)
        same(got, expected, 'the joint velocity', [(_increments(levels, damping), hint)])
    # A level that asks for directions which are taken already.
    levels.insert(2, (levels[0][0][:1] + levels[1][0], np.ones(1)))
    if not np.allclose(answer(levels, 0.1), laws.recursion(levels, 0.1)):
        raise Wrong(
            'a level that asks for directions which are taken already is part of the levels now. '
            'Its rows are zero up to rounding; the pseudo-inverse needs a larger rank tolerance.'
        )


def _increments(levels: laws.Levels, damping: float) -> Any:
    """The recursion that gives the last increment alone to the next level."""
    qd, P, last = np.zeros(6), np.eye(6), np.zeros(6)
    for J, v in levels:
        last = laws.inverse(J @ P, damping) @ (v - J @ last)
        qd, P = qd + last, P - laws.inverse(J @ P) @ J @ P
    return qd


@exercise('4.2')
def freedom_left(answer: Any) -> None:
    """Freedom after each of three levels."""
    mistakes = [
        (
            [3, 1, 0],
            'with the tip in place, link 4 can only go round it on a circle: its two rows take '
            'one direction.',
        ),
        ([3, 2, 1], 'tip and end of link 4 fix the angle of link 5: its row takes nothing.'),
        ([3, 1, 1], 'with the tip in place, the end of link 4 has one direction left, not two.'),
        ([2, 3, 3], 'these are the directions that are taken; five joints less these are left.'),
    ]
    same(answer, [3, 2, 2], 'the freedom left', mistakes)


@exercise('4.3')
def adaptive_factor(answer: Callable[..., Any]) -> None:
    """Factors of adaptive damping."""
    s = np.array([0.01, 0.05, 0.15, 0.2, 0.3, 2.0])
    for damping, region in ((0.1, 0.2), (0.2, 0.1)):
        near = 1.0 - (s / region) ** 2
        mistakes = [
            (s / (s**2 + damping**2), 'this is constant damping.'),
            (
                s / (s**2 + damping**2 * near),
                'from ε on the factor is 1/s: 1 - (s/ε)² must not become negative.',
            ),
            (
                s / (s**2 + damping**2 * np.maximum(0.0, 1.0 - s / region)),
                's/ε has to be squared.',
            ),
        ]
        expected = laws.damped(s, damping, region)
        same(answer(s, damping, region), expected, f'the factor of s = {s}', mistakes)


@exercise('4.4')
def half_share(answer: float) -> None:
    """Singular value at which damping lets half of the velocity through."""
    mistakes = [
        (0.05, 'the share is s f(s) = s² / (s² + λ²); set it to one half.'),
        (0.2, 'the share is s f(s) = s² / (s² + λ²); set it to one half.'),
    ]
    same(answer, 0.1, 'the singular value [m]', mistakes, tolerance=1e-3)
