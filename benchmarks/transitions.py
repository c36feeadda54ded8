"""Largest change of the command in one step while the stack changes at random all the time.

An ideal arm goes to random goals. Every 50 ms a task is switched on or off, comes or goes, levels
change places, or gains, the solver or limits change, in the way in which the controller's node
makes such changes. Nothing runs in real time.
"""

import argparse
import sys
import time
from collections import Counter
from pathlib import Path
from typing import NamedTuple

import numpy as np
from rich.console import Console
from rich.table import Table

from tp_controller.config import (
    build_addition,
    build_settings,
    check_changes,
    controller_schema,
    read_parameter_file,
    remaining,
    remove,
)
from tp_controller.errors import InvalidValue
from tp_controller.solvers import SATURATIONS
from tp_controller.tasks import PositionTask
from tp_controller.transition import largest_change

CONFIG = Path(__file__).resolve().parent.parent / 'config'
GOAL_PERIOD = 1.5
"""Time [s] between two goals."""
MOST_ADDED = 3
"""Tasks that are added until one of them is removed."""
BRAKING = 0.5
"""Time [s] in which an arm has braked."""
ROUNDING = 1e-6
"""Share of a bound that is rounding."""
ARMS = {'planar': 'b3_pressed.yaml', 'Panda': 'panda.yaml'}
FARTHEST = {'planar': 1.6, 'Panda': 0.75}
"""How far goals are from the base [m]."""
HANDS = {'planar': 'link_3', 'Panda': 'panda_hand_tcp'}
KINDS = ('switch', 'reorder', 'add', 'remove', 'gain', 'solver', 'damping')


class Outcome(NamedTuple):
    """What was found in one run."""

    steps: int
    changes: Counter[str]
    """How many changes of each kind were made, or refused."""
    bound: float
    """Bound on the change of a joint's velocity in a step, the largest of all joints [rad/s]."""
    largest: float
    """Largest such change where no range and no distance needed more [rad/s]."""
    share: float
    """The same as a share of the bound."""
    brakes: int
    """Steps in which a range or a distance needed more: joints beyond the bound only braked."""
    braking: float
    """Largest change in such a step [rad/s]."""
    astray: int
    """Steps beyond the bound in which a joint did anything but brake."""
    acceleration: float
    """Largest change as a share of what limits of acceleration allow."""
    distance: float
    """Least distance of a task from when the arm has been clear for `BRAKING` [m, rad]."""
    room: float
    """Least room of a joint's range [rad]."""
    seconds: float
    """Time [s] that it took."""


class Changes:
    """Makes changes at random, as the services of the controller's node do."""

    def __init__(self, arm: str, settings, rng: np.random.Generator) -> None:
        self._arm, self._settings, self._rng = arm, settings, rng
        self._own = list(settings.stack.tasks)
        self._added: list[str] = []
        self._number = 0
        self.counts: Counter[str] = Counter()

    def make(self) -> None:
        kind = KINDS[self._rng.integers(len(KINDS))]
        try:
            getattr(self, f'_{kind}')()
        except InvalidValue:
            kind = f'{kind} refused'
        self.counts[kind] += 1

    def _change(self, **changes) -> None:
        flat = {key.replace('__', '.'): value for key, value in changes.items()}
        check_changes(self._settings, controller_schema(self._settings.values), flat)()

    def _pick(self, names):
        return names[self._rng.integers(len(names))]

    def _switch(self) -> None:
        name = self._pick(list(self._settings.stack.tasks))
        on = not self._settings.stack.tasks[name].enabled
        self._change(**{f'tasks.{name}.enabled': on})

    def _reorder(self) -> None:
        names = list(self._rng.permutation(list(self._settings.stack.tasks)))
        # What keeps distances stays above the rest, as in any sensible stack.
        tasks = self._settings.stack.tasks
        names.sort(key=lambda name: not tasks[name].set_based)
        self._change(hierarchy=[str(name) for name in names])

    def _add(self) -> None:
        if len(self._added) >= MOST_ADDED:
            return self._remove()
        self._number += 1
        name = f'new_{self._number}'
        joints = list(self._settings.stack.robot.joints)
        q = self._settings.stack.robot.q
        block = self._pick(
            [
                {'type': 'posture', 'target': (q + self._rng.uniform(-0.5, 0.5, q.size)).tolist()},
                {'type': 'joint', 'joints': [self._pick(joints)]},
                {'type': 'orientation', 'frame': HANDS[self._arm], 'axes': 'z'},
                {'type': 'position', 'frame': HANDS[self._arm], 'axes': 'x'},
            ]
        )
        block['gain'] = [float(self._rng.uniform(0.5, 4.0))]
        addition = build_addition(self._settings, name, block)
        level = self._rng.integers(len(self._settings.stack.hierarchy) + 1)
        hierarchy = addition.check(int(level))
        addition.load()
        self._added.append(name)
        self._change(hierarchy=list(hierarchy))
        return None

    def _remove(self) -> None:
        if self._added:
            name = self._pick(self._added)
            self._change(hierarchy=remaining(self._settings.stack, [name]))
            remove(self._settings, name)
            self._added.remove(name)

    def _gain(self) -> None:
        name = self._pick(self._own)
        self._change(**{f'tasks.{name}.gain': [float(self._rng.uniform(0.5, 4.0))]})

    def _solver(self) -> None:
        self._change(
            solver__type=self._pick(['recursive', 'recursive', 'hqp', 'augmented', 'weighted']),
            solver__inverse=self._pick(['dls', 'adaptive']),
            solver__saturation=self._pick(list(SATURATIONS)),
        )

    def _damping(self) -> None:
        self._change(solver__damping=float(self._rng.uniform(0.02, 0.2)))


def run(arm: str, limited: bool, seconds: float, interval: float, seed: int) -> Outcome:
    """Move an arm under random changes.

    Parameters
    ----------
    arm
        Key of `ARMS`.
    limited
        Whether it has limits of acceleration.
    seconds, interval
        Simulated time [s], and that between two changes.
    seed
        Of all that is random.
    """
    values = read_parameter_file(CONFIG / ARMS[arm], 'tp_controller')
    start = read_parameter_file(CONFIG / ARMS[arm], 'tp_sim')['initial_positions']
    if not limited:
        values.pop('robot.limits.acceleration')
    settings = build_settings(values)
    stack = settings.stack
    period, limits = stack.safety_filter.period, stack.robot.limits
    rng = np.random.default_rng(seed)
    changes = Changes(arm, settings, rng)
    hands = [task for task in stack.tasks.values() if isinstance(task, PositionTask)]
    q, before = np.array(start), np.zeros(stack.robot.n)
    bound = largest_change(limits, period, stack.transition_time)
    largest = share = braking = acceleration = 0.0
    distance = room = np.inf
    brakes = astray = 0
    clear: dict[str, int] = {}
    steps, every = round(seconds / period), max(1, round(interval / period))
    begin = time.perf_counter()
    for i in range(steps):
        if i % round(GOAL_PERIOD / period) == 0:
            _aim(hands, rng, FARTHEST[arm])
        if i % every == 0:
            changes.make()
        command = stack.step(q).command
        change = np.abs(command - before)
        acceleration = max(acceleration, float((change / (limits.acceleration * period)).max()))
        beyond = change > bound * (1.0 + ROUNDING)
        if not beyond.any():
            largest, share = max(largest, change.max()), max(share, (change / bound).max())
        elif np.all((np.abs(command) <= np.abs(before))[beyond]):
            brakes, braking = brakes + 1, max(braking, change.max())
        else:
            astray += 1
        room = min(room, (q - limits.position_min).min(), (limits.position_max - q).min())
        kept = {name: stack.tasks[name].distance.min() for name in stack.safety_filter.kept}
        # A task that comes on ahead of a fast arm may find it too near to brake.
        since = i - round(BRAKING / period)
        clear = {name: clear.get(name, i) for name in kept}
        clear |= {name: i for name in kept if kept[name] < 0.0 and clear[name] >= since}
        distance = min([distance, *(kept[name] for name in clear if clear[name] < since)])
        before, q = command, q + period * command
    return Outcome(
        steps,
        changes.counts,
        float(bound.max()),
        float(largest),
        float(share),
        brakes,
        float(braking),
        astray,
        acceleration,
        float(distance),
        float(room),
        time.perf_counter() - begin,
    )


def _aim(hands: list[PositionTask], rng: np.random.Generator, farthest: float) -> None:
    """Give the hands a random goal above the base."""
    direction = rng.normal(size=3)
    direction[2] = abs(direction[2])
    reach = rng.uniform(0.3, farthest)
    for task in hands:
        task.target = reach * direction[: task.k] / np.linalg.norm(direction[: task.k])


def _table(outcomes: dict[str, Outcome], interval: float) -> Table:
    table = Table(title=f'Random changes of the stack every {1e3 * interval:g} ms')
    table.add_column('')
    for name in outcomes:
        table.add_column(name, justify='right')
    found = outcomes.values()
    for label, values in (
        ('steps', [f'{o.steps:,}' for o in found]),
        ('changes made', [f'{sum(o.changes.values()) - _refused(o):,}' for o in found]),
        ('changes refused', [f'{_refused(o):,}' for o in found]),
        ('largest bound [rad/s]', [f'{o.bound:.4f}' for o in found]),
        ('largest change [rad/s]', [f'{o.largest:.4f}' for o in found]),
        ('as a share of its bound', [f'{o.share:.6f}' for o in found]),
        ('steps that brake harder', [f'{o.brakes:,}' for o in found]),
        ('largest change in these [rad/s]', [f'{o.braking:.4f}' for o in found]),
        ('other steps beyond the bound', [f'{o.astray:,}' for o in found]),
        ('share of acceleration limit', [f'{o.acceleration:.6f}' for o in found]),
        ('least distance [m, rad]', [f'{o.distance:.7f}' for o in found]),
        ('least room of a range [rad]', [f'{o.room:.9f}' for o in found]),
        (
            'time per step [µs], changes included',
            [f'{1e6 * o.seconds / o.steps:.0f}' for o in found],
        ),
    ):
        table.add_row(label.replace('[', '\\['), *values)
    return table


def _refused(outcome: Outcome) -> int:
    return sum(count for kind, count in outcome.changes.items() if 'refused' in kind)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--minutes', type=float, default=10.0, help='simulated, of each arm')
    parser.add_argument('--interval', type=float, default=0.05, help='time [s] between changes')
    parser.add_argument('--seed', type=int, default=1)
    arguments = parser.parse_args()
    outcomes = {}
    for arm in ARMS:
        for limited in (False, True):
            name = f'{arm}, {"with" if limited else "no"}\nacceleration limits'
            seconds = 60.0 * arguments.minutes
            outcomes[name] = run(arm, limited, seconds, arguments.interval, arguments.seed)
    Console(width=120).print(_table(outcomes, arguments.interval))
    good = all(
        o.share <= 1.0 + ROUNDING
        and o.acceleration <= 1.0 + ROUNDING
        and not o.astray
        and o.room >= 0.0
        and o.distance >= 0.0
        for o in outcomes.values()
    )
    return 0 if good else 1


if __name__ == '__main__':
    sys.exit(main())
