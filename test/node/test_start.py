"""A controller that starts holds the arm unless it is asked for its targets; what it loads."""

import signal
import time
from pathlib import Path

import numpy as np
import pytest
from sensor_msgs.msg import JointState

from tp_controller import build_settings, read_parameter_file
from tp_controller.compiled import library_path
from tp_interfaces.msg import ControllerState

A = [0.4, 0.9, -0.3]
JOINTS = ['joint_1', 'joint_2', 'joint_3']


@pytest.mark.parametrize('start', [None, 'hold'])
def test_the_arm_stays_where_it_is_until_a_goal_comes(lone_controller, start):
    controller = lone_controller({'tp_controller': {'start': start}})
    for _ in range(3):
        assert np.abs(controller.ask(A)).max() < 1e-12
    for name in ('ee_position', 'joint_1_position'):
        task = controller.client.task(name)
        assert list(task.desired) == list(task.current)
    controller.client.send_goal('ee_position', [0.3, 1.2])
    assert np.abs(controller.ask(A)).max() > 0.1


def test_a_first_joint_state_that_waited_moves_nothing(lone_controller):
    controller = lone_controller()
    controller.process.signal(signal.SIGSTOP)
    controller.give(A)
    controller.client.spin_for(0.5)
    controller.process.signal(signal.SIGCONT)
    controller.client.wait_for(lambda: controller.state.ignored_states == 1, 'it to be counted')
    assert not controller.commands
    controller.process.wait_for_output('s old when it came')
    assert np.abs(controller.ask(A)).max() > 0.1


def test_a_driver_that_repeats_one_joint_state_moves_the_arm_for_a_moment_only(lone_controller):
    # Copies that a busy machine holds up for half of this do not count as one after the other.
    controller = lone_controller({'tp_controller': {'timeouts': {'joint_state': 1.0}}})
    client = controller.client
    msg = JointState(name=JOINTS, position=A)
    msg.header.stamp = client.node.get_clock().now().to_msg()

    def repeat(until):
        end = time.monotonic() + 60.0
        while not until():
            assert time.monotonic() < end
            client.publish('joint_states', msg)
            client.spin_for(0.005)

    repeat(lambda: controller.state.status == ControllerState.STALE)
    controller.process.wait_for_output('the same one, stamp and all, comes again and again')
    assert any(any(command.velocity) for command in controller.commands)
    count = len(controller.commands) + 20
    repeat(lambda: len(controller.commands) > count)
    assert not any(any(command.velocity) for command in controller.commands[-10:])
    # The driver goes on; an arm that did not follow is braked first.
    controller.stamp = msg.header.stamp.sec + 1
    client.wait_for(lambda: np.abs(controller.ask(A)).max() > 0.1, 'motion')


def test_a_first_velocity_beyond_the_limit_is_no_command(lone_controller):
    limits = {'velocity': [1.0], 'acceleration': [2.0]}
    controller = lone_controller({'/**': {'robot': {'limits': limits}}})
    controller.ask(A, velocity=[60.0, -60.0, 0.3])
    assert np.abs(controller.commands[0].velocity).max() <= 1.0


def test_with_start_target_the_arm_goes_to_the_targets_of_the_file(lone_controller):
    controller = lone_controller()
    assert np.abs(controller.ask(A)).max() > 0.1
    assert list(controller.client.task('ee_position').desired) == [1.0, 0.5]


def test_a_target_that_is_set_before_the_first_joint_state_counts(lone_controller):
    controller = lone_controller({'tp_controller': {'start': None}})
    controller.client.set_parameters('tp_controller', {'tasks.ee_position.target': [0.3, 1.2]})
    assert np.abs(controller.ask(A)).max() > 0.1
    assert list(controller.client.task('ee_position').desired) == [0.3, 1.2]
    assert list(controller.client.task('joint_1_position').desired) == A[:1]


def test_an_idle_task_keeps_the_target_of_the_file(lone_controller):
    controller = lone_controller({'tp_controller': {'start': None, 'hierarchy': ['ee_position']}})
    controller.ask(A)
    assert list(controller.client.task('joint_1_position').desired) == [0.0]


def test_the_library_holds_only_if_it_is_asked_to(config):
    flat = read_parameter_file(config / 'a4_position_joint.yaml', 'tp_controller')
    del flat['start']
    assert np.abs(build_settings(flat).stack.step(np.array(A)).command).max() > 0.1
    stack = build_settings(flat | {'start': 'hold'}).stack
    assert not stack.step(np.array(A)).command.any()


def test_the_process_loads_no_compiler(lone_controller):
    controller = lone_controller()
    assert np.abs(controller.ask(A)).max() > 0.1
    mapped = Path(f'/proc/{controller.process.pid}/maps').read_text(encoding='utf-8')
    assert library_path().name in mapped
    assert 'llvmlite' not in mapped
    assert 'compile' not in controller.process.output
