"""Checks of notebook 5: distances, hysteresis, velocity dampers."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

import lab
from checks.judge import Wrong, exercise, same, values


@exercise('5.1')
def distance_and_row(answer: Callable[..., Any]) -> None:
    """Distance from a circle, and its derivative by the joints."""
    center, radius = np.array([0.2, -0.3]), 0.4
    for angles in ([0.0, 0.6, 0.3], [0.4, 1.0, 2.0]):
        q = np.array(angles)
        p, J = lab.tip(lab.ARM, q), lab.jacobian(lab.ARM, q)[:2]
        way = p - center
        length = float(np.linalg.norm(way))
        got = answer(p, J, center, radius)
        if got is None:
            raise Wrong('there is no answer yet.')
        distance, row = got
        hint = 'the distance is measured from the surface: subtract the radius.'
        same(distance, length - radius, 'the distance', [(length, hint)])
        mistakes = [
            (-way / length @ J, 'the row points inwards; u goes from the centre to the tip.'),
            (way @ J, 'u has the length 1: divide by the norm.'),
            ((way / np.abs(way)) @ J, 'the norm is one number; do not divide element by element.'),
            (p / np.linalg.norm(p) @ J, 'u goes from the centre to the tip, not from the base.'),
        ]
        same(row, way / length @ J, 'the row', mistakes)


@exercise('5.2')
def switch(answer: Callable[..., Any]) -> None:
    """Switching with hysteresis."""
    on = False
    cases = [(0.3, 0), (0.15, 0), (0.1, 1), (0.05, 1), (0.15, 1), (0.19, 1), (0.21, 0), (0.15, 0)]
    for distance, expected in cases:
        got = answer(on, distance, 0.1, 0.2)
        if got is None:
            raise Wrong('there is no answer yet.')
        if bool(got) != bool(expected):
            was, state = ('on', 'off')[not on], ('off', 'on')[expected]
            raise Wrong(
                f'activation 0.1, release 0.2: a task that was {was} has to be {state} at the '
                f'distance {distance}.'
            )
        on = bool(got)


@exercise('5.3')
def largest_step(answer: Callable[..., Any]) -> None:
    """Farthest that the tip can move in a step."""
    for lengths, limit, dt in (((0.75, 0.5, 0.5), 1.5, 1.0 / 60.0), ((1.0, 0.2), 0.5, 0.1)):
        a = np.array(lengths)
        arms = np.cumsum(a[::-1])
        mistakes = [
            (a.sum() * limit * dt, 'every joint moves the tip, not joint 1 alone: add them all.'),
            (arms.sum() * limit, 'this is a speed: multiply by the time of a step.'),
            (
                a.sum() * len(a) * limit * dt,
                'joint 2 is nearer to the tip than joint 1: it moves it less.',
            ),
        ]
        expected = arms.sum() * limit * dt
        same(answer(a, limit, dt), expected, f'the step of links {a}', mistakes)


@exercise('5.4')
def least_rate(answer: Callable[..., Any]) -> None:
    """Bound of a velocity damper."""
    margin, activation, fastest, gain = 0.01, 0.21, 4.0, 2.0
    tau = (activation - margin) / fastest
    for d in (0.5, 0.21, 0.1, 0.011, 0.005, -0.02):
        expected = -(d - margin) / tau if d > margin else gain * (margin - d)
        mistakes = [
            (-expected, 'the sign: outside the margin the distance may shrink, inside it grows.'),
            (-(d - margin) / tau, 'inside the margin the gain counts, not τ.'),
            (-d / tau, 'the speed is zero at the margin, not at the boundary.'),
            (
                max(expected, -fastest),
                'do not stop at v_max: farther away all is free.',
            ),
        ]
        got = values(answer(d, margin, activation, fastest, gain))
        same(got, expected, f'the least rate at d = {d}', mistakes)
