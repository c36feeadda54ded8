"""Checks of notebook 3: velocities of tasks, angles, projectors, limits."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

import laws
from checks.judge import Wrong, exercise, same, values


@exercise('3.1')
def desired_velocity(answer: Callable[..., Any]) -> None:
    """Gain times error, and feedforward."""
    e, feedforward = np.array([0.2, -0.5]), np.array([0.1, 0.3])
    gains = {
        'one value': 2.0,
        'one per row': np.array([2.0, 3.0]),
        'a matrix': np.array([[2.0, 0.5], [0.0, 3.0]]),
    }
    for name, K in gains.items():
        full = K if np.ndim(K) == 2 else np.diag(np.broadcast_to(K, 2))
        mistakes = [
            (full @ e, 'the feedforward is missing.'),
            (full @ e - feedforward, 'the feedforward is added, not subtracted.'),
            (-full @ e + feedforward, 'the error is desired minus current: no minus sign.'),
        ]
        got = answer(e, K, feedforward)
        if np.shape(got) == (2, 2):
            raise Wrong('a gain matrix is multiplied by @, not element by element.')
        same(got, full @ e + feedforward, f'the velocity with {name}', mistakes)


@exercise('3.2')
def angle_error(answer: Callable[..., Any]) -> None:
    """Shortest way from one angle to another."""
    for desired, current in ((0.1, 0.3), (3.0, -3.0), (-3.0, 3.0), (9.0, 0.0), (-20.0, 1.0)):
        value = float(values(answer(desired, current)))
        plain = desired - current
        where = f'from {current} to {desired}'
        if abs(plain) > np.pi and np.isclose(value, plain):
            raise Wrong(f'the error {where} is {value:.2f}: it has to be wrapped.')
        if np.isclose(value, plain % (2.0 * np.pi)) and plain % (2.0 * np.pi) > np.pi:
            raise Wrong(f'the error {where} is {value:.2f}: wrap it to [-π, π], not to [0, 2π].')
        same(value, float(np.angle(np.exp(1j * plain))), f'the error {where}')


@exercise('3.3')
def projector(answer: Callable[..., Any]) -> None:
    """Projector into the null space, also of a Jacobian that has lost a rank."""
    rng = np.random.default_rng(4)
    J = rng.normal(size=(2, 3))
    singular = np.vstack([J[:1], 2.0 * J[:1]])
    for name, some in (('a random J', J), ('a singular J', singular)):
        P = np.eye(3) - laws.inverse(some) @ some
        leaky = np.eye(3) - laws.inverse(some, 0.1) @ some
        got = answer(some)
        if np.shape(got) == (2, 2):
            raise Wrong('J J⁺ is (k, k): the projector is made of J⁺ J.')
        mistakes = [
            (laws.inverse(some) @ some, 'this is J⁺ J, what J takes; what it leaves is I - J⁺ J.'),
            (leaky, 'there is damping in it: it leaks. Use the pseudo-inverse.'),
        ]
        same(got, P, f'the projector of {name}', mistakes)


@exercise('3.4')
def scaled(answer: Callable[..., Any]) -> None:
    """Scaling to the limits."""
    limit = np.array([1.0, 1.0, 0.5])
    for velocity in ([0.2, 0.1, 0.0], [2.0, 0.5, -0.1], [0.4, -3.0, 0.1], [0.1, 0.2, -2.0]):
        qd = np.array(velocity)
        forward = qd / max(1.0, float((qd / limit).max()))
        mistakes = [
            (forward, 'joints that move backwards are not limited: compare |q̇| with the limit.'),
            (np.clip(qd, -limit, limit), 'joints are cut one by one: the direction changes.'),
            (
                qd / np.max(np.abs(qd) / limit),
                'slow commands become faster: the factor is at most 1.',
            ),
            (qd / max(1.0, np.abs(qd).max()), 'every joint has a limit of its own.'),
        ]
        given = qd.copy()
        got = answer(given, limit)
        same(got, laws.scaled(qd, limit)[0], f'the command for q̇ = {qd}', mistakes)


@exercise('3.5')
def distance_behind(answer: float) -> None:
    """Steady error behind a moving target."""
    mistakes = [
        (0.8, 'it is w / K, not w K: a larger gain makes it smaller.'),
        (0.0, 'it vanishes only with the feedforward.'),
    ]
    same(answer, 0.05, 'the distance [m]', mistakes, tolerance=1e-3)
