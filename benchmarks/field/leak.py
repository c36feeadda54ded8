"""Priority leak: how much lower levels change the velocity of a higher one."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from field.cases import Case, hand_tasks
from field.processes import LIBRARIES, Library
from field.robots import HAND, panda
from field.serving import CannotDo
from field.states import random_states
from field.timing import open_sides
from tp_controller.robot import Robot, urdf_robot

LIMITS = (20.0, 5.0, 2.0, 0.5)
"""Velocity limits [rad/s]."""
STACKS = {
    'position, orientation, posture': [['position'], ['orientation'], ['posture']],
    'pose, posture': [['position', 'orientation'], ['posture']],
}
LEAST = 1e-2
"""Task velocity [m/s, rad/s] that smaller ones are measured against."""
SHARE = 0.01
"""Change of the first level that counts."""


class Leak(NamedTuple):
    """Changes of the first level over random draws, as a share of its velocity."""

    changes: np.ndarray
    failed: int
    """Draws without an answer."""
    reason: str
    """Last error."""

    @property
    def share(self) -> float:
        """Share of the draws that change by more than `SHARE`."""
        return float(np.mean(self.changes > SHARE))


def change(alone: np.ndarray, others: Sequence[np.ndarray], least: float = LEAST) -> float:
    """Largest change of a task velocity when levels are added below.

    Parameters
    ----------
    alone
        Task velocity (k,) without them.
    others
        Task velocities (k,) with some or all of them.
    least
        What the change is divided by at least.
    """
    size = max(least, float(np.linalg.norm(alone)))
    return max(float(np.linalg.norm(one - alone)) / size for one in others)


def random_goals(random: np.random.Generator, n: int) -> list[np.ndarray]:
    """Position (3,), quaternion (4,) and posture (n,), most of them far away."""
    turn = random.normal(size=4)
    return [random.normal(size=3), turn / np.linalg.norm(turn), random.normal(size=n)]


def leak_case(count: int) -> Case:
    """Panda in random states with random goals, at every limit and with levels added."""
    arm = panda()
    robot = urdf_robot(arm.urdf, arm.joints)
    random = np.random.default_rng(11)
    drawn = [random_goals(random, robot.n) for _ in range(count)]
    goals = {
        name: np.array([goal[i] for goal in drawn])
        for i, name in enumerate(('position', 'orientation', 'posture'))
    }
    problems: dict[str, Any] = {}
    for stack, levels in STACKS.items():
        for limit in LIMITS:
            for above in range(1, len(levels) + 1):
                problems[f'{stack} {above} {limit:g}'] = {
                    'levels': levels[:above],
                    'velocity': [limit] * robot.n,
                    'ranges': True,
                    'separate': True,
                }
    states = random_states(robot, count)
    return Case('leak', 'Leak', arm, hand_tasks(), problems, states, goals, np.zeros((1, robot.n)))


def measure(
    count: int, libraries: Sequence[Library] = LIBRARIES
) -> dict[str, dict[tuple[str, float], Leak] | str]:
    """Leak of every library by stack and limit, or why there is none."""
    case = leak_case(count)
    robot = urdf_robot(case.arm.urdf, case.arm.joints)
    sides, missing = open_sides(case, next(iter(case.problems)), libraries)
    found: dict[str, dict[tuple[str, float], Leak] | str] = dict(missing)
    for label, side in sides.items():
        leaks = {}
        try:
            for stack, levels in STACKS.items():
                for limit in LIMITS:
                    answers = [
                        side.ask('velocities', f'{stack} {above} {limit:g}', 0, count)
                        for above in range(1, len(levels) + 1)
                    ]
                    leaks[stack, limit] = _judge(robot, case, stack, answers)
            found[label] = leaks
        except (CannotDo, RuntimeError) as error:
            found[label] = str(error)
        side.stop()
    return found


def _judge(robot: Robot, case: Case, stack: str, answers: list[dict[str, Any]]) -> Leak:
    """Compare the first level's velocity, computed here from the joint velocities."""
    rows = 3 * len(STACKS[stack][0])
    changes, failed = [], 0
    drawn = zip(*(answer['velocities'] for answer in answers), strict=True)
    for q, velocities in zip(case.states, drawn, strict=True):
        if any(qd is None for qd in velocities):
            failed += 1
            continue
        robot.update(q)
        J = robot.frame(HAND).jacobian[:rows]
        alone, *others = [J @ np.array(qd) for qd in velocities]
        changes.append(change(alone, others))
    reasons = [answer['reason'] for answer in answers if answer['reason']]
    return Leak(np.array(changes), failed, reasons[-1] if reasons else '')
