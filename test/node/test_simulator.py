"""The simulator node: in real time, in lockstep, at its limits, reset."""

import os
import signal

import numpy as np
import pytest
from sensor_msgs.msg import JointState
from std_srvs.srv import SetBool

from tp_interfaces.srv import Reset, Step
from tp_sim.harness import (
    Client,
    ClosedLoop,
    GoalRejected,
    HarnessError,
    NodeProcess,
    PrivateDomain,
    edited,
    read_document,
    write_document,
)

JOINTS = ['joint_1', 'joint_2', 'joint_3']
START = [0.0, 0.6, 0.3]
LIMITS = {
    '/**': {
        'robot': {
            'limits': {
                'velocity': [0.5],
                'position_min': [-0.2, 0.0, 0.0],
                'position_max': [0.2, 1.0, 1.0],
            }
        }
    }
}


class LoneSimulator:
    def __init__(self, path):
        self.domain = PrivateDomain()
        self.process = NodeProcess('tp_sim', 'simulator', path, self.domain.environment())
        self.client = Client(self.domain)
        self.states = self.client.collect(JointState, 'joint_states')

    def command(self, velocity, names=JOINTS, stamp=None):
        msg = JointState(name=names, velocity=velocity)
        if stamp is not None:
            msg.header.stamp = stamp
        self.client.publish('joint_velocity_command', msg)

    def next_states(self, count=1):
        target = len(self.states) + count
        self.client.wait_for(lambda: len(self.states) >= target, 'joint states')
        return self.states[-count:]

    def close(self):
        self.process.stop()
        self.client.close()
        self.domain.close()


@pytest.fixture
def lone_simulator(config, tmp_path):
    made = []

    def make(changes):
        path = tmp_path / f'simulator_{len(made)}.yaml'
        write_document(edited(read_document(config / 'a4_position_joint.yaml'), changes), path)
        made.append(LoneSimulator(path))
        return made[-1]

    yield make
    for simulator in made:
        simulator.close()


def test_real_time_states_come_at_the_rate_and_stand_still_without_commands(lone_simulator):
    simulator = lone_simulator({'tp_sim': {'rate': 100.0}})
    simulator.next_states()
    states = simulator.next_states(100)
    stamps = np.array([s.header.stamp.sec + 1e-9 * s.header.stamp.nanosec for s in states])
    # A busy machine may miss some, which the median does not see.
    assert np.median(np.diff(stamps)) == pytest.approx(0.01, rel=0.1)
    assert all(list(s.position) == START and not any(s.velocity) for s in states)
    assert states[0].name == JOINTS
    assert states[0].header.frame_id == 'base'


def moves(state):
    return any(state.velocity)


def test_commands_move_the_joints_until_they_time_out(lone_simulator):
    simulator = lone_simulator({'tp_sim': {'command_timeout': 0.2}})
    simulator.next_states()
    simulator.command([-0.3, 0.1, 0.2], ['joint_3', 'joint_1', 'joint_2'])
    # A busy machine brings the whole motion at once.
    simulator.client.wait_for(lambda: any(map(moves, simulator.states)), 'motion')
    simulator.client.wait_for(lambda: not moves(simulator.states[-1]), 'a stop')
    assert [0.1, 0.2, -0.3] in [list(state.velocity) for state in simulator.states]
    moved = np.array(simulator.states[-1].position) - START
    # Within one period of 1/60 s on either side, and what the machine adds.
    assert 0.1 < moved[0] / 0.1 < 0.5
    assert moved == pytest.approx(moved[0] * np.array([1.0, 2.0, -3.0]))


def test_position_and_velocity_limits_hold(lone_simulator):
    simulator = lone_simulator(LIMITS)
    simulator.next_states()
    for _ in range(60):
        simulator.command([9.0, -9.0, 0.1])
        simulator.next_states()
    positions = np.array([s.position for s in simulator.states])
    speeds = np.array([s.velocity for s in simulator.states])
    assert np.all(positions >= [-0.2, 0.0, 0.0])
    assert np.all(positions <= [0.2, 1.0, 1.0])
    assert np.abs(speeds).max() <= 0.5 + 1e-12
    assert positions[-1, 0] == 0.2
    assert speeds[-1, 0] == 0.0


def test_commands_that_cannot_be_used_are_ignored(lone_simulator):
    simulator = lone_simulator({})
    simulator.next_states()
    simulator.command([1.0, 1.0], ['joint_1', 'joint_2'])
    simulator.command([1.0, float('nan'), 1.0])
    simulator.process.wait_for_output('command ignored')
    assert all(list(s.position) == START for s in simulator.next_states(5))


def test_reset_goes_to_given_or_initial_positions_or_says_why_not(lone_simulator):
    simulator = lone_simulator(LIMITS)

    def reset(names, positions):
        request = Reset.Request(name=names, position=positions)
        return simulator.client.call(Reset, 'tp_sim/reset', request)

    assert reset(['joint_2'], [0.9]).success
    assert list(simulator.next_states(2)[-1].position) == [0.0, 0.9, 0.3]
    for names, positions, reason in [
        (['joint_2'], [1.5], 'positions from'),
        (['joint_9'], [0.5], 'joint_1, joint_2, joint_3'),
        (['joint_1'], [], 'one position for each name'),
        (['joint_1'], [float('nan')], 'finite'),
    ]:
        response = reset(names, positions)
        assert not response.success
        assert reason in response.message
        assert list(simulator.next_states(2)[-1].position) == [0.0, 0.9, 0.3]
    assert reset([], []).success
    assert list(simulator.next_states(2)[-1].position) == START


def test_lockstep_waits_for_the_command_that_answers_its_stamp(lone_simulator):
    simulator = lone_simulator({'tp_sim': {'lockstep': True}})
    first = simulator.next_states()[0]
    simulator.client.spin_for(0.3)
    assert {s.header.stamp.nanosec for s in simulator.states} == {first.header.stamp.nanosec}
    simulator.command([0.6, 0.0, 0.0])
    simulator.client.spin_for(0.3)
    assert list(simulator.states[-1].position) == START
    simulator.command([0.6, 0.0, 0.0], stamp=first.header.stamp)
    simulator.client.wait_for(lambda: simulator.states[-1].position[0] != 0.0, 'a step')
    assert list(simulator.states[-1].position) == pytest.approx([0.01, 0.6, 0.3])
    stamps = [s.header.stamp.sec * 10**9 + s.header.stamp.nanosec for s in simulator.states]
    assert stamps[-1] - stamps[0] == round(1e9 / 60.0)


def test_pause_and_step_are_refused_in_real_time(lone_simulator):
    simulator = lone_simulator({})
    step = simulator.client.call(Step, 'tp_sim/step', Step.Request(steps=1))
    pause = simulator.client.call(SetBool, 'tp_sim/pause', SetBool.Request(data=True))
    assert not step.success
    assert not pause.success
    assert 'lockstep' in step.message
    assert 'lockstep' in pause.message


def test_a_paused_lockstep_goes_on_by_resume_and_stops_by_pause(config):
    with ClosedLoop(config / 'a4_position_joint.yaml') as loop:
        cycles = loop.state.cycles
        assert loop.client.call(SetBool, 'tp_sim/pause', SetBool.Request(data=False)).success
        loop.client.wait_for(lambda: loop.state.cycles > cycles + 100, 'cycles')
        with pytest.raises(HarnessError, match='busy'):
            loop.step()
        assert loop.client.call(SetBool, 'tp_sim/pause', SetBool.Request(data=True)).success
        loop.step(10)
        assert loop.record.error_norm['ee_position'][-1] < 0.5


def test_commands_of_the_type_that_the_controller_publishes_are_followed(config):
    changes = {'tp_controller': {'command': {'type': 'float64_multi_array'}}}
    with ClosedLoop(config / 'a4_position_joint.yaml', changes, lockstep=False) as loop:
        loop.client.wait_for(
            lambda: loop.client.task('ee_position').error_norm < 0.4, 'the arm to move'
        )


def test_a_step_without_a_controller_says_so_and_a_second_one_is_refused(lone_simulator):
    simulator = lone_simulator({'tp_sim': {'lockstep': True, 'paused': True}})
    client = simulator.client.node.create_client(Step, 'tp_sim/step')
    simulator.client.wait_for(client.service_is_ready, 'the service')
    client.call_async(Step.Request(steps=1))
    simulator.next_states()
    response = simulator.client.call(Step, 'tp_sim/step', Step.Request(steps=1))
    assert not response.success
    assert 'busy' in response.message
    simulator.process.wait_for_output('no command answers')
    # Shown anew, for a controller that takes no copies. Both are the same state.
    first = simulator.states[0].header.stamp
    again = first.sec * 10**9 + first.nanosec + 1
    simulator.client.wait_for(
        lambda: again in {s.header.stamp.sec * 10**9 + s.header.stamp.nanosec
                          for s in simulator.states}, 'the new stamp'
    )  # fmt: skip
    simulator.command([0.6, 0.0, 0.0], stamp=first)
    simulator.client.wait_for(lambda: simulator.states[-1].position[0] != 0.0, 'a step')
    last = simulator.states[-1].header.stamp
    passed = (last.sec - first.sec) * 10**9 + last.nanosec - first.nanosec
    assert passed == round(1e9 / 60.0)


def test_lockstep_with_array_commands_gives_the_same_motion(config):
    ends = []
    for kind in ('joint_state', 'float64_multi_array'):
        changes = {
            '/**': {'command': {'type': kind}},
            # Not the wall clock of a busy machine, only lost states shall end a wait.
            'tp_controller': {'timeouts': {'joint_state': 5.0}},
        }
        with ClosedLoop(config / 'a4_position_joint.yaml', changes) as loop:
            loop.run(2.0)
            ends.append(loop.record.q)
    assert np.array_equal(ends[0], ends[1])


def test_the_plant_of_the_parameters_is_simulated_and_changes_while_running(lone_simulator):
    simulator = lone_simulator({'tp_sim': {'plant': {'noise': 1e-3, 'scale': [1.0, 2.0, 1.0]}}})
    truth = simulator.client.collect(JointState, 'tp_sim/true_joint_states')
    simulator.client.wait_for(lambda: len(truth) > 20, 'true states')
    measured = np.array([s.position for s in simulator.next_states(20)])
    assert all(list(state.position) == START for state in truth)
    wrong = np.abs(measured - np.array([1.0, 2.0, 1.0]) * START)
    assert 0.0 < wrong.max() <= 1e-3
    simulator.client.set_parameters('tp_sim', {'plant.noise': 0.0, 'plant.scale': 1.0})
    simulator.client.wait_for(lambda: list(simulator.states[-1].position) == START, 'no noise')
    for name, value, reason in [
        ('plant.delay', 1.5, 'a whole number'),
        ('plant.state_loss', 1.5, 'from 0 to 1'),
        ('plant.lag', [0.1, 0.1], '1 value or 3'),
        ('plant.type', 'rigid_body', 'read-only'),
    ]:
        with pytest.raises(GoalRejected, match=reason):
            simulator.client.set_parameters('tp_sim', {name: value})


def test_a_blocked_arm_stands_still_and_a_silent_one_moves_unseen(lone_simulator):
    simulator = lone_simulator({'tp_sim': {'command_timeout': 60.0}})
    simulator.command([0.1, 0.0, 0.0])
    simulator.client.wait_for(
        lambda: bool(simulator.states) and simulator.states[-1].velocity[0] == 0.1, 'motion'
    )
    simulator.client.set_parameters('tp_sim', {'plant.blocked': True})
    first, *others = simulator.next_states(10)[5:]
    assert not any(first.velocity)
    assert all(state.position == first.position for state in others)
    simulator.client.set_parameters('tp_sim', {'plant.blocked': False, 'plant.silent': True})
    truth = simulator.client.collect(JointState, 'tp_sim/true_joint_states')
    simulator.client.wait_for(lambda: len(truth) > 5, 'true states')
    count = len(simulator.states)
    before = truth[-1].position[0]
    simulator.client.wait_for(lambda: truth[-1].position[0] > before + 0.01, 'motion')
    assert len(simulator.states) == count
    simulator.client.set_parameters('tp_sim', {'plant.silent': False})
    assert simulator.next_states()[0].position[0] > before


def test_an_end_of_a_range_is_named(lone_simulator):
    simulator = lone_simulator({**LIMITS, 'tp_sim': {'command_timeout': 60.0}})
    simulator.next_states()
    simulator.command([9.0, 0.0, 0.0])
    simulator.process.wait_for_output('at the end of the range, held by its stop: joint_1')


def test_a_stopped_simulator_catches_up(lone_simulator):
    simulator = lone_simulator({'tp_sim': {'command_timeout': 60.0}})
    simulator.next_states()
    simulator.command([0.1, 0.0, 0.0])
    simulator.client.wait_for(lambda: any(simulator.states[-1].velocity), 'motion')
    os.kill(simulator.process.pid, signal.SIGSTOP)
    simulator.client.spin_for(0.5)
    count = len(simulator.states)
    os.kill(simulator.process.pid, signal.SIGCONT)
    simulator.process.wait_for_output('caught up at once')
    before, after = simulator.states[count - 1], simulator.next_states()[0]
    gap = after.header.stamp.sec - before.header.stamp.sec
    gap += 1e-9 * (after.header.stamp.nanosec - before.header.stamp.nanosec)
    moved = after.position[0] - before.position[0]
    # To within a period on either side.
    assert moved / 0.1 == pytest.approx(gap, abs=2.5 / 60.0)


def test_in_lockstep_lost_states_are_steps_without_an_answer(config):
    plant = {'state_loss': 0.5, 'command_loss': 0.3, 'seed': 4}
    ends = []
    for _ in range(2):
        changes = {'tp_sim': {'command_timeout': 1.0, 'plant': plant}}
        with ClosedLoop(config / 'a4_position_joint.yaml', changes) as loop:
            loop.run(2.0)
            record = loop.record
            ends.append(record.q)
            assert 40 < len(record.time) < 90
            assert record.time[-1] == pytest.approx(2.0, abs=1e-6)
    assert np.array_equal(ends[0], ends[1])
