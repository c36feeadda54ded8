"""Shapes of links: along the links of an arm, from a URDF, and given."""

import math
import struct

import numpy as np
import pinocchio as pin
import pytest
from clearance_reference import point_line
from hypothesis import given
from hypothesis import strategies as st
from random_stacks import arms, examples, states
from references import dh_poses
from small_arms import planar_robot, robot_of
from test_real_arms import ARMS

from tp_controller import InvalidValue
from tp_controller.robot import (
    half_space,
    link_pairs,
    obstacle_clearance,
    read_description,
    robot_bodies,
    self_clearance,
    sphere,
    urdf_robot,
)
from tp_controller.robot.package_files import place_of
from tp_controller.robot.shapes import fitted_capsule

URDF = """
<robot name="arm">
  <link name="foot"><collision><geometry><box size="1 1 0.2"/></geometry></collision></link>
  <link name="arm">
    <collision>
      <origin xyz="0.5 0 0" rpy="0 1.5707963267948966 0"/>
      <geometry><cylinder radius="0.1" length="0.8"/></geometry>
    </collision>
    <collision>
      <origin xyz="1 0 0"/><geometry><sphere radius="0.2"/></geometry>
    </collision>
  </link>
  <link name="hand"><collision><geometry>SHAPE</geometry></collision></link>
  <link name="tip"/>
  <joint name="turn" type="continuous">
    <parent link="foot"/><child link="arm"/><origin xyz="0 0 0.5"/><axis xyz="0 0 1"/>
  </joint>
  <joint name="bend" type="continuous">
    <parent link="arm"/><child link="hand"/><origin xyz="1 0 0"/><axis xyz="0 0 1"/>
  </joint>
  <joint name="weld" type="fixed">
    <parent link="hand"/><child link="tip"/><origin xyz="0.3 0 0"/>
  </joint>
</robot>
"""
CYLINDER = '<cylinder radius="0.1" length="0.4"/>'


def line(shape):
    """Ends (2, 3) of the middle line of a capsule."""
    points, _ = shape.hull()
    return points[0], points[-1]


def bodies_of(text, **settings):
    return robot_bodies(urdf_robot(text), text, **settings)


@given(arms(1, 6), st.data())
@examples(60)
def test_capsules_along_the_links_of_a_dh_arm_go_from_joint_to_joint(block, data):
    dh = block['dh'] | {'types': ['revolute'] * len(block['joints'])}
    robot = robot_of(block | {'dh': dh})
    bodies = robot_bodies(robot, link_radius=[0.1])
    poses = dh_poses(dh, data.draw(states(robot.n)))
    foot = np.array(dh.get('base_pose', [0.0] * 6)[:3])
    for i, pose in enumerate(poses):
        place, (x, _, z) = pose[:3, 3], pose[:3, :3].T
        if dh.get('convention') == 'modified':
            # The joint is where d begins, the next one's axis where its a ends.
            start = place - dh['d'][i] * z
            end = place + dh['a'][i + 1] * x if i + 1 < robot.n else place
        else:
            start, end = poses[i - 1][:3, 3] if i else foot, place
        shapes = bodies.get(f'link_{i + 1}', ())
        assert len(shapes) == (np.linalg.norm(end - start) > 1e-9)
        for shape in shapes:
            places = [pose[:3, :3] @ point + place for point in line(shape)]
            np.testing.assert_allclose(places, [start, end], atol=1e-9)


def test_links_may_have_radii_of_their_own_and_capsules_in_place_of_these():
    bodies = robot_bodies(
        planar_robot(1.0, 0.5),
        link_radius=[0.1, 0.2],
        capsules={'base': [0, 0, -1, 0, 0, 0, 0.3], 'link_2': [0, 0, 0, 0, 0, 1, 0.4]},
    )
    assert list(bodies) == ['base', 'link_1', 'link_2']
    assert [shapes[0].size[0] for shapes in bodies.values()] == [0.3, 0.1, 0.4]
    np.testing.assert_allclose(line(bodies['link_1'][0]), [[-1, 0, 0], [0, 0, 0]], atol=1e-12)
    np.testing.assert_allclose(line(bodies['link_2'][0]), [[0, 0, 0], [0, 0, 1]], atol=1e-12)


def test_a_link_without_length_has_no_shape():
    assert list(robot_bodies(planar_robot(1.0, 0.0, 0.5), link_radius=[0.1])) == [
        'link_1',
        'link_3',
    ]


def test_along_the_links_of_a_urdf_the_last_one_ends_at_its_farthest_frame():
    bodies = bodies_of(URDF, link_radius=[0.1])
    assert list(bodies) == ['arm', 'hand']
    np.testing.assert_allclose(line(bodies['arm'][0]), [[0, 0, 0], [1, 0, 0]], atol=1e-12)
    np.testing.assert_allclose(line(bodies['hand'][0]), [[0, 0, 0], [0.3, 0, 0]], atol=1e-12)


def test_collision_shapes_of_a_urdf_are_where_it_says():
    text = URDF.replace('SHAPE', CYLINDER)
    bodies = bodies_of(text)
    kinds = {link: [shape.kind for shape in shapes] for link, shapes in bodies.items()}
    assert kinds == {'foot': ['box'], 'arm': ['cylinder', 'sphere'], 'hand': ['cylinder']}
    assert bodies['foot'][0].size == (1.0, 1.0, 0.2)
    np.testing.assert_allclose(line(bodies['arm'][0]), [[0.1, 0, 0], [0.9, 0, 0]], atol=1e-12)
    robot = urdf_robot(text)
    # Seen from the y side of a stretched arm: the sphere is the thickest part.
    wall = half_space([0.0, 1.0, 0.0], [0.0, -1.0, 0.0])
    clearance = obstacle_clearance(robot, bodies, wall)
    assert clearance.names == ('arm', 'hand')
    np.testing.assert_allclose(clearance.distances(), [0.8, 0.9], atol=1e-9)


def test_a_cylinder_with_spheres_at_its_ends_is_a_capsule():
    ball = '<collision><origin xyz="0 0 {}"/><geometry><sphere radius="0.1"/></geometry>'
    rounded = f'{CYLINDER}</geometry></collision>{ball.format(0.2)}</collision>{ball.format(-0.2)}'
    text = URDF.replace('SHAPE</geometry>', rounded)
    (shape,) = bodies_of(text)['hand']
    assert shape.kind == 'capsule'
    assert shape.size == pytest.approx((0.1, 0.4))


def test_a_mesh_that_is_not_there_wants_capsules_or_a_radius():
    text = URDF.replace('SHAPE', '<mesh filename="package://none/hand.stl"/>')
    with pytest.raises(InvalidValue) as caught:
        bodies_of(text)
    assert caught.value.key == 'robot.capsules.hand'
    assert 'package://none/hand.stl' in caught.value.got
    assert 'link_radius' in caught.value.accepts
    assert '\n' not in str(caught.value)
    given_one = bodies_of(text, capsules={'hand': [0, 0, 0, 0.3, 0, 0, 0.1]})
    assert list(given_one) == ['foot', 'arm', 'hand']
    assert list(bodies_of(text, link_radius=[0.1])) == ['arm', 'hand']


def read_stl(path):
    """Vertices (v, 3) of a binary STL file."""
    data = path.read_bytes()
    (count,) = struct.unpack_from('<I', data, 80)
    faces = np.frombuffer(data[84:], np.dtype([('v', '<f4', (4, 3)), ('end', '<u2')]), count)
    return faces['v'][:, 1:].reshape(-1, 3).astype(float)


@pytest.mark.parametrize('name', ['panda', 'ur5'])
def test_the_meshes_of_a_real_arm_are_inside_their_capsules(name):
    text = ARMS[name].text
    bodies = robot_bodies(ARMS[name].robot(), text)
    found = 0
    for link, shapes in bodies.items():
        element = text.split(f'<link name="{link}">')[1].split('</link>')[0]
        element = element.split('<collision>')[1].split('</collision>')[0]
        if '<origin' in element or '<mesh' not in element:
            continue
        vertices = read_stl(place_of(element.split('filename="')[1].split('"')[0]))
        ends, radius = line(shapes[0]), shapes[0].size[0]
        assert max(point_line(vertex, *ends) for vertex in vertices) <= radius + 1e-12
        assert radius < 0.5 * np.median(np.ptp(vertices, axis=0)) + 0.03
        found += 1
    assert found >= 7


@given(st.integers(1, 40), st.integers(0, 10**6))
@examples(60)
def test_a_fitted_capsule_holds_every_point(count, seed):
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(count, 3)) * rng.uniform(0.0, 1.0, 3) + rng.normal(size=3)
    shape = fitted_capsule(points)
    ends, radius = line(shape), shape.size[0]
    assert max(point_line(point, *ends) for point in points) <= radius + 1e-9


def test_the_capsule_round_a_capsule_is_about_that_one():
    rng = np.random.default_rng(3)
    directions = rng.normal(size=(4000, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    along = np.where(directions[:, 2] > 0.0, 0.3, -0.3)
    turn = pin.rpy.rpyToMatrix(np.array([0.4, 1.1, -0.7]))
    points = (0.1 * directions + np.outer(along, [0, 0, 1])) @ turn.T + [1.0, 2.0, 3.0]
    shape = fitted_capsule(points)
    assert shape.size == pytest.approx((0.1, 0.6), rel=0.05)
    np.testing.assert_allclose(shape.pose.translation, [1.0, 2.0, 3.0], atol=0.01)


def test_neighbours_and_links_without_a_shape_in_between_are_no_pairs():
    robot = planar_robot(1.0, 0.0, 1.0, 1.0)
    assert link_pairs(robot, robot_bodies(robot, link_radius=[0.1])) == [('link_1', 'link_4')]
    text = URDF.replace('SHAPE', CYLINDER)
    tip = {'tip': [0, 0, 0, 0.1, 0, 0, 0.05]}
    assert link_pairs(urdf_robot(text), bodies_of(text, capsules=tip)) == [
        ('foot', 'hand'),
        ('foot', 'tip'),
    ]


def test_pairs_may_be_named_or_left_out():
    robot = planar_robot(1.0, 1.0, 1.0, 1.0)
    bodies = robot_bodies(robot, link_radius=[0.1])
    assert self_clearance(robot, bodies, [('link_4', 'link_1')]).names == ('link_4 - link_1',)
    found = self_clearance(robot, bodies, ignore=[('link_4', 'link_1')])
    assert found.names == ('link_1 - link_3', 'link_2 - link_4')


def clad(**settings):
    return robot_bodies(planar_robot(1.0, 1.0), **settings)


def of_pairs(pairs=None, ignore=()):
    robot = planar_robot(1.0, 1.0, 1.0)
    self_clearance(robot, robot_bodies(robot, link_radius=[0.1]), pairs, ignore)


def from_sphere(links=None, **settings):
    robot = planar_robot(1.0, 1.0)
    obstacle_clearance(robot, robot_bodies(robot, **settings), sphere(1.0), links)


def clothed(shape):
    return bodies_of(URDF.replace('SHAPE', shape))


@pytest.mark.parametrize(
    ('make', 'key', 'accepts'),
    [
        (lambda: clad(link_radius=[0.1, 0.2, 0.3]), 'robot.link_radius', '1 value or 2'),
        (lambda: clad(link_radius=[]), 'robot.link_radius', '1 value or 2'),
        (lambda: clad(link_radius=[-0.1]), 'robot.link_radius', 'above 0'),
        (lambda: clad(link_radius=[math.nan]), 'robot.link_radius', 'above 0'),
        (
            lambda: clad(capsules={'hand': [0.0] * 7}),
            'robot.capsules.hand',
            'base, link_1, link_2',
        ),
        (lambda: clad(capsules={'link_1': [0.0] * 6}), 'robot.capsules.link_1', '7 a capsule'),
        (lambda: clad(capsules={'link_1': []}), 'robot.capsules.link_1', '7 a capsule'),
        (lambda: clad(capsules={'link_1': [0.0] * 7}), 'robot.capsules.link_1', 'above 0'),
        (
            lambda: clad(capsules={'link_1': [math.inf] * 7}),
            'robot.capsules.link_1',
            'radius above 0',
        ),
        (lambda: clothed('<cone/>'), 'robot.capsules.hand', 'above 0'),
        (lambda: clothed('<sphere radius="0"/>'), 'robot.capsules.hand', 'above 0'),
        (lambda: clothed('<sphere/>'), 'robot.urdf', '1 finite numbers'),
        (lambda: clothed(''), 'robot.capsules.hand', 'above 0'),
        (
            lambda: clothed(f'<mesh filename="{__file__}"/>'),
            'robot.capsules.hand',
            'radius above 0',
        ),
        (from_sphere, 'links', 'robot.link_radius'),
        (lambda: from_sphere(['hand'], link_radius=[0.1]), 'links', 'link_1, link_2'),
        (lambda: of_pairs([('link_1', 'hand')]), 'pairs', 'link_1, link_2'),
        (lambda: of_pairs([('link_1', 'link_1')]), 'pairs', 'joint in between'),
        (lambda: of_pairs(ignore=[('link_1', 'hand')]), 'ignore', 'link_1, link_2'),
        (lambda: of_pairs(ignore=[('link_1', 'link_3')]), 'pairs', 'not neighbours'),
    ],
)
def test_settings_that_make_no_sense_are_refused(make, key, accepts):
    with pytest.raises(InvalidValue) as caught:
        make()
    assert caught.value.key == key
    assert accepts in caught.value.accepts
    assert '\n' not in str(caught.value)


def test_a_description_may_say_capsules_as_pandas_does():
    text = read_description(
        'package://example-robot-data/robots/panda_description/urdf/panda_collision.urdf'
    )
    robot = urdf_robot(text, ARMS['panda'].joints)
    bodies = robot_bodies(robot, text)
    assert {shape.kind for shapes in bodies.values() for shape in shapes} == {'capsule'}
    assert len(bodies['panda_link5']) == 2
