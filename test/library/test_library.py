"""The library as people use it: robots, tasks and a stack made without parameter files."""

import math
import re

import numpy as np
import pytest
from hypothesis import given
from random_stacks import examples, states

from tp_controller import (
    InvalidValue,
    JointLimitsTask,
    JointTask,
    ObstacleTask,
    OrientationTask,
    PoseTask,
    PositionTask,
    PostureTask,
    Robot,
    SelfCollisionTask,
    Stack,
    UnusableState,
    build_settings,
)

LINKS = [0.75, 0.5, 0.5]
Q = np.array([0.1, 0.6, 0.3])
PANDA = 'package://example-robot-data/robots/panda_description/urdf/panda.urdf'


def planar(limits=None, **others):
    return Robot.from_dh(LINKS, limits={'velocity': 1.0} if limits is None else limits, **others)


def test_the_example_of_the_readme_has_at_most_15_lines_and_reaches_its_targets(
    repository, capsys
):
    readme = (repository / 'README.md').read_text(encoding='utf-8')
    blocks = re.findall(r'```python\n(.*?)```', readme, flags=re.DOTALL)
    (example,) = [block for block in blocks if 'tp_sim' not in block]
    assert len(example.splitlines()) <= 15
    exec(compile(example, 'README.md', 'exec'), {})
    errors = [float(word) for word in re.findall(r'-?\d\.\d*(?:e-?\d+)?', capsys.readouterr().out)]
    assert len(errors) == 10
    assert max(map(abs, errors)) < 2e-3


@given(states(3))
@examples(30)
def test_a_stack_made_of_objects_is_the_one_made_of_parameters(q):
    zeros = [0.0] * 3
    dh = {'theta': zeros, 'd': zeros, 'a': LINKS, 'alpha': zeros, 'types': ['revolute'] * 3}
    joints = ['joint_1', 'joint_2', 'joint_3']
    block = {
        'rate': 100.0,
        'robot': {'joints': joints, 'dh': dh, 'limits': {'velocity': [1.0]}},
        'hierarchy': ['tip + elbow', 'turn'],
        'tasks': {
            'tip': {
                'type': 'position',
                'frame': 'link_3',
                'axes': 'xy',
                'target': [1.0, 0.5],
                'gain': [2.0, 3.0],
                'feedforward': [0.1, 0.2],
            },
            'elbow': {'type': 'joint', 'joints': ['joint_2'], 'target': [0.4], 'gain': [4.0]},
            'turn': {'type': 'orientation', 'frame': 'link_2', 'axes': 'z', 'target': [0.3]},
        },
    }
    robot = planar()
    tip = PositionTask(
        'tip', robot, 'link_3', 'xy', target=[1.0, 0.5], gain=[2.0, 3.0], feedforward=[0.1, 0.2]
    )
    elbow = JointTask('elbow', robot, ['joint_2'], target=[0.4], gain=4.0)
    turn = OrientationTask('turn', robot, 'link_2', 'z', target=[0.3])
    step = Stack(robot, [[tip, elbow], turn], rate=100.0).step(q)
    expected = build_settings(block).stack.step(q)
    np.testing.assert_array_equal(step.command, expected.command)
    assert [level.tasks for level in step.levels] == [('tip', 'elbow'), ('turn',)]


def test_a_task_without_a_target_takes_its_value_at_the_first_step():
    robot = planar()
    hand = PoseTask('hand', robot, 'link_3', 'xy', 'z')
    stack = Stack(robot, [hand])
    assert hand.target is None
    assert not stack.step(Q).command.any()
    np.testing.assert_allclose(hand.target[2], Q.sum())


def test_every_scheme_can_be_had_by_name():
    robot = planar()
    tip = PositionTask('tip', robot, 'link_3', 'xy', target=[1.0, 0.5])
    for scheme in ('recursive', 'augmented', 'weighted', 'hqp'):
        step = Stack(robot, [tip], scheme).step(Q)
        np.testing.assert_allclose(step.levels[0].achieved, step.levels[0].requested, rtol=0.2)
    with pytest.raises(InvalidValue, match='recursive, augmented'):
        Stack(robot, [tip], 'best')


def test_a_task_takes_the_rate_of_its_stack():
    robot = planar()
    tip = PositionTask('tip', robot, 'link_3', 'xy')
    Stack(robot, [tip], rate=50.0)
    assert tip.period == 0.02


def test_set_based_tasks_keep_their_sets_on_the_way_to_a_target_beyond():
    robot = planar({'velocity': 1.0, 'position_min': -2.0, 'position_max': [2.0, 2.5, 2.5]})
    tip = PositionTask('tip', robot, 'link_3', 'xy', target=[0.0, 1.2])
    ball = ObstacleTask('ball', robot, 'link_3', [0.9, 1.0], 0.2, 'xy', period=0.01)
    ends = JointLimitsTask('ends', robot, period=0.01)
    stack, q = Stack(robot, [[ball, ends], [tip]], rate=100.0), Q.copy()
    for _ in range(800):
        q += stack.step(q).command / 100.0
        assert ball.distance[0] > 0.0
        assert (ends.distance > 0.0).all()
    assert np.abs(tip.error).max() < 1e-2


def test_a_robot_of_a_urdf_knows_its_limits_and_the_shapes_of_its_links():
    robot = Robot.from_urdf(PANDA, joints=[f'panda_joint{i}' for i in range(1, 8)])
    assert robot.n == 7
    assert math.isclose(robot.limits.velocity[0], 2.175)
    assert 'panda_link5' in robot.bodies
    faster = Robot.from_urdf(PANDA, limits={'velocity': 1.0}, link_radius=0.05)
    assert (faster.limits.velocity == 1.0).all()
    assert SelfCollisionTask('apart', faster, period=0.01).k > 3


@pytest.mark.parametrize(
    ('make', 'fragment'),
    [
        (lambda: Robot.from_dh(LINKS, limits={'speed': 1.0}), "got 'speed'; accepts some of vel"),
        (lambda: Robot.from_dh(LINKS, d=[0.0]), '3'),
        (lambda: Robot.from_urdf('/no/such.urdf'), '/no/such.urdf'),
        (lambda: Stack(planar(), [PostureTask('p', planar())]), 'another robot'),
        (lambda: Stack(planar(), [], rate=0.0), 'rate'),
        (lambda: PostureTask('p', planar(), gain=-1.0), 'gain'),
        (lambda: PostureTask('p', planar(), target=[1.0]), 'target'),
        (lambda: JointLimitsTask('l', planar(), lower=[-1.0], period=0.01, target=[1.0]), 'none'),
    ],
)
def test_what_cannot_be_used_is_refused_in_one_line(make, fragment):
    with pytest.raises(InvalidValue) as caught:
        make()
    assert fragment in str(caught.value)
    assert '\n' not in str(caught.value)


def stack_of(*names, robot=None, **settings):
    robot = planar() if robot is None else robot
    return Stack(robot, [PostureTask(name, robot, **settings) for name in names], rate=10.0)


def test_names_and_rates_that_do_not_fit_are_refused():
    robot = planar()
    with pytest.raises(InvalidValue, match=r'tasks\.a: got a second task of that name'):
        stack_of('a', 'a', robot=robot)
    with pytest.raises(InvalidValue, match='names of up to 80 letters'):
        stack_of('a + b')
    with pytest.raises(InvalidValue, match=r'tasks\.a\.gain'):
        stack_of('a', gain=25.0)
    ball = ObstacleTask('ball', robot, 'link_3', [0.9, 1.0, 0.0], 0.2, period=0.01)
    with pytest.raises(InvalidValue, match=r'tasks\.ball: got a period of 0\.01 s'):
        Stack(robot, [ball], rate=50.0)
    task = PostureTask('twice', robot)
    with pytest.raises(InvalidValue, match="'twice' twice"):
        Stack(robot, [task, task])


def test_an_unknown_setting_of_a_task_is_a_type_error():
    with pytest.raises(TypeError, match=r"PostureTask\(\) got an .* 'gian'"):
        PostureTask('p', planar(), gian=1.0)


def test_the_command_of_a_refused_state_is_the_callers_own():
    robot = planar({'velocity': 1.0, 'acceleration': 1.0})
    stack = Stack(
        robot, [PositionTask('tip', robot, 'link_3', 'xy', target=[1.0, 0.5])], rate=50.0
    )
    q = Q.copy()
    for _ in range(30):
        q += stack.step(q, 0.02).command / 50.0
    with pytest.raises(UnusableState) as caught:
        stack.step(q + 3.0, 0.02)
    command = caught.value.command
    kept = command.copy()
    for _ in range(5):
        stack.brake(0.02)
    np.testing.assert_array_equal(command, kept)
