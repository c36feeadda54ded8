"""The checks of the exercises say what is wrong with a wrong answer."""

import math

import numpy as np
import pytest

from checks import inequalities, kinematics, limits, more_levels, redundancy, two_priorities


def stops(*_):
    raise RuntimeError('division by nothing')


def inverse(J, damping):
    return J.T @ np.linalg.inv(J @ J.T + damping**2 * np.eye(len(J)))


def damped_projector(levels, damping):
    qd, P = np.zeros(6), np.eye(6)
    for J, v in levels:
        qd = qd + inverse(J @ P, damping) @ (v - J @ qd)
        P = P - inverse(J @ P, damping) @ J @ P
    return qd


def last_increment(levels, damping):
    qd, P, last = np.zeros(6), np.eye(6), np.zeros(6)
    for J, v in levels:
        last = inverse(J @ P, damping) @ (v - J @ last)
        qd, P = qd + last, P - np.linalg.pinv(J @ P, rcond=1e-8) @ J @ P
    return qd


def without_tolerance(levels, damping):
    qd, P = np.zeros(6), np.eye(6)
    for J, v in levels:
        qd = qd + inverse(J @ P, damping) @ (v - J @ qd)
        P = P - np.linalg.pinv(J @ P) @ J @ P
    return qd


WRONG = [
    (kinematics.tip, lambda a, q: np.array([a @ np.cos(q), a @ np.sin(q)]), 'add the angles'),
    (kinematics.tip, lambda a, q: 1.0, 'has the shape'),
    (kinematics.tip, lambda a, q: 'far away', 'has to be numbers'),
    (kinematics.tip, stops, 'stops with RuntimeError: division by nothing'),
    (kinematics.jacobian, lambda a, q: np.zeros((2, len(q))), 'it should be'),
    (kinematics.damped_inverse, lambda J, x: np.linalg.pinv(J), 'λ² is not added'),
    (kinematics.damped_inverse, lambda J, x: inverse(J, math.sqrt(x)), 'has to be squared'),
    (kinematics.least_damping, 0.25, 'not 1/λ'),
    (kinematics.seconds_to_a_tenth, 2.0, '1/e'),
    (redundancy.augmented_step, lambda A, a, B, b, x: inverse(A, x) @ a, 'it should be'),
    (
        redundancy.augmented_step,
        lambda A, a, B, b, x: inverse(A, x) @ a + inverse(B, x) @ b,
        'stack them',
    ),
    (
        redundancy.priority_step,
        lambda A, a, B, b, x: (
            inverse(A, x) @ a + inverse(B @ (np.eye(4) - np.linalg.pinv(A) @ A), x) @ b
        ),
        'subtract',
    ),
    (redundancy.null_vector, lambda J: np.cross(J[0], J[1]), 'its length'),
    (redundancy.null_vector, lambda J: J[0], 'should be zero'),
    (redundancy.condition, lambda J, q, q0: q0 - q, 'one number'),
    (
        two_priorities.desired_velocity,
        lambda e, K, f: K * np.asarray(e) + f,
        'not element by element',
    ),
    (two_priorities.desired_velocity, lambda e, K, f: np.dot(K, e) * 0.0 + f * 0.0, 'velocity'),
    (two_priorities.angle_error, lambda x, y: x - y, 'has to be wrapped'),
    (two_priorities.angle_error, lambda x, y: (x - y) % (2.0 * math.pi), 'not to'),
    (two_priorities.projector, lambda J: np.linalg.pinv(J) @ J, 'what it leaves'),
    (two_priorities.scaled, lambda v, x: v / max(1.0, (v / x).max()), 'move backwards'),
    (two_priorities.scaled, lambda v, x: np.clip(v, -x, x), 'one by one'),
    (two_priorities.distance_behind, 0.8, 'not w K'),
    (more_levels.recursion, damped_projector, 'the projector leaks'),
    (more_levels.recursion, last_increment, 'the last increment'),
    (more_levels.recursion, without_tolerance, 'rank tolerance'),
    (more_levels.freedom_left, [3, 2, 1], 'fix the angle'),
    (more_levels.adaptive_factor, lambda s, x, e: s / (s**2 + x**2), 'constant damping'),
    (more_levels.half_share, 0.2, 'one half'),
    (
        inequalities.distance_and_row,
        lambda p, J, c, r: (np.linalg.norm(p - c), J[0]),
        'subtract the radius',
    ),
    (
        inequalities.distance_and_row,
        lambda p, J, c, r: (np.linalg.norm(p - c) - r, np.sign(p - c) @ J),
        'element by element',
    ),
    (inequalities.switch, lambda on, d, near, far: d <= near, 'has to be on'),
    (inequalities.largest_step, lambda a, v, dt: a.sum() * v * dt, 'not joint 1 alone'),
    (inequalities.least_rate, lambda d, m, a, v, k: -(d - m) * v / (a - m), 'the gain counts'),
    (limits.largest_share, lambda x, w, low, high: 1.0, 'it should be'),
    (
        limits.answer_with_the_rest,
        lambda J, v, held, value: np.where(np.arange(4) == held, value, np.linalg.pinv(J) @ v),
        'answer anew',
    ),
    (limits.braking_distance, lambda v, a, T: v * v / (2.0 * a), 'continuous time'),
]


@pytest.mark.parametrize(('check', 'answer', 'said'), WRONG)
def test_a_wrong_answer_hears_what_is_wrong(capsys, check, answer, said):
    assert not check(answer)
    output = capsys.readouterr().out
    assert 'not yet: ' in output
    assert said in output
    assert len(output.splitlines()) <= 4


@pytest.mark.parametrize(('check', 'answer', 'said'), WRONG)
def test_an_empty_answer_hears_that_there_is_none(capsys, check, answer, said):
    assert not check(None)
    assert not check(...)
    assert capsys.readouterr().out.count('there is no answer yet.') == 2
