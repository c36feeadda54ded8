"""Ends of processes: in every phase to rest, status 0, no trace, no orphan."""

import os
import signal
import subprocess
import sys
import textwrap
import time

import pytest
from ament_index_python.packages import get_package_prefix
from sensor_msgs.msg import JointState

from tp_sim.harness import Client, ClosedLoop, NodeProcess, PrivateDomain
from tp_sim.harness.process import Process, executable_path

SIGNALS = pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
ALL_SIGNALS = pytest.mark.parametrize(
    'number', [signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT]
)
PATIENCE = 30.0
"""Time [s] for what takes a moment on an idle machine."""


def assert_clean(process):
    assert process.wait(PATIENCE) == 0, process.output
    assert 'Traceback' not in process.output
    assert 'rror' not in process.output


@SIGNALS
def test_controller_waiting_for_its_first_state_sends_zero_and_ends(lone_controller, number):
    controller = lone_controller()
    controller.process.signal(number)
    assert_clean(controller.process)
    controller.client.wait_for(lambda: bool(controller.commands), 'a command')
    assert not any(any(command.velocity) for command in controller.commands)
    assert (
        f'ended by {signal.Signals(number).name}: zero command sent' in controller.process.output
    )


@ALL_SIGNALS
def test_moving_controller_sends_zero_and_both_nodes_end(config, number):
    with ClosedLoop(config / 'a4_position_joint.yaml', lockstep=False) as loop:
        commands = loop.client.collect(JointState, 'joint_velocity_command')
        loop.client.wait_for(lambda: len(commands) > 5 and any(commands[-1].velocity), 'motion')
        controller, simulator = loop.controller, loop.simulator
        controller.signal(number)
        assert_clean(controller)
        loop.controller = None
        loop.client.wait_for(lambda: not any(commands[-1].velocity), 'a zero command')
        simulator.signal(number)
        assert_clean(simulator)
        loop.simulator = None


@SIGNALS
@pytest.mark.parametrize('delay', [0.0, 0.2, 0.4, 0.6])
def test_a_signal_during_start_up_leaves_no_trace(config, number, delay):
    domain = PrivateDomain()
    process = NodeProcess(
        'tp_controller',
        'controller',
        config / 'a4_position_joint.yaml',
        domain.environment(),
    )
    # From the moment at which the process itself, not Python, decides what a signal does.
    end = time.monotonic() + PATIENCE
    while not catches(process.pid, signal.SIGTERM):
        assert time.monotonic() < end, process.output
        time.sleep(0.005)
    time.sleep(delay)
    process.signal(number)
    assert_clean(process)
    domain.close()


@SIGNALS
def test_send_goal_that_waits_for_a_controller_ends_without_a_trace(number):
    domain = PrivateDomain()
    process = NodeProcess(
        'tp_controller',
        'send_goal',
        None,
        domain.environment(),
        arguments=['ee_position', '1', '1', '--timeout', '30'],
    )
    client = Client(domain)
    client.wait_for(lambda: 'send_goal' in client.node.get_node_names(), 'its node')
    process.signal(number)
    assert process.wait(PATIENCE) == 3, process.output
    assert process.output.strip() == 'send_goal: interrupted'
    client.close()
    domain.close()


def test_an_interrupted_comparison_says_so(config):
    command = f'{get_package_prefix("tp_sim")}/lib/tp_sim/compare'
    process = subprocess.Popen(
        [command, '--config', str(config / 'c3_repeatability.yaml')],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        # A pipe would keep the line back.
        env=os.environ | {'PYTHONUNBUFFERED': '1'},
        # Python is interrupted only if its parent does not ignore the signal.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),  # noqa: PLW1509
    )
    # Ten rounds at 500 Hz take seconds from here.
    assert process.stdout.readline().startswith('Running')
    process.send_signal(signal.SIGINT)
    _, message = process.communicate(timeout=PATIENCE)
    assert (process.returncode, message) == (130, 'compare: interrupted\n')


def test_no_node_outlives_a_killed_test(config, tmp_path):
    script = tmp_path / 'killed.py'
    script.write_text(
        textwrap.dedent(f"""
            from tp_sim.harness import ClosedLoop
            loop = ClosedLoop({str(config / 'a4_position_joint.yaml')!r})
            print(loop.controller.pid, loop.simulator.pid, flush=True)
            loop.run(1e6)
        """)
    )
    test = subprocess.Popen([sys.executable, str(script)], stdout=subprocess.PIPE, text=True)
    pids = [int(word) for word in test.stdout.readline().split()]
    assert len(pids) == 2
    test.kill()
    test.wait()
    test.stdout.close()
    end = time.monotonic() + PATIENCE
    while any(alive(pid) for pid in pids):
        assert time.monotonic() < end, 'a node is still there'
        time.sleep(0.05)


@pytest.mark.parametrize('verb', ['run', 'launch'])
def test_a_node_ends_at_rest_when_its_ros2_is_killed(config, tmp_path, verb):
    # kill ends the command at once and does not reach what it has started.
    ros2 = tmp_path / 'ros2'
    ros2.write_text(
        textwrap.dedent(f"""
            import subprocess
            node = subprocess.Popen([
                {str(executable_path('tp_controller', 'controller'))!r},
                '--ros-args', '--params-file', {str(config / 'a4_position_joint.yaml')!r},
            ], start_new_session=True)
            print(node.pid, flush=True)
            node.wait()
        """)
    )
    domain = PrivateDomain()
    command = Process('ros2', [sys.executable, str(ros2), verb], domain.environment())
    command.wait_for_output('waiting for joint states', PATIENCE)
    pid = int(command.output.split()[0])
    command.kill()
    command.wait_for_output('ended by SIGTERM: zero command sent', PATIENCE)
    end = time.monotonic() + PATIENCE
    while alive(pid):
        assert time.monotonic() < end, 'the node is still there'
        time.sleep(0.05)
    domain.close()


@pytest.mark.parametrize(
    ('package', 'executable'), [('tp_controller', 'controller'), ('tp_sim', 'simulator')]
)
def test_a_node_says_how_it_is_started(package, executable):
    command = [str(executable_path(package, executable)), '--help']
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert done.stdout.startswith(f'usage: {executable} --ros-args --params-file FILE')


def catches(pid, number):
    """Whether a process has a handler of its own for a signal."""
    with open(f'/proc/{pid}/status') as status:
        caught = next(line for line in status if line.startswith('SigCgt:'))
    return int(caught.split()[1], 16) >> (number - 1) & 1


def alive(pid):
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    with open(f'/proc/{pid}/stat') as stat:
        # An ended process that nobody has waited for is not alive.
        return stat.read().rpartition(')')[2].split()[0] != 'Z'
