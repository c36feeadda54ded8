"""Longest gap between commands while tasks come, go and change at random and the arm moves.

Simulator and controller run in real time; a process of its own notes when commands arrive. For
comparison, the first part of the time passes without any change.
"""

import argparse
import os
import random
import subprocess
import sys
import tempfile
import time
from collections import Counter
from functools import partial
from pathlib import Path

import numpy as np
from rcl_interfaces.srv import SetParametersAtomically
from rclpy.parameter import Parameter
from rich.console import Console
from rich.table import Table
from sensor_msgs.msg import JointState

from tp_controller.config import read_parameter_file
from tp_controller.ros.goals import goal_message
from tp_interfaces.srv import AddTask, RemoveTask
from tp_sim.harness import ClosedLoop
from tp_sim.harness.client import Client

HERE = Path(__file__).resolve().parent
CONFIG = HERE.parent / 'config' / 'panda.yaml'
TOPICS = ('joint_states', 'joint_velocity_command')
QUIET = 0.2
"""Share of the time that passes without changes first."""
WAITING = 8
"""Requests without an answer, at which no further one is sent."""
GOALS = ([0.5, 0.3, 0.3], [0.45, -0.3, 0.5], [0.6, 0.0, 0.6])
TASKS = (
    '{type: obstacle, whole_arm: true, shape: box, center: [0.7, 0.5, 0], size: [0.2, 0.2, 0.4]}',
    '{type: obstacle, whole_arm: true, center: [0.2, 0.6, 0.6], radius: 0.1}',
    '{type: obstacle, frame: panda_hand, center: [0.2, -0.6, 0.6], radius: 0.1}',
    '{type: self_collision, ignore: [panda_link5 panda_link7, panda_link5 panda_hand]}',
    '{type: joint_limits}',
    '{type: posture, gain: [0.5]}',
    '{type: orientation, frame: panda_link4}',
)
CHANGES = (
    {'tasks.hand_position.gain': [2.0]},
    {'tasks.hand_position.gain': [3.0]},
    {'tasks.posture.target': [0.0, 0.0, 0.0, -1.4, 0.0, 1.7, 0.0]},
    {'robot.limits.velocity': [1.5]},
    {'robot.limits.velocity': [2.0]},
    {'solver.damping': 0.06},
)


class Changes:
    """Sends requests at random, without waiting for their answers."""

    def __init__(self, client: Client, seed: int) -> None:
        self._random = random.Random(seed)
        node = client.node
        self._add = node.create_client(AddTask, 'tp_controller/add_task')
        self._remove = node.create_client(RemoveTask, 'tp_controller/remove_task')
        self._set = node.create_client(
            SetParametersAtomically, 'tp_controller/set_parameters_atomically'
        )
        for service in (self._add, self._remove, self._set):
            client.wait_for(service.service_is_ready, 'the services')
        self._waiting = 0
        self._loaded: list[str] = []
        self._number = 0
        self.counts: Counter[str] = Counter()
        self.longest_answer = 0.0

    def send(self) -> None:
        """Send one request, or none while too many wait."""
        if self._waiting >= WAITING:
            self.counts['skipped'] += 1
            return
        kind = self._random.choice(('add', 'remove', 'change'))
        if kind == 'add' and len(self._loaded) < 6:
            self._number += 1
            name = f'new_{self._number}'
            text, level = self._random.choice(TASKS), self._random.choice((-1, 0, 0, 1))
            future = self._add.call_async(AddTask.Request(name=name, parameters=text, level=level))
        elif kind == 'remove' and self._loaded:
            name = self._loaded.pop(self._random.randrange(len(self._loaded)))
            future = self._remove.call_async(RemoveTask.Request(name=name))
        else:
            kind, name = 'change', ''
            request = SetParametersAtomically.Request()
            request.parameters = [
                Parameter(key, value=value).to_parameter_msg()
                for key, value in self._random.choice(CHANGES).items()
            ]
            future = self._set.call_async(request)
        self._waiting += 1
        sent = time.monotonic()

        def answered(future: object) -> None:
            self._waiting -= 1
            self.longest_answer = max(self.longest_answer, time.monotonic() - sent)
            answer = future.result()
            good = answer.result.successful if kind == 'change' else answer.success
            self.counts[kind if good else f'{kind} refused'] += 1
            if not good:
                print(answer, file=sys.stderr)
            elif kind == 'add':
                self._loaded.append(name)

        future.add_done_callback(answered)


def give_priority(pid: int, priority: int) -> None:
    """Let every thread of a process go before those without such a priority."""
    for thread in Path(f'/proc/{pid}/task').iterdir():
        os.sched_setscheduler(int(thread.name), os.SCHED_FIFO, os.sched_param(priority))


def run(seconds: float, interval: float, config: Path, seed: int, realtime: bool) -> bool:
    """Measure and print; return whether no gap was longer than two periods."""
    period = 1.0 / float(read_parameter_file(config, 'tp_controller')['rate'])
    with tempfile.TemporaryDirectory() as folder, ClosedLoop(config, lockstep=False) as loop:
        client = loop.client
        goals = [goal_message(client.task('hand_position'), goal) for goal in GOALS]
        client.ignore_state()
        path = Path(folder) / 'times.npz'
        receiver = subprocess.Popen(
            [sys.executable, __file__, '--receive', str(path)],
            env=loop.environment,
            stdin=subprocess.PIPE,
        )
        changes = Changes(client, seed)
        client.spin_for(5.0)  # the receiver joins
        if realtime:
            processes = (loop.controller.pid, receiver.pid, loop.simulator.pid)
            for priority, pid in enumerate(processes, 20):
                give_priority(pid, priority)
        parts = []
        next_goal = 0.0
        for part, changing in ((QUIET * seconds, False), (seconds, True)):
            start = time.monotonic()
            due = start
            while (now := time.monotonic()) < start + part:
                if now >= next_goal:
                    client.publish('tp_controller/hand_position/goal', goals[0])
                    goals.append(goals.pop(0))
                    next_goal = now + 1.5
                if changing:
                    changes.send()
                due = max(due + interval, now)
                client.spin_for(max(due - time.monotonic(), 0.0))
            parts.append((start, time.monotonic()))
        receiver.communicate()
        times = dict(np.load(path))
    return _print(times, parts, period, changes)


def _print(
    times: dict[str, np.ndarray], parts: list[tuple[float, float]], period: float, changes: Changes
) -> bool:
    table = Table(title=f'Gaps between messages [periods of {1e3 * period:g} ms]')
    for column in ('gaps between', 'count', 'median', '99 %', '99.9 %', 'longest', 'over 2'):
        table.add_column(column, justify='left' if column == 'gaps between' else 'right')
    longest = np.inf
    for name, (start, end) in zip(('', ', with changes'), parts, strict=True):
        for topic in TOPICS:
            found = times[topic]
            gaps = np.diff(found[(found >= start) & (found <= end)]) / period
            longest = float(gaps.max())
            figures = (np.median(gaps), *np.percentile(gaps, (99.0, 99.9)), longest)
            table.add_row(
                f'{topic.replace("_", " ")}{name}',
                str(len(gaps)),
                *(f'{figure:.2f}' for figure in figures),
                str(int((gaps > 2.0).sum())),
            )
    console = Console(width=100)
    console.print(table)
    done = ', '.join(f'{count} {kind}' for kind, count in sorted(changes.counts.items()))
    console.print(
        f'{done}; slowest answer {changes.longest_answer:.2f} s ({os.cpu_count()} cores)'
    )
    return longest <= 2.0


def receive(path: str) -> None:
    """Note when messages arrive until the input ends."""
    import threading

    import rclpy

    rclpy.init(args=[])
    node = rclpy.create_node('receiver')
    times: dict[str, list[float]] = {topic: [] for topic in TOPICS}
    for topic, found in times.items():
        note = partial(_note, found)
        node.create_subscription(JointState, topic, note, 100, raw=True)
    ended = threading.Event()
    threading.Thread(target=lambda: (sys.stdin.read(), ended.set()), daemon=True).start()
    while not ended.is_set():
        rclpy.spin_once(node, timeout_sec=0.1)
    np.savez(path, **{topic: np.array(found) for topic, found in times.items()})


def _note(times: list[float], _: bytes) -> None:
    times.append(time.monotonic())


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--seconds', type=float, default=300.0, help='with changes')
    parser.add_argument('--interval', type=float, default=0.05, help='time [s] between changes')
    parser.add_argument('--config', type=Path, default=CONFIG, help='a Panda at some rate')
    parser.add_argument('--seed', type=int, default=1)
    parser.add_argument(
        '--realtime', action='store_true', help='give the nodes priority (SCHED_FIFO; as root)'
    )
    parser.add_argument('--receive', help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.receive:
        receive(arguments.receive)
        return 0
    kept = run(
        arguments.seconds,
        arguments.interval,
        arguments.config,
        arguments.seed,
        arguments.realtime,
    )
    return 0 if kept else 1


if __name__ == '__main__':
    sys.exit(main())
