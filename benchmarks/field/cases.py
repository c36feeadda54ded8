"""Cases of the comparison: robot, tasks, limits, states and goals, written for every side."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from field.robots import (
    HAND,
    SPHERES,
    Arm,
    panda,
    planar,
    two_pandas,
    without_limits,
    write_with_world,
)
from field.states import (
    LINK_PAIRS,
    PERIOD,
    POINTS,
    ROOM,
    TIP,
    arm_is_clear,
    path,
    random_states,
    tip_is_clear,
)
from tp_controller.robot import Robot, urdf_robot
from tp_controller.rotations import quaternion_from_rotation

OUT = Path(__file__).resolve().parents[2] / 'out' / 'field'
GAIN = 3.0
"""Gain of every task [1/s]."""
PANDA_JOINTS = [f'panda_joint{i + 1}' for i in range(7)]
PANDA_GOAL = [0.4, -0.4, 0.3, -2.0, 0.2, 1.8, 1.0]
"""Configuration [rad] whose hand pose is the goal."""
POSTURE = [0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785]
PANDA_VELOCITY = [2.175] * 4 + [2.61] * 3
PANDA_ACCELERATION = [15.0, 7.5, 10.0, 12.5, 15.0, 20.0, 20.0]
ROWS = 20
"""Nearest pairs of shapes that get a row where a library asks for a number."""


class Case(NamedTuple):
    """What one comparison is about."""

    name: str
    title: str
    arm: Arm
    tasks: Mapping[str, Mapping[str, Any]]
    problems: Mapping[str, Mapping[str, Any]]
    """Levels and limits by name; the time of a step is measured with the first."""
    states: np.ndarray
    """Configurations (m, n) [rad]."""
    goals: Mapping[str, np.ndarray]
    """Goals (m, size) or (1, size) by task."""
    velocities: np.ndarray
    """Velocities (m, n) or (1, n) [rad/s] of the step before."""
    more: Mapping[str, Any] = {}
    """Obstacles and what sides need to know of them."""

    def write(self) -> Path:
        """Write everything for the sides; return the scenario's path."""
        folder = OUT / self.name
        world = folder / 'world'
        world.mkdir(parents=True, exist_ok=True)
        (folder / 'robot.urdf').write_text(self.arm.urdf, encoding='utf-8')
        more = {'world': [], 'pairs': [], 'world_pairs': []} | dict(self.more)
        write_with_world(shaped_tip(self.arm.urdf, more), more['world'], world / 'robot.urdf')
        pairs = more['pairs'] + more['world_pairs']
        (world / 'pairs.json').write_text(json.dumps(pairs), encoding='utf-8')
        goals = {f'goal_{name}': values for name, values in self.goals.items()}
        np.savez(folder / 'arrays.npz', states=self.states, velocities=self.velocities, **goals)
        scenario = more | {
            'urdf': str(folder / 'robot.urdf'),
            'world_folder': str(world),
            'arrays': str(folder / 'arrays.npz'),
            'joints': list(self.arm.joints),
            'period': PERIOD,
            'gain': GAIN,
            'tasks': self.tasks,
            'problems': self.problems,
        }
        path = folder / 'scenario.json'
        path.write_text(json.dumps(scenario), encoding='utf-8')
        return path


def planar_case(count: int) -> Case:
    """Planar 3R: position of the tip, then the angle of the second link."""
    arm = planar()
    tasks = {
        'position': {'type': 'position', 'frame': 'tip', 'axes': 'xy'},
        'orientation': {'type': 'orientation', 'frame': 'link_2', 'axes': 'z'},
    }
    goals = {'position': np.array([[0.9, 0.4, 0.0]]), 'orientation': _about_z(0.5)}
    levels = [['position'], ['orientation']]
    return _case('planar', 'Planar 3R, 2 levels', without_limits(arm), tasks, levels, goals, count)


def panda_case(count: int, kind: str) -> Case:
    """Panda, three levels; ``kind`` says which limits and obstacles there are."""
    titles = {
        'free': 'Panda, 3 levels',
        'limits': 'Panda, 3 levels, velocity and range limits',
        'moving': 'Panda, 3 levels, velocity, range and acceleration limits, along a path',
        'spheres': 'Panda, 3 levels, limits and three spheres',
        'table': 'Panda, 3 levels, limits, whole arm clear of table, pillar, ball and itself',
    }
    arm = panda(SPHERES if kind == 'table' else None)
    robot = urdf_robot(arm.urdf, arm.joints)
    more: dict[str, Any] = {}
    limits: dict[str, Any] = {'velocity': PANDA_VELOCITY, 'ranges': True}
    states = None
    if kind == 'free':
        arm, limits = without_limits(arm), {}
    if kind == 'spheres':
        more = {'world': POINTS, 'tip': {'frame': HAND, 'radius': TIP}}
        more['world_pairs'] = [(HAND, shape['name']) for shape in POINTS]
        states = random_states(robot, count, lambda: tip_is_clear(robot))
    if kind == 'table':
        more = {'world': ROOM, 'pairs': LINK_PAIRS, 'rows': ROWS}
        more['world_pairs'] = [(link, shape['name']) for link in SPHERES for shape in ROOM]
        states = random_states(robot, count, lambda: arm_is_clear(robot))
    if more:
        limits['obstacles'] = True
    goals, velocities = hand_goal(robot), np.zeros((1, robot.n))
    if kind == 'moving':
        limits['acceleration'] = PANDA_ACCELERATION
        states, velocities = path(robot, count)
        lead, _ = path(robot, count, 1.0 / GAIN)
        poses = [pose_of(robot, q, HAND) for q in lead]
        goals = {
            'position': np.array([pose[0] for pose in poses]),
            'orientation': np.array([pose[1] for pose in poses]),
            'posture': lead,
        }
    levels = [['position'], ['orientation'], ['posture']]
    name = f'panda_{kind}'
    problems = {'step': {'levels': levels} | limits}
    if states is None:
        states = random_states(robot, count)
    return Case(name, titles[kind], arm, hand_tasks(), problems, states, goals, velocities, more)


def body_case(count: int) -> Case:
    """Upper body of two Pandas: hands, an elbow and a posture as six levels."""
    arm = two_pandas()
    robot = urdf_robot(arm.urdf, arm.joints)
    reference = np.tile([0.0, -0.6, 0.0, -2.0, 0.0, 1.6, 0.8], 2)
    tasks: dict[str, dict[str, Any]] = {}
    goals: dict[str, np.ndarray] = {'posture': reference[None]}
    for kind in ('position', 'orientation'):
        for side in ('left', 'right'):
            name = f'{side}_{kind}'
            tasks[name] = {'type': kind, 'frame': f'{side}_{HAND}'}
            pose = pose_of(robot, reference, f'{side}_{HAND}')
            goals[name] = np.array([pose[kind == 'orientation']])
    tasks['elbow'] = {'type': 'position', 'frame': 'left_panda_link4'}
    goals['elbow'] = np.array([pose_of(robot, reference + 0.3, 'left_panda_link4')[0]])
    tasks['posture'] = {'type': 'posture'}
    title = 'Upper body of 14 joints, 6 levels, velocity and range limits'
    limits = {'velocity': PANDA_VELOCITY * 2, 'ranges': True}
    levels = [[name] for name in tasks]
    return _case('body', title, arm, tasks, levels, goals, count, limits)


def all_cases(count: int) -> list[Case]:
    """Every case with as many states."""
    kinds = ('free', 'limits', 'moving', 'spheres', 'table')
    return [
        planar_case(count),
        *(panda_case(count, kind) for kind in kinds),
        body_case(count),
    ]


def hand_tasks() -> dict[str, dict[str, Any]]:
    """Position, orientation and posture of a Panda."""
    return {
        'position': {'type': 'position', 'frame': HAND},
        'orientation': {'type': 'orientation', 'frame': HAND},
        'posture': {'type': 'posture'},
    }


def hand_goal(robot: Robot) -> dict[str, np.ndarray]:
    """One reachable pose of a Panda's hand and a posture."""
    position, turn = pose_of(robot, np.array(PANDA_GOAL), HAND)
    return {
        'position': position[None],
        'orientation': turn[None],
        'posture': np.array([POSTURE]),
    }


def pose_of(robot: Robot, q: np.ndarray, frame: str) -> tuple[np.ndarray, np.ndarray]:
    """Position (3,) [m] and quaternion (4,) x y z w of a frame."""
    robot.update(q)
    found = robot.frame(frame)
    return np.array(found.position), np.array(quaternion_from_rotation(found.rotation))


def shaped_tip(urdf: str, more: Mapping[str, Any]) -> str:
    """URDF with a sphere around the tip, where there is one."""
    tip = more.get('tip')
    if not tip:
        return urdf
    shape = f'<collision><geometry><sphere radius="{tip["radius"]}"/></geometry></collision>'
    name = f'<link name="{tip["frame"]}"'
    before, after = urdf.split(name, 1)
    # the link has nothing inside, or more
    if after.startswith((' />', '/>')):
        return f'{before}{name}>{shape}</link>{after.split(">", 1)[1]}'
    return f'{before}{name}>{shape}{after.split(">", 1)[1]}'


def _case(
    name: str,
    title: str,
    arm: Arm,
    tasks: Mapping[str, Mapping[str, Any]],
    levels: Sequence[Sequence[str]],
    goals: Mapping[str, np.ndarray],
    count: int,
    limits: Mapping[str, Any] | None = None,
) -> Case:
    robot = urdf_robot(arm.urdf, arm.joints)
    problems = {'step': {'levels': levels} | dict(limits or {})}
    states = random_states(robot, count)
    return Case(name, title, arm, tasks, problems, states, goals, np.zeros((1, robot.n)))


def _about_z(angle: float) -> np.ndarray:
    return np.array([[0.0, 0.0, np.sin(angle / 2), np.cos(angle / 2)]])
