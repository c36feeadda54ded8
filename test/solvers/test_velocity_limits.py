import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from random_stacks import examples, numbers, parameters, positive_vectors, states
from small_arms import planar_block

from tp_controller import build_settings
from tp_controller.solvers.kernel import shorten


@st.composite
def limited_stacks(draw):
    """Parameters without limits, limits, and a state."""
    block = draw(parameters(dampings=st.just(0.0) | numbers(0.01, 1)))
    n = len(block['robot']['joints'])
    velocity = draw(positive_vectors(1, 0.01, 2) | positive_vectors(n, 0.01, 2))
    return block, velocity, draw(states(n))


def step(block, q, velocity=None):
    limits = {} if velocity is None else {'limits': {'velocity': velocity}}
    solver = block.get('solver', {}) | {'saturation': 'uniform'}
    return build_settings(block | {'robot': block['robot'] | limits, 'solver': solver}).stack.step(
        q
    )


@given(limited_stacks())
@examples(100)
def test_no_component_ever_exceeds_its_limit_and_the_direction_is_kept(case):
    block, velocity, q = case
    free = step(block, q)
    limited = step(block, q, velocity)
    assert np.all(np.abs(limited.command) <= np.array(velocity))
    excess = np.max(np.abs(free.command) / velocity)
    assert limited.scale == pytest.approx(1.0 / max(1.0, excess), rel=1e-12)
    np.testing.assert_allclose(
        limited.command, free.command * limited.scale, rtol=1e-12, atol=1e-300
    )


@given(limited_stacks())
@examples(60)
def test_without_limits_the_scale_is_one(case):
    block, _, q = case
    assert step(block, q).scale == 1.0


@given(limited_stacks())
@examples(60)
def test_limits_shorten_what_every_level_achieves_and_not_what_it_requests(case):
    block, velocity, q = case
    free, limited = step(block, q), step(block, q, velocity)
    for wide, narrow in zip(free.levels, limited.levels, strict=True):
        size = max(1.0, np.abs(wide.achieved).max())
        np.testing.assert_array_equal(narrow.requested, wide.requested)
        np.testing.assert_allclose(
            narrow.achieved, limited.scale * wide.achieved, atol=1e-12 * size
        )


@pytest.mark.parametrize('sign', [1.0, -1.0])
def test_speeds_of_either_sign_are_limited(sign):
    block = {
        'robot': planar_block(1.0, 1.0),
        'solver': {'damping': 0.0},
        'hierarchy': ['joints'],
        'tasks': {
            'joints': {
                'type': 'joint',
                'joints': ['joint_1', 'joint_2'],
                'target': [sign * 4.0, sign * 1.0],
            }
        },
    }
    result = step(block, np.zeros(2), [2.0])
    np.testing.assert_array_equal(result.command, [sign * 2.0, sign * 0.5])
    assert result.scale == 0.5


speeds = st.floats(-1e6, 1e6, allow_subnormal=False)


@given(st.lists(st.tuples(speeds, st.floats(1e-6, 1e6)), min_size=1, max_size=9))
@examples(250)
def test_scaling_is_exact_to_the_last_bit_at_the_limit(pairs):
    qd, velocity = np.array(pairs).T.copy()
    scaled = qd.copy()
    scale = shorten(scaled, np.ascontiguousarray(velocity))
    assert np.all(np.abs(scaled) <= velocity)
    assert 0.0 < scale <= 1.0
    np.testing.assert_allclose(scaled, scale * qd, rtol=1e-14, atol=1e-300)
    if scale == 1.0:
        np.testing.assert_array_equal(scaled, qd)
    else:
        assert np.max(np.abs(scaled) / velocity) == pytest.approx(1.0, rel=1e-14)


def test_a_velocity_on_the_limit_is_left_as_it_is():
    qd = np.array([1.0, -2.0])
    assert shorten(qd, np.array([1.0, 2.0])) == 1.0
    np.testing.assert_array_equal(qd, [1.0, -2.0])
