"""Tasks that keep whole links clear of obstacles and of each other."""

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from random_stacks import examples, states, vectors
from small_arms import planar_block

from tp_controller import InvalidValue, build_settings, read_parameter_file
from tp_controller.config import build_addition
from tp_controller.tasks import SelfCollisionTask, WholeArmTask

CONFIG = Path(__file__).resolve().parents[2] / 'config'
DT = 0.01


def parameters(tasks, hierarchy=None, robot=None, **changes):
    """Planar arm with capsules along its links, tasks above a posture far round."""
    block = planar_block(1.0, 1.0, 1.0, 1.0)
    block |= {'limits': {'velocity': [1.0]}, 'link_radius': [0.1]}
    posture = {'type': 'posture', 'target': [2.8, 2.8, 2.8, 2.8]}
    return {
        'robot': block | (robot or {}),
        'rate': 1.0 / DT,
        'hierarchy': hierarchy or [*tasks, 'home'],
        'tasks': tasks | {'home': posture},
    } | changes


def stack_of(tasks, **changes):
    return build_settings(parameters(tasks, **changes)).stack


def obstacle(**settings):
    return {'type': 'obstacle', 'whole_arm': True, 'center': [0.0, 2.0, 0.0]} | settings


SPHERE = obstacle(radius=0.5)
SHAPES = {
    'sphere': SPHERE,
    'box': obstacle(shape='box', size=[1.0, 1.0, 1.0], orientation=[0.0, 0.0, 1.0, 3.0]),
    'cylinder': obstacle(shape='cylinder', radius=0.5, length=2.0),
    'half_space': obstacle(shape='half_space', normal=[0.0, -1.0, 0.0]),
}


@pytest.mark.parametrize('kind', SHAPES)
def test_no_link_touches_an_obstacle_that_stands_in_the_way(kind):
    stack = stack_of({'wall': SHAPES[kind]})
    task = stack.tasks['wall']
    assert isinstance(task, WholeArmTask)
    assert task.obstacle.kind == kind
    q, least, active = np.zeros(4), math.inf, False
    for _ in range(800):
        q = q + DT * stack.step(q).command
        least, active = min(least, task.distance.min()), active or task.active
    assert active
    assert 0.0 <= least < 0.1


def test_links_that_are_not_named_go_through():
    stack = stack_of({'wall': SPHERE | {'links': ['link_1', 'link_2']}})
    assert stack.tasks['wall'].components == ('link_1', 'link_2')


def test_a_new_target_moves_the_obstacle():
    stack = stack_of({'wall': SPHERE})
    task = stack.tasks['wall']
    stack.step(np.zeros(4))
    np.testing.assert_allclose(task.clearance.distances()[0], 2.0 - 0.6)
    task.target = [0.5, 1.0, 0.0]
    stack.step(np.zeros(4))
    np.testing.assert_allclose(task.clearance.distances()[0], 1.0 - 0.6)
    np.testing.assert_allclose(task.center, [0.5, 1.0, 0.0])
    np.testing.assert_allclose(task.obstacle.pose.translation, [0.5, 1.0, 0.0])


@given(states(4), st.lists(vectors(4, 1), min_size=1, max_size=6))
@examples(30)
def test_a_probe_tells_distances_and_changes_nothing(q, ways):
    stack = stack_of(
        {'wall': SHAPES['box'], 'self': {'type': 'self_collision', 'push_apart': True}}
    )
    stack.step(q)
    for task in (stack.tasks['wall'], stack.tasks['self']):
        stack.robot.update(q)
        task.update()
        before = task.distance.copy(), task.J.copy()
        for way in ways:
            stack.robot.place(q + np.array(way))
            out = np.full(task.k, np.nan)
            task.probe(out)
            exact = task.clearance.distances()
            assert np.all(out <= exact + 1e-6)
            near = exact < task.clearance.threshold
            np.testing.assert_allclose(out[near], exact[near], atol=1e-6)
            np.testing.assert_array_equal(task.distance, before[0])
        np.testing.assert_array_equal(task.J, before[1])


def test_an_arm_that_is_folded_onto_itself_stops_before_it_touches():
    stack = stack_of({'self': {'type': 'self_collision'}})
    task = stack.tasks['self']
    assert isinstance(task, SelfCollisionTask)
    assert task.components == ('link_1 - link_3', 'link_1 - link_4', 'link_2 - link_4')
    q, least = np.zeros(4), math.inf
    for _ in range(800):
        q = q + DT * stack.step(q).command
        least = min(least, task.distance.min())
    assert 0.0 <= least < 0.05


def test_pairs_are_texts_of_two_links():
    one = {'type': 'self_collision', 'pairs': ['link_4  link_1']}
    assert stack_of({'self': one}).tasks['self'].components == ('link_4 - link_1',)
    two = {'type': 'self_collision', 'ignore': ['link_4 link_1']}
    names = stack_of({'self': two}).tasks['self'].components
    assert names == ('link_1 - link_3', 'link_2 - link_4')


def refused(tasks, **changes):
    with pytest.raises(InvalidValue) as caught:
        stack_of(tasks, **changes)
    assert '\n' not in str(caught.value)
    return caught.value


@pytest.mark.parametrize(
    ('changes', 'key', 'words'),
    [
        ({'frame': 'link_1'}, 'frame', 'with whole_arm'),
        ({'axes': 'xy'}, 'axes', 'with whole_arm'),
        ({'whole_arm': False}, 'frame', 'or whole_arm: true'),
        ({'whole_arm': False, 'frame': 'link_1', 'shape': 'box'}, 'shape', 'whole_arm: true'),
        ({'whole_arm': False, 'frame': 'link_1', 'links': ['link_1']}, 'links', 'whole_arm'),
        ({'whole_arm': False, 'frame': 'link_1', 'length': 1.0}, 'length', 'whole_arm'),
        ({'whole_arm': False, 'frame': 'link_1', 'radius': None}, 'radius', 'above 0'),
        ({'radius': None}, 'radius', 'for the shape sphere'),
        ({'length': 1.0}, 'length', 'with the shape sphere'),
        ({'orientation': [0.0, 0.0, 0.0, 1.0]}, 'orientation', 'with the shape sphere'),
        ({'shape': 'cylinder'}, 'length', 'for the shape cylinder'),
        ({'shape': 'box', 'radius': None}, 'size', 'for the shape box'),
        ({'shape': 'box', 'size': [1.0] * 3}, 'radius', 'with the shape box'),
        ({'shape': 'box', 'radius': None, 'size': [1.0]}, 'size', '3 numbers above 0'),
        ({'shape': 'half_space', 'radius': None}, 'normal', 'for the shape half_space'),
        (
            {'shape': 'half_space', 'radius': None, 'normal': [0.0, 0.0, 0.0]},
            'normal',
            'not all zero',
        ),
        (
            {'shape': 'half_space', 'radius': None, 'normal': [1.0, 0.0]},
            'normal',
            '3 values',
        ),
        ({'shape': 'cone'}, 'shape', 'half_space'),
        ({'center': [0.0, 2.0]}, 'center', '3 values'),
        ({'links': ['hand']}, 'links', 'link_1, link_2'),
        ({'switching': 'hysteresis', 'activation': 0.2, 'release': 0.1}, 'release', 'more than'),
    ],
)
def test_a_combination_that_makes_no_sense_is_refused(changes, key, words):
    error = refused({'wall': SPHERE | changes})
    assert error.key == f'tasks.wall.{key}'
    assert words in f'{error.got} {error.accepts}'


@pytest.mark.parametrize(
    ('task', 'key', 'words'),
    [
        ({'pairs': ['link_1']}, 'pairs', 'two names of links'),
        ({'pairs': ['link_1 link_2 link_3']}, 'pairs', 'two names of links'),
        ({'ignore': ['link_1 hand']}, 'ignore', 'link_1, link_2'),
        ({'pairs': ['link_1 link_1']}, 'pairs', 'joint in between'),
        ({'target': [1.0]}, 'target', 'unknown parameter'),
    ],
)
def test_pairs_that_make_no_sense_are_refused(task, key, words):
    error = refused({'self': {'type': 'self_collision'} | task})
    assert error.key == f'tasks.self.{key}'
    assert words in f'{error.got} {error.accepts}'


@pytest.mark.parametrize(
    ('robot', 'key'),
    [
        ({'link_radius': [0.1, 0.2]}, 'robot.link_radius'),
        ({'link_radius': [0.0]}, 'robot.link_radius'),
        ({'capsules': {'hand': [0.0] * 7}}, 'robot.capsules.hand'),
        ({'capsules': {'link_1': [0.0] * 6}}, 'robot.capsules.link_1'),
    ],
)
def test_shapes_of_links_that_make_no_sense_are_refused_whoever_needs_them(robot, key):
    for tasks in ({'wall': SPHERE}, {}):
        assert refused(tasks, hierarchy=['home'], robot=robot).key == key


def test_links_without_shapes_want_some():
    error = refused({'wall': SPHERE}, robot={'link_radius': None})
    assert error.key == 'tasks.wall.links'
    assert 'robot.link_radius' in error.accepts


def test_a_mesh_that_is_not_there_matters_to_tasks_that_need_it(tmp_path):
    robot = '<robot name="a"><link name="foot"/><link name="arm"><collision><geometry>{}'
    joint = '<joint name="j" type="continuous"><parent link="foot"/><child link="arm"/></joint>'
    mesh = '<mesh filename="none.stl"/></geometry></collision></link>'
    path = tmp_path / 'arm.urdf'
    path.write_text(f'{robot.format(mesh)}{joint}</robot>')
    block = {'robot': {'urdf': str(path)}, 'hierarchy': ['home'], 'tasks': {'home': {}}}
    block['tasks']['home'] = {'type': 'posture'}
    settings = build_settings(block)
    wall = SPHERE | {'switching': 'hysteresis', 'activation': 0.1}
    with pytest.raises(InvalidValue) as caught:
        build_addition(settings, 'wall', wall)
    assert caught.value.key == 'robot.capsules.arm'
    given = {'capsules': {'arm': [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.1]}}
    block['robot'] |= given
    added = build_addition(build_settings(block), 'wall', wall)
    assert added.task.components == ('arm',)


def test_capsules_of_ones_own_take_the_place_of_those_along_the_links():
    stack = stack_of(
        {'wall': SPHERE}, robot={'capsules': {'link_1': [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.3]}}
    )
    np.testing.assert_allclose(stack.tasks['wall'].clearance.distances()[0], math.sqrt(5.0) - 0.8)


def random_goals(rng, count):
    return rng.uniform([-0.6, -0.6, -0.2], [0.7, 0.7, 0.8], (count, 3))


@pytest.mark.parametrize('seed', range(2))
def test_the_panda_at_its_table_touches_nothing_whatever_its_goals(seed):
    path = CONFIG / 'panda_table.yaml'
    stack = build_settings(read_parameter_file(path, 'tp_controller')).stack
    dt = 1.0 / read_parameter_file(path, 'tp_sim')['rate']
    q = np.array(read_parameter_file(path, 'tp_sim')['initial_positions'])
    clear = [task for task in stack.tasks.values() if task.set_based]
    assert [task.warnings for task in clear] == [()] * len(clear)
    for goal in random_goals(np.random.default_rng(seed), 5):
        stack.tasks['hand_position'].target = goal
        for _ in range(400):
            q = q + dt * stack.step(q).command
            for task in clear:
                assert task.distance.min() >= 0.0, task.name


def test_the_panda_at_its_table_reaches_the_goals_that_are_free():
    path = CONFIG / 'panda_table.yaml'
    stack = build_settings(read_parameter_file(path, 'tp_controller')).stack
    q = np.array(read_parameter_file(path, 'tp_sim')['initial_positions'])
    for goal, free in (([0.45, 0.25, 0.1], True), ([0.5, 0.3, 0.6], False)):
        stack.tasks['hand_position'].target = goal
        for _ in range(1000):
            q = q + stack.step(q).command / 200.0
        error = np.linalg.norm(stack.tasks['hand_position'].error)
        assert (error < 1e-3) == free
    assert 0.0 < stack.tasks['ball'].distance.min() < 0.01


@pytest.mark.parametrize('far', [1e9, 3e5, 50.0])
def test_an_obstacle_that_was_far_away_is_as_near_as_ever_when_it_comes_back(far):
    stack = stack_of({'ball': SPHERE})
    task = stack.tasks['ball']
    q = np.array([1.4, 0.1, 0.0, 0.0])
    stack.step(q)
    expected = task.distances().copy()
    task.target = [far, far, 0.0]
    stack.step(q)
    task.target = SPHERE['center']
    stack.step(q)
    np.testing.assert_allclose(task.distances(), expected, atol=1e-6)
    assert np.all(task.distance <= expected + 1e-6)
