"""Configurations that have goals: each found is one, and a no says why."""

import json
from functools import cache
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tp_controller import (
    InvalidValue,
    JointTask,
    OrientationTask,
    PositionTask,
    PostureTask,
    Stack,
    build_settings,
    read_parameter_file,
)
from tp_controller.planning import solve
from tp_controller.planning.command import main
from tp_controller.robot.draws import random_configuration

CONFIG = Path(__file__).resolve().parents[2] / 'config'
READY = np.array([0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785])

seeds = st.integers(0, 10_000)


@cache
def shipped(name):
    """Stack of a parameter file."""
    return build_settings(read_parameter_file(CONFIG / f'{name}.yaml', 'tp_controller')).stack


def at_random(robot, seed):
    rng = np.random.default_rng(seed)
    return random_configuration(robot, rng), random_configuration(robot, rng)


def pose(robot, frame, q):
    """Pose of a frame by Pinocchio alone."""
    model, data = robot.model, robot.model.createData()
    pin.framesForwardKinematics(model, data, np.asarray(q))
    return data.oMf[model.getFrameId(frame)].copy()


@pytest.mark.parametrize(
    ('name', 'task', 'frame'),
    [
        ('panda_pose', 'hand_pose', 'panda_hand_tcp'),
        ('ur5_pose', 'tool_pose', 'tool0'),
    ],
)
@settings(max_examples=12)
@given(seed=seeds)
def test_every_solution_has_the_pose_inside_the_ranges(name, task, frame, seed):
    stack = shipped(name)
    robot = stack.robot
    start, end = at_random(robot, seed)
    wanted = pose(robot, frame, end)
    quaternion = pin.Quaternion(wanted.rotation).coeffs()
    answer = solve(stack, {task: [*wanted.translation, *quaternion]}, start)
    assert answer.solutions
    for one in answer.solutions:
        assert np.all(robot.limits.position_min <= one.q)
        assert np.all(one.q <= robot.limits.position_max)
        missed = wanted.actInv(pose(robot, frame, one.q))
        assert np.linalg.norm(pin.log6(missed).vector) < 1e-5
    costs = [one.cost for one in answer.solutions]
    assert costs == sorted(costs)
    for i, one in enumerate(answer.solutions):
        for other in answer.solutions[:i]:
            assert np.abs(one.q - other.q).max() > 0.2


@settings(max_examples=12)
@given(seed=seeds)
def test_every_solution_keeps_the_distances(seed):
    stack = shipped('panda_table')
    robot = stack.robot
    start, end = at_random(robot, seed)
    place = pose(robot, 'panda_hand_tcp', end).translation
    model = robot.model
    geometry = pin.GeometryModel()
    pillar = stack.tasks['pillar'].obstacle
    ball = stack.tasks['ball'].obstacle
    for i, obstacle in enumerate((pillar, ball)):
        shape = pin.GeometryObject(f'{i}', 0, obstacle.pose, obstacle.geometry())
        geometry.addGeometryObject(shape)
    for link, shapes in robot.bodies.items():
        frame = model.frames[model.getFrameId(link)]
        if frame.parentJoint == 0:
            continue
        for shape in shapes:
            name, moved = f'{link} {geometry.ngeoms}', frame.placement * shape.pose
            object_ = pin.GeometryObject(name, frame.parentJoint, moved, shape.geometry())
            number = geometry.addGeometryObject(object_)
            for i in range(2):
                geometry.addCollisionPair(pin.CollisionPair(i, number))
    answer = solve(stack, {'hand_position': place}, start, seconds=0.3)
    data, results = model.createData(), geometry.createData()
    for one in answer.solutions:
        assert np.linalg.norm(pose(robot, 'panda_hand_tcp', one.q).translation - place) < 1e-5
        pin.updateGeometryPlacements(model, data, geometry, results, one.q)
        pin.computeDistances(geometry, results)
        assert min(found.min_distance for found in results.distanceResults) > 0.0
        assert one.clearance >= 0.0


def test_the_stack_stays_at_rest_in_a_solution():
    stack = shipped('panda_pose')
    start, end = at_random(stack.robot, 3)
    stack.robot.update(end)
    goal = stack.tasks['hand_pose'].current
    best = solve(stack, {'hand_pose': goal}, start).best
    own = build_settings(read_parameter_file(CONFIG / 'panda_pose.yaml', 'tp_controller')).stack
    own.tasks['hand_pose'].target = goal
    own.tasks['posture'].target = best.q
    assert np.abs(own.step(best.q).command).max() < 1e-4


def test_stack_and_robot_stay_as_they_are():
    stack = shipped('panda_table')
    stack.robot.update(READY)
    before = {name: task.target for name, task in stack.tasks.items()}
    solve(stack, {'hand_position': [0.45, 0.25, 0.1]}, READY + 0.1)
    assert np.array_equal(stack.robot.q, READY)
    for name, task in stack.tasks.items():
        assert np.array_equal(task.target, before[name])


def test_a_joint_that_turns_goes_the_shorter_way():
    stack = shipped('ur5_pose')
    start = np.array([3.0, -1.0, 1.0, -1.0, -1.5, 0.0])
    stack.robot.update(start + np.array([-2.0 * np.pi + 0.2, 0.0, 0.0, 0.0, 0.0, 0.0]))
    best = solve(stack, {'tool_pose': stack.tasks['tool_pose'].current}, start).best
    assert np.allclose(best.q, start + np.array([0.2, 0.0, 0.0, 0.0, 0.0, 0.0]), atol=1e-5)


def stack_with(levels, **changes):
    robot = shipped('panda_pose').robot
    tasks = {
        'place': PositionTask('place', robot, 'panda_hand_tcp'),
        'elbow': JointTask('elbow', robot, ['panda_joint4'], target=[-2.0]),
        'down': OrientationTask(
            'down', robot, 'panda_hand_tcp', axes='xy', target=[1.0, 0.0, 0.0, 0.0]
        ),
        'posture': PostureTask('posture', robot),
    }
    return Stack(robot, [tasks[name] for name in levels], rate=200.0)


def test_levels_above_hold_in_a_solution():
    stack = stack_with(['down', 'place', 'posture'])
    answer = solve(stack, {'place': [0.5, 0.2, 0.3]}, READY)
    for one in answer.solutions:
        axis = pose(stack.robot, 'panda_hand_tcp', one.q).rotation[:, 2]
        assert np.allclose(axis, [0.0, 0.0, -1.0], atol=1e-5)


def test_levels_below_need_not_hold():
    stack = stack_with(['place', 'down', 'posture'])
    assert solve(stack, {'place': [0.2, 0.1, 1.0]}, READY).solutions


@pytest.mark.parametrize(
    ('name', 'goals', 'reasons', 'words'),
    [
        ('panda_table', {'hand_position': [2.0, 0.0, 0.5]}, (), 'out of reach'),
        ('panda_table', {'hand_position': [0.5, 0.3, 0.6]}, ('ball',), 'because of ball'),
        ('panda_table', {'hand_position': [0.3, 0.3, -0.2]}, ('table',), 'because of table'),
    ],
)
def test_a_no_says_why(name, goals, reasons, words):
    answer = solve(shipped(name), goals, READY, seconds=0.8)
    assert not answer.solutions
    assert answer.reasons == reasons
    assert words in answer.text
    assert 'none found in' in answer.text


def test_a_no_names_the_level_above():
    answer = solve(
        stack_with(['elbow', 'place', 'posture']), {'place': [0.84, 0.0, 0.3]}, READY, 0.8
    )
    assert answer.reasons == ('elbow',)
    assert 'elbow above it' in answer.text


def test_a_no_names_the_joint_whose_range_is_too_small():
    stack = stack_with(['elbow', 'posture'])
    answer = solve(stack, {'elbow': [0.5]}, READY, 0.4)
    assert answer.reasons == ('panda_joint4',)
    assert 'the range of panda_joint4' in answer.text


@pytest.mark.parametrize(
    ('goals', 'key'),
    [
        ({}, 'goals'),
        ({'nobody': [0.0]}, 'goals'),
        ({'table': [0.0, 0.0, 0.0]}, 'goals'),
        ({'hand_position': [0.0]}, 'hand_position.target'),
        ({'hand_position': [0.0, 0.0, float('nan')]}, 'hand_position.target'),
    ],
)
def test_a_goal_that_cannot_be_used_is_refused(goals, key):
    with pytest.raises(InvalidValue) as caught:
        solve(shipped('panda_table'), goals, READY)
    assert caught.value.key == key


def test_the_command_prints_solutions_as_json(capsys):
    words = [str(CONFIG / 'a4_position_joint.yaml'), 'ee_position', '0.3', '1.2']
    assert main([*words, 'joint_1_position', '0.8', '--json']) == 0
    found = json.loads(capsys.readouterr().out)
    assert found['found']
    assert all(abs(one['q'][0] - 0.8) < 1e-6 for one in found['solutions'])


def test_the_command_says_no_and_why(capsys):
    words = [str(CONFIG / 'a4_position_joint.yaml'), 'ee_position', '5', '0', '--seconds', '0.3']
    assert main(words) == 1
    assert 'out of reach' in capsys.readouterr().out


@pytest.mark.parametrize(
    ('words', 'message'),
    [
        (['1.0', '2.0'], 'a task first'),
        (['ee_position', '1.0', '0.0', 'ee_position', '1.0'], 'twice'),
        (['ee_position', '1.0'], 'accepts 2 values'),
        (['nobody', '1.0'], "got 'nobody'"),
    ],
)
def test_the_command_refuses_in_one_line(words, message, capsys):
    assert main([str(CONFIG / 'a4_position_joint.yaml'), *words]) == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.count('\n') == 1
