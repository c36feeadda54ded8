"""The controller's cycle in real time: newest states, pauses, braking, errors, floods of goals."""

import os
import signal
import subprocess
import sys
import textwrap
import time

import numpy as np
import pytest
from geometry_msgs.msg import PointStamped, PoseStamped
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState

from tp_interfaces.msg import ControllerState
from tp_sim.harness import Client, ClosedLoop, PrivateDomain
from tp_sim.harness.document import edited

START = np.array([0.0, 0.6, 0.3])
JOINTS = ['joint_1', 'joint_2', 'joint_3']
ACCELERATION = 2.0
RATE = 60.0
LIMIT = 0.1
"""Parameter `timeouts.joint_state` [s]."""
SLOW_START = {
    '/**': {'rate': RATE, 'robot': {'limits': {'acceleration': [ACCELERATION]}}},
    'tp_controller': {'hierarchy': ['ee_position']},
}


class Arm:
    """Joints that a test moves and tells about itself."""

    def __init__(self, controller):
        self.controller = controller
        self.client = controller.client
        self.q, self.qd = START.copy(), np.zeros(3)
        self.now = time.time_ns()
        self._publisher = self.client.node.create_publisher(JointState, 'joint_states', 10)
        self.client.wait_for(
            lambda: self._publisher.get_subscription_count() > 0, 'a listener to joint states'
        )

    @property
    def commands(self):
        return self.controller.commands

    @property
    def state(self):
        return self.controller.state

    def tell(self, stamp=None, position=None, names=JOINTS):
        """Publish a joint state; return its stamp [ns]."""
        stamp = self.now if stamp is None else stamp
        msg = JointState(name=names, velocity=list(self.qd[: len(names)]))
        msg.position = list(self.q if position is None else position)
        msg.header.stamp.sec, msg.header.stamp.nanosec = divmod(stamp, 1_000_000_000)
        self._publisher.publish(msg)
        return stamp

    def ask(self, stamp=None, position=None):
        """Publish a joint state until it is answered; return the velocities of the answer.

        A state that a busy machine delivers too late is not answered.
        """
        count, stamp = len(self.commands), self.now if stamp is None else stamp
        end = time.monotonic() + 20.0
        while time.monotonic() < end:
            self.tell(stamp, position)
            again = time.monotonic() + 0.5
            while time.monotonic() < again:
                self.client.spin_for(0.001)
                for command in self.commands[count:]:
                    if nanoseconds(command) == stamp:
                        return np.array(command.velocity)
        raise AssertionError('no answer')

    def step(self):
        """One period of the arm."""
        self.now += round(1e9 / RATE)
        command = self.ask()
        self.q += command / RATE
        self.qd = command
        return command

    def coast(self, seconds):
        """Tell nothing for a time, and carry out what comes until then."""
        last, count = self.commands[-1], len(self.commands)
        self.client.spin_for(seconds)
        if seconds > LIMIT:
            self.client.wait_for(lambda: not any(self.commands[-1].velocity), 'rest')
        self.q += min(seconds, LIMIT) * np.array(last.velocity)
        self.q += sum((np.array(c.velocity) for c in self.commands[count:]), np.zeros(3)) / RATE
        self.qd = np.array(self.commands[-1].velocity)
        self.now += round(1e9 * seconds)


@pytest.fixture
def patient(lone_controller):
    """An arm that is not braked where a busy machine brings a state late."""
    return Arm(lone_controller(edited(SLOW_START, {'/**': {'timeouts': {'joint_state': 5.0}}})))


def nanoseconds(msg):
    return msg.header.stamp.sec * 1_000_000_000 + msg.header.stamp.nanosec


@pytest.fixture
def arm(lone_controller):
    return Arm(lone_controller(SLOW_START))


def assert_inside_the_acceleration_limit(commands):
    velocities = np.array([command.velocity for command in commands])
    changes = np.abs(np.diff(velocities, axis=0, prepend=np.zeros((1, 3))))
    assert changes.max() <= ACCELERATION / RATE * (1.0 + 1e-9)


def test_no_command_follows_from_a_state_of_before_a_pause(config):
    with ClosedLoop(config / 'a4_position_joint.yaml', lockstep=False) as loop:
        commands = []

        def keep(msg, info):
            # One that was written when the process stopped may arrive afterwards.
            commands.append((info['source_timestamp'], nanoseconds(msg), any(msg.velocity)))

        loop.client.subscribe(JointState, 'joint_velocity_command', keep)
        for _ in range(3):
            loop.reset()
            loop.client.wait_for(lambda: commands and commands[-1][2], 'motion')
            os.kill(loop.controller.pid, signal.SIGSTOP)
            begin, count = time.time_ns(), len(commands)
            loop.client.spin_for(1.0)
            end = time.time_ns()
            os.kill(loop.controller.pid, signal.SIGCONT)
            loop.client.wait_for(lambda n=count: len(commands) > n + 20, 'commands')
            stamps = [stamp for sent, stamp, _ in commands[count:] if sent > begin]
            assert min(stamps) > end - 0.1e9, 'older than timeouts.joint_state'
        state = loop.client.state
        assert state.skipped + state.ignored_states > 0


def test_states_that_stop_and_come_back_leave_the_acceleration_inside_its_limit(arm):
    for gap in (0.5, 2.0, 0.05):
        for _ in range(30):
            speed = np.abs(arm.step()).max()
        assert speed > 10.0 * ACCELERATION / RATE
        arm.coast(gap)
        if gap > LIMIT:
            arm.client.wait_for(lambda: arm.state.status == ControllerState.STALE, 'the state')
            # A busy machine may be another cause.
            arm.controller.process.wait_for_output(': braking to rest')
            arm.q = START.copy()
    arm.step()
    assert_inside_the_acceleration_limit(arm.commands)


def test_after_a_long_stop_of_the_process_an_arm_that_has_come_to_rest_is_not_braked(arm):
    for _ in range(30):
        arm.step()
    os.kill(arm.controller.process.pid, signal.SIGSTOP)
    count = len(arm.commands)
    arm.client.spin_for(0.6)
    os.kill(arm.controller.process.pid, signal.SIGCONT)
    arm.client.wait_for(lambda: arm.state.status == ControllerState.STALE, 'the state')
    arm.client.wait_for(lambda: len(arm.commands) > count + 5, 'commands')
    assert not any(any(command.velocity) for command in arm.commands[count:])


def test_states_that_overtake_each_other_are_dropped_and_counted(patient):
    for _ in range(20):
        patient.step()
    count = len(patient.commands)
    patient.tell(patient.now - 50_000_000, patient.q - 0.1)
    patient.client.wait_for(lambda: patient.state.overtaken == 1, 'it to be counted')
    assert patient.now - 50_000_000 not in [nanoseconds(c) for c in patient.commands[count:]]
    patient.step()
    assert_inside_the_acceleration_limit(patient.commands)


@pytest.mark.parametrize('ahead', [0.0, 0.5, -0.5])
def test_states_of_another_device_are_passed_over_whatever_their_stamps(patient, ahead):
    patient.step()
    for _ in range(9):
        patient.tell(patient.now + round(1e9 * ahead), [0.02], ['gripper'])
        patient.step()
        patient.tell(patient.now + round(1e9 * ahead), [0.02], ['gripper'])
    state = patient.state
    assert (state.overtaken, state.ignored_states, state.skipped) == (0, 0, 0)
    assert np.abs(patient.qd).max() == pytest.approx(10 * ACCELERATION / RATE)
    assert_inside_the_acceleration_limit(patient.commands)


def test_a_state_that_is_sent_twice_gets_the_same_command_twice(patient):
    for _ in range(10):
        patient.now += round(1e9 / RATE)
        command = patient.ask()
        assert np.array_equal(patient.ask(), command)
        patient.q += command / RATE
        patient.qd = command
    assert np.abs(command).max() == pytest.approx(10 * ACCELERATION / RATE)


def test_a_simulation_that_waits_for_a_while_is_answered_again(config):
    with ClosedLoop(config / 'a4_position_joint.yaml', SLOW_START) as loop:
        for pause in (0.0, 0.05, 0.09, 0.1, 0.11, 0.12, 0.15, 0.3):
            loop.run(0.2)
            assert np.any(loop.state.command)
            time.sleep(pause)
        loop.run(0.2)
        assert 'no command answers' not in loop.simulator.output
        assert loop.state.ignored_states == 0


@pytest.mark.parametrize('stamp', [0, 5_000_000_000])
def test_states_with_a_constant_stamp_move_the_arm(patient, stamp):
    command, at = np.zeros(3), time.monotonic()
    for i in range(20):
        # Without stamps the time that really passes counts.
        patient.client.spin_for(1.0 / RATE)
        at, before = time.monotonic(), at
        patient.q += (at - before) * command
        patient.q[2] += 1e-6 * i
        count = len(patient.commands)
        # Braking may come between on a busy machine; it carries the present time.
        command = patient.qd = patient.ask(stamp)
        assert len(patient.commands) > count
    assert patient.state.overtaken == 0
    assert np.abs(command).max() > 3 * ACCELERATION / RATE
    assert_inside_the_acceleration_limit(patient.commands)


def test_stamps_that_go_back_for_good_are_followed_and_told(patient):
    for _ in range(20):
        patient.step()
    patient.now -= 60_000_000_000
    for _ in range(4):
        patient.now += round(1e9 / RATE)
        patient.tell()
        patient.client.spin_for(1.0 / RATE)
    patient.client.wait_for(lambda: patient.state.overtaken == 4, 'them to be counted')
    patient.step()
    patient.client.wait_for(lambda: 'went back by' in patient.state.message, 'a message')
    patient.step()
    assert_inside_the_acceleration_limit(patient.commands)


def test_the_newest_goal_of_a_flood_counts(arm):
    arm.step()
    for i in range(1000):
        msg = PointStamped()
        msg.point.x, msg.point.y = 0.9, 0.3 + 1e-4 * i
        arm.client.publish('tp_controller/ee_position/goal', msg)
    arm.client.wait_for(
        lambda: list(arm.client.task('ee_position').desired) == [0.9, 0.3 + 1e-4 * 999],
        'the last goal',
    )
    arm.step()
    assert arm.client.task('ee_position').accepted_goals < 1000


def test_a_second_publisher_is_named_until_it_is_gone(arm):
    rival = arm.client.node.create_publisher(JointState, 'joint_velocity_command', 10)
    told = '/joint_velocity_command has 2 publishers, /harness, /tp_controller: two controllers'
    arm.client.wait_for(lambda: told in arm.state.message, 'a warning')
    arm.client.node.destroy_publisher(rival)
    arm.client.wait_for(lambda: 'publishers' not in arm.state.message, 'its end')


@pytest.mark.parametrize(
    ('topic', 'message_type', 'reliability', 'told'),
    [
        (
            'joint_states',
            JointState,
            ReliabilityPolicy.BEST_EFFORT,
            '/joint_states: /harness publishes as best effort, which is not heard; reliable is',
        ),
        (
            'tp_controller/ee_position/goal',
            PoseStamped,
            ReliabilityPolicy.RELIABLE,
            '/tp_controller/ee_position/goal: /harness publishes geometry_msgs/msg/PoseStamped, '
            'which is not heard; it takes geometry_msgs/msg/PointStamped',
        ),
    ],
    ids=['best effort', 'wrong type'],
)
def test_who_is_not_heard_is_named(arm, topic, message_type, reliability, told):
    qos = QoSProfile(depth=1, reliability=reliability)
    arm.client.node.create_publisher(message_type, topic, qos)
    arm.client.wait_for(lambda: told in arm.state.message, 'a warning')


BROKEN = """
    import sys
    from tp_controller.ros import state
    from tp_controller.ros.controller import ControllerNode
    from tp_controller.ros.run import run_node

    def fail(*_):
        raise KeyError('on purpose')

    class Broken(ControllerNode):
        def start(self, given, description):
            super().start(given, description)
            what = '{what}'
            if what == 'explanation':
                state.explanations = fail
            elif what == 'timer':
                self.create_timer(0.2, fail)
            else:
                step, self._left = self._stack.step_in_place, 20
                def limited(*state):
                    self._left -= 1
                    return step(*state) if self._left > 0 else fail()
                self._stack.step_in_place = limited

    if __name__ == '__main__':
        sys.exit(run_node('tp_controller', 'broken', 'Broken'))
"""


class BrokenLoop:
    """Simulator's place is taken by the test; the controller has a fault."""

    def __init__(self, what, folder, config):
        self.domain = PrivateDomain()
        script = folder / 'broken.py'
        script.write_text(textwrap.dedent(BROKEN.replace('{what}', what)))
        self.process = subprocess.Popen(
            [sys.executable, str(script), '--ros-args', '--params-file', str(config)],
            env=self.domain.environment(),
            stderr=subprocess.PIPE,
            text=True,
        )
        self.client = Client(self.domain)
        self.commands = self.client.collect(JointState, 'joint_velocity_command')

    @property
    def state(self):
        return self.client.state

    def close(self):
        self.process.kill()
        self.process.wait()
        self.process.stderr.close()
        self.client.close()
        self.domain.close()


@pytest.fixture
def broken(tmp_path, config):
    made = []

    def make(what):
        made.append(BrokenLoop(what, tmp_path, config / 'a4_position_joint.yaml'))
        made[-1].client.wait_for(lambda: made[-1].state is not None, 'the controller')
        return made[-1]

    yield make
    for loop in made:
        loop.close()


def test_an_error_in_the_cycle_ends_with_a_zero_command_and_a_line(broken):
    loop = broken('step')
    arm = Arm(loop)
    end = time.monotonic() + 20.0
    while loop.process.poll() is None and time.monotonic() < end:
        arm.now += 1
        arm.tell()
        arm.client.spin_for(0.01)
    assert loop.process.wait(0.1) == 1
    arm.client.wait_for(lambda: not any(arm.commands[-1].velocity), 'a zero command')
    assert any(any(command.velocity) for command in arm.commands)
    message = loop.process.stderr.read()
    assert "ended by ControlFailed: KeyError: 'on purpose': zero command sent" in message
    assert 'Traceback' in message


@pytest.mark.parametrize(
    ('what', 'told'),
    [('explanation', "no explanation: KeyError: 'on purpose'"), ('timer', '')],
)
def test_an_error_beside_the_cycle_is_told_and_control_goes_on(broken, what, told):
    loop = broken(what)
    arm = Arm(loop)
    for _ in range(100):
        arm.step()
        time.sleep(0.005)
    assert told in arm.state.message
    loop.process.send_signal(signal.SIGINT)
    assert loop.process.wait(10.0) == 0
    message = loop.process.stderr.read()
    assert "KeyError: 'on purpose'" in message
    assert 'ended by SIGINT' in message
