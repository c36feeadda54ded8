import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from urdf_arm import ARM
from urdf_reference import descriptions, jacobian, poses

from tp_controller import InvalidValue
from tp_controller.robot import read_description, urdf_robot
from tp_controller.tasks import JointTask

H = 1e-6


@given(descriptions(), st.data())
def test_poses_agree_with_an_independent_reader(case, data):
    text, leaders = case
    joints = data.draw(st.permutations(leaders))
    count = data.draw(st.integers(1, len(joints)))
    controlled, others = joints[:count], joints[count:]
    position = st.floats(-3.0, 3.0)
    q = data.draw(st.lists(position, min_size=count, max_size=count))
    rest = {name: data.draw(position) for name in others}
    robot = urdf_robot(text, controlled, rest_positions=rest)
    robot.update(np.array(q))
    expected = poses(text, dict(zip(controlled, q, strict=True)) | rest)
    assert set(robot.frames) == set(expected)
    for name, pose in expected.items():
        frame = robot.frame(name)
        np.testing.assert_allclose(frame.position, pose[:3, 3], atol=1e-9)
        np.testing.assert_allclose(frame.rotation, pose[:3, :3], atol=1e-9)


@given(descriptions(), st.data())
def test_jacobians_agree_with_finite_differences(case, data):
    text, joints = case
    robot = urdf_robot(text, joints)
    q = np.array([data.draw(st.floats(-3.0, 3.0)) for _ in joints])
    name = data.draw(st.sampled_from(robot.frames))
    robot.update(q)
    J = robot.frame(name).jacobian.copy()
    assert J.shape == (6, robot.n)
    for i in range(robot.n):
        before, after = (
            poses(text, dict(zip(joints, q + sign * H * np.eye(robot.n)[i], strict=True)))[name]
            for sign in (-1.0, 1.0)
        )
        linear = (after[:3, 3] - before[:3, 3]) / (2.0 * H)
        W = (after[:3, :3] - before[:3, :3]) / (2.0 * H) @ robot.frame(name).rotation.T
        np.testing.assert_allclose(J[:3, i], linear, atol=1e-6)
        np.testing.assert_allclose(J[3:, i], [W[2, 1], W[0, 2], W[1, 0]], atol=1e-6)


@given(descriptions(), st.data())
def test_jacobians_agree_with_the_axes_of_the_joints(case, data):
    text, joints = case
    robot = urdf_robot(text, joints)
    q = np.array([data.draw(st.floats(-3.0, 3.0)) for _ in joints])
    robot.update(q)
    expected = poses(text, dict(zip(joints, q, strict=True)))
    for name in robot.frames:
        J = jacobian(text, expected, name, joints)
        np.testing.assert_allclose(robot.frame(name).jacobian, J, rtol=0.0, atol=1e-9)


def test_without_names_all_movable_joints_are_controlled_in_the_order_of_the_file():
    robot = urdf_robot(ARM)
    assert robot.joints == ('shoulder', 'elbow', 'grip')
    assert robot.base_frame == 'world'
    assert robot.frames[-1] == 'thumb'


def test_limits_come_from_the_description_unless_they_are_given():
    limits = urdf_robot(ARM).limits
    np.testing.assert_array_equal(limits.velocity, [2.0, 3.0, 0.2])
    np.testing.assert_array_equal(limits.position_min, [-np.inf, -1.0, 0.0])
    np.testing.assert_array_equal(limits.position_max, [np.inf, 2.0, 0.1])
    given = urdf_robot(ARM, limits={'velocity': [0.5], 'position_max': [9.0, 9.0, 9.0]}).limits
    np.testing.assert_array_equal(given.velocity, [0.5, 0.5, 0.5])
    np.testing.assert_array_equal(given.position_min, [-np.inf, -1.0, 0.0])
    np.testing.assert_array_equal(given.position_max, [9.0, 9.0, 9.0])


@pytest.mark.parametrize(
    'part',
    [
        *('<dynamics/>', '<calibration/>', '<safety_controller/>', '<limit effort="much"/>'),
        '<dynamics damping="a"/>',
        '<unheard_of/>',
    ],
)
def test_what_the_kinematics_do_not_need_is_not_read(part, capfd):
    robot = urdf_robot(ARM.replace('<axis xyz="0 -1 0"/>', f'<axis xyz="0 -1 0"/>{part}'))
    assert robot.joints == ('shoulder', 'elbow', 'grip')
    assert capfd.readouterr() == ('', '')


def test_limits_too_large_to_be_meant_are_none():
    text = ARM.replace('lower="-1" upper="2"', 'lower="0" upper="1e16"')
    limits = urdf_robot(text.replace('velocity="3"', 'velocity="1e9"')).limits
    np.testing.assert_array_equal(limits.position_min, [-np.inf, 0.0, 0.0])
    np.testing.assert_array_equal(limits.position_max, [np.inf, np.inf, 0.1])
    np.testing.assert_array_equal(limits.velocity, [2.0, np.inf, 0.2])


def test_everything_may_be_expressed_in_a_link_fixed_to_the_root():
    robot = urdf_robot(ARM, base_frame='base')
    np.testing.assert_allclose(robot.frame('lower').position, [1.0, 0.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(robot.frame('base').position, np.zeros(3), atol=1e-12)
    np.testing.assert_allclose(robot.frame('world').position, [0.0, 0.0, -1.0], atol=1e-12)
    np.testing.assert_allclose(robot.frame('lower').jacobian[:3, 0], [0, 1, 0], atol=1e-12)


def test_limits_of_a_mimicking_joint_are_limits_of_its_leader():
    text = ARM.replace(
        '<mimic joint="grip"/>', '<mimic joint="grip" multiplier="-2" offset="0.1"/>'
    )
    limits = urdf_robot(text, ['grip']).limits
    np.testing.assert_allclose(limits.velocity, [0.1])
    np.testing.assert_allclose([limits.position_min, limits.position_max], [[0.0], [0.05]])


def test_a_mimicking_joint_follows_its_leader():
    robot = urdf_robot(ARM, ['grip'], base_frame='base', rest_positions={'elbow': np.pi / 2})
    robot.update(np.array([0.04]))
    np.testing.assert_allclose(robot.frame('finger').position, [0.96, 0.5, 0.0], atol=1e-12)
    np.testing.assert_allclose(robot.frame('thumb').position, [1.04, 0.5, 0.0], atol=1e-12)
    np.testing.assert_allclose(robot.frame('thumb').jacobian[:3, 0], [1, 0, 0], atol=1e-12)


def test_the_error_of_a_continuous_joint_goes_the_short_way_and_of_another_does_not():
    robot = urdf_robot(ARM)
    task = JointTask('turn', robot, ['shoulder', 'elbow'])
    task.target = [6.0, 6.0]
    robot.update(np.array([-1.0, -1.0, 0.0]))
    task.update()
    np.testing.assert_allclose(task.error, [7.0 - 2.0 * np.pi, 7.0])


BAD = [
    ('</robot>', '', 'robot.urdf', 'malformed XML'),
    ('<robot name="arm">', '<robot name="arm"><joint/>', 'robot.urdf', 'a joint named None'),
    ('type="prismatic"', 'type="ball"', 'robot.urdf', "'ball'"),
    ('<parent link="upper"/>', '<parent link="uper"/>', 'robot.urdf', "parent 'uper'"),
    ('<parent link="world"/>', '<parent link="thumb"/>', 'robot.urdf', 'roots'),
    ('<child link="thumb"/>', '<child link="finger"/>', 'robot.urdf', "'finger' as a child twice"),
    ('xyz="1 0 0"', 'xyz="1 0"', 'robot.urdf', "'1 0'"),
    ('xyz="1 0 0"', 'xyz="1 nan 0"', 'robot.urdf', "'1 nan 0'"),
    ('<mimic joint="grip"/>', '<mimic joint="clip"/>', 'robot.urdf', "'clip'"),
    ('lower="-1" upper="2"', 'lower="2" upper="-1"', 'robot.limits.position_min', '2.0'),
    ('<link name="thumb"/>', '<link name="thumb"/>' * 2, 'robot.urdf', 'links'),
    ('xyz="0 -1 0"', 'xyz="0 0 0"', 'robot.urdf', "axis '0 0 0'"),
    ('xyz="0 -1 0"', '', 'robot.urdf', "axis ''"),
    ('xyz="1 0 0"', 'xyz="1_0 0 0"', 'robot.urdf', "'1_0 0 0'"),
]


@pytest.mark.parametrize(('old', 'new', 'key', 'got'), BAD)
def test_a_description_that_is_not_one_is_refused_with_the_reason(old, new, key, got):
    assert old in ARM
    with pytest.raises(InvalidValue) as error:
        urdf_robot(ARM.replace(old, new, 1) if new else ARM.replace(old, new))
    assert error.value.key == key
    assert got in error.value.got


@pytest.mark.parametrize(
    ('arguments', 'key', 'accepts'),
    [
        ({'joints': ['wrist']}, 'robot.joints', 'some of shoulder, elbow, grip'),
        ({'joints': ['grip_mirror']}, 'robot.joints', 'some of shoulder, elbow, grip'),
        ({'joints': ['elbow', 'elbow']}, 'robot.joints', 'every joint once'),
        ({'base_frame': 'upper'}, 'robot.base_frame', 'one of world, base'),
        ({'rest_positions': {'elbow': 0.0}}, 'robot.rest_positions', 'some of nothing'),
        ({'limits': {'velocity': [1.0, 2.0]}}, 'robot.limits.velocity', '1 value or 3'),
    ],
)
def test_what_the_description_has_not_is_refused_with_what_it_has(arguments, key, accepts):
    with pytest.raises(InvalidValue) as error:
        urdf_robot(ARM, **arguments)
    assert error.value.key == key
    assert accepts in error.value.accepts


def test_a_description_that_is_too_long_is_refused_unread():
    with pytest.raises(InvalidValue, match='10000008 characters'):
        urdf_robot(f'<robot/>{" " * 10_000_000}')


def test_a_description_in_which_nothing_moves_is_refused():
    with pytest.raises(InvalidValue, match='without a movable joint') as error:
        urdf_robot('<robot name="table"><link name="top"/></robot>')
    assert error.value.key == 'robot.urdf'


def test_descriptions_are_read_from_paths_and_packages(tmp_path, monkeypatch):
    folder = tmp_path / 'share' / 'my_arm' / 'urdf'
    folder.mkdir(parents=True)
    (folder / 'arm.urdf').write_text(ARM)
    monkeypatch.setenv('AMENT_PREFIX_PATH', f'/nowhere:{tmp_path}')
    assert read_description('package://my_arm/urdf/arm.urdf') == ARM
    assert read_description(str(folder / 'arm.urdf')) == ARM
    for path, got in [
        ('package://my_leg/urdf/arm.urdf', "the package 'my_leg'"),
        ('package://my_arm/urdf/leg.urdf', 'No such file'),
        (str(tmp_path), 'Is a directory'),
    ]:
        with pytest.raises(InvalidValue, match=r'robot\.urdf: got ') as error:
            read_description(path)
        assert got in error.value.got


def test_packages_of_ros_go_before_those_of_python(tmp_path, monkeypatch):
    ros, modules, prefix = (tmp_path / name for name in ('ros', 'modules', 'prefix'))
    monkeypatch.setenv('AMENT_PREFIX_PATH', str(ros))
    monkeypatch.setattr(sys, 'path', ['/nowhere', str(modules)])
    monkeypatch.setattr(sys, 'prefix', str(prefix))
    for place in (prefix, modules / 'cmeel.prefix', ros):
        folder = place / 'share' / 'my_arm'
        folder.mkdir(parents=True)
        (folder / 'arm.urdf').write_text(str(place))
        assert read_description('package://my_arm/arm.urdf') == str(place)
    with pytest.raises(InvalidValue) as error:
        read_description('package://my_leg/arm.urdf')
    assert str(error.value) == (
        "robot.urdf: got the package 'my_leg'; "
        'accepts a package in AMENT_PREFIX_PATH or of this Python'
    )
