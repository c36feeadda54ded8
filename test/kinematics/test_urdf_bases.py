"""Bases in parameter files and URDFs: what is read, and what is refused in one line."""

import numpy as np
import pytest
from poses import pose, turn_about_z

from tp_controller import JointTask, Stack
from tp_controller.config import build_robot, describe_robot
from tp_controller.config.build import read_parameters
from tp_controller.errors import InvalidValue
from tp_controller.robot import obstacle_clearance, sphere, urdf_robot

ARM = """
<robot name="arm">
  <link name="foot"/><link name="upper"/><link name="lower"/><link name="finger"/>
  <joint name="shoulder" type="continuous"><parent link="foot"/><child link="upper"/>
    <origin xyz="0.1 0 0.3"/><axis xyz="0 0 1"/><limit effort="1" velocity="1.5"/></joint>
  <joint name="elbow" type="revolute"><parent link="upper"/><child link="lower"/>
    <origin xyz="0.4 0 0"/><axis xyz="0 1 0"/>
    <limit lower="-2" upper="2" effort="1" velocity="2.0"/></joint>
  <joint name="grip" type="prismatic"><parent link="lower"/><child link="finger"/>
    <origin xyz="0.3 0 0"/><axis xyz="1 0 0"/><mimic joint="elbow" multiplier="0.1" offset="0.2"/>
    <limit lower="-1" upper="1" effort="1" velocity="1.0"/></joint>
</robot>
"""
CART = """
<robot name="cart">
  <link name="ground"/><link name="cart"/><link name="arm"/>
  <joint name="drive" type="planar"><parent link="ground"/><child link="cart"/>
    <origin xyz="1 2 0.5" rpy="0 0 0.3"/><axis xyz="0 0 1"/>
    <limit effort="1" velocity="0.7"/></joint>
  <joint name="turn" type="revolute"><parent link="cart"/><child link="arm"/>
    <axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="1" velocity="2.0"/></joint>
</robot>
"""
DH = {
    'theta': [0.0, 0.0],
    'd': [0.0, 0.0],
    'a': [0.4, 0.3],
    'alpha': [0.0, 0.0],
    'types': ['revolute', 'revolute'],
}


def values_of(**robot):
    return read_parameters(
        {
            'robot': {'dh': DH, 'joints': ['one', 'two'], **robot},
            'rate': 100.0,
            'hierarchy': ['posture'],
            'tasks': {'posture': {'type': 'posture'}},
        }
    )


@pytest.mark.parametrize('kind', ['planar', 'differential', 'floating'])
def test_a_base_is_put_in_front_of_a_description(kind):
    robot = urdf_robot(ARM, base=kind)
    fixed = urdf_robot(ARM)
    assert robot.base_frame == 'odom'
    assert robot.frames[-4:] == ('foot', 'upper', 'lower', 'finger')
    assert robot.joints[-2:] == ('shoulder', 'elbow')
    assert robot.limits.velocity[-2:] == pytest.approx([1.5, 2.0])
    assert np.all(np.isinf(robot.limits.velocity[:-2]))
    rng = np.random.default_rng(2)
    q = robot.integrate(robot.neutral, rng.uniform(-1.0, 1.0, robot.n))
    robot.update(q)
    fixed.update(q[-2:])
    seen = fixed.frame('finger')
    M = pose(q[:-2])
    assert robot.frame('finger').position == pytest.approx(
        M[:3, :3] @ seen.position + M[:3, 3], abs=1e-12
    )
    assert robot.frame('finger').rotation == pytest.approx(M[:3, :3] @ seen.rotation, abs=1e-12)


def test_joints_of_a_description_may_be_in_any_order_behind_a_base():
    robot = urdf_robot(ARM, ['elbow', 'shoulder'], 'map', base='differential')
    assert robot.joints == ('base/forward', 'base/yaw', 'elbow', 'shoulder')
    assert robot.base_frame == 'map'
    q, step = np.array([0.3, -0.2, 0.4, 0.7, -0.5]), 1e-6
    frame = robot.frame('finger')
    for i in range(robot.n):
        way = step * np.eye(robot.n)[i]
        places = []
        for sign in (1.0, -1.0):
            robot.update(robot.integrate(q, sign * way))
            places.append(frame.position.copy())
        robot.update(q)
        slope = (places[0] - places[1]) / (2.0 * step)
        assert frame.jacobian[:3, i] == pytest.approx(slope, abs=1e-8)


def test_a_planar_joint_of_a_description_moves_in_the_frame_before_it():
    robot = urdf_robot(CART)
    assert robot.joints == ('drive/forward', 'drive/left', 'drive/yaw', 'turn')
    assert robot.coordinates == ('drive/x', 'drive/y', 'drive/yaw', 'turn')
    assert robot.limits.velocity == pytest.approx([0.7, 0.7, 0.7, 2.0])
    robot.update(np.array([0.5, -0.4, 0.2, 0.0]))
    R = turn_about_z(0.3)
    assert robot.frame('cart').position == pytest.approx(R @ [0.5, -0.4, 0.0] + [1.0, 2.0, 0.5])
    assert robot.frame('cart').rotation == pytest.approx(turn_about_z(0.5))


def test_a_floating_joint_may_carry_the_last_link():
    text = CART.replace('type="planar"', 'type="floating"')
    robot = urdf_robot(text, ['turn', 'drive'])
    assert robot.joints[:2] == ('turn', 'drive/forward')
    q = np.concatenate([[0.3], [0.1, 0.2, 0.3], [0.0, 0.0, np.sin(0.2), np.cos(0.2)]])
    robot.update(q)
    R = turn_about_z(0.3)
    assert robot.frame('cart').position == pytest.approx(R @ [0.1, 0.2, 0.3] + [1.0, 2.0, 0.5])
    assert robot.frame('arm').rotation == pytest.approx(turn_about_z(0.3 + 0.4 + 0.3))


def test_a_pose_that_is_not_controlled_stays_at_its_origin():
    robot = urdf_robot(CART, ['turn'])
    assert robot.joints == ('turn',)
    assert robot.frame('cart').position == pytest.approx([1.0, 2.0, 0.5])


@pytest.mark.parametrize(
    ('old', 'new', 'line'),
    [
        (
            '<axis xyz="0 0 1"/>\n    <limit effort="1" velocity="0.7"/>',
            '<axis xyz="1 0 0"/>',
            "robot.urdf: got planar joint 'drive' axis '1 0 0'; accepts 0 0 1, or no axis",
        ),
        ('name="drive"', 'name="base"', "robot.urdf: got a joint named 'base'"),
        ('"ground"', '"odom"', "robot.urdf: got links ['odom', 'cart', 'arm', 'odom']"),
    ],
)
def test_a_description_that_does_not_suit_a_base_is_refused(old, new, line):
    with pytest.raises(InvalidValue) as error:
        urdf_robot(CART.replace(old, new), base='planar')
    assert str(error.value).startswith(line)


@pytest.mark.parametrize(
    ('robot', 'line'),
    [
        (
            {'base': 'wheels'},
            "robot.base: got 'wheels'; accepts one of fixed, planar, floating, differential",
        ),
        (
            {'base': 'differential', 'limits': {'velocity': [1.0, 1.0]}},
            'robot.limits.velocity: got 2 values [1.0, 1.0]; accepts 1 value or 4, one per '
            'velocity, those of the base first',
        ),
        (
            {'base': 'planar', 'limits': {'position_min': [-1.0] * 5}},
            'robot.limits.position_min: got 5 values [-1.0, -1.0, -1.0, -1.0, -1.0]; accepts 1 '
            'value or 2, one per joint of robot.joints',
        ),
        (
            {'base': 'planar', 'base_frame': 'base'},
            "robot.base_frame: got 'base'; accepts a name that no link has (base, link_1, link_2)",
        ),
        (
            {'base': 'planar', 'joints': ['base', 'two']},
            "robot.joints: got 'base' beside robot.base; accepts another name",
        ),
    ],
)
def test_a_base_that_cannot_be_had_is_refused_in_one_line(robot, line):
    with pytest.raises(InvalidValue) as error:
        build_robot(values_of(**robot))
    assert str(error.value) == line


def test_ranges_are_those_of_the_joints_alone():
    limits = {
        'velocity': [0.5, 1.0, 2.0, 3.0],
        'position_min': [-1.0, -2.0],
        'position_max': [2.0],
    }
    robot = build_robot(values_of(base='differential', limits=limits))
    assert robot.limits.velocity == pytest.approx([0.5, 1.0, 2.0, 3.0])
    assert robot.limits.position_min[2:] == pytest.approx([-1.0, -2.0])
    assert robot.limits.position_max == pytest.approx([np.inf, np.inf, 2.0, 2.0])
    changed = robot.limits.replaced(position_max=[1.0, 1.5])
    assert changed.position_max == pytest.approx([np.inf, np.inf, 1.0, 1.5])


def test_a_description_of_an_arm_on_a_base_is_that_of_the_arm():
    values = values_of(base='differential', limits={'velocity': [0.5, 1.0, 2.0, 3.0]})
    robot, text = build_robot(values), describe_robot(values)
    again = urdf_robot(text, base='differential')
    assert again.joints == ('base/forward', 'base/yaw', 'one', 'two')
    assert again.limits.velocity[2:] == pytest.approx([2.0, 3.0])
    q = np.array([0.3, -0.2, 0.4, 0.7, -0.5])
    for made in (robot, again):
        made.update(q)
    assert again.frame('link_2').position == pytest.approx(robot.frame('link_2').position)


def test_a_continuous_joint_moves_on_where_its_position_begins_anew():
    robot = urdf_robot(ARM, limits={'acceleration': [4.0]})
    turn = JointTask('turn', robot, ['shoulder'], feedforward=[1.0], gain=1e-9)
    stack = Stack(robot, [turn], rate=100.0)
    angle = 0.0
    for i in range(800):
        measured = np.angle(np.exp(1j * angle))
        command = stack.step(np.array([measured, 0.0]), 0.01).command
        assert stack.arm.following, i
        angle += 0.01 * command[0]
    assert angle == pytest.approx(8.0, abs=0.3)


@pytest.mark.parametrize('kind', ['planar', 'differential', 'floating'])
def test_distances_of_a_whole_robot_are_the_same_however_it_came_there(kind):
    """Lower bounds from distances elsewhere never say more than the distance."""
    rng = np.random.default_rng(5)
    robots = [
        build_robot(values_of(base=kind, link_radius=[0.1], limits={'velocity': [1.0]}))
        for _ in range(2)
    ]
    obstacle = sphere(0.2, [0.8, 0.3, 0.1])
    moving, fresh = (obstacle_clearance(one, one.bodies, obstacle) for one in robots)
    for clearance in (moving, fresh):
        clearance.threshold = 0.3
    q = robots[0].neutral
    for _ in range(300):
        q = robots[0].integrate(q, rng.normal(size=robots[0].n) * rng.choice([0.01, 0.5]))
        robots[0].update(q)
        moving.update()
        robots[1].update(q)
        exact = fresh.distances()
        assert np.all(moving.distance <= exact + 1e-6)
        assert moving.distance.min() == pytest.approx(exact.min(), abs=1e-6)
        near = exact < 0.3
        assert moving.distance[near] == pytest.approx(exact[near], abs=1e-6)
        # The slope of a distance is its derivative along the velocities.
        qd, step = rng.uniform(-1.0, 1.0, robots[0].n), 1e-6
        ends = []
        for sign in (1.0, -1.0):
            robots[1].update(robots[1].integrate(q, sign * step * qd))
            ends.append(fresh.distances())
        slope = (ends[0] - ends[1]) / (2.0 * step)
        outside = near & (exact > 1e-3)
        assert (moving.slope @ qd)[outside] == pytest.approx(slope[outside], abs=1e-3)
