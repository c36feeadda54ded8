"""One hour at 500 Hz in real time: missed commands by cause, memory and age over time."""

from __future__ import annotations

import argparse
import operator
import os
import tempfile
import time
from array import array
from pathlib import Path

import numpy as np
import rclpy
from geometry_msgs.msg import PointStamped
from rclpy.context import Context
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.qos import QoSProfile
from rich.console import Console
from rich.markup import escape
from rich.progress import Progress
from rich.table import Table
from sensor_msgs.msg import JointState

from tp_controller.ros.polled import subscribe, taker
from tp_sim.faults import arm
from tp_sim.faults.missed import SHARE, UNEXPLAINED, Times, ages, missed
from tp_sim.faults.pauses import PauseWatch, take_priority
from tp_sim.faults.record import longest
from tp_sim.faults.report import write_section
from tp_sim.harness import NodeProcess, PrivateDomain, write_document

RATE = 500.0
GOAL = 2.0
"""Time [s] between goals."""
LOOK = 5.0
"""Time [s] between looks at the memory."""
SHORTEST = 0.5
"""Time [min] with enough of them."""
WARM_UP = 3.0
"""Time [s] at the start that is left out."""
LARGEST_GROWTH = 5.0
"""Megabytes after the first tenth, and"""
AGE_GROWTH = 1.5
"""times the age of the first tenth that the last one may have."""
MEGABYTE = 1e6
PAGE = 'docs/faults.md'
SECTION = 'soak'


class Threads:
    """Times that the threads of a process have run, and have waited for a processor."""

    def __init__(self, pid: int) -> None:
        self._files = [
            os.open(path, os.O_RDONLY) for path in Path(f'/proc/{pid}/task').glob('*/schedstat')
        ]
        self._waits = [0] * len(self._files)
        self.look()

    def look(self) -> tuple[float, float, float]:
        """Times [s] that they ran, that they waited, and the longest new wait of one."""
        found = [os.pread(file, 100, 0).split() for file in self._files]
        waits = [int(f[1]) for f in found]
        longest = max(map(operator.sub, waits, self._waits), default=0)
        self._waits = waits
        return 1e-9 * sum(int(f[0]) for f in found), 1e-9 * sum(waits), 1e-9 * longest


class Listener:
    """Takes joint states and commands, and sends goals."""

    def __init__(self, domain: PrivateDomain) -> None:
        self._context = Context()
        with domain.entered():
            rclpy.init(args=[], context=self._context, domain_id=domain.number)
            self.node = rclpy.create_node(
                'soak', context=self._context, use_global_arguments=False
            )
        qos = QoSProfile(depth=5000)
        self._subscriptions = [
            subscribe(self.node, JointState, topic, qos)
            for topic in ('joint_states', 'joint_velocity_command')
        ]
        self._goals = self.node.create_publisher(PointStamped, 'tp_controller/ee_position/goal', 1)
        self._wait_set = rclpy_implementation.WaitSet(2, 0, 0, 0, 0, 0, self._context.handle)
        self.stamps, self.answers = array('q'), array('q')
        self.sent, self.answered = array('d'), array('d')
        self.noted, self.ran = array('d'), array('d')
        self.waited, self.longest = array('d'), array('d')
        self.lost = 0
        self._numbers: list[int | None] = [None, None]
        self._goal = 0

    def send_goal(self) -> None:
        self._goal = (self._goal + 1) % len(arm.GOALS)
        msg = PointStamped()
        msg.point.x, msg.point.y = arm.GOALS[self._goal]
        self._goals.publish(msg)

    def listen(self, seconds: float, controller: Threads, simulator: Threads) -> None:
        """Record everything that comes in a time [s]."""
        end = time.monotonic() + seconds
        states, commands = map(taker, self._subscriptions)
        while time.monotonic() < end:
            self._wait_set.clear_entities()
            for subscription in self._subscriptions:
                self._wait_set.add_subscription(subscription.handle)
            self._wait_set.wait(20_000_000)
            while (found := states()) is not None:
                self._note(0, *found, self.stamps, self.sent)
            while (found := commands()) is not None:
                self._note(1, *found, self.answers, self.answered)
                self.noted.append(time.time())
                ran, waited, longest = controller.look()
                _, others_waited, others_longest = simulator.look()
                self.waited.append(waited + others_waited)
                self.longest.append(max(longest, others_longest))
                self.ran.append(ran)

    def _note(self, index, msg, info, stamps, times) -> None:
        stamp = msg.header.stamp
        stamps.append(stamp.sec * 1_000_000_000 + stamp.nanosec)
        times.append(1e-9 * info['source_timestamp'])
        number, before = info.get('publication_sequence_number'), self._numbers[index]
        if number is not None and before is not None and before < number < 2**62:
            self.lost += number - before - 1
        self._numbers[index] = number

    def forget(self) -> None:
        """Begin to record anew."""
        for values in self._all():
            del values[:]
        self.lost = 0

    def times(self) -> Times:
        return Times(*map(np.array, self._all()))

    def _all(self) -> tuple[array, ...]:
        commands = self.answers, self.answered, self.noted, self.waited, self.longest, self.ran
        return self.stamps, self.sent, *commands

    def close(self) -> None:
        self.node.destroy_node()
        rclpy.try_shutdown(context=self._context)


def run(minutes: float, page: Path | None) -> bool:
    """Run, print, and return whether nothing grew and nothing is unexplained."""
    take_priority()
    domain, folder = PrivateDomain(), tempfile.TemporaryDirectory()
    path = Path(folder.name) / 'parameters.yaml'
    write_document(arm.parameters(rate=RATE), path)
    environment = domain.environment()
    nodes = [
        NodeProcess('tp_controller', 'controller', path, environment),
        NodeProcess('tp_sim', 'simulator', path, environment),
    ]
    # Pauses that explain a missed command are shorter than a period.
    listener, watch = Listener(domain), PauseWatch(SHARE / RATE)
    memory: list[list[float]] = []
    try:
        time.sleep(WARM_UP)
        threads = [Threads(node.pid) for node in nodes]
        listener.send_goal()
        listener.listen(WARM_UP, *threads)
        listener.forget()
        begin = time.time()
        with Progress() as progress:
            bar = progress.add_task('soak', total=60.0 * minutes)
            while (passed := time.time() - begin) < 60.0 * minutes:
                progress.update(bar, completed=passed)
                listener.send_goal()
                listener.listen(GOAL, *threads)
                if len(memory) <= passed / LOOK:
                    memory.append([p.resident_memory / MEGABYTE for p in nodes])
    finally:
        statuses = [node.stop() for node in nodes]
        listener.close()
        watch.close()
        domain.close()
        folder.cleanup()
    pauses = watch.pauses(begin)
    times = listener.times()
    causes = missed(times, 1.0 / RATE, pauses)
    rows, good = _figures(times, causes, np.array(memory), minutes)
    rows += [
        ('longest pause of a bare timer process [ms]', f'{1e3 * longest(pauses):.1f}'),
        (f'its pauses above {1e3 * SHARE / RATE:g} ms', f'{len(pauses):,}'),
        ('time that both nodes waited for a processor', _share(times)),
        ('messages that the listener lost', f'{listener.lost}'),
        ('load of the machine', f'{os.getloadavg()[1]:.1f} on {os.cpu_count()} cores'),
    ]
    table = Table(title=f'{minutes:g} minutes at {RATE:g} Hz in real time', title_style='bold')
    table.add_column('')
    table.add_column('', justify='right')
    for row in rows:
        table.add_row(*map(escape, row))
    Console(width=100).print(table)
    if page is not None:
        lines = [f'| {minutes:g} minutes at {RATE:g} Hz | |', '|---|---:|']
        lines += [f'| {label} | {value} |' for label, value in rows]
        write_section(page, SECTION, '\n'.join(lines))
    return good and not any(statuses) and not listener.lost


def _figures(
    times: Times, causes: dict[str, int], memory: np.ndarray, minutes: float
) -> tuple[list[tuple[str, str]], bool]:
    when, age = ages(times)
    tenths = np.minimum((10.0 * (when - when[0]) / (when[-1] - when[0])).astype(int), 9)
    first, last = age[tenths == 0], age[tenths == 9]
    left_out = round(RATE * 1e-9 * float(np.diff(times.stamps).sum())) - times.stamps.size + 1
    rows = [
        ('joint states', f'{times.stamps.size:,}'),
        ('commands', f'{times.answers.size:,}'),
        ('steps that the simulator caught up without a joint state', f'{left_out:,}'),
        ('joint states without a command', f'{sum(causes.values()):,}'),
        *((f'– {cause}', f'{count:,}') for cause, count in sorted(causes.items())),
    ]
    for label, values in (('all', age), ('first tenth', first), ('last tenth', last)):
        found = (np.median(values), np.percentile(values, 99), values.max())
        text = ', '.join(f'{1e3 * value:.2f}' for value in found)
        rows.append((f'age of the command [ms], {label}: median, 99 %, largest', text))
    settled = memory[len(memory) // 10 :]
    slopes = np.polyfit(np.linspace(0.0, minutes * 0.9 / 60.0, len(settled)), settled, 1)[0]
    growth = settled.max(axis=0) - settled[0]
    for i, name in enumerate(('controller', 'simulator')):
        rows.append(
            (
                f'memory of the {name} [MB]: first, last, growth after a tenth, slope per h',
                f'{memory[0, i]:.1f}, {memory[-1, i]:.1f}, {growth[i]:.2f}, {slopes[i]:.2f}',
            )
        )
    good = (
        not causes.get(UNEXPLAINED)
        and float(growth.max()) < LARGEST_GROWTH
        and float(np.median(last)) < AGE_GROWTH * float(np.median(first))
    )
    return rows, good


def _share(times: Times) -> str:
    passed = times.answered[-1] - times.answered[0]
    return f'{100.0 * (times.waited[-1] - times.waited[0]) / passed:.1f} %'


if __name__ == '__main__':
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--minutes', type=float, default=60.0, help='how long (%(default)s)')
    parser.add_argument('--page', type=Path, help=f'page for the figures, such as {PAGE}')
    given = parser.parse_args()
    if not given.minutes >= SHORTEST:
        parser.error(f'--minutes: got {given.minutes:g}; accepts a number from {SHORTEST:g} up')
    raise SystemExit(0 if run(given.minutes, given.page) else 1)
