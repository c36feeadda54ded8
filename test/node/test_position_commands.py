"""Joint positions as commands, over the real nodes."""

import signal

import numpy as np
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

from tp_interfaces.msg import ControllerState
from tp_sim.harness import ClosedLoop, NodeProcess

TOPIC = 'joint_position_command'
START = [0.0, 0.6, 0.3]
RATE, SPEED, ACCELERATION = 100.0, 1.0, 2.0
LIMITS = {'velocity': [SPEED], 'acceleration': [ACCELERATION]}


def shared(kind, **robot):
    return {
        'rate': RATE,
        'robot': {'limits': LIMITS} | robot,
        'command': {'type': f'{kind}_position'},
    }


def assert_smooth(sent):
    """Speeds and accelerations of positions, those that were sent twice left out."""
    sent = np.array(sent)
    sent = sent[np.append(True, np.any(np.diff(sent, axis=0) != 0.0, axis=1))]
    speed = np.diff(sent, axis=0) * RATE
    assert np.abs(speed).max() <= SPEED + 1e-9
    # Where one was left out that was no repetition it had come to rest.
    assert np.abs(np.diff(speed, axis=0)).max() <= 2.0 * ACCELERATION / RATE + 1e-9


def test_a_late_arm_is_driven_by_arrays_of_positions(config):
    changes = {
        '/**': shared('float64_multi_array', delay=[0.03], lag=[0.05]),
        'tp_sim': {'plant': {'delay': 3, 'lag': [0.05]}},
        'tp_controller': {'timeouts': {'joint_state': 60.0}, 'start': 'hold'},
    }
    with ClosedLoop(config / 'a4_position_joint.yaml', changes) as loop:
        sent = loop.client.collect(Float64MultiArray, TOPIC)
        loop.run(0.1)
        assert [list(msg.data) for msg in sent] == [START] * len(sent)
        loop.send_goal('ee_position', [1.0, 0.5])
        loop.run(8.0)
        assert loop.client.task('ee_position').error_norm < 5e-3
        assert loop.state.status == ControllerState.RUNNING
        assert_smooth([msg.data for msg in sent])
        before = len(sent)
        loop.reset({'joint_1': 0.5, 'joint_2': 0.9, 'joint_3': 0.3})
        loop.run(0.1)
        there = [list(msg.data) for msg in sent[before:]]
        assert [0.5, 0.9, 0.3] in there
        there = there[there.index([0.5, 0.9, 0.3]) :]
        assert_smooth(there)


def test_a_controller_that_ends_repeats_where_it_came_to_rest(config):
    changes = {'/**': shared('joint_state'), 'tp_controller': {'start': 'hold'}}
    with ClosedLoop(config / 'a4_position_joint.yaml', changes, lockstep=False) as loop:
        client = loop.client
        sent = client.collect(JointState, TOPIC)
        loop.send_goal('ee_position', [1.0, -0.5])
        client.wait_for(lambda: np.abs(loop.state.command).max() > 0.3, 'motion')
        controller = loop.controller
        controller.signal(signal.SIGTERM)
        assert controller.wait(30.0) == 0, controller.output
        assert 'ended by SIGTERM: braked to rest in' in controller.output
        loop.controller = None
        client.wait_for(lambda: len({tuple(msg.position) for msg in sent[-10:]}) == 1, 'rest')
        assert_smooth([msg.position for msg in sent])
        assert not any(len(msg.velocity) for msg in sent)


def test_an_arm_that_comes_back_elsewhere_hears_no_old_position(config):
    changes = {'/**': shared('joint_state'), 'tp_controller': {'start': 'hold'}}
    with ClosedLoop(config / 'a4_position_joint.yaml', changes, lockstep=False) as loop:
        client = loop.client
        loop.send_goal('ee_position', [1.0, -0.5])
        client.wait_for(lambda: np.abs(loop.state.command).max() > 0.3, 'motion')
        loop.simulator.stop()
        loop.simulator = None
        client.wait_for(lambda: loop.state.status == ControllerState.STALE, 'the pause')
        client.wait_for(lambda: not any(loop.state.command), 'rest')
        sent = client.collect(JointState, TOPIC)
        client.spin_for(0.4)
        del sent[:]
        client.spin_for(0.3)
        assert not sent
        loop.simulator = NodeProcess('tp_sim', 'simulator', loop.parameter_file, loop.environment)
        client.wait_for(lambda: len(sent) > 3, 'commands')
        assert list(sent[0].position) == START
        assert_smooth([msg.position for msg in sent])
