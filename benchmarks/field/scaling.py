"""Cost of a step of ours against joints, levels and rows."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from field.cases import Case, pose_of
from field.processes import LIBRARIES
from field.robots import spatial
from field.states import random_states
from field.timing import Times, measure
from tp_controller.robot import urdf_robot

OWN = tuple(library for library in LIBRARIES if library.environment is None)
JOINTS = (3, 7, 14, 30, 45, 60)
LEVELS = range(1, 11)
STEPS = 100
"""Steps in a block."""
VELOCITY = 2.0
"""Velocity limit [rad/s]."""

Curve = dict[str, dict[int, Times]]
"""Times by solver and by number of joints, levels or rows."""


def against_joints(count: int) -> Curve:
    """Three levels (position and orientation of the tip, posture) on longer and longer chains."""
    found: Curve = {library.label: {} for library in OWN}
    tasks = {
        'position': {'type': 'position', 'frame': 'tip'},
        'orientation': {'type': 'orientation', 'frame': 'tip'},
        'posture': {'type': 'posture'},
    }
    for n in JOINTS:
        arm = spatial(n)
        robot = urdf_robot(arm.urdf, arm.joints)
        position, turn = pose_of(robot, np.full(n, 0.4), 'tip')
        goals = {
            'position': position[None],
            'orientation': turn[None],
            'posture': np.zeros((1, n)),
        }
        case = _chain(f'joints_{n}', n, tasks, {'step': [[name] for name in tasks]}, goals, count)
        for (label, _), times in measure(case, STEPS, OWN).items():
            if isinstance(times, Times):
                found[label][n] = times
    return found


def against_levels(count: int, stacked: bool) -> Curve:
    """Positions of 1 to 10 links of a chain of 30 joints, each a level or all on one level."""
    n = 3 * len(LEVELS)
    arm = spatial(n)
    robot = urdf_robot(arm.urdf, arm.joints)
    tasks = {f'link_{3 * i}': {'type': 'position', 'frame': f'link_{3 * i}'} for i in LEVELS}
    goals = {name: pose_of(robot, np.full(n, 0.2), name)[0][None] for name in tasks}
    names = list(tasks)
    problems = {str(i): [names[:i]] if stacked else [[name] for name in names[:i]] for i in LEVELS}
    case = _chain('rows' if stacked else 'levels', n, tasks, problems, goals, count)
    found: Curve = {library.label: {} for library in OWN}
    for (label, problem), times in measure(case, STEPS, OWN).items():
        if isinstance(times, Times):
            found[label][int(problem) * (3 if stacked else 1)] = times
    return found


def _chain(
    name: str,
    n: int,
    tasks: Mapping[str, Mapping[str, Any]],
    levels: Mapping[str, list[list[str]]],
    goals: Mapping[str, np.ndarray],
    count: int,
) -> Case:
    arm = spatial(n)
    limits = {'velocity': [VELOCITY] * n, 'ranges': True}
    problems = {key: {'levels': value} | limits for key, value in levels.items()}
    states = random_states(urdf_robot(arm.urdf, arm.joints), count)
    return Case(name, name, arm, tasks, problems, states, goals, np.zeros((1, n)))
