"""Start of the controller: from the start of its process to its first command.

A node publishes joint states all the time; the real executable is started beside it, again and
again. Where the time goes is seen in a run of its own, which Python's import times slow down a
little.
"""

import re
import time
from collections import Counter
from pathlib import Path
from typing import NamedTuple

import numpy as np
from command_age import processor_time
from rclpy.clock import Clock, ClockType
from rich.console import Console
from rich.markup import escape
from rich.table import Table
from sensor_msgs.msg import JointState

from tp_controller.config import read_parameter_file
from tp_sim.harness import Client, NodeProcess, PrivateDomain

CONFIG = Path(__file__).resolve().parent.parent / 'config' / 'panda.yaml'
LONGEST_START = 1.5
"""Seconds."""
LARGEST_MEMORY = 200.0
"""Megabytes."""
RATE = 500.0
KILOBYTE = 1.024e-3
"""Megabytes."""
OWN = 'tp_controller'


class Run(NamedTuple):
    """One start."""

    made: float
    """Time [s] until the node says that it waits for joint states,"""
    first: float
    """and until its first command came."""
    processor: float
    """Time [s] that processors spent in it until then: other processes hardly change that."""
    resident: float
    """Memory [MB] then,"""
    private: float
    """and what of it no other process shares."""


def run(runs: int) -> bool:
    """Measure and print; return whether the promises hold."""
    found, imports, mappings = [], Counter(), Counter()
    domain = PrivateDomain()
    client = Client(domain)
    client.ignore_state()
    try:
        # The first start reads the files from the disk, and compiles modules: it does not count.
        for number in range(-1, runs + 1):
            last = number == runs
            process, measured = _start(client, domain, last)
            if last:
                imports, mappings = import_times(process.output), _mappings(process.pid)
            elif number >= 0:
                found.append(measured)
            process.stop()
    finally:
        client.close()
        domain.close()
    medians = Run(*np.median(found, axis=0))
    _print(medians, imports, mappings, runs)
    return medians.first < LONGEST_START and medians.resident < LARGEST_MEMORY


def import_times(text: str) -> Counter[str]:
    """Time [s] of all imports by package, out of what ``python -X importtime`` writes."""
    times: Counter[str] = Counter()
    for own, name in re.findall(r'^import time: +(\d+) \|.*\| +(\S+)$', text, re.MULTILINE):
        times[name.partition('.')[0]] += 1e-6 * int(own)
    return times


def _start(client: Client, domain: PrivateDomain, told: bool) -> tuple[NodeProcess, Run]:
    """Start the controller and wait for its first command, with import times if `told`."""
    names = read_parameter_file(CONFIG, OWN)['robot.joints']
    positions = read_parameter_file(CONFIG, 'tp_sim')['initial_positions']
    msg = JointState(name=names, position=positions, velocity=[0.0] * len(names))
    publisher = client.node.create_publisher(JointState, 'joint_states', 100)
    came: list[float] = []
    subscription = client.subscribe(
        JointState, 'joint_velocity_command', lambda _: came.append(time.time())
    )

    def publish() -> None:
        msg.header.stamp = client.node.get_clock().now().to_msg()
        publisher.publish(msg)

    timer = client.node.create_timer(
        1.0 / RATE, publish, clock=Clock(clock_type=ClockType.STEADY_TIME)
    )
    environment = domain.environment() | ({'PYTHONPROFILEIMPORTTIME': '1'} if told else {})
    environment.pop('PYTHONDONTWRITEBYTECODE', None)
    begin = time.time()
    process = NodeProcess(OWN, 'controller', CONFIG, environment)
    client.wait_for(lambda: bool(came), 'the first command')
    processor, memory = processor_time(process.pid), _rollup(process.pid)
    client.node.destroy_timer(timer)
    client.node.destroy_publisher(publisher)
    client.node.destroy_subscription(subscription)
    # The log tells its own time.
    made = re.search(r'\[(\d+\.\d+)\] \[tp_controller\]: waiting', process.output)
    assert made is not None
    return process, Run(float(made[1]) - begin, came[0] - begin, processor, *memory)


def _rollup(pid: int) -> tuple[float, float]:
    """Memory [MB] of a process: resident, and private."""
    text = Path(f'/proc/{pid}/smaps_rollup').read_text(encoding='utf-8')
    sizes = {
        name: KILOBYTE * int(size) for name, size in re.findall(r'^(\w+): +(\d+) kB', text, 8)
    }
    return sizes['Rss'], sizes['Private_Clean'] + sizes['Private_Dirty']


def _mappings(pid: int) -> Counter[str]:
    """Resident memory [MB] by what is mapped."""
    sizes: Counter[str] = Counter()
    name = ''
    for line in Path(f'/proc/{pid}/smaps').read_text(encoding='utf-8').splitlines():
        if re.match(r'^[0-9a-f]+-', line):
            words = line.split(maxsplit=5)
            name = words[5].rpartition('/')[2].partition('.')[0] if len(words) > 5 else ''
            name = name if name and not name.startswith('[') else 'heap, stacks'
        elif line.startswith('Rss:'):
            sizes[name] += KILOBYTE * int(line.split()[1])
    return sizes


def _print(medians: Run, imports: Counter[str], mappings: Counter[str], runs: int) -> None:
    console = Console(width=100)
    times = {
        'to the node waiting for joint states': medians.made,
        'joint states found, first step': medians.first - medians.made,
        'start to first command': medians.first,
        'processor time until then': medians.processor,
    }
    title = f'Start of the controller on {CONFIG.name} [ms], median of {runs} starts'
    console.print(_table(title, {name: 1e3 * value for name, value in times.items()}, 0))
    largest = {name: 1e3 * value for name, value in imports.most_common(10)}
    largest['others'] = 1e3 * sum(imports.values()) - sum(largest.values())
    largest['all'] = 1e3 * sum(imports.values())
    console.print(_table('Imports by package [ms], in a run that measures them', largest, 0))
    parts = dict(mappings.most_common(12))
    parts['others'] = sum(mappings.values()) - sum(parts.values())
    parts['resident'] = medians.resident
    parts['private'] = medians.private
    console.print(_table('Memory at the first command [MB]', parts, 1))


def _table(title: str, values: dict[str, float], digits: int) -> Table:
    table = Table(title=escape(title), show_header=False)
    table.add_column()
    table.add_column(justify='right')
    for name, value in values.items():
        table.add_row(name, f'{value:.{digits}f}')
    return table
