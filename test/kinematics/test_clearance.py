"""Signed distances of links from obstacles and from each other, and their derivatives."""

import math

import numpy as np
import pinocchio as pin
import pytest
from clad_arms import SIZES, clad_arms, matrix, obstacles, shape_of
from clearance_reference import gap, line_distance, lines_distance, moved
from hypothesis import assume, given
from hypothesis import strategies as st
from random_stacks import (
    examples,
    nonzero_vectors,
    states,
    vectors,
)
from references import rotation
from small_arms import planar_robot

from tp_controller.robot import (
    Shape,
    capsule,
    half_space,
    obstacle_clearance,
    robot_bodies,
    self_clearance,
    sphere,
)

H = 1e-6


def ends(given, places, link):
    """Ends of a link's capsule in the base frame, and its radius."""
    values = np.array(given[link])
    return moved(places[link], values[:3]), moved(places[link], values[3:6]), values[6]


def distance_from(given, places, link, obstacle, only=''):
    start, end, radius = ends(given, places, link)
    if only:
        start = end = {'start': start, 'end': end}[only]
    return line_distance(*obstacle, start, end) - radius


def distance_between(given, places, name):
    one, other = (ends(given, places, link) for link in name.split(' - '))
    return lines_distance(*one[:2], *other[:2]) - one[2] - other[2]


def assert_slope(slope, distance, q, qd, rough=False):
    """Compare with finite differences, except where the distance has a kink."""
    ahead, here, behind = distance(q + H * qd), distance(q), distance(q - H * qd)
    if abs(ahead + behind - 2.0 * here) < 1e-4 * H:
        # A cylinder's normal comes from iterations: it is as good as the root of their end.
        atol = (1e-3 if rough else 1e-5) * (1.0 + np.abs(qd).sum())
        assert slope @ qd == pytest.approx((ahead - behind) / (2.0 * H), abs=atol)


@given(clad_arms(), obstacles(), st.data())
@examples(50)
def test_links_are_as_far_from_an_obstacle_as_in_plain_numpy(arm, obstacle, data):
    robot, given_capsules, places = arm
    q, qd = data.draw(states(robot.n)), data.draw(states(robot.n))
    bodies = robot_bodies(robot, capsules=given_capsules)
    clearance = obstacle_clearance(robot, bodies, shape_of(obstacle), list(bodies))
    robot.update(q)
    clearance.update()
    for row, name in enumerate(clearance.names):
        link, _, end = name.partition(' ')

        def distance(q, link=link, end=end):
            return distance_from(given_capsules, places(q), link, obstacle, end)

        # Deeper, the way out for the capsule is not that for its middle line.
        if obstacle[0][0] != 'half_space' and distance(q) < 1e-3 - given_capsules[link][6]:
            assert clearance.distance[row] < 1e-3 - given_capsules[link][6]
            continue
        assert clearance.distance[row] == pytest.approx(distance(q), abs=1e-6)
        assert_slope(clearance.slope[row], distance, q, qd, obstacle[0][0] == 'cylinder')


@given(clad_arms(), st.data())
@examples(50)
def test_links_are_as_far_from_each_other_as_in_plain_numpy(arm, data):
    robot, given_capsules, places = arm
    q, qd = data.draw(states(robot.n)), data.draw(states(robot.n))
    clearance = made(robot, robot_bodies(robot, capsules=given_capsules))
    robot.update(q)
    clearance.update()
    for row, name in enumerate(clearance.names):

        def distance(q, name=name):
            return distance_between(given_capsules, places(q), name)

        assert clearance.distance[row] == pytest.approx(distance(q), abs=1e-6)
        depth = sum(given_capsules[link][6] for link in name.split(' - '))
        if distance(q) > 1e-3 - depth:
            assert_slope(clearance.slope[row], distance, q, qd)


def made(robot, bodies):
    """Clearance of every pair of links with a joint in between, neighbours too."""
    links = list(bodies)
    places = [robot.model.frames[robot.frame(link).index].parentJoint for link in links]
    pairs = [
        (a, b)
        for i, a in enumerate(links)
        for j, b in enumerate(links[:i])
        if places[i] != places[j]
    ]
    assume(pairs)
    return self_clearance(robot, bodies, pairs)


@given(obstacles(('sphere', 'cylinder', 'box')), obstacles(), vectors(3, 1), st.data())
@examples(150)
def test_the_distance_is_the_widest_gap_also_where_shapes_overlap(body, other, turn, data):
    """A slab as wide as the distance, and nearest points as far apart, prove it."""
    robot = planar_robot(1.0)
    clearance = obstacle_clearance(robot, {'link_1': (shape_of(body),)}, shape_of(other))
    q = data.draw(states(1))
    robot.update(q)
    (distance,) = clearance.distances()
    ((point, nearest),) = clearance.nearest_points()
    link = matrix([0.0, 0.0, q[0]], [math.cos(q[0]), math.sin(q[0]), 0.0])
    pose = link @ body[1]
    atol = 1e-5
    assert np.linalg.norm(point - nearest) == pytest.approx(abs(distance), abs=atol)
    assume(abs(distance) > 1e-3)
    normal = (point - nearest) / np.copysign(np.linalg.norm(point - nearest), distance)
    assert gap(body[0], pose, *other, normal) == pytest.approx(distance, abs=atol)
    for direction in data.draw(st.lists(nonzero_vectors(3), max_size=20)):
        aside = np.array(direction) / np.linalg.norm(direction)
        assert gap(body[0], pose, *other, aside) <= distance + atol


@given(clad_arms(), obstacles(), st.data())
@examples(30)
def test_results_are_the_same_where_no_view_has_them(arm, obstacle, data):
    """Another coal may keep its results in another way; then they are copied one by one."""
    robot, given_capsules, _ = arm
    bodies = robot_bodies(robot, capsules=given_capsules)
    pair = [obstacle_clearance(robot, bodies, shape_of(obstacle), list(bodies)) for _ in range(2)]
    pair[1]._copies, pair[1]._found = True, np.zeros_like(pair[1]._found)
    for _ in range(3):
        robot.update(data.draw(states(robot.n)))
        for clearance in pair:
            clearance.threshold = 0.5
            clearance.update()
        np.testing.assert_array_equal(pair[0].distance, pair[1].distance)
        np.testing.assert_array_equal(pair[0].slope, pair[1].slope)


@given(clad_arms(), obstacles(), st.data())
@examples(80)
def test_no_state_changes_a_distance_faster_than_its_reach(arm, obstacle, data):
    robot, given_capsules, _ = arm
    bodies = robot_bodies(robot, capsules=given_capsules)
    both = obstacle_clearance(robot, bodies, shape_of(obstacle), list(bodies))
    for clearance in (both, made(robot, bodies)):
        robot.update(data.draw(states(robot.n)))
        clearance.update()
        assert np.all(np.abs(clearance.slope) <= clearance.reach + 1e-6)


@given(clad_arms(), obstacles(), st.data())
@examples(60)
def test_a_bound_is_never_above_its_distance_and_near_ones_are_exact(arm, obstacle, data):
    robot, given_capsules, _ = arm
    bodies = robot_bodies(robot, capsules=given_capsules)
    threshold = 0.2
    q = data.draw(states(robot.n)) * 0.5
    links = list(bodies)
    pair = [obstacle_clearance(robot, bodies, shape_of(obstacle), links) for _ in range(2)]
    own = [made(robot, bodies) for _ in range(2)]
    for _ in range(8):
        q = np.clip(q + 0.1 * np.array(data.draw(vectors(robot.n, 1))), -5.0, 5.0)
        robot.update(q)
        for kept, fresh in (pair, own):
            kept.threshold = threshold
            kept.update()
            exact = fresh.distances()
            fresh.update()
            near = exact < threshold
            assert np.all(kept.distance <= exact + 1e-6)
            np.testing.assert_allclose(kept.distance[near], exact[near], atol=1e-6)
            assert np.all(kept.distance[~near] >= threshold - 1e-6)
            assert kept.distance.min() == pytest.approx(exact.min(), abs=1e-6)
            assert not kept.slope[~near].any()
            probed = np.zeros_like(exact)
            kept.probe(probed)
            np.testing.assert_array_equal(probed, kept.distance)


def test_where_iterations_fail_what_was_known_counts_and_the_way_is_that_of_the_middles(
    monkeypatch,
):
    robot = planar_robot(1.0, 1.0)
    bodies = robot_bodies(robot, link_radius=[0.1])
    clearance = obstacle_clearance(robot, bodies, sphere(0.2, [1.0, 1.0, 0.0]), ['link_1'])
    clearance._copies, clearance._found = True, np.zeros_like(clearance._found)
    clearance.update()
    before = clearance.distance.copy()
    robot.update(np.array([0.1, 0.0]))
    monkeypatch.setattr(clearance, '_copy', lambda count: clearance._found.fill(math.nan))
    clearance.update()
    np.testing.assert_allclose(clearance.distance, before - 0.1 * clearance.reach[:, 0])
    # The middle of the link is at half its length, the obstacle's at (1, 1).
    middle = 0.5 * np.array([np.cos(0.1), np.sin(0.1)])
    way = (np.array([1.0, 1.0]) - middle) / np.linalg.norm(np.array([1.0, 1.0]) - middle)
    turn = np.array([-middle[1], middle[0]])
    np.testing.assert_allclose(clearance.slope, [[-way @ turn, 0.0]], atol=1e-9)


def test_of_far_rows_only_the_least_distance_is_computed_anew(monkeypatch):
    robot = planar_robot(1.0, 1.0)
    clearance = obstacle_clearance(
        robot, robot_bodies(robot, link_radius=[0.1]), half_space([0.0, -5.0, 0.0], [0, 1, 0])
    )
    clearance.threshold = 0.1
    clearance.update()
    compute, computed = clearance._compute, []

    def noted(count):
        computed.extend(clearance._near[:count].tolist())
        return compute(count)

    monkeypatch.setattr(clearance, '_compute', noted)
    robot.update(np.array([-0.5, 0.0]))
    clearance.update()
    assert computed == [3]
    assert clearance.names == ('link_1 start', 'link_1 end', 'link_2 start', 'link_2 end')
    away = 0.5 * np.array([0.1, 1.1, 1.1])
    np.testing.assert_allclose(clearance.distance[:3], 4.9 - away)
    assert clearance.distance[3] == pytest.approx(4.9 - 2.0 * np.sin(0.5))


@given(clad_arms(), obstacles(), vectors(3, 1), vectors(3, 1), st.booleans(), st.data())
@examples(50)
def test_an_obstacle_that_has_moved_is_as_one_that_was_always_there(
    arm, obstacle, turn, way, turned, data
):
    robot, given_capsules, _ = arm
    bodies = robot_bodies(robot, capsules=given_capsules)
    shape, pose = obstacle
    robot.update(data.draw(states(robot.n)))
    clearance = obstacle_clearance(robot, bodies, shape_of(obstacle), list(bodies))
    clearance.threshold = 0.3
    clearance.update()
    pose = pose.copy()
    pose[:3, 3] += way
    if turned:
        pose[:3, :3] = pose[:3, :3] @ rotation(turn)
    clearance.move(pin.SE3(pose))
    clearance.update()
    there = obstacle_clearance(robot, bodies, shape_of((shape, pose)), list(bodies))
    there.threshold = 0.3
    there.update()
    exact = there.distances()
    assert np.all(clearance.distance <= exact + 1e-6)
    np.testing.assert_allclose(clearance.slope, there.slope, atol=2e-3)
    near = exact < 0.3
    np.testing.assert_allclose(clearance.distance[near], exact[near], atol=1e-6)
    assert clearance.obstacle.pose.isApprox(pin.SE3(pose))


@pytest.mark.parametrize('height', [0.1, 0.05, 0.0, -0.05, -0.2, -1.0])
@pytest.mark.parametrize(
    'kind', ['sphere', 'cylinder', 'box', 'half_space'], ids=lambda kind: f'from a {kind}'
)
def test_the_way_out_of_an_overlap_is_the_way_in(kind, height):
    """A rod over the top of something, at any height and depth to its middle."""
    size = {'sphere': (2.0,), 'cylinder': (9.0, 4.0), 'box': (9.0, 9.0, 4.0), 'half_space': ()}
    top = {'half_space': 0.0}.get(kind, 2.0)
    below = pin.SE3(np.eye(3), np.array([1.0, 0.0, -top]))
    robot = planar_robot(1.0)
    robot.update(np.zeros(1))
    body = capsule([0.0, 0.0, 0.0], [0.0, 0.0, 1.0], 0.1).moved(
        pin.SE3(np.eye(3), np.array([0.0, 0.0, 0.1 + height]))
    )
    clearance = obstacle_clearance(robot, {'link_1': (body,)}, Shape(kind, size[kind], below))
    distances = clearance.distances()
    assert distances.min() == pytest.approx(height, abs=1e-6)
    if height:
        point, nearest = clearance.nearest_points()[np.argmin(distances)]
        np.testing.assert_allclose((point - nearest) / height, [0.0, 0.0, 1.0], atol=1e-3)


@pytest.mark.parametrize('kind', ['sphere', 'cylinder', 'box'])
def test_in_the_very_middle_distance_and_slope_are_finite(kind):
    robot = planar_robot(1.0)
    for turns in np.linspace(0.0, 2.0 * math.pi, 17):
        shape = Shape(kind, (0.4,) * SIZES[kind], pin.SE3(np.eye(3), np.array([1.0, 0.0, 0.0])))
        for body in (Shape('sphere', (0.1,), pin.SE3.Identity()), shape.moved(pin.SE3.Identity())):
            clearance = obstacle_clearance(robot, {'link_1': (body,)}, shape)
            robot.update(np.array([turns if turns < 3.0 else 0.0]))
            clearance.update()
            assert np.all(np.isfinite(clearance.slope))
            assert np.all(np.abs(clearance.slope) <= clearance.reach + 1e-9)
            assert np.all(np.abs(clearance.distance) < 3.0)


def test_a_link_with_several_shapes_has_the_nearest_one_in_its_row():
    robot = planar_robot(1.0, 1.0)
    arm = robot_bodies(
        robot,
        capsules={'link_2': [-1, 0, 0, 0, 0, 0, 0.1, 0, 0, 0, 0, 0.5, 0, 0.2]},
    )
    clearance = obstacle_clearance(robot, arm, sphere(1.0, [0.0, 3.0, 0.0]))
    robot.update(np.zeros(2))
    clearance.update()
    assert clearance.names == ('link_2',)
    away = math.hypot(2.0, 2.5)
    np.testing.assert_allclose(clearance.distance, [away - 1.2])
    np.testing.assert_allclose(clearance.slope, [[-6.0 / away, -3.5 / away]])
    robot.update(np.array([-math.pi / 2, 0.0]))
    clearance.update()
    np.testing.assert_allclose(clearance.distance, [2.9])
    np.testing.assert_allclose(clearance.slope, [[0.0, 0.0]], atol=1e-12)


def test_the_ends_of_capsules_have_rows_of_their_own_along_flat_obstacles():
    robot = planar_robot(1.0)
    bodies = robot_bodies(robot, link_radius=[0.1])
    below = pin.SE3(np.eye(3), np.array([0.0, -1.0, 0.0]))
    robot.update(np.array([0.2]))
    for shape, names in (
        (sphere(0.5, below.translation), ('link_1',)),
        (half_space(below.translation, [0.0, 1.0, 0.0]), ('link_1 start', 'link_1 end')),
        (Shape('box', (9.0, 0.2, 9.0), below), ('link_1', 'link_1 start', 'link_1 end')),
    ):
        clearance = obstacle_clearance(robot, bodies, shape)
        assert clearance.names == names
    np.testing.assert_allclose(clearance.distances(), [0.8, 0.8, 0.8 + math.sin(0.2)])


def test_only_joints_between_two_links_change_their_distance():
    robot = planar_robot(1.0, 1.0, 1.0, 1.0)
    clearance = self_clearance(robot, robot_bodies(robot, link_radius=[0.1]))
    assert clearance.names == ('link_1 - link_3', 'link_1 - link_4', 'link_2 - link_4')
    np.testing.assert_array_equal(
        clearance.reach > 0.0,
        [[False, True, True, False], [False, True, True, True], [False, False, True, True]],
    )
    # The first joint beyond link 1 is at its end: no more than its length and radius away.
    np.testing.assert_allclose(clearance.reach[1], [0.0, 1.1, 2.1, 1.1])
