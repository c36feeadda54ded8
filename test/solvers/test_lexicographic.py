"""Levels of equalities and inequalities in a box, against a cascade of quadratic programs."""

import time

import daqp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from lexicographic_references import Problem, cascade, level_norms, random_problem, violation
from random_stacks import examples

from tp_controller.solvers.lexicographic import LexicographicProblem

COUNT = 1000


def solve(problem, metric=None):
    """Answer (n,), whether it is proven, and the solver."""
    solver = LexicographicProblem(problem.J.shape[1], problem.starts, problem.one_sided, metric)
    x = np.full(problem.J.shape[1], 7.0)
    proven = solver.solve(problem.J, problem.velocity, problem.lower, problem.upper, x)
    return x, proven, solver


def problem_of(levels, lower, upper):
    """Problem of levels (J, velocity, one_sided)."""
    return Problem(
        np.vstack([J for J, _, _ in levels]).astype(float),
        np.concatenate([v for _, v, _ in levels]).astype(float),
        np.cumsum([0] + [len(v) for _, v, _ in levels]),
        np.concatenate([np.full(len(v), sided) for _, v, sided in levels]),
        np.array(lower, dtype=float),
        np.array(upper, dtype=float),
    )


def test_it_agrees_with_a_cascade_of_quadratic_programs():
    """On every one of them: none is left out for its outcome."""
    for seed in range(COUNT):
        problem = random_problem(seed)
        expected = cascade(problem)
        x, proven, _ = solve(problem)
        assert proven, seed
        np.testing.assert_allclose(x, expected, rtol=0.0, atol=1e-5, err_msg=str(seed))
        np.testing.assert_allclose(
            level_norms(problem, x), level_norms(problem, expected), rtol=0.0, atol=1e-5
        )


def test_it_agrees_with_the_cascade_in_another_metric():
    for seed in range(200):
        problem = random_problem(seed)
        n = problem.J.shape[1]
        # Well-conditioned: the distance that counts is another one, no joint is heavy.
        T = np.eye(n) + 0.3 * np.random.default_rng(seed).uniform(-1.0, 1.0, (n, n)) / n**0.5
        x, proven, _ = solve(problem, T)
        assert proven, seed
        np.testing.assert_allclose(x, cascade(problem, T), atol=1e-5, err_msg=str(seed))


@given(st.integers(0, 100_000))
@examples(200)
def test_the_answer_is_in_the_box_and_its_violations_are_told(seed):
    problem = random_problem(seed)
    x, _, solver = solve(problem)
    assert np.all((problem.lower <= x) & (x <= problem.upper))
    np.testing.assert_allclose(solver.violation(x), violation(problem, x), atol=1e-12)
    for joint in np.flatnonzero(solver.stopped_joints >= 0):
        ends = problem.lower[joint], problem.upper[joint]
        assert np.abs(x[joint] - ends).min() <= 1e-9
    stopping = solver.stopped_rows >= 0
    assert np.all(problem.one_sided[stopping])
    np.testing.assert_allclose((problem.J @ x - problem.velocity)[stopping], 0.0, atol=1e-8)


@given(st.integers(0, 100_000))
@examples(200)
def test_rows_of_zeros_are_as_if_they_were_not(seed):
    """To the last bit, whatever they ask for; levels of nothing else as well."""
    problem = random_problem(seed)
    rng = np.random.default_rng(seed)
    J, velocity, one_sided = [], [], []
    starts = [0]
    for start, stop in zip(problem.starts[:-1], problem.starts[1:], strict=True):
        if rng.random() < 0.3:
            J, velocity = [*J, np.zeros_like(problem.J[0])], [*velocity, 0.0]
            one_sided = [*one_sided, rng.random() < 0.5]
            starts.append(len(J))
        for row in range(start, stop):
            if rng.random() < 0.3:
                J, velocity = [*J, np.zeros_like(problem.J[0])], [*velocity, rng.normal()]
                one_sided = [*one_sided, rng.random() < 0.5]
            J, velocity = [*J, problem.J[row]], [*velocity, problem.velocity[row]]
            one_sided = [*one_sided, problem.one_sided[row]]
        starts.append(len(J))
    with_zeros = Problem(
        np.array(J),
        np.array(velocity),
        np.array(starts),
        np.array(one_sided),
        problem.lower,
        problem.upper,
    )
    np.testing.assert_array_equal(solve(with_zeros)[0], solve(problem)[0])


def test_daqp_has_room_for_all_rows_as_active(monkeypatch):
    """What it takes in beyond its room ends the process."""
    shapes = []
    call = daqp.solve

    def watched(H, f, A, most, least, sense, breaks, **settings):
        counted = int((A != 0.0).any(axis=1).sum())
        free = np.diff(breaks, prepend=0).max() if len(breaks) else (sense == 8).sum()
        shapes.append((A.shape[1] + free, counted, len(breaks)))
        return call(H, f, A, most, least, sense, breaks, **settings)

    monkeypatch.setattr(daqp, 'solve', watched)
    for seed in range(300):
        solve(random_problem(seed))
    assert all(room >= counted for room, counted, _ in shapes)
    assert {breaks > 1 for _, _, breaks in shapes} == {True, False}


def test_inside_a_level_violations_weigh_alike_however_long_the_rows_are():
    """Min (x - 1)² + (10 x)² is at 1/101."""
    x, proven, _ = solve(problem_of([([[1.0], [10.0]], [1.0, 0.0], False)], [-5.0], [5.0]))
    assert proven
    assert x[0] == pytest.approx(1 / 101, abs=1e-12)


def test_who_stopped_a_level_is_told():
    """The row stops the second level, a joint's bound the third, and nothing the first."""
    levels = [
        ([[-1.0, 0.0, 0.0]], [-0.5], True),
        ([[1.0, 0.0, 0.0]], [2.0], False),
        ([[0.0, 1.0, 0.0]], [2.0], False),
    ]
    x, _, solver = solve(problem_of(levels, [-1.0] * 3, [1.0] * 3))
    np.testing.assert_allclose(x, [0.5, 1.0, 0.0], atol=1e-12)
    np.testing.assert_array_equal(solver.stopped_rows, [1, -1, -1])
    np.testing.assert_array_equal(solver.stopped_joints, [-1, 2, -1])


@pytest.mark.parametrize('value', [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize('place', ['J', 'velocity'])
def test_what_is_not_finite_is_refused(place, value):
    problem = random_problem(3)
    getattr(problem, place).flat[0] = value
    with pytest.raises(np.linalg.LinAlgError, match='range of floats'):
        solve(problem)


def test_an_answer_takes_microseconds():
    """Median on 7 joints: three one-sided rows, two tasks and a posture in a tight box."""
    rng = np.random.default_rng(0)
    durations = []
    for _ in range(200):
        levels = [(rng.normal(size=(1, 7)), rng.normal(size=1) - 1.0, True) for _ in range(3)]
        levels += [(rng.normal(size=(3, 7)), rng.normal(size=3), False) for _ in range(2)]
        levels.append((np.eye(7), rng.normal(size=7), False))
        problem = problem_of(levels, [-0.5] * 7, [0.5] * 7)
        _, proven, solver = solve(problem)
        assert proven
        x = np.zeros(7)
        for _ in range(3):
            started = time.perf_counter()
            solver.solve(problem.J, problem.velocity, problem.lower, problem.upper, x)
            durations.append(time.perf_counter() - started)
    # A fraction of this on an idle machine.
    assert np.median(durations) < 200e-6
