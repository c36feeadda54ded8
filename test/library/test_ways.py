"""Ways to goals: they keep ranges, distances, limits and what has to hold; judged by Pinocchio."""

import time
from functools import cache
from itertools import pairwise
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tp_controller import InvalidValue, Limits, build_settings, read_parameter_file
from tp_controller.planning import Kind, Phase, Planner, find_way, look_ahead, solve
from tp_controller.planning.clear import Clear
from tp_controller.planning.conditions import Conditions
from tp_controller.planning.messages import Failed, Request, asked_parameters
from tp_controller.planning.remote import RemotePlanner
from tp_controller.planning.timing import SHARE, timed
from tp_controller.robot.draws import random_configuration

CONFIG = Path(__file__).resolve().parents[2] / 'config'
READY = np.array([0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785])
BEHIND = np.array([-1.35, 0.9, 0.0, -1.3, 0.0, 2.2, 0.785])
TCP = 'panda_hand_tcp'
UPRIGHT = {
    'tasks.down.type': 'orientation',
    'tasks.down.frame': TCP,
    'tasks.down.axes': 'xy',
    'tasks.down.target': [1.0, 0.0, 0.0, 0.0],
    'hierarchy': ['ranges', 'table + pillar + ball', 'self', 'down', 'hand_position', 'posture'],
}

seeds = st.integers(0, 10_000)


def parameters(name, **changes):
    return read_parameter_file(CONFIG / f'{name}.yaml', 'tp_controller') | changes


@cache
def table():
    return build_settings(parameters('panda_table')).stack


@cache
def upright():
    return build_settings(parameters('panda_table') | UPRIGHT).stack


def surroundings(stack):
    """Model of coal with all obstacles and links, made without the library's clearances."""
    robot, model, geometry = stack.robot, stack.robot.model, pin.GeometryModel()
    obstacles = [stack.tasks[name].obstacle for name in ('pillar', 'ball')]
    for i, obstacle in enumerate(obstacles):
        geometry.addGeometryObject(
            pin.GeometryObject(f'{i}', 0, obstacle.pose, obstacle.geometry())
        )
    for link, shapes in robot.bodies.items():
        frame = model.frames[model.getFrameId(link)]
        for shape in shapes if frame.parentJoint else ():
            name, place = f'{link} {geometry.ngeoms}', frame.placement * shape.pose
            number = geometry.addGeometryObject(
                pin.GeometryObject(name, frame.parentJoint, place, shape.geometry())
            )
            for i in range(len(obstacles)):
                geometry.addCollisionPair(pin.CollisionPair(i, number))
    return geometry


def least_distance(stack, geometry, q):
    data, results = stack.robot.model.createData(), geometry.createData()
    pin.updateGeometryPlacements(stack.robot.model, data, geometry, results, q)
    pin.computeDistances(geometry, results)
    return min(found.min_distance for found in results.distanceResults)


def rotation(robot, q):
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, q)
    return data.oMf[robot.model.getFrameId(TCP)].rotation


def clear_start(stack, rng):
    """Random configuration that keeps all distances."""
    guards = [task for level in stack.members for task in level if task.set_based]
    while True:
        q = random_configuration(stack.robot, rng)
        stack.robot.update(q)
        found = []
        for task in guards:
            distance = np.empty(task.k)
            task.probe(distance, task.kept)
            found.append((distance - task.kept).min())
        if min(found) > 0.0:
            return q


def sampled(way, count):
    return [way.path.at(time) for time in np.linspace(0.0, way.duration, count)]


@settings(max_examples=10)
@given(seed=seeds)
def test_a_way_is_clear_inside_the_limits_and_ends_at_a_solution(seed):
    stack = table()
    robot, rng = stack.robot, np.random.default_rng(seed)
    start, end = clear_start(stack, rng), clear_start(stack, rng)
    robot.update(end)
    goals = {'hand_position': stack.tasks['hand_position'].current}
    answer = solve(stack, goals, start)
    with Conditions(stack, goals, start) as conditions:
        way = find_way(conditions, answer.solutions)
    assert way is not None
    geometry = surroundings(stack)
    limits = robot.limits
    for q, qd in sampled(way, 40):
        assert np.all(q >= limits.position_min)
        assert np.all(q <= limits.position_max)
        assert np.all(np.abs(qd) <= limits.velocity)
        assert least_distance(stack, geometry, q) > 0.0
    assert np.allclose(way.points[0], start, rtol=0.0, atol=1e-12)
    assert np.allclose(way.path.at(0.0)[0], start)
    assert np.allclose(way.path.at(way.duration)[0], way.solution.q)
    assert any(way.solution is one for one in answer.solutions)


def test_a_way_moves_no_task_faster_than_its_largest_speed():
    stack = build_settings(parameters('panda_table')).stack
    hand, robot = stack.tasks['hand_position'], stack.robot
    start = solve(stack, {'hand_position': [0.6, -0.15, 0.3]}, READY).best.q
    goals = {'hand_position': [0.15, -0.6, 0.35]}
    answer = solve(stack, goals, start)

    def fastest_way():
        with Conditions(stack, goals, start) as conditions:
            way = find_way(conditions, answer.solutions)
        speeds = []
        for q, qd in sampled(way, 400):
            robot.update(q)
            speeds.append(np.linalg.norm(hand.frame.jacobian[:3] @ qd))
        return way, max(speeds)

    way, before = fastest_way()
    hand.max_speed = 0.25 * before
    slower, speed = fastest_way()
    assert 0.24 * before < speed < 0.252 * before
    assert slower.duration > way.duration


def test_a_way_leads_around_what_is_between():
    stack = table()
    # On both sides of the pillar, the hand low.
    goals = {'hand_position': [0.15, -0.6, 0.35]}
    start = solve(stack, {'hand_position': [0.6, -0.15, 0.3]}, READY).best.q
    answer = solve(stack, goals, start)
    with Conditions(stack, goals, start) as conditions:
        clear = Clear(conditions)
        blocked = [one for one in answer.solutions if clear.way(start, one.q) is None]
        assert blocked
        way = find_way(conditions, blocked)
    assert way is not None
    assert way.planned
    assert len(way.points) > 2
    geometry = surroundings(stack)
    assert min(least_distance(stack, geometry, q) for q, _ in sampled(way, 60)) > 0.0


def test_tasks_above_hold_on_the_way():
    stack = upright()
    robot = stack.robot
    start = solve(stack, {'hand_position': [0.45, 0.0, 0.2]}, READY).best.q
    goals = {'hand_position': [0.2, -0.6, 0.4]}
    answer = solve(stack, goals, start)
    with Conditions(stack, goals, start) as conditions:
        way = find_way(conditions, answer.solutions)
    assert way is not None
    assert way.holding == ('down',)
    for q, _ in sampled(way, 60):
        assert np.degrees(np.arccos(np.clip(-rotation(robot, q)[2, 2], -1.0, 1.0))) < 0.5


def test_a_task_above_that_does_not_hold_now_need_not_on_the_way():
    stack = upright()
    goals = {'hand_position': [0.45, 0.0, 0.3]}
    start = READY + np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.5, 0.0])
    answer = solve(stack, goals, start)
    with Conditions(stack, goals, start) as conditions:
        way = find_way(conditions, answer.solutions)
    assert way is not None
    assert way.holding == ()


@settings(max_examples=60)
@given(
    points=st.lists(
        st.lists(st.floats(-3.0, 3.0), min_size=3, max_size=3), min_size=1, max_size=7
    ),
    speeds=st.lists(st.floats(0.2, 3.0), min_size=3, max_size=3),
    rises=st.lists(st.floats(0.5, 20.0), min_size=3, max_size=3),
    rest=st.booleans(),
)
def test_a_timed_way_keeps_speeds_and_accelerations_and_begins_and_ends_at_rest(
    points, speeds, rises, rest
):
    points = np.array(points)
    limits = Limits(3, velocity=speeds, acceleration=rises)
    path = timed(points, limits, lambda _: not rest)
    times = path.times
    assert np.allclose(path.at(0.0)[0], points[0])
    assert np.allclose(path.at(float(times[-1]))[0], points[-1])
    if len(times) == 1:
        return  # it is there already
    rates = np.array([path.at(float(time) - 1e-12)[1] for time in times[1:]])
    assert np.all(np.abs(rates) <= SHARE * limits.velocity + 1e-6)
    for first, last in pairwise(times):
        a, b = (path.at(float(first + share * (last - first)))[1] for share in (0.25, 0.75))
        rise = (b - a) / (0.5 * (last - first))
        assert np.all(np.abs(rise) <= SHARE * limits.acceleration + 1e-5)
    assert np.allclose(rates[-1], 0.0, atol=1e-6)
    if rest:
        # Every point is met exactly.
        values = np.array([path.at(float(time))[0] for time in times])
        for point in points:
            assert np.abs(values - point).max(axis=1).min() < 1e-6


def test_a_look_ahead_at_a_lower_rate_is_not_trusted_where_a_task_above_is_disturbed():
    planner = Planner(parameters('panda_table') | UPRIGHT | {'tasks.down.gain': [3.0]})
    start = [2.51045531, 0.63846323, 0.75566278, -1.7830415, -0.5324533, 2.20579575, 2.0239979]
    goals = {'hand_position': [-0.51345084, -0.35707146, 0.026474]}
    planner._copy_targets(planner._coarse)
    coarse = look_ahead(planner._coarse, goals, start, {'hand_position': 1e-3})
    assert coarse.reached
    plan = planner.plan(goals, np.array(start), {'hand_position': 1e-3})
    assert plan.kind is not Kind.STRAIGHT


def test_a_look_ahead_waits_for_tasks_with_a_largest_speed():
    stack = build_settings(parameters('panda', rate=50.0)).stack
    hand = stack.tasks['hand_position']
    hand.max_speed = 0.008
    stack.robot.update(READY)
    goal = hand.frame.position + np.array([0.0, 0.3, -0.1])
    found = look_ahead(stack, {'hand_position': goal}, READY, {'hand_position': 1e-3})
    assert found.reached
    assert found.time == pytest.approx(np.hypot(0.3, 0.1) / 0.008, rel=0.1)


@pytest.mark.parametrize('seed', [1, 2])
def test_a_look_ahead_says_what_the_stack_does(seed):
    stack = build_settings(parameters('panda_pose')).stack
    robot, rng = stack.robot, np.random.default_rng(seed)
    start, end = random_configuration(robot, rng), random_configuration(robot, rng)
    robot.update(end)
    goals = {'hand_pose': stack.tasks['hand_pose'].current}
    found = look_ahead(stack, goals, start, {'hand_pose': 1e-3})
    own = build_settings(parameters('panda_pose')).stack
    own.tasks['hand_pose'].target = goals['hand_pose']
    q = start.copy()
    for _ in range(round(found.time / 0.005) + 20):
        q = q + 0.005 * own.step(q).command
    error = np.linalg.norm(own.tasks['hand_pose'].error)
    assert (error < 1e-3) == found.reached


def test_a_planner_goes_straight_or_around_or_says_no():
    planner = Planner(parameters('panda_pose'))
    stack, phases = planner.stack, []
    tolerances = {'hand_pose': 1e-3}
    kinds = set()
    rng = np.random.default_rng(4)
    for _ in range(4):
        start, end = (random_configuration(stack.robot, rng) for _ in range(2))
        stack.robot.update(end)
        goals = {'hand_pose': stack.tasks['hand_pose'].current}
        plan = planner.plan(goals, start, tolerances, tell=phases.append)
        kinds.add(plan.kind)
        assert (plan.way is not None) == (plan.kind is Kind.AROUND)
    assert kinds == {Kind.STRAIGHT, Kind.AROUND}
    assert set(phases) == set(Phase)
    plan = planner.plan({'hand_pose': [2.0, 0.0, 0.5, 0.0, 0.0, 0.0, 1.0]}, READY, tolerances)
    assert plan.kind is Kind.NONE
    assert 'out of reach' in plan.text


def test_a_planner_looks_ahead_for_a_stack_without_a_rate():
    values = parameters('a4_position_joint')
    del values['rate']
    plan = Planner(values).plan({'ee_position': [0.3, 1.2]}, np.array([0.0, 0.6, 0.3]))
    assert plan.kind is Kind.STRAIGHT


def test_a_planner_stops_when_it_is_told():
    planner = Planner(parameters('panda_pose'))
    goals = {'hand_pose': [2.0, 0.0, 0.5, 0.0, 0.0, 0.0, 1.0]}
    plan = planner.plan(goals, READY, stop=lambda: True)
    assert plan.kind is Kind.NONE
    assert sum(plan.seconds.values()) < 1.0


def test_the_planner_of_a_process_plans_and_comes_back_after_it_was_killed():
    settings = build_settings(parameters('panda_pose'))
    remote = RemotePlanner()

    def ask(number):
        goals = {'hand_pose': np.array([0.5, 0.3, 0.3, 1.0, 0.0, 0.0, 0.0])}
        request = Request(
            number, asked_parameters(settings), None, {}, goals, {'hand_pose': 1e-3}, READY, True
        )
        remote.ask(request)
        end = time.monotonic() + 20.0
        while time.monotonic() < end:
            for found, reply in remote.take():
                if found == number and not isinstance(reply, Phase):
                    return reply
            time.sleep(0.01)
        raise AssertionError('no reply')

    try:
        assert ask(1).plan.kind is Kind.STRAIGHT
        remote.kill()
        while not any(isinstance(reply, Failed) for _, reply in remote.take()):
            time.sleep(0.01)
        assert ask(2).plan.kind is Kind.STRAIGHT
    finally:
        remote.close()


def test_a_task_above_that_only_a_lower_rate_loses_is_held_on_the_straight_way():
    planner = Planner(parameters('panda_table') | UPRIGHT)
    stack = planner.stack
    start = solve(stack, {'hand_position': [0.3, 0.0, 0.3]}, READY).best.q
    goals = {'hand_position': [0.0, 0.55, 0.3]}
    planner._copy_targets(planner._coarse)
    assert look_ahead(planner._coarse, goals, start, {'hand_position': 1e-3}).lost == ('down',)
    assert planner.plan(goals, start, {'hand_position': 1e-3}).kind is Kind.STRAIGHT


def test_a_base_that_moves_is_refused():
    stack = build_settings(parameters('mobile_planar')).stack
    q = stack.robot.neutral
    stack.robot.update(q)
    name = next(task.name for level in stack.members for task in level if task.frame_name)
    goals = {name: stack.tasks[name].current}
    with Conditions(stack, goals, q) as conditions, pytest.raises(InvalidValue) as caught:
        find_way(conditions, [])
    assert caught.value.key == 'around'
