"""Posture and manipulability, which take up what the other levels leave."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from random_stacks import examples, numbers
from small_arms import planar_block, planar_robot
from urdf_arm import ARM

from tp_controller import InvalidValue, build_settings
from tp_controller.objectives import ManipulabilityObjective
from tp_controller.robot import urdf_robot
from tp_controller.tasks import ManipulabilityTask, PostureTask

Q = np.array([0.3, 0.7, -0.9, 0.5])


def stack_of(lowest, **solver):
    block = {
        'robot': planar_block(1.0, 1.0, 1.0, 1.0),
        'solver': {'damping': 0.0} | solver,
        'hierarchy': ['tip', 'lowest'],
        'tasks': {
            'tip': {'type': 'position', 'frame': 'link_4', 'axes': 'xy'},
            'lowest': lowest,
        },
    }
    return build_settings(block).stack


def test_a_posture_has_a_row_and_a_value_for_every_joint():
    task = PostureTask('p', urdf_robot(ARM, ['shoulder', 'elbow']))
    assert task.components == task.target_components == ('shoulder', 'elbow')
    task.target = [3.0, 1.0]
    task.robot.update(np.array([-3.0, 0.5]))
    task.update()
    np.testing.assert_allclose(task.error, [6.0 - 2.0 * np.pi, 0.5])
    np.testing.assert_array_equal(task.J, np.eye(2))


def test_below_a_position_the_posture_is_approached_as_far_as_it_lets():
    """What is left of the way to it lies in the rows of the position."""
    stack = stack_of({'type': 'posture', 'target': [0.5, 0.5, 0.5, 0.5], 'gain': [2.0]})
    q = Q.copy()
    for _ in range(1000):
        q = q + 0.01 * stack.step(q).command
    stack.step(q)
    J = stack.tasks['tip'].J
    left = stack.tasks['lowest'].error
    assert np.linalg.norm(stack.tasks['tip'].error) < 1e-3
    assert np.linalg.norm(left) > 0.1
    np.testing.assert_allclose(left - np.linalg.pinv(J) @ (J @ left), np.zeros(4), atol=1e-5)


def test_a_manipulability_task_moves_along_the_gradient_that_is_left():
    lowest = {'type': 'manipulability', 'frame': 'link_4', 'position_axes': 'xy', 'gain': [0.7]}
    stack = stack_of(lowest)
    stack.step(Q)
    measure = ManipulabilityObjective(stack.robot, 'link_4', 'xy')
    gradient = np.zeros(4)
    measure.gradient(gradient)
    J = stack.tasks['tip'].J
    expected = 0.7 * (gradient - np.linalg.pinv(J) @ (J @ gradient))
    np.testing.assert_allclose(stack.step(Q).command, expected, atol=1e-9)
    assert stack.tasks['lowest'].current == pytest.approx([measure.value])
    assert stack.tasks['lowest'].target is None


@given(st.tuples(numbers(-3, 3), numbers(0.3, 1.0), numbers(0.3, 1.0), numbers(0.3, 1.0)))
@examples(20)
def test_the_manipulability_rises_while_the_tip_stays(q):
    """To an optimum, where the gradient lies in the rows of the tip."""
    stack = stack_of(
        {'type': 'manipulability', 'frame': 'link_4', 'position_axes': 'xy', 'gain': [1.0]}
    )
    q = np.array(q)
    values = []
    for _ in range(300):
        q = q + 0.02 * stack.step(q).command
        values.append(float(stack.tasks['lowest'].current[0]))
    # Steps of finite length move the tip a little, and the optimum with it.
    assert np.diff(values).min() > -1e-5
    assert np.linalg.norm(stack.tasks['tip'].error) < 1e-2


def test_it_is_the_projected_gradient_scheme_as_a_task():
    lowest = {'type': 'manipulability', 'frame': 'link_4', 'position_axes': 'xy'}
    objective = lowest | {'gain': 1.0}
    scheme = stack_of(lowest, type='projected_gradient', objective=objective)
    scheme.hierarchy = ['tip']
    np.testing.assert_allclose(scheme.step(Q).command, stack_of(lowest).step(Q).command, atol=1e-9)


def test_a_task_without_a_target_takes_none():
    lowest = {'type': 'manipulability', 'frame': 'link_4', 'position_axes': 'xy', 'target': [1.0]}
    with pytest.raises(InvalidValue, match='an unknown parameter') as caught:
        stack_of(lowest)
    assert caught.value.key == 'tasks.lowest.target'


def test_a_measure_that_cannot_be_is_refused_by_its_key():
    with pytest.raises(InvalidValue) as caught:
        stack_of({'type': 'manipulability', 'frame': 'hand'})
    assert caught.value.key == 'tasks.lowest.frame'
    robot = planar_robot(1.0)
    measure = ManipulabilityObjective(robot, 'link_1', 'x')
    assert ManipulabilityTask('m', robot, measure).frame_name == 'link_1'
