"""Age of commands at 1 kHz: from a joint state's publication to the receipt of its command.

The joint states are those of an arm that does what it is commanded. The controller and a bare
node that only echoes them run side by side; the joint states go to one and to the other in turn,
so that both see the same machine. Then both have their turn again with a listener to a state like
the controller's, and the controller with 4,000 goals a second beside that.
"""

import gc
import os
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from rclpy.clock import Clock, ClockType
from rich.console import Console
from rich.markup import escape
from rich.table import Table
from sensor_msgs.msg import JointState

from tp_sim.harness import Client, NodeProcess, PrivateDomain

HERE = Path(__file__).resolve().parent
CONFIG = HERE.parent / 'config' / 'a4_position_joint.yaml'
RATE = 1000.0
ECHO = 'bare echo node'
ALONE = 'controller'
HEARD = 'controller, state heard'
ECHO_HEARD = 'bare echo node, state heard'
FLOODED = 'controller, 4,000 goals/s'
BESIDE = {
    HEARD: ['listener.py', 'tp_controller/state'],
    ECHO_HEARD: ['listener.py', 'telling_echo/state'],
    FLOODED: [
        *('-m', 'tp_sim.faults.goal_flood', 'tp_controller/ee_position/goal'),
        'tp_controller/state',
    ],
}
"""What runs beside the node, with its arguments."""
SEGMENT = 5.0
"""Time [s] before the other node gets its turn."""
TICK = 1.0 / os.sysconf('SC_CLK_TCK')


class Result:
    """What was measured of a node in one situation."""

    def __init__(self) -> None:
        self.waiting: dict[int, int] = {}
        """Times of sending [ns] by stamp, of states without an answer."""
        self.ages: list[float] = []
        self.cpu = 0.0
        """Time [s] that processors spent in the node's process."""

    @property
    def unanswered(self) -> int:
        """States without an answer: a newer one was there already."""
        return len(self.waiting)

    @property
    def sent(self) -> int:
        """States published."""
        return len(self.ages) + len(self.waiting)


class Driver:
    """Publishes joint states at a rate and notes when each is answered.

    There is one for each node: a second subscription to its commands would delay the first.
    """

    def __init__(self, client: Client, topic: str, command_topic: str, pid: int) -> None:
        self._client = client
        self._pid = pid
        self._publisher = client.node.create_publisher(JointState, topic, 100)
        client.subscribe(JointState, command_topic, self._on_command)
        self._msg = JointState(
            name=['joint_1', 'joint_2', 'joint_3'],
            position=[0.0, 0.6, 0.3],
            velocity=[0.0, 0.0, 0.0],
        )
        self._result = Result()

    def drive(self, seconds: float, result: Result) -> None:
        """Publish for a time, then wait for the last answers."""
        self._result = result
        self._client.wait_for(
            lambda: self._publisher.get_subscription_count() > 0, 'the node to be measured'
        )
        timer = self._client.node.create_timer(
            1.0 / RATE, self._publish, clock=Clock(clock_type=ClockType.STEADY_TIME)
        )
        before = processor_time(self._pid)
        self._client.spin_for(seconds)
        result.cpu += processor_time(self._pid) - before
        self._client.node.destroy_timer(timer)
        self._client.spin_for(0.3)

    def _publish(self) -> None:
        for joint, speed in enumerate(self._msg.velocity):
            self._msg.position[joint] += speed / RATE
        now = time.time_ns()
        stamp = self._msg.header.stamp
        stamp.sec, stamp.nanosec = divmod(now, 1_000_000_000)
        self._result.waiting[now] = time.perf_counter_ns()
        self._publisher.publish(self._msg)

    def _on_command(self, msg: JointState) -> None:
        stamp = msg.header.stamp.sec * 1_000_000_000 + msg.header.stamp.nanosec
        self._msg.velocity = msg.velocity
        sent = self._result.waiting.pop(stamp, None)
        if sent is not None:
            self._result.ages.append((time.perf_counter_ns() - sent) * 1e-6)


def run(seconds: float) -> bool:
    """Measure and print; return whether the promises hold."""
    domain = PrivateDomain()
    echo = _start(['echo_node.py', 'echo'], domain)
    telling = _start(['echo_node.py', 'telling_echo', 'state'], domain)
    controller = NodeProcess(
        'tp_controller', 'controller', CONFIG, domain.environment(), ['-p', f'rate:={RATE}']
    )
    client = Client(domain)
    # The state is published only for those who listen; here nobody is to.
    client.ignore_state()
    own = Driver(client, 'joint_states', 'joint_velocity_command', controller.pid)
    bare, bare_heard = (
        Driver(client, f'{name}/joint_states', f'{name}/command', process.pid)
        for name, process in (('echo', echo), ('telling_echo', telling))
    )
    driven = {ECHO: bare, ECHO_HEARD: bare_heard}
    results = {name: Result() for name in (ALONE, ECHO, HEARD, ECHO_HEARD, FLOODED)}
    gc.disable()
    try:
        left = seconds
        while left > 0.0:
            for name, result in results.items():
                beside = _start(BESIDE[name], domain) if name in BESIDE else None
                driven.get(name, own).drive(min(left, SEGMENT), result)
                if beside is not None:
                    _stop(beside)
            left -= SEGMENT
    finally:
        gc.enable()
        _stop(echo)
        _stop(telling)
        controller.stop()
        client.close()
        domain.close()
    _print(results, seconds)
    measured = results[ALONE]
    return bool(np.median(measured.ages) < 1.0 and measured.unanswered < 0.05 * measured.sent)


def processor_time(pid: int) -> float:
    """Time [s] that processors have spent in a process."""
    fields = Path(f'/proc/{pid}/stat').read_text(encoding='utf-8').rpartition(')')[2].split()
    return TICK * (int(fields[11]) + int(fields[12]))


def _start(command: Sequence[str], domain: PrivateDomain) -> subprocess.Popen[bytes]:
    return subprocess.Popen([sys.executable, *command], env=domain.environment(), cwd=HERE)


def _stop(process: subprocess.Popen[bytes]) -> None:
    process.terminate()
    try:
        process.wait(5.0)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


def _print(results: dict[str, Result], seconds: float) -> None:
    table = Table(
        title=escape(f'Age of the command [ms], joint states at 1 kHz for {seconds:g} s')
    )
    for column in ('node', 'states', 'unanswered', 'median', '99 %', 'largest', 'CPU [µs]'):
        table.add_column(column, justify='left' if column == 'node' else 'right')
    medians, costs = {}, {}
    for name, result in results.items():
        ages = np.array(result.ages)
        medians[name], costs[name] = np.median(ages), result.cpu / len(result.ages)
        figures = (medians[name], np.percentile(ages, 99), ages.max())
        counts = (str(result.sent), str(result.unanswered))
        cost = f'{1e6 * costs[name]:.0f}'
        table.add_row(name, *counts, *(f'{value:.3f}' for value in figures), cost)
    console = Console(width=100)
    console.print(table)
    for name, other in ((ALONE, ECHO), (HEARD, ECHO), (ECHO_HEARD, ECHO), (HEARD, ECHO_HEARD)):
        console.print(
            f'{name}, against {other}: age {medians[name] / medians[other]:.2f}, '
            f'CPU {costs[name] / costs[other]:.2f}'
        )
    console.print(f'CPU: time of the process per answer; {os.cpu_count()} cores')
