"""The command that measures an arm."""

import signal

import numpy as np
import pytest
import yaml
from sensor_msgs.msg import JointState

from tp_sim.harness import (
    Client,
    NodeProcess,
    PrivateDomain,
    edited,
    read_document,
    write_document,
)

PLANT = {'tp_sim': {'plant': {'delay': 2, 'lag': [0.03], 'noise': [1e-4]}}}
RATE = 60.0


class Arm:
    """A simulator in real time, without a controller."""

    def __init__(self, path):
        self.path = path
        self.domain = PrivateDomain()
        self.environment = self.domain.environment()
        self.simulator = NodeProcess('tp_sim', 'simulator', path, self.environment)
        self.client = Client(self.domain)
        self.states = self.client.collect(JointState, 'joint_states')
        self.commands = self.client.collect(JointState, 'joint_velocity_command')
        self.client.wait_for(lambda: bool(self.states), 'joint states')

    def begin(self, *arguments):
        return NodeProcess(
            'tp_controller',
            'measure_arm',
            None,
            self.environment,
            arguments=['--config', str(self.path), *arguments],
        )

    def finish(self, process):
        """Exit status and output."""
        self.client.wait_for(lambda: not process.running, 'measure_arm')
        return process.wait(), process.output.strip()

    def close(self):
        self.simulator.stop()
        self.client.close()
        self.domain.close()


@pytest.fixture(scope='module')
def arm(config, tmp_path_factory):
    path = tmp_path_factory.mktemp('arm') / 'parameters.yaml'
    limits = {'/**': {'robot': {'limits': {'acceleration': [10.0]}}}}
    document = edited(edited(read_document(config / 'a4_position_joint.yaml'), PLANT), limits)
    write_document(document, path)
    arm = Arm(path)
    yield arm
    arm.close()


def test_delay_lag_and_noise_are_those_of_the_simulator(arm):
    start = np.array(arm.states[-1].position)
    for _ in range(3):
        arm.commands.clear()
        status, output = arm.finish(arm.begin('--yes'))
        # On a busy machine it may find another arm than this one, or no states for too long, and
        # says so: again, then.
        if status == 0 and 'do not use' not in output:
            break
    assert status == 0, output
    found = yaml.safe_load(output[output.index('robot:') :])['robot']
    # On a busy machine states come late, and so do their answers: those are part of the delay.
    # Of a period, delay and lag cannot always be told apart.
    assert found['delay'] == pytest.approx([2.0 / RATE] * 3, abs=1.3 / RATE)
    assert np.add(found['delay'], found['lag']) == pytest.approx(2.0 / RATE + 0.03, abs=0.015)
    assert found['noise'] == pytest.approx([1.2e-4] * 3, rel=0.2)
    assert 'do not use' not in output
    sent = np.array([command.velocity for command in arm.commands])
    assert not sent[-10:].any()
    assert np.abs(np.diff(sent, axis=0)).max() <= 10.0 / RATE + 1e-9
    # Each joint is brought back, whatever came late; what was sent last still acts for a moment.
    assert np.array(arm.states[-1].position) == pytest.approx(start, abs=5e-3)


def test_it_refuses_beside_a_controller(arm):
    controller = NodeProcess('tp_controller', 'controller', arm.path, arm.environment)
    arm.client.wait_for(
        lambda: arm.client.node.count_publishers('joint_velocity_command') == 1, 'a controller'
    )
    status, output = arm.finish(arm.begin('--yes'))
    controller.stop()
    assert status == 2
    assert output == (
        'measure_arm: /joint_velocity_command has a publisher, /tp_controller: end it first, only '
        'one may move the arm'
    )


def test_it_does_not_move_the_arm_unasked(arm):
    arm.client.wait_for(
        lambda: not arm.client.node.count_publishers('joint_velocity_command'), 'nobody'
    )
    arm.client.spin_for(0.2)  # what was sent before
    arm.commands.clear()
    status, output = arm.finish(arm.begin())
    assert status == 2
    assert output == 'measure_arm: this moves the arm: say --yes, or run it in a terminal'
    assert not arm.commands


def test_a_signal_brakes_the_arm(arm):
    arm.commands.clear()
    process = arm.begin('--yes')
    arm.client.wait_for(
        lambda: any(np.any(command.velocity) for command in arm.commands), 'a motion'
    )
    process.signal(signal.SIGTERM)
    status, output = arm.finish(process)
    assert status == 4
    assert output.splitlines()[-1] == ('measure_arm: ended by SIGTERM; the arm was braked to rest')
    arm.client.wait_for(lambda: not np.any(arm.commands[-1].velocity), 'rest')
    sent = np.array([command.velocity for command in arm.commands])
    assert np.abs(np.diff(sent, axis=0)).max() <= 10.0 / RATE + 1e-9


def test_joint_states_that_stop_end_it(arm):
    process = arm.begin('--yes')
    count = len(arm.commands)
    arm.client.wait_for(
        lambda: any(np.any(command.velocity) for command in arm.commands[count:]), 'a motion'
    )
    arm.client.set_parameters('tp_sim', {'plant.silent': True})
    status, output = arm.finish(process)
    arm.client.set_parameters('tp_sim', {'plant.silent': False})
    assert status == 4
    assert 'no joint state for' in output.splitlines()[-1]
    assert not np.any(arm.commands[-1].velocity)
