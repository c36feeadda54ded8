"""Set-based tasks: distances, thresholds, and what they do to the levels below."""

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from random_stacks import arms, examples, numbers, parameters, positive_vectors, states, vectors
from references import dh_poses
from small_arms import planar_block, planar_robot, robot_of
from urdf_arm import ARM
from urdf_reference import descriptions

from tp_controller import InvalidValue, build_settings, read_parameter_file
from tp_controller.robot import Limits, urdf_robot
from tp_controller.tasks import JointLimitsTask, ObstacleTask, Switching

CONFIG = Path(__file__).resolve().parents[2] / 'config'
H = 1e-6
ON = Switching('hysteresis', 0.1)


def measured(task, q):
    """Distances and their derivative, with every row in."""
    task.robot.update(q)
    task.measure()
    return task.distance.copy(), task._slope.copy()


def limited(robot, velocity=1.0, **position):
    robot.limits = Limits(robot.n, velocity=[velocity], **position)
    return robot


@given(arms(min_joints=1, max_joints=7), st.data())
@examples(60)
def test_an_obstacle_is_as_far_away_as_its_surface_and_j_is_the_rate(block, data):
    n = len(block['joints'])
    q, qd = data.draw(states(n)), data.draw(states(n))
    axes = data.draw(st.sampled_from(['xyz', 'xy', 'xz', 'yz', 'x']))
    rows = ['xyz'.index(letter) for letter in axes]
    center = data.draw(vectors(len(axes), 2))
    task = ObstacleTask('o', robot_of(block), f'link_{n}', center, 0.3, axes, switching=ON)

    def distance(q):
        way = dh_poses(block['dh'], q)[-1][:3, 3][rows] - center
        return float(np.linalg.norm(way)) - 0.3

    assume(distance(q) > -0.29)
    found, J = measured(task, q)
    assert found == pytest.approx([distance(q)], abs=1e-9)
    rate = (distance(q + H * qd) - distance(q - H * qd)) / (2.0 * H)
    assert float(J[0] @ qd) == pytest.approx(rate, abs=1e-4, rel=1e-5)


@given(st.data())
@examples(40)
def test_joint_limits_are_as_far_away_as_their_nearer_end(data):
    robot = planar_robot(1.0, 1.0, 1.0)
    task = JointLimitsTask(
        'l', robot, ['joint_3', 'joint_1'], [-2.0, -math.inf], [1.0, 3.0], switching=ON
    )
    q = data.draw(states(3))
    distance, J = measured(task, q)
    nearer = [min(q[2] + 2.0, 1.0 - q[2]), 3.0 - q[0]]
    np.testing.assert_allclose(distance, nearer, atol=1e-12)
    expected = np.array([[0.0, 0.0, 1.0 if q[2] + 2.0 < 1.0 - q[2] else -1.0], [-1.0, 0.0, 0.0]])
    np.testing.assert_array_equal(J, expected)


def test_a_row_comes_in_at_the_activation_and_goes_out_at_the_release():
    task = JointLimitsTask(
        'l', planar_robot(1.0), None, [-1.0], [1.0], switching=Switching('hysteresis', 0.1, 0.3)
    )
    task.gain = [2.0]
    active = []
    for q in (0.0, 0.85, 0.89, 0.91, 0.85, 0.75, 0.71, 0.69, 0.85, 0.89, -0.95, 0.0):
        task.robot.update(np.array([q]))
        task.update()
        active.append(task.active)
        velocity = np.full(1, 7.0)
        task.desired_velocity(velocity)
        wanted = 2.0 * (0.5 - task.distance[0]) if task.active else 0.0
        np.testing.assert_allclose(velocity, [wanted])
        np.testing.assert_array_equal(task.J, [[-np.sign(q) if task.active else 0.0]])
    assert active == [False] * 3 + [True] * 4 + [False] * 3 + [True] + [False]


def test_a_task_that_leaves_the_hierarchy_forgets_that_it_was_in():
    stack = joint_stack()
    stack.step(np.array([0.99, 0.0]))
    assert stack.tasks['range'].active
    stack.hierarchy = ['hand']
    assert not stack.tasks['range'].active
    assert not stack.tasks['range'].J.any()


def joint_stack(**changes):
    block = {
        'robot': planar_block(1.0, 1.0) | {'limits': {'velocity': [1.0]}},
        'rate': 100.0,
        'hierarchy': ['range', 'hand'],
        'tasks': {
            'range': {'type': 'joint_limits', 'min': [-1.0], 'max': [1.0]},
            'hand': {'type': 'joint', 'joints': ['joint_1', 'joint_2'], 'target': [5.0, 0.5]},
        },
    }
    return build_settings(block | changes).stack


def test_a_level_below_does_not_move_what_is_held_at_its_limit():
    stack = joint_stack(solver={'damping': 0.0})
    q = np.zeros(2)
    for _ in range(2000):
        q = q + 0.01 * stack.step(q).command
        assert np.abs(q).max() <= 1.0
    assert q[0] > 0.9
    assert q[1] == pytest.approx(0.5, abs=1e-2)


@given(parameters(), st.data())
@examples(60)
def test_a_set_based_task_that_stays_out_changes_no_command_by_even_one_bit(block, data):
    n = len(block['robot']['joints'])
    q = data.draw(states(n))
    block['robot'] = block['robot'] | {'limits': {'velocity': [2.0]}}
    block['rate'] = 100.0
    plain = build_settings(block).stack.step(q).command
    how = data.draw(st.sampled_from(['smooth', 'hysteresis']))
    assume(how == 'hysteresis' or 'prismatic' not in block['robot']['dh']['types'])
    far = {
        'type': 'obstacle',
        'frame': f'link_{n}',
        'center': [100.0, 0.0, 0.0],
        'radius': 1.0,
        'activation': 0.1,
        'switching': how,
    }
    ends = {'type': 'joint_limits', 'min': [-100.0], 'max': [100.0], 'switching': how}
    tasks = block['tasks'] | {'far': far, 'ends': ends}
    levels = block['hierarchy']
    place = data.draw(st.integers(0, len(levels)))
    apart = [*levels[:place], 'far', 'ends', *levels[place:]]
    shared = [f'far + {levels[0]} + ends', *levels[1:]]
    for hierarchy in (apart, shared):
        stack = build_settings(block | {'tasks': tasks, 'hierarchy': hierarchy}).stack
        assert stack.step(q).command.tobytes() == plain.tobytes()


@given(arms(min_joints=1, max_joints=7), st.data())
@examples(60)
def test_no_state_moves_a_frame_faster_than_its_reach(block, data):
    robot = robot_of(block)
    n = robot.n
    robot.limits = Limits(n, position_min=[-4.0], position_max=[4.0])
    reach = robot.reach(f'link_{n}')
    robot.update(data.draw(states(n)))
    speeds = np.linalg.norm(robot.frame(f'link_{n}').jacobian[:3], axis=0)
    assert np.all(speeds <= reach + 1e-9)


@given(descriptions(), st.data())
@examples(40)
def test_the_reach_holds_on_trees_with_mimic_joints(case, data):
    text, joints = case
    robot = urdf_robot(text, joints)
    robot.limits = Limits(robot.n, position_min=[-4.0], position_max=[4.0])
    robot.update(data.draw(states(robot.n)))
    name = data.draw(st.sampled_from(robot.frames))
    speeds = np.linalg.norm(robot.frame(name).jacobian[:3], axis=0)
    assert np.all(speeds <= robot.reach(name) + 1e-9)


def test_the_reach_of_a_stretched_arm_is_exact():
    np.testing.assert_allclose(planar_robot(0.75, 0.5, 0.5).reach('link_3'), [1.75, 1.0, 0.5])


def test_beyond_a_slide_without_limits_the_reach_is_infinite():
    block = planar_block(1.0, 1.0)
    block['dh']['types'] = ['revolute', 'prismatic']
    np.testing.assert_array_equal(robot_of(block).reach('link_2'), [np.inf, 1.0])


def random_goals(rng, count):
    """Points (count, 2) all over the reach of the arm and a little beyond."""
    radius, angle = np.sqrt(rng.uniform(0.0, 3.5, count)), rng.uniform(-np.pi, np.pi, count)
    return np.c_[radius * np.cos(angle), radius * np.sin(angle)]


def least_distance(name, seed, count, **changes):
    """Smallest distance of any set-based task over random goals of 10 s each."""
    path = CONFIG / f'{name}.yaml'
    stack = build_settings(read_parameter_file(path, 'tp_controller') | changes).stack
    q = np.array(read_parameter_file(path, 'tp_sim')['initial_positions'])
    tasks = [task for task in stack.tasks.values() if task.set_based]
    least = math.inf
    for goal in random_goals(np.random.default_rng(seed), count):
        stack.tasks['ee_position'].target = goal
        for _ in range(600):
            q = q + stack.step(q).command / 60.0
            least = min(least, *(float(task.distance.min()) for task in tasks))
    return least


@pytest.mark.parametrize('seed', range(4))
@pytest.mark.parametrize('name', ['b1_obstacles', 'b2_joint_limits'])
def test_with_safe_thresholds_no_boundary_is_ever_crossed(name, seed):
    assert least_distance(name, seed, 20) > 0.0


@pytest.mark.parametrize(
    ('activation', 'low', 'high'), [(1e-9, -0.03, -0.005), (0.02, -0.01, 0.01), (0.05, 0.02, 0.05)]
)
def test_b1_the_arm_comes_as_close_as_in_the_report(activation, low, high):
    """About 2.3 cm inside, 0.3 cm inside and 3.6 cm outside, over 30 random goals."""
    thresholds = {
        'switching': 'hysteresis',
        'activation': activation,
        'release': activation + 0.05,
    }
    changes = {
        f'tasks.obstacle_{i}.{key}': value for i in (1, 2, 3) for key, value in thresholds.items()
    }
    assert low < least_distance('b1_obstacles', 1, 30, **changes) < high


def test_b1_a_goal_inside_an_obstacle_leaves_the_arm_outside():
    path = CONFIG / 'b1_obstacles.yaml'
    stack = build_settings(read_parameter_file(path, 'tp_controller')).stack
    q = np.array(read_parameter_file(path, 'tp_sim')['initial_positions'])
    stack.tasks['ee_position'].target = [0.0, 1.0]
    for _ in range(1200):
        q = q + stack.step(q).command / 60.0
    assert 0.0 < stack.tasks['obstacle_1'].distance[0] < 0.3


@given(positive_vectors(3, 0.1, 2), numbers(10, 200))
@examples(20)
def test_left_out_thresholds_are_safe_at_the_rate_and_the_velocity_limits(velocity, rate):
    robot = planar_robot(0.75, 0.5, 0.5)
    robot.limits = Limits(3, velocity=velocity)
    task = watcher(robot, rate, Switching('hysteresis'))
    travel = float(np.dot(velocity, [1.75, 1.0, 0.5])) / rate
    assert task.activation > travel
    assert task.release > task.activation
    assert task.warnings == ()
    close = watcher(robot, rate, Switching('hysteresis', 0.9 * travel))
    (warning,) = close.warnings
    assert f'{task.activation / 1.25:.3g}' in warning
    assert task.activation / 1.25 == pytest.approx(travel)
    assert 'tasks.o.activation' in warning


def watcher(robot, rate, switching):
    return ObstacleTask('o', robot, 'link_3', [0.0, 0.0], 0.1, 'xy', 1.0 / rate, switching)


@given(positive_vectors(3, 0.1, 2), positive_vectors(3, 1, 20), numbers(20, 1000))
@examples(20)
def test_a_left_out_activation_leaves_time_to_brake(velocity, acceleration, rate):
    robot = planar_robot(0.75, 0.5, 0.5)
    robot.limits = Limits(3, velocity=velocity, acceleration=acceleration)
    task = watcher(robot, rate, Switching())
    fastest = float(np.dot(velocity, [1.75, 1.0, 0.5]))
    braking = max(4.0 / rate, 2.0 * float(np.max(np.divide(velocity, acceleration))))
    assert task.margin == pytest.approx(1e-4 + 0.5 * fastest * sum(velocity) / rate**2)
    assert task.activation == pytest.approx(task.margin + fastest * braking)
    assert task.warnings == ()
    (warning,) = watcher(robot, rate, Switching(activation=0.9 * task.activation)).warnings
    assert f'{task.activation:.3g}' in warning


def obstacle(**changes):
    settings = {'frame': 'link_2', 'center': [0.0, 0.0], 'radius': 1.0, 'axes': 'xy'}
    robot = limited(planar_robot(1.0, 1.0))
    return ObstacleTask('o', robot, **(settings | {'period': 0.01} | changes))


def joint_limits(**changes):
    robot = limited(planar_robot(1.0, 1.0), position_min=[-1.0, -2.0], position_max=[3.0])
    return JointLimitsTask('l', robot, **({'period': 0.01} | changes))


@pytest.mark.parametrize(
    ('make', 'key', 'accepts'),
    [
        (lambda: obstacle(radius=0.0), 'radius', 'above 0'),
        (lambda: obstacle(center=[0.0]), 'center', '2 values'),
        (lambda: obstacle(center=[0.0, math.nan]), 'center', 'finite'),
        (lambda: obstacle(frame='hand'), 'frame', 'link_1, link_2'),
        (lambda: obstacle(axes='q'), 'axes', 'xyz'),
        (lambda: obstacle(switching=Switching('off')), 'switching', 'smooth, hysteresis'),
        (
            lambda: obstacle(switching=Switching('hysteresis', 0.2, 0.1)),
            'release',
            'more than the activation',
        ),
        (
            lambda: obstacle(period=math.inf, switching=Switching('hysteresis')),
            'activation',
            'rate and robot.limits.velocity',
        ),
        (lambda: obstacle(period=math.inf), 'activation', 'switching hysteresis'),
        (lambda: obstacle(switching=Switching(release=0.3)), 'release', 'switching hysteresis'),
        (
            lambda: obstacle(switching=Switching('hysteresis', margin=0.3)),
            'margin',
            'switching smooth',
        ),
        (lambda: obstacle(switching=Switching(margin=0.0)), 'margin', 'above 0'),
        (lambda: obstacle(switching=Switching('smooth', 0.1, None, 0.2)), 'activation', 'margin'),
        (lambda: joint_limits(joints=['x']), 'joints', 'joint_1, joint_2'),
        (lambda: joint_limits(joints=[]), 'joints', 'joint_1, joint_2'),
        (lambda: joint_limits(lower=[1.0, 2.0, 3.0]), 'min', '1 value or 2'),
        (lambda: joint_limits(lower=[5.0]), 'min', 'below max'),
        (lambda: JointLimitsTask('l', planar_robot(1.0)), 'min', 'robot.limits.position_min'),
    ],
)
def test_settings_that_make_no_sense_are_refused(make, key, accepts):
    with pytest.raises(InvalidValue) as caught:
        make()
    assert caught.value.key == key
    assert accepts in caught.value.accepts


def test_the_robots_own_limits_are_the_range_when_none_is_given():
    task = joint_limits()
    distance, _ = measured(task, np.array([0.5, -1.5]))
    np.testing.assert_allclose(distance, [1.5, 0.5])


def test_a_joint_without_limits_is_never_near_one():
    robot = limited(urdf_robot(ARM, ['shoulder', 'elbow']), position_max=None)
    robot.limits = urdf_robot(ARM, ['shoulder', 'elbow']).limits
    distance, _ = measured(JointLimitsTask('l', robot, period=0.01), np.array([50.0, 0.5]))
    np.testing.assert_allclose(distance, [np.inf, 1.5])


@pytest.mark.parametrize('key', ['target', 'feedforwards'])
def test_an_obstacle_has_no_such_parameter(key):
    tasks = {'o': {'type': 'obstacle', 'frame': 'link_2', 'center': [0.0] * 3, 'radius': 1.0}}
    tasks['o'][key] = [1.0]
    with pytest.raises(InvalidValue, match='an unknown parameter') as caught:
        joint_stack(tasks=tasks, hierarchy=['o'])
    assert caught.value.key == f'tasks.o.{key}'


def test_a_square_scheme_takes_no_task_whose_rows_come_and_go():
    with pytest.raises(InvalidValue, match='range, whose rows come and go') as caught:
        joint_stack(solver={'type': 'extended_jacobian'})
    assert caught.value.key == 'hierarchy'
