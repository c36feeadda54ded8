"""The robot's description by topic or parameter, through the real nodes."""

import signal
import subprocess

import numpy as np
import pytest
from ament_index_python.packages import get_package_prefix
from std_msgs.msg import String

from tp_controller.robot import urdf_robot
from tp_controller.ros.robot_node import TOPIC_QOS
from tp_interfaces.msg import ControllerState
from tp_sim.harness import (
    Client,
    ClosedLoop,
    GoalRejected,
    NodeProcess,
    PrivateDomain,
    edited,
    read_document,
    write_document,
)

TELESCOPE = """
<robot name="telescope">
  <link name="floor"/><link name="tower"/><link name="tip"/>
  <joint name="turn" type="revolute"><parent link="floor"/><child link="tower"/>
    <axis xyz="0 0 1"/><limit lower="-3" upper="3" effort="1" velocity="1.0"/></joint>
  <joint name="slide" type="prismatic"><parent link="tower"/><child link="tip"/>
    <axis xyz="1 0 0"/><limit lower="0.2" upper="1.5" effort="1" velocity="0.5"/></joint>
</robot>
"""
NO_ROBOT = {'/**': {'robot': None}}
WAITING = 'waiting for robot_description on /robot_description'


@pytest.fixture
def telescope():
    """Parameters for the telescope, without its description."""
    return {
        'tp_sim': {'rate': 60.0, 'initial_positions': [0.5, 0.4]},
        'tp_controller': {
            'hierarchy': ['tip_position'],
            'tasks': {
                'tip_position': {'type': 'position', 'frame': 'tip', 'axes': 'xy', 'gain': [2.0]}
            },
        },
    }


def descriptions(client):
    """List of the descriptions that are published, with those before."""
    found = []
    client.node.create_subscription(
        String, 'robot_description', lambda msg: found.append(msg.data), TOPIC_QOS
    )
    return found


# Description by topic


def test_a_controller_without_a_robot_takes_that_of_the_simulator(config):
    document = read_document(config / 'a4_position_joint.yaml')
    document = edited(document, {**NO_ROBOT, 'tp_sim': {'robot': document['/**']['robot']}})
    with ClosedLoop(document, namespace='arm_1') as loop:
        assert loop.state.joint_names == ['joint_1', 'joint_2', 'joint_3']
        loop.send_goal('ee_position', [0.3, 1.2])
        loop.run(10.0)
        record = loop.record
        output = loop.controller.output
    assert 'waiting for robot_description on /arm_1/robot_description' in output
    assert record.error_norm['ee_position'][-1] < 1e-3
    # The limits came along.
    assert np.max(np.abs(record.qd)) <= 1.0


def test_both_nodes_take_a_description_that_was_there_before_them(telescope):
    shared = {'robot': {'joints': ['slide', 'turn'], 'base_frame': 'floor'}}
    telescope['tp_sim']['initial_positions'] = [0.4, 0.5]
    with ClosedLoop(telescope, {'/**': shared}, description=TELESCOPE) as loop:
        loop.send_goal('tip_position', [0.5, 0.6])
        loop.run(5.0)
        assert loop.record.error_norm['tip_position'][-1] < 1e-3
        assert loop.state.joint_names == ['slide', 'turn']
        # The simulator does not say again what it was told.
        assert loop.client.node.count_publishers('robot_description') == 1


def test_a_description_may_come_late_and_stays(lone_controller, config):
    controller = lone_controller(NO_ROBOT, ['-r', 'robot_description:=description'], wait=False)
    client, process = controller.client, controller.process
    client.wait_for(lambda: client.state is not None, 'the controller')
    assert client.state.message == 'waiting for robot_description on /description'
    with pytest.raises(GoalRejected, match='waiting for robot_description on /description'):
        client.set_parameters('tp_controller', {'hierarchy': ['nonsense']})
    text = printed(config / 'a4_position_joint.yaml').stdout
    publisher = client.node.create_publisher(String, 'description', TOPIC_QOS)
    publisher.publish(String(data=text))
    controller.wait_until_up()
    before = controller.ask([0.0, 0.6, 0.3])
    for other in (text.replace('\n', ' '), TELESCOPE, '<robot'):
        publisher.publish(String(data=other))
    client.wait_for(lambda: 'ignored' in process.output, 'a warning')
    # This arm did not move as commanded: the next answer would be braking, until it rests.
    client.wait_for(lambda: controller.state.status == ControllerState.STALE, 'rest')
    assert controller.ask([0.0, 0.6, 0.3]) == before
    assert 'waiting' not in controller.state.message
    client.set_parameters('tp_controller', {'hierarchy': ['ee_position']})
    assert process.stop() == 0
    assert process.output.count('another robot_description is ignored') == 1


def test_nodes_that_are_told_nothing_say_so_and_end(lone_controller):
    controller = lone_controller(NO_ROBOT, wait=False)
    simulator = NodeProcess(
        *('tp_sim', 'simulator', None, controller.domain.environment()),
        ['-p', 'tp_sim:rate:=60.0'],
    )
    client, process = controller.client, controller.process
    states = client.collect(ControllerState, 'tp_controller/state')
    client.wait_for(lambda: len(states) > 2, 'signs of life')
    assert controller.state.status == ControllerState.WAITING
    assert controller.state.message == WAITING
    simulator.wait_for_output(WAITING)
    process.signal(signal.SIGINT)
    simulator.signal(signal.SIGTERM)
    for node in (process, simulator):
        assert node.wait(5.0) == 0
        assert [WAITING in line for line in node.output.splitlines()] == [True]


def test_a_goal_for_a_controller_that_waits_is_refused_with_the_reason(lone_controller):
    controller = lone_controller(NO_ROBOT, wait=False)
    sender = NodeProcess(
        'tp_controller',
        'send_goal',
        None,
        controller.domain.environment(),
        arguments=['ee_position', '1.0', '0.5'],
    )
    assert sender.wait() == 2
    assert sender.output == f'send_goal: the controller is {WAITING}\n'


NODES = {'tp_controller': 'controller', 'tp_sim': 'simulator'}


@pytest.mark.parametrize(
    ('package', 'text', 'message'),
    [
        ('tp_controller', TELESCOPE[:-9], 'robot_description: got malformed XML'),
        ('tp_controller', TELESCOPE, "robot.joints: got 'joint_1'; accepts some of turn, slide"),
        ('tp_sim', TELESCOPE.replace('"tip"', '"tower"'), 'robot_description: got links'),
    ],
    ids=['malformed', 'another robot', 'for the simulator'],
)
def test_a_description_that_cannot_be_used_ends_the_node(config, tmp_path, package, text, message):
    document = read_document(config / 'a4_position_joint.yaml')
    joints = document['/**']['robot']['joints']
    path = tmp_path / 'parameters.yaml'
    write_document(edited(document, {'/**': {'robot': None}}), path)
    domain = PrivateDomain()
    rule = ['-p', f'{package}:robot.joints:=[{", ".join(joints)}]']
    process = NodeProcess(package, NODES[package], path, domain.environment(), rule)
    client = Client(domain)
    client.publish_description(text)
    assert process.wait() == 2, process.output
    waiting, refusal = process.output.splitlines()
    assert 'waiting for robot_description' in waiting
    assert refusal.startswith(f'{package}: {message}')
    client.close()
    domain.close()


# By parameter, and what the simulator publishes


@pytest.mark.parametrize('by', ['parameter', 'file'])
def test_the_simulator_publishes_the_description_that_it_was_given(telescope, tmp_path, by):
    path = tmp_path / 'telescope.urdf'
    path.write_text(TELESCOPE)
    robot = {'robot': {'urdf': str(path)}} if by == 'file' else {'robot_description': TELESCOPE}
    with ClosedLoop(telescope, {'/**': robot}) as loop:
        found = descriptions(loop.client)
        loop.client.wait_for(lambda: bool(found), 'a description')
        loop.send_goal('tip_position', [0.5, 0.6])
        loop.run(5.0)
        assert loop.record.error_norm['tip_position'][-1] < 1e-3
        # A controller that knows its robot does not listen.
        assert 'waiting for robot_description' not in loop.controller.output
    assert found == [TELESCOPE]


# The executable that prints


def printed(config):
    executable = f'{get_package_prefix("tp_sim")}/lib/tp_sim/description'
    return subprocess.run(
        [executable, '--config', config], capture_output=True, text=True, timeout=30, check=False
    )


@pytest.mark.parametrize('name', ['a1_position', 'd_prr'])
def test_the_description_of_a_dh_arm_is_printed(config, name):
    path = config / f'{name}.yaml'
    result = printed(path)
    assert (result.returncode, result.stderr) == (0, '')
    block = read_document(path)['/**']['robot']
    found = urdf_robot(result.stdout)
    assert list(found.joints) == block['joints']
    assert {'base', 'link_1', 'link_2', 'link_3'} < set(found.frames)


def test_a_urdf_is_printed_as_it_is(telescope, tmp_path):
    (tmp_path / 'telescope.urdf').write_text(TELESCOPE)
    robot = {'robot': {'urdf': str(tmp_path / 'telescope.urdf')}}
    write_document(telescope | {'/**': robot}, tmp_path / 'parameters.yaml')
    assert printed(tmp_path / 'parameters.yaml').stdout == TELESCOPE


def test_what_cannot_be_described_is_refused_in_one_line(telescope, tmp_path):
    path = tmp_path / 'parameters.yaml'
    for robot, message in [
        (None, 'description: robot: got no value; accepts robot.dh, robot.urdf or robot_desc'),
        ({'robot': {'urdf': 'nothing.urdf'}}, "description: robot.urdf: got 'nothing.urdf' (No"),
        ({'robot_description': '<robot/>'}, 'description: robot_description: got links []'),
    ]:
        write_document(telescope | ({'/**': robot} if robot else {}), path)
        result = printed(path)
        assert (result.returncode, result.stdout) == (2, '')
        (line,) = result.stderr.splitlines()
        assert line.startswith(message)
