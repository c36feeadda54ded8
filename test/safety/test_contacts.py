"""What is in contact at the first joint state: said, and left alone unless asked for."""

import numpy as np
import pytest

from tp_controller.config import build_settings
from tp_controller.solvers.directions import STILL

DATA = 'package://example-robot-data/robots'
UR10 = {'urdf': f'{DATA}/ur_description/urdf/ur10_robot.urdf'}
BENT = np.array([0.0, -1.0, 1.8, -2.37, -1.57, 0.0])
BAXTER = {
    'urdf': f'{DATA}/baxter_description/urdf/baxter.urdf',
    'joints': [f'left_{joint}' for joint in ('s0', 's1', 'e0', 'e1', 'w0', 'w1', 'w2')],
}
RATE = 125.0


def stack_of(robot, **self_collision):
    tasks = {'self': {'type': 'self_collision', **self_collision}, 'arm': {'type': 'posture'}}
    hierarchy = ['self', 'arm']
    parameters = {'rate': RATE, 'robot': robot, 'hierarchy': hierarchy, 'tasks': tasks}
    return build_settings(parameters).stack


def run(stack, q, steps):
    largest = 0.0
    for _ in range(steps):
        command = stack.step(q).command
        largest = max(largest, float(np.abs(command).max()))
        q = q + command / RATE
    return q, largest


@pytest.mark.parametrize(('robot', 'start'), [(UR10, BENT), (BAXTER, np.full(7, 0.1))])
def test_links_that_always_overlap_neither_drive_the_arm_nor_freeze_it(robot, start):
    stack = stack_of(robot)
    q, largest = run(stack, start, 20)
    assert largest < STILL
    (notice,) = stack.tasks['self'].take_notices()
    assert stack.tasks['self'].warnings == (notice,)
    assert stack.tasks['self'].take_notices() == []
    goal = start + 0.05
    stack.tasks['arm'].target = goal
    q, _ = run(stack, q, 800)
    np.testing.assert_allclose(q, goal, atol=0.01)


def test_the_notice_is_one_line_with_the_pairs_to_be_ignored():
    stack = stack_of(UR10)
    stack.step(BENT)
    (notice,) = stack.tasks['self'].take_notices()
    assert notice.startswith('tasks.self: nearer than 0.00')
    assert 'base_link - upper_arm_link (-0.019 m)' in notice
    assert notice.endswith('ignore: ["base_link upper_arm_link"]')
    assert '\n' not in notice
    row = stack.tasks['self'].components.index('base_link - upper_arm_link')
    assert np.isinf(stack.tasks['self'].distances()[row])
    clean = stack_of(UR10, ignore=['base_link upper_arm_link'])
    clean.step(BENT)
    assert clean.tasks['self'].take_notices() == []


def test_asked_for_they_are_pushed_apart():
    stack = stack_of(UR10, push_apart=True)
    _, largest = run(stack, BENT, 5)
    assert largest > 0.01
    assert 'pushed apart:' in stack.tasks['self'].take_notices()[0]


FOLDED, OPEN, APART = [0.0, 3.05, 0.0], [0.0, 2.0, 0.0], 'link_1 - link_3'


def planar(**task):
    """An arm whose last link lies on its first when it is folded."""
    zeros = [0.0] * 3
    robot = {
        'joints': ['joint_1', 'joint_2', 'joint_3'],
        'dh': {
            'theta': zeros,
            'd': zeros,
            'a': [1.0, 0.5, 0.4],
            'alpha': zeros,
            'types': ['revolute'] * 3,
        },
        'limits': {'velocity': [1.0], 'acceleration': [10.0]},
        'link_radius': [0.05],
    }
    return stack_of(robot, **task)


def test_a_pair_that_has_been_apart_is_kept_like_every_other():
    stack = planar()
    task = stack.tasks['self']
    q, largest = run(stack, np.array(FOLDED), 10)
    assert largest < STILL
    assert APART in task.take_notices()[0]
    assert np.isinf(task.distance).all()
    stack.tasks['arm'].target = OPEN
    q, _ = run(stack, q, 300)
    assert task.take_notices() == [f'tasks.self: apart, and kept from now on: {APART}']
    assert task.warnings == ()
    assert task.distance[0] > 0.1
    stack.tasks['arm'].target = FOLDED
    q, _ = run(stack, q, 500)
    assert 0.0 < task.distance[0] < 0.02
    assert q[1] < 3.05


def test_a_pair_with_a_gap_below_the_margin_may_not_touch_but_is_not_pushed():
    stack = planar(margin=0.2, activation=0.4)
    task = stack.tasks['self']
    q, largest = run(stack, np.array([0.0, 2.6, 0.0]), 5)
    assert 0.0 < task.distance[0] < 0.2
    assert largest < STILL
    stack.tasks['arm'].target = FOLDED
    q, _ = run(stack, q, 500)
    assert 0.0 < task.distance[0] < 0.05


def test_links_that_touch_an_obstacle_at_the_first_joint_state_are_named():
    ball = {'type': 'obstacle', 'whole_arm': True, 'radius': 0.2, 'center': [0.5, 0.1, 0.0]}
    robot = {'joints': ['turn', 'bend'], 'link_radius': [0.05], 'limits': {'velocity': [1.0]}}
    zeros = [0.0, 0.0]
    robot['dh'] = {
        'theta': zeros,
        'd': zeros,
        'a': [1.0, 1.0],
        'alpha': zeros,
        'types': ['revolute'] * 2,
    }
    stack = build_settings(
        {'rate': RATE, 'robot': robot, 'hierarchy': ['ball'], 'tasks': {'ball': ball}}
    ).stack
    stack.step(np.zeros(2))
    (notice,) = stack.tasks['ball'].take_notices()
    assert notice.startswith('tasks.ball: nearer than')
    assert 'link_1 (-0.15 m)' in notice
    assert notice.endswith('links: [link_2]')
    assert stack.tasks['ball'].warnings == (notice,)


def test_a_margin_that_absurd_speeds_make_necessary_is_told_in_one_line():
    robot = {'urdf': BAXTER['urdf'], 'joints': ['head_pan', 'left_s0', 'left_s1']}
    (warning,) = stack_of(robot).tasks['self'].warnings
    assert 'tasks.self.margin:' in warning
    assert 'head_pan may turn at 10000 rad/s' in warning
