import math

import numpy as np
import pytest
from small_arms import planar_block

from tp_controller import InvalidValue, UnusableState, build_settings

GOOD = np.array([0.3, 0.2, 0.1])


def stack_of(damping=0.1, **tip):
    """Stack of an arm whose second joint slides in the plane."""
    block = planar_block(0.75, 0.5, 0.5)
    block['dh']['types'] = ['revolute', 'prismatic', 'revolute']
    block['dh']['alpha'] = [math.pi / 2, -math.pi / 2, 0.0]
    return build_settings(
        {
            'robot': block | {'limits': {'velocity': [1.0]}},
            'solver': {'damping': damping},
            'hierarchy': ['tip', 'first'],
            'tasks': {
                'tip': {'type': 'position', 'frame': 'link_3', 'axes': 'xy'} | tip,
                'first': {'type': 'joint', 'joints': ['joint_1'], 'target': [5.0]},
                'turn': {'type': 'orientation', 'frame': 'link_3'},
            },
        }
    ).stack


@pytest.mark.parametrize('damping', [0.0, 0.1])
@pytest.mark.parametrize('value', [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize('joint', range(3))
def test_a_position_that_is_not_finite_is_refused_and_the_next_state_is_answered(
    damping, value, joint
):
    q = GOOD.copy()
    q[joint] = value
    stack = stack_of(damping, target=[1.0, 0.5])
    with pytest.raises(UnusableState, match='no finite command'):
        stack.step(q)
    expected = stack_of(damping, target=[1.0, 0.5]).step(GOOD).command
    np.testing.assert_array_equal(stack.step(GOOD).command, expected)


@pytest.mark.parametrize('value', [math.nan, math.inf])
def test_no_task_takes_its_first_target_from_a_state_that_is_not_finite(value):
    stack = stack_of()
    with pytest.raises(UnusableState):
        stack.step(np.array([0.3, value, 0.1]))
    assert np.all(np.isfinite(stack.step(GOOD).command))
    for name in ('tip', 'turn'):
        np.testing.assert_allclose(stack.tasks[name].target, stack.tasks[name].current, atol=1e-12)


def test_a_refused_state_leaves_a_command_of_zero():
    stack = stack_of(target=[1.0, 0.5])
    command = stack.step_in_place(GOOD).command
    assert np.any(command != 0.0)
    with pytest.raises(UnusableState):
        stack.step(np.full(3, math.nan))
    np.testing.assert_array_equal(command, np.zeros(3))


@pytest.mark.parametrize('damping', [0.0, 0.1])
@pytest.mark.parametrize('target', [[1.0, 0.5], None])
@pytest.mark.parametrize('value', [1e300, -1e300])
@pytest.mark.filterwarnings('ignore:overflow encountered')
def test_numbers_that_leave_the_range_of_floats_are_refused(damping, target, value):
    stack = stack_of(damping, **({'target': target} if target else {}))
    with pytest.raises(UnusableState, match='no finite command'):
        stack.step(np.array([0.3, value, 0.1]))
    expected = stack_of(damping, **({'target': target} if target else {})).step(GOOD)
    np.testing.assert_array_equal(stack.step(GOOD).command, expected.command)


@pytest.mark.parametrize('value', [1e100, 1e155, 1e200, 1e300])
@pytest.mark.filterwarnings('ignore:overflow encountered')
def test_a_huge_position_never_costs_a_level_its_priority(value):
    """Where squares leave the range of floats no rank may be read out of them."""
    stack = stack_of(target=[1.0, 0.5])
    achieved = []
    for hierarchy in (['tip'], ['tip', 'first']):
        stack.hierarchy = hierarchy
        try:
            achieved.append(stack.step(np.array([0.3, value, 0.1])).levels[0].achieved.copy())
        except UnusableState:
            achieved.append(np.zeros(2))
    np.testing.assert_allclose(achieved[1], achieved[0], rtol=1e-6, atol=1e-6)


@pytest.mark.filterwarnings('ignore:overflow encountered', 'ignore:invalid value encountered')
def test_a_wish_beyond_the_range_of_floats_is_refused():
    stack = stack_of(target=[1.0, 0.0])
    # Beyond what is accepted; only the sum leaves the range of floats.
    stack.tasks['tip']._feedforward = np.array([1.7e308, -1.7e308])
    with pytest.raises(UnusableState):
        stack.step(GOOD)


@pytest.mark.filterwarnings('ignore:overflow encountered', 'ignore:invalid value encountered')
def test_a_wish_that_is_not_finite_makes_a_moving_arm_brake():
    """Nobody else would: without a command the last one goes on."""
    limits = {'velocity': [1.0], 'acceleration': [2.0]}
    stack = build_settings(
        {
            'robot': planar_block(1.0, 1.0) | {'limits': limits},
            'rate': 100.0,
            'hierarchy': ['tip'],
            'tasks': {'tip': {'type': 'position', 'frame': 'link_2', 'target': [-1.0, 1.0, 0.0]}},
        }
    ).stack
    q = np.array([0.3, 0.5])
    for _ in range(20):
        command = stack.step(q).command.copy()
        q = q + 0.01 * command
    stack.tasks['tip']._feedforward = np.array([1.7e308, -1.7e308, 0.0])
    stack.tasks['tip'].revision += 1
    while np.any(command != 0.0):
        with pytest.raises(UnusableState) as caught:
            stack.step(q)
        slower = caught.value.command.copy()
        assert np.abs(slower).sum() < np.abs(command).sum()
        assert np.abs(slower - command).max() <= 0.02 * (1.0 + 1e-9)
        command, q = slower, q + 0.01 * slower


def test_an_enormous_target_is_refused():
    with pytest.raises(InvalidValue, match=r'up to 1e\+09 in size'):
        stack_of().tasks['tip'].target = [1e10, 0.0]


def test_an_enormous_gain_is_refused():
    with pytest.raises(InvalidValue, match=r'up to 1e\+09'):
        stack_of().tasks['tip'].gain = [1e308]
