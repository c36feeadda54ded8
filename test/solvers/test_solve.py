"""`solve` on levels of random numbers against the recursion written down plainly."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from plain_levels import random_levels, resolve
from random_stacks import examples
from references import recursion

from tp_controller import InvalidValue, Inverse, Level, solve, solver_of

SCHEMES = ('recursive', 'augmented', 'weighted', 'hqp')
ROWS = st.lists(st.integers(1, 3), min_size=1, max_size=4)


@st.composite
def problems(draw, max_joints=8):
    """Levels (J, velocity) of random numbers."""
    n = draw(st.integers(2, max_joints))
    return random_levels(draw(st.integers(0, 2**32)), n, draw(ROWS)), n


@st.composite
def bounded_problems(draw):
    """Levels with inequality rows that rest keeps, and bounds that leave room for rest."""
    levels, n = draw(problems())
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    sizes = draw(st.lists(st.integers(0, 2), min_size=len(levels), max_size=len(levels)))
    levels = [
        Level(J, velocity, rng.normal(size=(m, n)), -rng.uniform(0.0, 0.5, m))
        for (J, velocity), m in zip(levels, sizes, strict=True)
    ]
    return levels, -rng.uniform(0.0, 1.0, n), rng.uniform(0.1, 1.0, n)


@given(problems(), st.sampled_from([0.01, 0.1, 1.0]))
@examples(100)
def test_without_bounds_the_answer_is_that_of_the_recursion(problem, damping):
    levels, _ = problem
    expected, shares = recursion(levels, damping)
    assume(not np.any((shares > 1e-13) & (shares < 1e-6)))
    found = solve(levels, damping=damping)
    np.testing.assert_allclose(found.velocity, expected, atol=1e-8)
    assert found.scale == 1.0
    assert not found.active_joints.any()


@given(problems(), st.sampled_from(SCHEMES), st.sampled_from([0.3, np.inf]))
@examples(100)
def test_the_answer_is_that_of_the_schemes_solver(problem, scheme, limit):
    levels, n = problem
    found = solve(levels, -limit, limit, scheme)
    expected = resolve(solver_of(scheme, n), levels, limit)
    np.testing.assert_array_equal(found.velocity, expected)


@given(bounded_problems(), st.sampled_from(SCHEMES))
@examples(150)
def test_no_answer_leaves_the_bounds_and_the_rest_describes_it(problem, scheme):
    levels, low, high = problem
    found = solve(levels, low, high, scheme)
    qd = found.velocity
    assert ((qd >= low - 1e-12) & (qd <= high + 1e-12)).all()
    np.testing.assert_array_equal(found.active_joints == 1, qd >= high - 1e-9)
    np.testing.assert_array_equal(found.active_joints == -1, qd <= low + 1e-9)
    assert found.proven
    for level, part in zip(levels, found.levels, strict=True):
        np.testing.assert_array_equal(part.requested, level.velocity)
        np.testing.assert_allclose(part.achieved, level.J @ qd, atol=1e-12)
        np.testing.assert_allclose(part.rates, level.C @ qd, atol=1e-12)
        assert 0.0 <= part.share <= 1.0


@given(bounded_problems(), st.sampled_from(['recursive', 'hqp']))
@examples(100)
def test_inequality_rows_of_the_first_level_that_rest_keeps_are_kept(problem, scheme):
    levels, low, high = problem
    above = Level(C=levels[0].C, least=levels[0].least)
    levels = [above] if above.least.size else []
    levels += [Level(J, velocity) for J, velocity, *_ in problem[0]]
    found = solve(levels, low, high, scheme)
    if above.least.size:
        part = found.levels[0]
        assert (part.rates >= above.least - 1e-6).all()
        np.testing.assert_array_equal(
            part.active, part.rates <= above.least + 1e-9 * _sizes(above)
        )


def _sizes(level):
    return np.maximum(1.0, np.linalg.norm(level.C, axis=1))


@given(bounded_problems(), st.sampled_from(['recursive', 'hqp']))
@examples(100)
def test_lower_levels_change_nothing_above_them(problem, scheme):
    levels, low, high = problem
    whole, alone = solve(levels, low, high, scheme), solve(levels[:1], low, high, scheme)
    np.testing.assert_allclose(whole.levels[0].achieved, alone.levels[0].achieved, atol=1e-6)


@given(problems())
@examples(50)
def test_with_uniform_saturation_the_direction_is_kept(problem):
    levels, _ = problem
    free, scaled = solve(levels), solve(levels, -0.2, 0.2, saturation='uniform')
    np.testing.assert_allclose(scaled.velocity, scaled.scale * free.velocity, atol=1e-12)
    assert np.abs(scaled.velocity).max() <= 0.2


def test_what_the_bounds_exclude_from_rest_is_inside_them_too():
    levels = random_levels(3, 4, [2, 1])
    low, high = np.array([0.1, -1.0, -1.0, -1.0]), np.array([0.5, -0.2, 1.0, 1.0])
    for scheme in SCHEMES:
        qd = solve(levels, low, high, scheme).velocity
        assert ((qd >= low - 1e-12) & (qd <= high + 1e-12)).all(), scheme


def test_one_row_may_be_given_as_a_vector_and_a_level_have_an_inverse_of_its_own():
    J = np.array([1.0, 1.0])
    assert solve([(J, 1.0)], inverse='pinv').velocity == pytest.approx([0.5, 0.5])
    exact = Level(J, 1.0, inverse=Inverse('pinv'))
    assert solve([exact], damping=1.0).velocity == pytest.approx([0.5, 0.5])
    assert solve([(J, 1.0)], damping=1.0).velocity == pytest.approx([1.0 / 3.0] * 2)


def test_weights_decide_between_levels_that_contradict_each_other():
    J = [[1.0, 0.0]]
    levels = [Level(J, [1.0], weight=3.0), Level(J, [0.0])]
    assert solve(levels, scheme='weighted', inverse='pinv').velocity[0] == pytest.approx(0.75)


def test_a_gradient_takes_up_the_freedom_that_is_left():
    found = solve(
        [([1.0, 1.0], [1.0])], scheme='projected_gradient', inverse='pinv', gradient=[1.0, -1.0]
    )
    np.testing.assert_allclose(found.velocity, [1.5, -0.5])


def test_the_arrays_are_copies():
    J, velocity = np.eye(2), np.ones(2)
    found = solve([(J, velocity)])
    found.levels[0].requested[:] = 5.0
    J[:] = 7.0
    assert velocity.tolist() == [1.0, 1.0]


WIDE = np.ones((2, 3))


@pytest.mark.parametrize(
    ('arguments', 'message'),
    [
        (([],), 'levels: got no level'),
        (([Level()],), 'levels[0]: got no rows; accepts J with velocity'),
        (([Level(WIDE)],), 'levels[0].velocity: got no value'),
        (([Level(velocity=[1.0])],), 'levels[0].J: got no value'),
        (
            ([(WIDE, [1.0])],),
            'got shape (1,) with levels[0].J of shape (2, 3)',
        ),
        (
            ([(np.ones((1, 2, 3)), [1.0])],),
            'levels[0].J: got shape (1, 2, 3); accepts',
        ),
        (([(WIDE, [1.0, 1.0]), ([1.0, 1.0], 1.0)],), 'levels[1]: got 2 columns, levels[0] has 3'),
        (([Level(WIDE, [1.0, 1.0], [1.0], 0.0)],), 'levels[0].C: got 1 columns, J has 3'),
        (([(WIDE, [1.0, np.nan])],), 'levels[0].velocity: got [1.0, nan]; accepts finite numbers'),
        (([(WIDE, ['a', 'b'])],), 'levels[0].velocity: got'),
        (([([[1.0], [1.0, 2.0]], [1.0, 1.0])],), 'levels[0].J: got'),
        (([(1e300 * WIDE, [1.0, 1.0])],), 'levels: got numbers beyond the range'),
        (([Level(WIDE, [1.0, 1.0], weight=0.0)],), 'levels[0].weight: got 0.0'),
        (([Level(WIDE, [1.0, 1.0], inverse='dls')],), "levels[0].inverse: got 'dls'"),
        (([(WIDE, [1.0, 1.0])], 1.0, -1.0), 'low: got [1.0, 1.0, 1.0] with high [-1.0'),
        (([(WIDE, [1.0, 1.0])], [1.0, 1.0]), 'low: got shape (2,); accepts one value or shape (3'),
        (([(WIDE, [1.0, 1.0])], np.nan), 'low: got nan; accepts numbers'),
        (
            ([(WIDE, [1.0, 1.0])], None, None, 'best'),
            "scheme: got 'best'; accepts one of",
        ),
        (([(WIDE, [1.0, 1.0])], None, None, 'extended_jacobian'), 'hierarchy: got 2 rows for 3'),
        (([(WIDE, [1.0, 1.0])], None, None, 'projected_gradient'), 'objective'),
    ],
)
def test_what_cannot_be_used_is_refused_in_one_line(arguments, message):
    with pytest.raises(InvalidValue) as caught:
        solve(*arguments)
    assert message in str(caught.value)
    assert '\n' not in str(caught.value)


@pytest.mark.parametrize(
    ('settings', 'message'),
    [
        ({'inverse': 'best'}, 'inverse: got'),
        ({'damping': -1.0}, 'damping: got -1.0'),
        ({'saturation': 'uniform', 'high': 1.0}, 'low = -high'),
        ({'gradient': [1.0]}, 'gradient: got shape (1,); accepts shape (3,)'),
        ({'gradient': [1.0] * 3, 'scheme': 'extended_jacobian'}, 'gradient: got a value'),
    ],
)
def test_settings_that_cannot_be_used_are_refused(settings, message):
    with pytest.raises(InvalidValue) as caught:
        solve([(WIDE, [1.0, 1.0])], **settings)
    assert message in str(caught.value)
