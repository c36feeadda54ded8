"""Age of commands at 1 kHz: from a joint state's publication to the receipt of its command.

The controller and a bare node that only echoes joint states run side by side; the joint
states go to one and to the other in turn, so that both see the same machine. Then the controller
has its turn again, with 4,000 goals a second and a listener to its state.
"""

import gc
import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
from rclpy.clock import Clock, ClockType
from rclpy.publisher import Publisher
from rich.console import Console
from rich.markup import escape
from rich.table import Table
from sensor_msgs.msg import JointState

from tp_sim.harness import Client, NodeProcess, PrivateDomain

HERE = Path(__file__).resolve().parent
CONFIG = HERE.parent / 'config' / 'a4_position_joint.yaml'
RATE = 1000.0
FLOODED = 'controller, 4,000 goals/s'
SEGMENT = 10.0
"""Time [s] before the other node gets its turn."""


class Driver:
    """Publishes joint states at a rate and notes when each is answered."""

    def __init__(self, client: Client, publisher: Publisher, command_topic: str) -> None:
        self._client = client
        self._publisher = publisher
        client.subscribe(JointState, command_topic, self._on_command)
        self._msg = JointState(
            name=['joint_1', 'joint_2', 'joint_3'],
            position=[0.0, 0.6, 0.3],
            velocity=[0.0, 0.0, 0.0],
        )
        self._sent: dict[int, int] = {}
        self.ages: list[float] = []

    def drive(self, seconds: float) -> None:
        """Publish for a time, then wait for the last answers."""
        self._client.wait_for(
            lambda: self._publisher.get_subscription_count() > 0, 'the node to be measured'
        )
        timer = self._client.node.create_timer(
            1.0 / RATE, self._publish, clock=Clock(clock_type=ClockType.STEADY_TIME)
        )
        self._client.spin_for(seconds)
        self._client.node.destroy_timer(timer)
        self._client.spin_for(0.3)

    @property
    def unanswered(self) -> int:
        """States without an answer: a newer one was there already."""
        return len(self._sent)

    @property
    def sent(self) -> int:
        """States published."""
        return len(self.ages) + len(self._sent)

    def _publish(self) -> None:
        now = time.time_ns()
        stamp = self._msg.header.stamp
        stamp.sec, stamp.nanosec = divmod(now, 1_000_000_000)
        self._sent[now] = time.perf_counter_ns()
        self._publisher.publish(self._msg)

    def _on_command(self, msg: JointState) -> None:
        stamp = msg.header.stamp.sec * 1_000_000_000 + msg.header.stamp.nanosec
        sent = self._sent.pop(stamp, None)
        if sent is not None:
            self.ages.append((time.perf_counter_ns() - sent) * 1e-6)


def run(seconds: float) -> bool:
    """Measure and print; return whether the promises hold."""
    domain = PrivateDomain()
    echo = subprocess.Popen([sys.executable, HERE / 'echo_node.py'], env=domain.environment())
    controller = NodeProcess('tp_controller', 'controller', CONFIG, domain.environment())
    client = Client(domain)
    # The state is published only for those who listen; here nobody is to.
    client.ignore_state()
    states, echoed = (
        client.node.create_publisher(JointState, topic, 100)
        for topic in ('joint_states', 'echo/joint_states')
    )
    drivers = {
        'controller': Driver(client, states, 'joint_velocity_command'),
        'bare echo node': Driver(client, echoed, 'echo/command'),
        FLOODED: Driver(client, states, 'joint_velocity_command'),
    }
    gc.disable()
    try:
        left = seconds
        while left > 0.0:
            for name, driver in drivers.items():
                flood = _flood(domain) if name == FLOODED else None
                driver.drive(min(left, SEGMENT))
                if flood is not None:
                    flood.terminate()
                    flood.wait()
            left -= SEGMENT
    finally:
        gc.enable()
        echo.terminate()
        echo.wait()
        controller.stop()
        client.close()
        domain.close()
    _print(drivers, seconds)
    measured = drivers['controller']
    return bool(np.median(measured.ages) < 1.0 and measured.unanswered < 0.05 * measured.sent)


def _flood(domain: PrivateDomain) -> subprocess.Popen[bytes]:
    return subprocess.Popen([sys.executable, HERE / 'goal_flood.py'], env=domain.environment())


def _print(drivers: dict[str, Driver], seconds: float) -> None:
    table = Table(
        title=escape(f'Age of the command [ms], joint states at 1 kHz for {seconds:g} s')
    )
    for column in ('node', 'states', 'unanswered', 'median', '99 %', 'largest'):
        table.add_column(column, justify='left' if column == 'node' else 'right')
    for name, driver in drivers.items():
        ages = np.array(driver.ages)
        figures = (np.median(ages), np.percentile(ages, 99), ages.max())
        table.add_row(
            name, str(driver.sent), str(driver.unanswered), *(f'{value:.3f}' for value in figures)
        )
    console = Console(width=100)
    console.print(table)
    medians = [np.median(driver.ages) for driver in drivers.values()]
    console.print(
        f'Median against the bare echo node: {medians[0] / medians[1]:.2f} '
        f'({os.cpu_count()} cores)'
    )
