"""How often the real arms of config/ reach random goals: `python benchmarks/reach.py`.

Start and goal are drawn uniformly inside the joints' ranges (a joint that turns without end
takes any angle); the goal is the pose of the hand there. What the nodes do in lockstep is
computed without them: the stack of the shipped parameter file answers a configuration, the
simulator's joints move on within their speeds and ranges. Every draw is tried four times:

- as it is;
- with a way around, as `~/reach` with ``around`` goes it (benchmarks/around.py has more);
- with joints that have speeds but no ends of their ranges;
- from the posture of the file in place of the random start.

OInK, PlaCo and Pink get the same starts and goals (benchmarks/reach_others.py). What a case or a
library gave is kept in out/reach and not tried again, so that the whole can be done in pieces, by
``--arms`` and ``--sides`` or by ending and calling it again. ``--write`` puts the tables into
docs/real_arms.md; without out/reach all is tried anew.
"""

import argparse
import json
import math
import multiprocessing
import os
from collections import Counter
from collections.abc import Sequence
from typing import Any, NamedTuple

# One thread per process: small matrices gain nothing from more.
os.environ.update({f'{name}_NUM_THREADS': '1' for name in ('OMP', 'OPENBLAS', 'MKL')})

import numpy as np
from around_motion import CLOSE, CONFIG, pursue
from around_motion import Case as Around
from draws import ARMS, draw
from reach_others import OTHERS, OUT, reached
from reach_tables import show, write

from tp_controller.config import build_settings, read_parameter_file
from tp_controller.robot import Limits
from tp_controller.stack import Stack
from tp_controller.tasks import PoseTask, PostureTask, Task
from tp_sim.integrator import Integrator

SECONDS = 10.0
LATE = 40.0
"""Time [s] after which a run that has not arrived is given up."""
CHUNK = 10
OWN = 'own'

ARRIVED, SLOW, LIMIT, SINGULAR, OTHER = 'arrived', 'late', 'end', 'singular', 'other'


class Case(NamedTuple):
    """A stack to try."""

    arm: str
    file: str
    hierarchy: tuple[str, ...]

    @property
    def levels(self) -> str:
        """What it is to reach, without the posture at its end."""
        return ', '.join(name.rsplit('_', 1)[-1] for name in self.hierarchy[:-1])

    def stack(self) -> Stack:
        values = read_parameter_file(CONFIG / f'{self.file}.yaml', 'tp_controller')
        return build_settings(values | {'hierarchy': list(self.hierarchy)}).stack


class Job(NamedTuple):
    """Some of the draws of a case."""

    case: Case
    draws: range
    count: int


class Outcome(NamedTuple):
    """What became of one draw."""

    ending: str
    without_ends: bool
    """Whether the goal is reached where the joints' ranges have no ends."""
    from_posture: bool
    """Whether the goal is reached from the posture."""
    around: bool
    """Whether the goal is reached with a way around."""
    find: float
    """Time [s] to find configurations,"""
    plan: float
    """and to plan a way; 0 where the straight way is taken."""
    length: float
    """Length of the motion around over that of the straight line in joint space, NaN where the
    straight way is taken."""


def cases(arm: str) -> list[Case]:
    """Position alone, position over orientation, and pose, each over the posture."""
    hierarchies = {
        file: tuple(read_parameter_file(CONFIG / f'{file}.yaml', 'tp_controller')['hierarchy'])
        for file in (arm, f'{arm}_pose')
    }
    position, *_, posture = hierarchies[arm]
    return [
        Case(arm, arm, (position, posture)),
        *(Case(arm, file, hierarchy) for file, hierarchy in hierarchies.items()),
    ]


class Pursuit:
    """A stack and simulated joints on their way to a goal."""

    def __init__(self, stack: Stack, start: np.ndarray, limits: Limits, dt: float) -> None:
        self._stack = stack
        self._joints = Integrator(start, limits)
        self._dt = dt
        self._time = 0.0
        self._aims = [task for task in stack.tasks.values() if not isinstance(task, PostureTask)]
        self._aims = [task for task in self._aims if stack.level_of(task.name) >= 0]
        self._held = math.inf
        self.stopped = False
        """Whether a joint was held at an end of its range."""

    def run(self, until: float) -> bool:
        """Go on to a time [s]; return whether the goal is reached then."""
        self._stack.robot.limits = self._joints.limits
        self._stack.rest()
        for _ in range(round((until - self._time) / self._dt)):
            command = self._stack.step(self._joints.q).command
            self._joints.step(command, self._dt)
            self._held += self._dt
            if self._stack.solver.held.any():
                self.stopped, self._held = True, 0.0
        self._time = until
        self._stack.step(self._joints.q)
        errors = np.concatenate([_error(task) for task in self._aims])
        return bool(np.all(errors <= np.concatenate([_tolerance(task) for task in self._aims])))

    def cause(self) -> str:
        """Why the arm rests, or wanders, where it is."""
        if self._held < 1.0:
            return LIMIT
        J = np.vstack([task.J for task in self._aims])
        damped = self._stack.solver.inverse.region
        return SINGULAR if np.linalg.svd(J, compute_uv=False)[-1] < damped else OTHER


def _error(task: Task) -> np.ndarray:
    parts = np.split(task.error, [3]) if isinstance(task, PoseTask) else [task.error]
    return np.array([np.linalg.norm(part) for part in parts])


def _tolerance(task: Task) -> np.ndarray:
    return {'position': CLOSE[:1], 'orientation': CLOSE[1:]}.get(task.type, CLOSE)


def outcomes(job: Job) -> list[Outcome]:
    """Try some draws."""
    names = job.case.hierarchy[:-1]
    levels = (('hierarchy', list(job.case.hierarchy)),)
    way = Around(f'{job.case.file} {job.case.levels}', job.case.file, names, levels)
    stack = job.case.stack()
    robot, limits = stack.robot, stack.robot.limits
    path = CONFIG / f'{job.case.file}.yaml'
    dt = 1.0 / read_parameter_file(path, 'tp_sim')['rate']
    endless = Limits(robot.n, velocity=limits.velocity)
    posture = stack.tasks[job.case.hierarchy[-1]].target
    frame = robot.frame(stack.tasks[job.case.hierarchy[0]].frame_name)
    starts, goals = draw(robot, job.count)
    result = []
    for i in job.draws:
        robot.update(goals[i])
        for name in names:
            task = stack.tasks[name]
            task.target = task.target_from_pose(frame.position, frame.rotation)
        targets = {name: stack.tasks[name].target for name in names}
        pursuit = Pursuit(stack, starts[i], limits, dt)
        arrived = pursuit.run(SECONDS)
        without_ends = arrived
        if pursuit.stopped:
            # A run that met no end would be the same without them.
            without_ends = Pursuit(stack, starts[i], endless, dt).run(SECONDS)
        ending = ARRIVED
        if not arrived:
            ending = SLOW if pursuit.run(LATE) else pursuit.cause()
        from_posture = Pursuit(stack, posture, limits, dt).run(SECONDS)
        gone = pursue(way, starts[i], targets)
        length = gone.length / max(gone.direct, 1e-3) if gone.kind == 'around' else math.nan
        result.append(
            Outcome(ending, without_ends, from_posture, gone.reached, *gone.seconds[1:], length)
        )
    return result


def try_arm(arm: str, count: int, sides: Sequence[str]) -> None:
    """Try all draws of an arm by some sides; what is kept already is not tried again."""
    path = OUT / f'{arm}.json'
    kept: dict[str, Any] = {}
    if path.exists():
        kept = json.loads(path.read_text(encoding='utf-8'))
    if kept.get('count') != count:
        kept = {'count': count, 'own': {}, 'others': {}}
    OUT.mkdir(parents=True, exist_ok=True)
    left = [case for case in cases(arm) if case.levels not in kept['own'] and OWN in sides]
    with multiprocessing.get_context('spawn').Pool(2) as pool:
        for case in left:
            chunks = [range(i, min(i + CHUNK, count)) for i in range(0, count, CHUNK)]
            jobs = [Job(case, chunk, count) for chunk in chunks]
            tried = [one for some in pool.imap(outcomes, jobs) for one in some]
            kept['own'][case.levels] = summary(tried)
            path.write_text(json.dumps(kept), encoding='utf-8')
    for library in OTHERS:
        if library.label in sides and library.label not in kept['others']:
            kept['others'][library.label] = reached(library, arm, count, SECONDS, CLOSE)
            path.write_text(json.dumps(kept), encoding='utf-8')


def summary(tried: Sequence[Outcome]) -> dict[str, float]:
    """Shares [%] and medians of a case."""
    endings = Counter(one.ending for one in tried)
    counts = {name: endings[name] for name in (ARRIVED, SLOW, LIMIT, SINGULAR, OTHER)}
    counts['around'] = sum(one.around for one in tried)
    counts['no ends'] = sum(one.without_ends for one in tried)
    counts['from it'] = sum(one.from_posture for one in tried)
    found = {name: 100.0 * number / len(tried) for name, number in counts.items()}
    not_straight = [one for one in tried if not math.isnan(one.length)]
    for name in ('find', 'plan', 'length'):
        values = [getattr(one, name) for one in not_straight]
        found[name] = float(np.median(values)) if values else math.nan
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--arms', nargs='*', choices=ARMS, default=list(ARMS), help='(all)')
    parser.add_argument('--count', type=int, default=200, help='draws per arm (%(default)s)')
    sides = [OWN, *(one.label for one in OTHERS)]
    parser.add_argument('--sides', nargs='+', choices=sides, default=sides, help='(all)')
    parser.add_argument('--write', action='store_true', help='write docs/real_arms.md')
    arguments = parser.parse_args()
    for arm in arguments.arms:
        try_arm(arm, arguments.count, arguments.sides)
    show(OUT)
    if arguments.write:
        write(OUT)


if __name__ == '__main__':
    main()
