"""The command that measures an arm asks who reads its commands, as the controller does."""

import numpy as np
import pytest
from ros2_control_stand_in import JOINTS, START, Ros2Control
from std_msgs.msg import Float64MultiArray

from tp_sim.harness import (
    Client,
    NodeProcess,
    PrivateDomain,
    edited,
    read_document,
    write_document,
)

OTHER_ORDER = ['joint_2', 'joint_3', 'joint_1']


class Unmoved(Ros2Control):
    """An arm that takes commands and stands: where it would go depends on the machine."""

    def _on_command(self, msg):
        self.received.append(list(msg.data))


@pytest.fixture
def measured(config, tmp_path):
    """Make an arm behind ros2_control and a measurement of it."""
    domain = PrivateDomain()
    client = Client(domain)
    made = []

    def make(interface, joints):
        kind = 'float64_multi_array' + ('_position' if interface == 'position' else '')
        changes = {
            '/**': {
                'rate': None,  # a busy machine may keep another one
                'command': {'type': kind},
                'timeouts': {'joint_state': 60.0},
                'robot': {'limits': {'acceleration': [10.0]}},
            }
        }
        path = tmp_path / 'parameters.yaml'
        write_document(edited(read_document(config / 'a4_position_joint.yaml'), changes), path)
        arm = Unmoved(client.node, interface, joints)
        topic = f'joint_{interface}_command:=/{interface}_controller/commands'
        arguments = ['--config', str(path), '--yes', '--ros-args', '-r', topic]
        process = NodeProcess(
            'tp_controller', 'measure_arm', None, domain.environment(), arguments=arguments
        )
        made.append(process)
        return arm, process

    yield client, make
    for process in made:
        process.stop()
    client.close()
    domain.close()


def test_it_sends_nothing_to_a_reader_that_takes_it_for_other_joints(measured):
    client, make = measured
    arm, process = make('position', OTHER_ORDER)
    client.wait_for(lambda: not process.running, 'measure_arm')
    assert process.wait() == 2
    assert process.output.strip() == (
        'measure_arm: /position_controller/commands: /harness has the joints joint_2, joint_3, '
        'joint_1, robot.joints is joint_1, joint_2, joint_3: nothing is sent'
    )
    assert not arm.received
    assert arm.state == START


def test_a_reader_that_comes_later_and_does_not_fit_ends_it(measured):
    client, make = measured
    arm, process = make('velocity', JOINTS)
    client.wait_for(lambda: np.any(arm.received), 'motion')
    arm._joints = OTHER_ORDER
    late = []
    client.node.create_subscription(
        Float64MultiArray, '/velocity_controller/commands', late.append, 10
    )
    client.wait_for(lambda: not process.running, 'measure_arm')
    assert process.wait() == 4
    told = process.output.splitlines()[-1]
    assert told.startswith('measure_arm: ended by /velocity_controller/commands: /harness has')
    assert told.endswith('nothing is sent')
    assert not np.any(arm.received[-1])
