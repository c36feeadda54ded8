"""Cases about other nodes: floods, malformed messages, second ones, robots in namespaces."""

from __future__ import annotations

import sys
import time

from tp_sim.faults import arm
from tp_sim.faults.fuzz import Fuzz
from tp_sim.faults.rig import Rig
from tp_sim.harness import Process


def in_namespace(namespace: str, *topics: str) -> list[str]:
    """ROS arguments for a node in a namespace whose topics are not."""
    remaps = [f'{name}:=/{name.lstrip("/")}' for name in topics]
    return [argument for rule in (f'__ns:=/{namespace}', *remaps) for argument in ('-r', rule)]


def goals(rig: Rig) -> None:
    """Send 4,000 goals a second."""
    topic = rig.judged.topics.goals
    flood = rig.start_beside('flood', sys.executable, '-m', 'tp_sim.faults.goal_flood', topic)
    rig.move(4.0)
    flood.stop()
    rig.recover()


def fuzz(rig: Rig) -> None:
    """Send 10,000 malformed messages, parameters and service calls."""
    found = Fuzz(rig.client, rig.judged.node)
    states = f'/{rig.judged.topics.states.lstrip("/")}'
    for _ in range(10):
        rig.next_goal()
        found.messages(600, (states,))
    found.services(1000)
    changed = found.parameters(3000)
    told = ', '.join(f'{count} {kind}' for kind, count in found.counts.items())
    rig.notes.append(f'{told}; {found.answered} calls answered')
    if changed:
        rig.wrong.append(f'parameters took malformed values: {", ".join(changed)}')
    rig.recover()


def fuzz_states(rig: Rig) -> None:
    """Send malformed joint states and bytes between the right ones, by a second publisher."""
    found = Fuzz(rig.client, rig.judged.node)
    states = f'/{rig.judged.topics.states.lstrip("/")}'
    node = rig.client.node
    name = rig.judged.node.rpartition('/')[2]
    others = [
        topic for topic, _ in node.get_subscriber_names_and_types_by_node(name, '/')
        if topic != states
    ]  # fmt: skip
    for _ in range(5):
        rig.next_goal()
        found.messages(400, tuple(others), together=4)
    rig.notes.append(f'{found.counts["messages"]} messages, {found.counts["bytes"]} as bytes')
    rig.recover()


def two_controllers(rig: Rig) -> None:
    """Run a second controller on the same topics for 4 s."""
    rig.mixed = True
    topics = rig.judged.topics
    other = rig.start_controller(*in_namespace('second', topics.states, topics.commands))
    rig.wait_for(lambda: rig.relay.listeners > 1, 'the second controller')
    rig.move(4.0)
    _end(rig, other)
    rig.recover()


def two_simulators(rig: Rig) -> None:
    """Run a second simulator, whose arm is elsewhere, on the same topics for 4 s."""
    rig.mixed = True
    other = rig.start_simulator(arm.ELSEWHERE, *in_namespace('second'), root='/')
    rig.move(4.0)
    _end(rig, other)
    rig.recover()


def _end(rig: Rig, other: Process) -> None:
    if status := other.stop():
        rig.wrong.append(f'the second {other.name} ended with status {status}')


def namespaces(rig: Rig) -> None:
    """Run three robots in namespaces; kill one controller, the others do not notice."""
    begin = time.time()
    robots = [
        Rig(rig.judged, rig.watch, name, rig.domain, rate=100.0)
        for name in ('arm_1', 'arm_2', 'arm_3')
    ]
    try:
        for _ in range(2):
            for robot in robots:
                robot.next_goal()
            rig.client.spin_for(1.0)
        killed = time.time()
        counts = [len(robot.relay.commands) for robot in robots]
        robots[0].controller.kill()
        rig.client.spin_for(1.0)
        for robot, count in zip(robots[1:], counts[1:], strict=True):
            came = len(robot.relay.commands) - count
            if came < 0.8 * (time.time() - killed - 0.1) * robot.rate:
                rig.wrong.append(f'{robot.namespace} got {came} commands in 1 s')
        robots[0].controller = robots[0].start_controller()
        for robot in robots:
            robot.recover()
            robot.stop()
            found = robot.findings(begin)
            found.wrong = [f'{robot.namespace}: {text}' for text in found.wrong]
            rig.others.append(found)
        slowest = max(robots, key=lambda robot: robot.recovery)
        rig.well, rig.recovery = slowest.well, slowest.recovery
        rig.way = max(robot.way for robot in robots)
    finally:
        for robot in robots:
            robot.close()
