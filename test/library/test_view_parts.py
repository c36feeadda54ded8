"""What the page in the browser is made of, without a server, a browser or ROS."""

from types import SimpleNamespace

import numpy as np
import pinocchio as pin
import pytest

from tp_controller import ObstacleTask, Robot
from tp_controller.scenery import is_planar, obstacle_shape
from tp_controller.view.hierarchy import (
    joined,
    left_out,
    levels_of,
    listed,
    lowered,
    parameter,
    raised,
)
from tp_controller.view.history import History
from tp_controller.view.page import trusted
from tp_controller.view.surroundings import shortest_ways
from tp_controller.view.targets import freedom, handle_place, target_place, target_values
from tp_controller.view.task_folder import read_numbers
from tp_controller.view.view import reach_of
from tp_controller.view.wishes import Change, Goal, Wishes

LEVELS = [['a'], ['b', 'c'], ['d']]
PANDA = 'package://example-robot-data/robots/panda_description/urdf/panda.urdf'


@pytest.mark.parametrize(
    ('move', 'name', 'found'),
    [
        (raised, 'd', [['a'], ['d'], ['b', 'c']]),
        (raised, 'a', LEVELS),
        (raised, 'c', [['a'], ['c'], ['b'], ['d']]),
        (lowered, 'a', [['b', 'c'], ['a'], ['d']]),
        (lowered, 'd', LEVELS),
        (lowered, 'b', [['a'], ['c'], ['b'], ['d']]),
        (joined, 'd', [['a'], ['b', 'c', 'd']]),
        (joined, 'a', LEVELS),
        (left_out, 'a', [['b', 'c'], ['d']]),
        (listed, 'e', [*LEVELS, ['e']]),
        (listed, 'c', LEVELS),
        (raised, 'nobody', LEVELS),
    ],
)
def test_a_task_moves_one_place_at_a_time(move, name, found):
    assert move(LEVELS, name) == found
    assert LEVELS == [['a'], ['b', 'c'], ['d']]


def test_levels_come_from_the_state_and_go_to_the_parameter():
    found = {'a': 1, 'b': -1, 'c': 0}
    tasks = [SimpleNamespace(name=name, level=level) for name, level in found.items()]
    assert levels_of(tasks) == [['c'], ['a']]
    assert parameter(LEVELS) == ['a', 'b + c', 'd']
    assert parameter([]) == ['']


def task(kind, frame, components, desired, relative_to=''):
    return SimpleNamespace(
        type=kind,
        frame=frame,
        target_components=components.split(),
        desired=desired,
        relative_to=relative_to,
    )


@pytest.mark.parametrize(
    ('kind', 'components', 'relative_to'),
    [
        ('position', 'x y z', ''),
        ('position', 'x z', 'panda_link2'),
        ('orientation', 'qx qy qz qw', 'panda_link3'),
        ('pose', 'x y z qx qy qz qw', ''),
    ],
)
def test_a_target_that_is_dragged_has_the_values_of_where_it_is_put(kind, components, relative_to):
    robot = Robot.from_urdf(PANDA, joints=[f'panda_joint{i}' for i in range(1, 8)])
    robot.update(np.array([0.3, -0.4, 0.2, -2.0, 0.1, 1.9, 0.5]))
    rng = np.random.default_rng(1)
    put = pin.SE3(pin.exp3(rng.normal(size=3)), rng.normal(size=3))
    found = task(kind, 'panda_hand', components, [0.0] * len(components.split()), relative_to)
    found.desired = target_values(robot, found, put)
    place = target_place(robot, found)
    if 'x y z' in components:
        assert np.allclose(place.translation, put.translation)
    if 'qw' in components:
        assert np.allclose(place.rotation, put.rotation)
    else:
        seen = robot.frame(relative_to).rotation if relative_to else np.eye(3)
        assert np.allclose(handle_place(robot, found).rotation, seen)
    assert np.allclose(target_values(robot, found, place), found.desired)


def test_an_angle_is_the_turn_about_its_axis():
    robot = Robot.from_dh([0.75, 0.5, 0.5])
    robot.update(np.array([0.2, 0.3, 0.4]))
    found = task('pose', 'link_3', 'x y rz', [1.0, 0.5, 2.5])
    place = target_place(robot, found)
    assert np.allclose(place.rotation, pin.exp3(np.array([0.0, 0.0, 2.5])))
    assert np.allclose(target_values(robot, found, place), found.desired)


def test_a_target_without_values_is_where_the_frame_is():
    robot = Robot.from_dh([0.75, 0.5, 0.5])
    place = target_place(robot, task('position', 'link_3', 'x y', [np.nan, np.nan]))
    assert np.allclose(place.translation, [1.75, 0.0, 0.0])


def test_only_what_takes_goals_in_space_has_a_handle():
    types = ('position', 'orientation', 'joint', 'obstacle')
    assert freedom(task('position', 'f', 'x y', []), types).axes == (True, True, False)
    assert freedom(task('orientation', 'f', 'rz', []), types).turns == (False, False, True)
    assert freedom(task('orientation', 'f', 'qx qy qz qw', []), types).turns == (True,) * 3
    assert freedom(task('obstacle', '', 'x y z', []), types) is not None
    assert freedom(task('joint', '', 'joint_1', []), types) is None
    assert freedom(task('manipulability', 'f', 'x', []), types) is None


def test_history_keeps_the_last_seconds_in_bounded_memory():
    history = History(2, seconds=1.0, rate=10.0)
    room = history._room
    for i in range(1000):
        history.add(0.05 * i, np.array([i, -i]))
    times, values = history.recent()
    assert history._room is room
    assert times[-1] == 0.0
    assert np.all(np.diff(times) > 0.0)
    assert -1.0 <= times[0] < -0.85
    assert np.allclose(values[0], 998 + times / 0.05)
    history.add(0.0, np.zeros(2))
    assert len(history.recent()[0]) == 1


def test_of_goals_the_newest_counts_and_of_the_rest_each():
    wishes = Wishes()
    for i in range(3):
        wishes.add(Goal('tip', (float(i),)))
        wishes.add(Change('solver.damping', [float(i)]))
    taken = list(wishes.take())
    assert [wish.value for wish in taken[:3]] == [[0.0], [1.0], [2.0]]
    assert taken[3:] == [Goal('tip', (2.0,))]
    assert not list(wishes.take())


def test_pages_of_other_sites_are_not_trusted():
    own = {'localhost', 'lab'}

    def let_in(site, asked=None):
        return trusted(f'http://{site}', site if asked is None else asked, own)

    assert all(map(let_in, ('localhost:8080', '127.0.0.1:8080', '192.168.0.7:8080', 'lab:8080')))
    assert let_in('[::1]:8080')
    # A name of a stranger may lead to this machine.
    assert not let_in('example.org:8080')
    assert not let_in('203.0.113.5', '127.0.0.1:8080')
    assert not let_in('127.0.0.1:9999', '127.0.0.1:8080')
    assert not let_in('localhost:8080', '')
    assert not trusted('null', 'localhost:8080', own)


def test_obstacles_in_two_axes_are_discs_and_their_distance_is_a_line():
    robot = Robot.from_dh([1.0, 1.0], limits={'velocity': 1.0})
    ball = ObstacleTask('ball', robot, 'link_2', [2.0, 1.0], 0.25, axes='xy', period=0.01)
    shape = obstacle_shape(ball)
    assert shape.kind == 'cylinder'
    assert np.allclose(shape.pose.translation, [2.0, 1.0, 0.0])
    state = task('obstacle', 'link_2', 'x y', [2.0, 0.5])
    ways, distances = shortest_ways(ball, state)
    assert np.allclose(ways[0], [[2.0, 0.0, 0.0], [2.0, 0.25, 0.0]])
    assert np.allclose(distances, [0.25])


def test_the_camera_knows_planar_arms_and_their_reach():
    planar = Robot.from_dh([0.75, 0.5, 0.5])
    assert is_planar(planar)
    assert reach_of(planar, 1.0) == pytest.approx(1.75)
    assert not is_planar(Robot.from_dh([0.5, 0.5], alpha=[1.0, 0.0]))


def test_gains_are_read_as_people_write_them():
    assert read_numbers('1, 2 3.5') == [1.0, 2.0, 3.5]
    assert read_numbers('') == read_numbers('fast') == []
