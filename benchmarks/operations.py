"""Whether limits and distances are kept while an operator works with a moving arm, in real time.

It also tells how old the joint states were when commands answered them, while and after each kind
of operation.

The arm has delay, lag and noise, which the controller knows, and busy loops run beside it. Twice a
second something happens at random: a goal, a goal by ``~/reach``, a path, a path of a thousand
poses, a hold, a task switched off and on, another order of the hierarchy, a deactivation. The
joints' true motion is judged. The exit status is 1 if a limit of speed was broken, a command
changed by more than the limit of acceleration allows, or a distance was not positive.

A command may differ from the one before by what the limit allows in one period, however much time
has passed. The simulator stops the joints when no command comes for 0.3 s, as drivers do: after
that a command counts from what the joints do, and zero is allowed.

    python benchmarks/operations.py --seconds 60 --busy 4
    python benchmarks/operations.py --type joint_state_position
    python benchmarks/operations.py --only long_path
    python benchmarks/operations.py --solver hqp
"""

from __future__ import annotations

import argparse
import random
import subprocess
import sys
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from builtin_interfaces.msg import Duration
from geometry_msgs.msg import Transform
from lifecycle_msgs.srv import ChangeState
from numpy.typing import NDArray
from rclpy.qos import QoSProfile
from rich.console import Console
from rich.table import Table
from sensor_msgs.msg import JointState
from std_srvs.srv import SetBool
from trajectory_msgs.msg import MultiDOFJointTrajectory, MultiDOFJointTrajectoryPoint

from tp_controller import Stack, build_settings
from tp_interfaces.msg import ControllerState
from tp_sim.harness import ClosedLoop, GoalRejected
from tp_sim.harness.document import edited, read_document

CONFIG = Path(__file__).resolve().parent.parent / 'config' / 'panda_table.yaml'
TASK = 'hand_position'
KINDS = ('goal', 'reach', 'path', 'long_path', 'hold', 'switch', 'order', 'deactivate')
GOALS = (
    (0.45, 0.25, 0.1),
    (0.5, 0.3, 0.35),
    (0.2, -0.6, 0.4),
    (0.5, 0.3, 0.85),
    (0.9, 0.9, 0.2),
    (0.3, 0.0, 0.6),
)
"""Some out of reach, some inside obstacles."""
ORDERS = (
    ['ranges', 'table + pillar + ball', 'self', 'posture', 'hand_position'],
    ['ranges', 'table + pillar + ball', 'self', 'hand_position', 'posture'],
)
DELAY, LAG, NOISE = 2, 0.02, 5e-4
"""Of the arm: periods, [s], [rad]."""
WAY = 0.3
"""Time [s] between the points of a path."""
MANY = 1000
"""Points of a long path,"""
STEP = 0.005
"""and time [s] between them."""
PAUSE = 0.5
"""Time [s] after each operation."""
ROUNDING = 1.01
"""Stamps are rounded to nanoseconds, commands leave a little later or sooner."""
WATCHDOG = 0.3
"""Time [s] without a command after which the joints are stopped."""
PAUSED = 0.25
"""Time [s] between two commands' stamps after which the joints may have been stopped,"""
AFTERWARDS = 0.15
"""and time [s] after that in which a command may go towards what they do."""


class Operator:
    """Does at random what an operator may do."""

    def __init__(self, loop: ClosedLoop, kinds: Sequence[str], seed: int) -> None:
        self._loop, self._kinds, self._random = loop, kinds, random.Random(seed)
        self._long = [self._points(MANY, STEP, self._place(), self._place()) for _ in range(4)]
        self.done: Counter[str] = Counter()
        self.ages: dict[str, list[float]] = {}
        """Age [s] of the joint state that each command answered, by the operation of its time."""
        self._kind = 'nothing'
        loop.client.on_state.append(self._note)

    def _note(self, state: ControllerState) -> None:
        if state.status == ControllerState.RUNNING:
            self.ages.setdefault(self._kind, []).append(state.command_age)

    def act(self) -> None:
        """Do one thing."""
        kind = self._kind = self._random.choice(self._kinds)
        self.done[kind] += 1
        try:
            getattr(self, f'_{kind}')()
        except GoalRejected:
            self.done[f'{kind} refused'] += 1
        self._loop.client.spin_for(PAUSE)

    def _goal(self) -> None:
        self._loop.send_goal(TASK, self._place())

    def _reach(self) -> None:
        self._loop.client.start_reach({TASK: self._place()}, time_limit=5.0)

    def _path(self) -> None:
        message = self._points(3, WAY, self._place(), self._place())
        self._loop.client.publish(f'tp_controller/{TASK}/trajectory', message)

    def _long_path(self) -> None:
        message = self._random.choice(self._long)
        self._loop.client.publish(f'tp_controller/{TASK}/trajectory', message)

    def _points(
        self, count: int, step: float, begin: list[float], end: list[float]
    ) -> MultiDOFJointTrajectory:
        """Path on a straight line with so much time [s] from point to point."""
        message = MultiDOFJointTrajectory()
        for number in range(1, count + 1):
            share = (number - 1) / max(count - 1, 1)
            transform = Transform()
            place = transform.translation
            place.x, place.y, place.z = (
                (1.0 - share) * a + share * b for a, b in zip(begin, end, strict=True)
            )
            transform.rotation.w = 1.0
            point = MultiDOFJointTrajectoryPoint(transforms=[transform])
            seconds, rest = divmod(round(1e9 * step * number), 10**9)
            point.time_from_start = Duration(sec=seconds, nanosec=rest)
            message.points.append(point)
        return message

    def _hold(self) -> None:
        for hold in (True, False):
            request = SetBool.Request(data=hold)
            self._loop.client.call(SetBool, 'tp_controller/hold', request)
            self._loop.client.spin_for(WAY)

    def _switch(self) -> None:
        name = self._random.choice(('posture', TASK))
        for enabled in (False, True):
            self._loop.set_parameters({f'tasks.{name}.enabled': enabled})
            self._loop.client.spin_for(WAY)

    def _order(self) -> None:
        for order in ORDERS:
            self._loop.set_parameters({'hierarchy': order})
            self._loop.client.spin_for(WAY)

    def _deactivate(self) -> None:
        for label in ('deactivate', 'activate'):
            request = ChangeState.Request()
            request.transition.label = label
            self._loop.client.call(ChangeState, 'tp_controller/change_state', request)

    def _place(self) -> list[float]:
        return list(self._random.choice(GOALS))


class Record:
    """What one topic with joints said."""

    def __init__(self, messages: list[JointState], joints: list[str], field: str) -> None:
        stamps = [message.header.stamp for message in messages]
        self.times = np.array([stamp.sec + 1e-9 * stamp.nanosec for stamp in stamps])
        self.values = np.array(
            [
                [getattr(message, field)[message.name.index(joint)] for joint in joints]
                for message in messages
            ]
        )

    def speed(self, limit: NDArray[np.float64], period: float) -> float:
        """Largest change per time between two messages, as a share of a limit (n,)."""
        times = np.maximum(np.diff(self.times), period)
        return float((np.abs(np.diff(self.values, axis=0)) / times[:, None] / limit).max())


def largest_change(
    sent: Record, steps: NDArray[np.float64], true: Record, allowed: NDArray[np.float64]
) -> float:
    """Largest change of the command, as a share of what is allowed from one to the next (n,).

    Parameters
    ----------
    sent, true
        Velocities that were commanded, and those of the joints.
    steps
        How many commands there were from each to the next: a busy machine loses some on the way
        here.
    allowed
        Limits of acceleration times one period (n,) [rad/s, m/s].
    """
    last, new, times = sent.values[:-1], sent.values[1:], sent.times[1:]
    found = np.searchsorted(true.times, times + 1e-6, side='right') - 1
    moved = true.values[np.maximum(found, 0)]
    paused = np.diff(sent.times) > PAUSED
    since = times - np.maximum.accumulate(np.where(paused, times, -np.inf))
    recent = (since < AFTERWARDS)[:, None]
    low = np.where(recent, np.minimum(last, moved), last)
    high = np.where(recent, np.maximum(last, moved), last)
    stopped = paused[:, None] & (moved * np.sign(last) < 0.5 * np.abs(last))
    low, high = (np.where(stopped, moved, bound) for bound in (low, high))
    # After such a pause the controller need not brake an arm that is being stopped.
    zero = paused & ~new.any(axis=1)
    low, high = (np.where(zero[:, None], new, bound) for bound in (low, high))
    return float((np.maximum(low - new, new - high) / (steps[:, None] * allowed)).max())


def run(
    config: Path,
    seconds: float,
    ideal: bool,
    kind: str,
    solver: str,
    kinds: Sequence[str],
    seed: int,
) -> bool:
    """Operate, judge and print; return whether everything was kept."""
    document = edited(read_document(config), {'tp_controller': {'solver': {'type': solver}}})
    period = 1.0 / float(document['/**']['rate'])
    changes: dict[str, Any] = {'/**': {'command': {'type': kind}}}
    changes['tp_sim'] = {'command_timeout': WATCHDOG}
    if not ideal:
        known = {'delay': DELAY * period, 'lag': LAG, 'noise': NOISE}
        changes['/**']['robot'] = known
        changes['tp_sim'] |= {'plant': {'delay': DELAY, 'lag': [LAG], 'noise': [NOISE]}}
    topic = 'joint_velocity_command' if kind == 'joint_state' else 'joint_position_command'
    with ClosedLoop(edited(document, changes), lockstep=False) as loop:
        true = loop.client.collect(JointState, 'tp_sim/true_joint_states')
        sent: list[JointState] = []
        numbers: list[int] = []

        def note(command: JointState, info: dict[str, int]) -> None:
            sent.append(command)
            numbers.append(info['publication_sequence_number'])

        loop.client.node.create_subscription(JointState, topic, note, QoSProfile(depth=5000))
        operator = Operator(loop, kinds, seed)
        begin = loop.client.node.get_clock().now()
        while (loop.client.node.get_clock().now() - begin).nanoseconds < 1e9 * seconds:
            operator.act()
        overruns, skipped = loop.client.state.overruns, loop.client.state.skipped
        output = loop.controller.output
    stack = build_settings(edited(document['/**'], document['tp_controller'])).stack
    joints, limits = list(stack.robot.joints), stack.robot.limits
    speed = np.abs(Record(true, joints, 'velocity').values) / limits.velocity
    rows = [('speed of the joints, share of the limit', float(speed.max()), speed.max() <= 1.0)]
    if kind == 'joint_state':
        speeds = Record(true, joints, 'velocity')
        allowed = limits.acceleration * period
        commands = Record(sent, joints, 'velocity')
        change = largest_change(commands, np.diff(numbers), speeds, allowed)
        rows.append(('change of the command, share of the limit', change, change <= ROUNDING))
    else:
        change = Record(sent, joints, 'position').speed(limits.velocity, period)
        rows.append(('speed of the reference, share of the limit', change, change <= ROUNDING))
    for name, distance in least_distances(stack, Record(true, joints, 'position')).items():
        rows.append((f'least distance of {name} [mm or mrad]', 1e3 * distance, distance > 0.0))
    table = Table(
        title=f'{numbers[-1] - numbers[0] + 1} commands, {overruns} late, {skipped} states skipped'
    )
    for column in ('', 'largest or least', 'kept'):
        table.add_column(column, justify='left' if column == '' else 'right')
    for name, value, kept in rows:
        table.add_row(name, f'{value:.4g}', 'yes' if kept else '[red]no[/]')
    console = Console(width=100)
    console.print(table)
    console.print(ages_table(operator))
    if 'Traceback' in output:
        print(output, file=sys.stderr)
        return False
    return all(kept for _, _, kept in rows)


def ages_table(operator: Operator) -> Table:
    """How old joint states were when they were answered, by operation."""
    table = Table(title='age of the joint state that a command answered [ms]')
    for column in ('operation', 'times', 'refused', 'commands', 'median', '99.9 %', 'largest'):
        table.add_column(column, justify='left' if column == 'operation' else 'right')
    for kind, ages in sorted(operator.ages.items()):
        values = 1e3 * np.quantile(ages, [0.5, 0.999, 1.0])
        done = (operator.done[kind], operator.done[f'{kind} refused'], len(ages))
        table.add_row(kind, *map(str, done), *(f'{value:.2f}' for value in values))
    return table


def least_distances(stack: Stack, record: Record) -> dict[str, float]:
    """Least distance of each set-based task, at one in five of the configurations."""
    tasks = {name: task for name, task in stack.tasks.items() if task.set_based}
    least = dict.fromkeys(tasks, np.inf)
    for q in record.values[::5]:
        stack.robot.update(q)
        for name, task in tasks.items():
            task.update()
            least[name] = min(least[name], float(task.distances().min()))
    return least


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--config', type=Path, default=CONFIG, help='the Panda at its table')
    parser.add_argument('--seconds', type=float, default=60.0)
    parser.add_argument('--busy', type=int, default=0, help='loops that keep processors busy')
    parser.add_argument('--ideal', action='store_true', help='no delay, lag or noise')
    parser.add_argument(
        '--type', choices=('joint_state', 'joint_state_position'), default='joint_state'
    )
    parser.add_argument('--solver', choices=('recursive', 'hqp'), default='recursive')
    parser.add_argument('--only', choices=KINDS, help='one kind of operation')
    parser.add_argument('--seed', type=int, default=0)
    chosen = parser.parse_args()
    loop = [sys.executable, '-c', 'while True: pass']
    busy = [subprocess.Popen(loop) for _ in range(chosen.busy)]
    try:
        kinds = [chosen.only] if chosen.only else KINDS
        kept = run(
            chosen.config,
            chosen.seconds,
            chosen.ideal,
            chosen.type,
            chosen.solver,
            kinds,
            chosen.seed,
        )
    finally:
        for process in busy:
            process.kill()
    return 0 if kept else 1


if __name__ == '__main__':
    sys.exit(main())
