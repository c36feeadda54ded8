"""Closed loops of robots whose base moves, against bodies moved by matrices."""

import re

import numpy as np
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st
from poses import Body, pose

from tp_controller import (
    JointLimitsTask,
    JointTask,
    ObstacleTask,
    PoseTask,
    PositionTask,
    PostureTask,
    Robot,
    Stack,
)
from tp_controller.config import build_settings, read_parameter_file
from tp_controller.errors import InvalidValue, UnusableState
from tp_controller.parameters import flatten
from tp_controller.robot import Response

BASES = ('planar', 'differential', 'floating')
COUNTS = {'planar': 3, 'differential': 2, 'floating': 6}
LENGTHS = (0.4, 0.35)
RATE = 100.0
DT = 1.0 / RATE
ROUNDING = 1e-9
seeds = st.integers(0, 2**32 - 1)


def mobile(kind, foot=0.2, velocity=1.0, acceleration=5.0):
    return Robot.from_dh(
        a=LENGTHS,
        base=kind,
        base_pose=[foot, 0.0, 0.0, 0.0, 0.0, 0.0],
        limits={
            'velocity': velocity,
            'acceleration': acceleration,
            'position_min': -2.5,
            'position_max': 2.5,
        },
    )


def run(stack, body, seconds, see=lambda *_: None):
    """Let a stack move a body; velocities and accelerations stay within their limits."""
    limits, before = stack.robot.limits, np.zeros(stack.robot.n)
    for _ in range(round(seconds * RATE)):
        command = stack.step(body.q, DT).command
        assert not stack.arm.notice
        assert np.all(np.abs(command) <= limits.velocity * (1.0 + ROUNDING))
        change = limits.acceleration * DT * (1.0 + ROUNDING)
        assert np.all(np.abs(command - before) <= change + 1e-12)
        see(body, command)
        before, body = command, body.after(command, DT)
        assert np.all(np.abs(body.joints) <= 2.5)
    return body


def test_the_hand_of_a_floating_base_reaches_a_pose():
    robot = mobile('floating')
    target = pose([0.5, -0.4, 0.7, 0.2, -0.3, 0.5, 0.7])
    goal = [0.5, -0.4, 0.7, 0.2, -0.3, 0.5, 0.7]
    hand = PoseTask('hand', robot, 'link_2', target=goal, gain=2.0)
    stack = Stack(robot, [hand, PostureTask('posture', robot, target=[0.5, -1.0])], rate=RATE)
    body = run(stack, Body('floating', LENGTHS, [0.3, -0.6], foot=0.2), 10.0)
    assert body.hand == pytest.approx(target, abs=1e-3)
    assert body.joints == pytest.approx([0.5, -1.0], abs=1e-2)


@pytest.mark.parametrize('turns', [0.0, 2.0, -3.0])
def test_a_floating_base_has_no_attitude_that_it_cannot_turn_through(turns):
    robot = mobile('floating')
    spin = JointTask('far', robot, ['base/x'], target=[1.0])
    stack = Stack(robot, [spin, PostureTask('posture', robot, target=[0.0, 0.0])], rate=RATE)
    body = Body('floating', LENGTHS, [0.0, 0.0], foot=0.2)
    body.base = pose([0.0, 0.0, 0.0, 0.0, np.sin(turns / 2), 0.0, np.cos(turns / 2)])
    body = run(stack, body, 8.0)
    assert body.base[0, 3] == pytest.approx(1.0, abs=1e-3)


@pytest.mark.parametrize('kind', BASES)
@given(seed=seeds)
@settings(max_examples=3)
def test_the_hand_reaches_goals_around_it(kind, seed):
    rng = np.random.default_rng(seed)
    robot = mobile(kind)
    goal = rng.uniform(-1.5, 1.5, 2)
    hand = PositionTask('hand', robot, 'link_2', axes='xy', target=goal, gain=2.0)
    stack = Stack(robot, [hand], rate=RATE)
    body = run(stack, Body(kind, LENGTHS, rng.uniform(0.4, 1.2, 2), foot=0.2), 12.0)
    assert body.hand[:2, 3] == pytest.approx(goal, abs=2e-3)


@pytest.mark.parametrize('kind', BASES)
@given(seed=seeds)
@settings(max_examples=4)
def test_the_hand_and_the_base_stay_out_of_circles_between_samples_too(kind, seed):
    rng = np.random.default_rng(seed)
    robot = mobile(kind, velocity=1.5, acceleration=3.0)
    goal = rng.uniform(-1.5, 1.5, 2)
    body = Body(kind, LENGTHS, rng.uniform(-1.2, 1.2, 2), foot=0.2)
    # Between the hand and its goal, and in the way of the base.
    center, radius = body.hand[:2, 3] + 0.5 * (goal - body.hand[:2, 3]), 0.15
    away = np.linalg.norm(center - body.hand[:2, 3]) - radius
    near = np.linalg.norm(center) - radius
    tasks = [PositionTask('hand', robot, 'link_2', axes='xy', target=goal, gain=3.0)]
    for name, frame, room in (('tip', 'link_2', away), ('foot', 'base', near)):
        if room > 0.05:
            tasks.insert(
                0,
                ObstacleTask(name, robot, frame, center, radius, axes='xy', period=DT),
            )
    stack = Stack(robot, tasks, rate=RATE)
    kept = {task.name for task in tasks}
    least = [np.inf]

    def see(body, command):
        for share in (0.25, 0.5, 0.75, 1.0):
            later = body.after(command, share * DT)
            places = {'tip': later.hand, 'foot': later.base}
            for name in kept & places.keys():
                least[0] = min(least[0], np.linalg.norm(places[name][:2, 3] - center) - radius)

    run(stack, body, 6.0, see)
    assert least[0] > 0.0


@pytest.mark.parametrize('kind', BASES)
def test_a_base_that_is_late_stays_clear_of_what_it_is_told_of(kind):
    robot = mobile(kind, velocity=1.5, acceleration=3.0)
    delay, lag = 3, 0.05
    robot.response = Response.of(robot.n, delay=[delay * DT], lag=[lag])
    center, radius = np.array([1.2, 0.05]), 0.3
    hand = PositionTask('hand', robot, 'link_2', axes='xy', target=[1.9, -0.4], gain=3.0)
    clear = ObstacleTask('clear', robot, 'link_2', center, radius, axes='xy', period=DT)
    stack = Stack(robot, [clear, hand], rate=RATE)
    body = Body(kind, LENGTHS, [0.8, -1.0], foot=0.2)
    line, speed, least = [np.zeros(robot.n)] * delay, np.zeros(robot.n), np.inf
    fine = 10
    for _ in range(800):
        line.append(stack.step(body.q, DT, speed).command)
        command = line.pop(0)
        for _ in range(fine):
            # The lag in small steps, each with its mean velocity.
            behind = speed - command
            h = DT / fine
            mean = command + behind * lag / h * (1.0 - np.exp(-h / lag))
            body, speed = body.after(mean, h), command + behind * np.exp(-h / lag)
            least = min(least, np.linalg.norm(body.hand[:2, 3] - center) - radius)
    assert least > 0.0
    assert stack.arm.following


@pytest.mark.parametrize('kind', ['planar', 'differential'])
def test_yaw_is_a_joint_that_goes_the_short_way(kind):
    robot = mobile(kind)
    turn = JointTask('turn', robot, ['base/yaw', 'joint_1'], target=[3.0, 0.5], gain=2.0)
    stack = Stack(robot, [turn], rate=RATE)
    body = Body(kind, LENGTHS, [0.0, 0.0], foot=0.2)
    body.base = pose([0.3, -0.2, -3.0])
    turns = []
    body = run(stack, body, 6.0, lambda _, command: turns.append(command[-3]))
    assert body.q[2] == pytest.approx(3.0, abs=1e-3)
    assert np.all(np.array(turns) <= 1e-12)


def test_a_planar_base_goes_to_a_place():
    robot = mobile('planar')
    place = JointTask(
        'place', robot, ['base/x', 'base/y', 'base/yaw'], target=[0.7, -0.5, 1.0], gain=2.0
    )
    stack = Stack(robot, [place], rate=RATE)
    body = run(stack, Body('planar', LENGTHS, [0.2, 0.4], foot=0.2), 8.0)
    assert body.q[:3] == pytest.approx([0.7, -0.5, 1.0], abs=1e-3)


@pytest.mark.parametrize('kind', BASES)
def test_a_base_stays_inside_a_range_of_its_place(kind):
    robot = mobile(kind)
    fence = JointLimitsTask(
        'fence', robot, ['base/x', 'base/y', 'joint_1'], [-0.3, -0.3, -1.0], [0.3, 0.3, 1.0], DT
    )
    hand = PositionTask('hand', robot, 'link_2', axes='xy', gain=3.0)
    stack = Stack(robot, [fence, hand], rate=RATE)
    body = Body(kind, LENGTHS, [0.4, 0.8], foot=0.2)
    reach = [np.zeros(2)]

    def see(body, command):
        for share in (0.5, 1.0):
            later = body.after(command, share * DT)
            reach[0] = np.maximum(reach[0], np.abs(later.base[:2, 3]))
            assert abs(later.joints[0]) <= 1.0

    for goal in ([2.0, 0.5], [-2.0, 1.0], [0.0, -2.0], [0.3, 0.2]):
        hand.target = goal
        body = run_on(stack, body, 4.0, see)
    assert np.all(reach[0] <= 0.3)
    assert reach[0].max() > 0.28


def run_on(stack, body, seconds, see):
    for _ in range(round(seconds * RATE)):
        command = stack.step(body.q, DT).command
        see(body, command)
        body = body.after(command, DT)
    return body


@pytest.mark.parametrize(
    ('kind', 'joint', 'line'),
    [
        (
            'differential',
            'base/x',
            "joints: got 'base/x' of a differential drive, which cannot move across; accepts some "
            'of base/yaw, joint_1, joint_2, or a position task of a frame in front of the axle',
        ),
        (
            'floating',
            'base/qx',
            "joints: got 'base/qx', a part of a rotation; accepts some of base/x, base/y, base/z, "
            'joint_1, joint_2, or an orientation task',
        ),
        (
            'planar',
            'base/forward',
            "joints: got 'base/forward'; accepts some of base/x, base/y, base/yaw, joint_1, "
            'joint_2',
        ),
    ],
)
def test_a_joint_task_that_cannot_be_had_is_refused_in_one_line(kind, joint, line):
    with pytest.raises(InvalidValue) as error:
        JointTask('base', mobile(kind), [joint])
    assert str(error.value) == line


def test_a_posture_is_that_of_the_joints():
    assert PostureTask('posture', mobile('differential')).components == ('joint_1', 'joint_2')


def test_a_base_turns_on_where_its_yaw_begins_anew():
    robot = mobile('planar')
    turn = JointTask('turn', robot, ['base/yaw'], feedforward=[1.0], gain=1e-9)
    stack = Stack(robot, [turn], rate=RATE)
    # More than a turn: the measured yaw goes on at -pi.
    body = run(stack, Body('planar', LENGTHS, [0.0, 0.0]), 8.0)
    assert stack.arm.following
    assert body.q[2] == pytest.approx(8.0 - 2.0 * np.pi, abs=0.3)


def test_a_quaternion_without_a_length_is_no_state():
    robot = mobile('floating')
    stack = Stack(robot, [PostureTask('posture', robot, target=[0.0, 0.0])], rate=RATE)
    q = robot.neutral
    stack.step(q)
    q[3:7] = 0.0
    with pytest.raises(UnusableState, match='no joint can be at the position'):
        stack.step(q, DT)
    q[6] = 1.0
    assert stack.step(q, DT).command == pytest.approx(np.zeros(8))


def test_a_base_that_jumps_is_braked():
    robot = mobile('differential')
    hand = PositionTask('hand', robot, 'link_2', axes='xy', target=[2.0, 1.0])
    stack = Stack(robot, [hand], rate=RATE)
    body = Body('differential', LENGTHS, [0.4, 0.4], foot=0.2)
    body = run(stack, body, 1.0)
    q = body.q
    q[0] += 0.5
    with pytest.raises(UnusableState, match='base/forward jumped by'):
        stack.step(q, DT)


def test_a_base_with_lag_that_moves_at_the_start_is_seen_where_it_gets_to():
    robot = mobile('planar')
    robot.response = Response.of(robot.n, lag=[0.1])
    stack = Stack(robot, [PostureTask('posture', robot)], rate=RATE)
    stack.step(robot.neutral, qd=np.array([0.5, 0.0, 0.0, 0.0, 0.0]))
    assert stack.arm.reference[0] == pytest.approx(0.05)


def test_the_tables_of_the_page_name_the_coordinates_and_velocities(repository):
    page = (repository / 'docs' / 'spaces.md').read_text(encoding='utf-8')
    for kind in BASES:
        robot = mobile(kind)
        for name in (*robot.coordinates, *robot.joints):
            leaf = name.removeprefix('base')
            assert name.startswith('joint') or f'`{leaf}`' in page or f'`<joint>{leaf}`' in page


def test_the_parameters_of_the_page_make_the_robot_of_the_example_file(repository, config):
    page = (repository / 'docs' / 'spaces.md').read_text(encoding='utf-8')
    (text,) = re.findall(r'```yaml\n(.*?)```', page, flags=re.DOTALL)
    values = read_parameter_file(config / 'mobile_planar.yaml', 'tp_controller')
    for key, value in flatten(yaml.safe_load(text)).items():
        assert values[key] == value, key


@pytest.mark.parametrize('kind', ['planar', 'differential'])
def test_an_extended_jacobian_keeps_the_gradient_of_its_objective_at_zero(config, kind):
    values = dict(read_parameter_file(config / 'mobile_planar.yaml', 'tp_controller'))
    values = {key: value for key, value in values.items() if not key.startswith('tasks.post')}
    values |= {
        'robot.base': kind,
        'robot.limits.velocity': [1.0],
        'robot.limits.acceleration': [4.0],
        'hierarchy': ['hand_position'],
        'solver.type': 'extended_jacobian',
        'solver.objective.type': 'manipulability',
        'solver.objective.gain': 3.0,
        'solver.objective.frame': 'link_2',
        'solver.objective.position_axes': 'xy',
    }
    stack = build_settings(values).stack
    stack.tasks['hand_position'].target = [0.8, 0.5]
    body = Body(kind, LENGTHS, [0.6, -0.9], foot=0.2)
    for _ in range(400):
        body = body.after(stack.step(body.q).command, DT)
    assert body.hand[:2, 3] == pytest.approx([0.8, 0.5], abs=5e-3)
    stack.step(body.q)
    gradient = np.zeros(stack.robot.n)
    stack.solver.objective.gradient(gradient)
    free = np.linalg.svd(stack.rows.J)[2][2:]
    assert free @ gradient == pytest.approx(np.zeros(len(free)), abs=1e-3)
