"""Descriptions of arms as manufacturers ship them, against a reader of the tests' own."""

import re
from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple
from xml.etree import ElementTree

import numpy as np
import pytest
from urdf_reference import jacobian, joint_elements, poses

from tp_controller.robot import read_description, urdf_robot
from tp_controller.tasks import JointTask

STATES = 1000
PACKAGE = 'package://example-robot-data/robots/'
UR_JOINTS = ['shoulder_pan', 'shoulder_lift', 'elbow', 'wrist_1', 'wrist_2', 'wrist_3']


class Arm(NamedTuple):
    path: str
    joints: list[str]
    middle: str
    tip: str
    held: Mapping[str, float] = MappingProxyType({})

    @property
    def text(self):
        return read_description(PACKAGE + self.path)

    def robot(self, text=None):
        return urdf_robot(text or self.text, self.joints, rest_positions=self.held)


ARMS = {
    'panda': Arm(
        'panda_description/urdf/panda.urdf',
        [f'panda_joint{i + 1}' for i in range(7)],
        'panda_link4',
        'panda_hand_tcp',
        {'panda_finger_joint1': 0.03},
    ),
    'ur5': Arm(
        'ur_description/urdf/ur5_robot.urdf',
        [f'{name}_joint' for name in UR_JOINTS],
        'forearm_link',
        'tool0',
    ),
    'ur10': Arm(
        'ur_description/urdf/ur10_robot.urdf',
        [f'{name}_joint' for name in UR_JOINTS],
        'forearm_link',
        'tool0',
    ),
    'kinova': Arm(
        'kinova_description/robots/kinova.urdf',
        [f'j2s6s200_joint_{i + 1}' for i in range(6)],
        'j2s6s200_link_3',
        'j2s6s200_end_effector',
    ),
}
TURNING = {'kinova': ['j2s6s200_joint_1', 'j2s6s200_joint_4', 'j2s6s200_joint_6']}
"""Joints that turn without end."""

each_arm = pytest.mark.parametrize('arm', ARMS.values(), ids=ARMS)


def random_states(limits):
    """Random states (STATES, n) inside limits; joints without any turn several times round."""
    lower = np.where(np.isinf(limits.position_min), -20.0, limits.position_min)
    upper = np.where(np.isinf(limits.position_max), 20.0, limits.position_max)
    return np.random.default_rng(5).uniform(lower, upper, (STATES, lower.size))


@each_arm
def test_poses_and_jacobians_agree_with_an_independent_reader(arm):
    robot = arm.robot()
    states = random_states(robot.limits)
    found = {name: np.zeros((STATES, 4, 4)) for name in robot.frames}
    found_jacobians = {name: np.zeros((STATES, 6, robot.n)) for name in (arm.middle, arm.tip)}
    for i, q in enumerate(states):
        robot.update(q)
        for name, pose in found.items():
            frame = robot.frame(name)
            pose[i, :3, :3], pose[i, :3, 3], pose[i, 3, 3] = frame.rotation, frame.position, 1.0
        for name, J in found_jacobians.items():
            J[i] = robot.frame(name).jacobian
    expected = poses(arm.text, dict(zip(arm.joints, states.T, strict=True)) | dict(arm.held))
    assert found.keys() == expected.keys()
    for name, pose in expected.items():
        np.testing.assert_allclose(found[name], pose, rtol=0.0, atol=1e-9, err_msg=name)
    for name, J in found_jacobians.items():
        expected_J = jacobian(arm.text, expected, name, arm.joints)
        np.testing.assert_allclose(J, expected_J, rtol=0.0, atol=1e-9, err_msg=name)


@each_arm
def test_limits_are_those_of_the_description(arm):
    limits = arm.robot().limits
    written = {joint.get('name'): joint for joint in joint_elements(arm.text).values()}
    for i, name in enumerate(arm.joints):
        limit = written[name].find('limit')
        assert limits.velocity[i] == float(limit.get('velocity'))
        if written[name].get('type') != 'continuous':
            assert limits.position_min[i] == float(limit.get('lower'))
            assert limits.position_max[i] == float(limit.get('upper'))


@pytest.mark.parametrize('name', ARMS)
def test_joints_that_turn_without_end_have_no_range_and_go_the_short_way(name):
    arm = ARMS[name]
    robot = arm.robot()
    turning = np.isin(arm.joints, TURNING.get(name, []))
    np.testing.assert_array_equal(robot.wrapping, turning)
    np.testing.assert_array_equal(np.isinf(robot.limits.position_min), turning)
    np.testing.assert_array_equal(np.isinf(robot.limits.position_max), turning)
    task = JointTask('turn', robot, arm.joints)
    task.target = [3.0] * robot.n
    robot.update(np.full(robot.n, -3.0))
    task.update()
    np.testing.assert_allclose(task.error, np.where(turning, 6.0 - 2.0 * np.pi, 6.0))


@each_arm
def test_meshes_may_be_missing_without_a_word(arm, tmp_path, capfd):
    text, count = re.subn(r'filename="[^"]*"', 'filename="package://none/none.dae"', arm.text)
    assert count > 0
    path = tmp_path / 'arm.urdf'
    path.write_text(text)
    robot = arm.robot(read_description(str(path)))
    assert capfd.readouterr() == ('', '')
    links = [link.get('name') for link in ElementTree.fromstring(text).findall('link')]
    assert sorted(robot.frames) == sorted(links)
