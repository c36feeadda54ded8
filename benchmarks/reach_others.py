"""The goals of benchmarks/reach.py for OInK, PlaCo and Pink, each in a process of its own.

Each library has the same arm, levels, gain, ranges and speeds, and no shapes. It gets the
configuration at the rate of the arm's file and its velocity is carried out exactly, inside ranges
and speeds. Weights are 1 and 0.1 for position and orientation, so that a goal of both has no
lasting error, and 1e-6 for the posture; OInK has strict levels.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from draws import draw
from field.processes import LIBRARIES, Library, NotInstalled, Side
from field.robots import Arm, bare
from field.serving import CannotDo

from tp_controller.config import build_settings, read_parameter_file
from tp_controller.robot import Robot, read_description, urdf_robot
from tp_controller.rotations import quaternion_from_rotation

CONFIG = Path(__file__).resolve().parent.parent / 'config'
OUT = Path(__file__).resolve().parent.parent / 'out' / 'reach'
OTHERS = tuple(one for one in LIBRARIES if one.label in ('OInK', 'PlaCo', 'Pink'))
LEVELS = {
    'position': [['position']],
    'position, orientation': [['position'], ['orientation']],
    'pose': [['position', 'orientation']],
}
FAINT = 6
"""Level of the posture for libraries with weights: a tenth of the weight for each level."""
CHUNK = 10


def reached(
    library: Library, arm: str, count: int, seconds: float, close: np.ndarray
) -> dict[str, float | str]:
    """Share [%] of goals that a library reaches, by levels; else why it cannot.

    Parameters
    ----------
    library
        The library.
    arm
        Name of the arm's file.
    count
        Number of draws.
    seconds
        Time [s] that each has.
    close
        Largest distance [m] and angle [rad] of a goal that is reached.
    """
    scenario, robot, frame, goals = write(library, arm, count, seconds)
    found: dict[str, float | str] = {}
    try:
        side = Side(library, scenario)
    except NotInstalled as error:
        return dict.fromkeys(LEVELS, f'not installed: {error}')
    try:
        for levels, names in LEVELS.items():
            hits = 0
            for first in range(0, count, CHUNK):
                last = min(first + CHUNK, count)
                answer = side.ask('pursuit', levels, first, last)
                if answer['failed']:
                    print(f'{library.label}, {arm}, {levels}: {answer}', flush=True)
                for q, goal in zip(answer['ends'], goals[first:last], strict=True):
                    errors = errors_at(robot, frame, q, goal)
                    size = sum(map(len, names))
                    hits += bool(np.all(errors[:size] <= close[:size]))
            found[levels] = 100.0 * hits / count
    except CannotDo as error:
        return dict.fromkeys(LEVELS, str(error))
    finally:
        side.stop()
    return found


def errors_at(robot: Robot, frame: str, q: Sequence[float], goal: np.ndarray) -> np.ndarray:
    """Distance [m] and angle [rad] of a frame at q (n,) from where it is at another one."""
    robot.update(np.array(q))
    place, turn = robot.frame(frame).position.copy(), robot.frame(frame).rotation.copy()
    robot.update(goal)
    rotation = robot.frame(frame).rotation
    cosine = 0.5 * (np.trace(turn.T @ rotation) - 1.0)
    apart = float(np.linalg.norm(turn - rotation))
    # For small angles the Frobenius norm is exact where the cosine is not.
    angle = np.arccos(np.clip(cosine, -1.0, 1.0)) if apart > 0.1 else apart / np.sqrt(2.0)
    return np.array([np.linalg.norm(place - robot.frame(frame).position), angle])


def write(
    library: Library, arm: str, count: int, seconds: float
) -> tuple[Path, Robot, str, np.ndarray]:
    """Write what a library reads; its path, the robot, the frame of the goals, and the goals."""
    values = read_parameter_file(CONFIG / f'{arm}.yaml', 'tp_controller')
    stack = build_settings(values).stack
    own, limits = stack.robot, stack.robot.limits
    position, *_, posture = (stack.tasks[name] for name in stack.hierarchy)
    starts, goals = draw(own, count)
    ends = zip(limits.position_min, limits.position_max, limits.velocity, strict=True)
    text = read_description(values['robot.urdf'])
    plain: Arm = bare(text, dict(zip(own.joints, map(tuple, ends), strict=True)))
    robot = urdf_robot(plain.urdf, plain.joints)
    places, turns = [], []
    for q in goals:
        robot.update(q)
        frame = robot.frame(position.frame_name)
        places.append(frame.position.copy())
        turns.append(quaternion_from_rotation(frame.rotation))
    rate = read_parameter_file(CONFIG / f'{arm}.yaml', 'tp_sim')['rate']
    folder = OUT / f'{arm}-{library.label}'
    (folder / 'world').mkdir(parents=True, exist_ok=True)
    (folder / 'robot.urdf').write_text(plain.urdf, encoding='utf-8')
    np.savez(
        folder / 'arrays.npz',
        states=starts,
        velocities=np.zeros((1, own.n)),
        goal_position=np.array(places),
        goal_orientation=np.array(turns),
        goal_posture=np.repeat(posture.target[None], count, axis=0),
    )
    frames = {'position': 'position', 'orientation': 'orientation'}
    tasks: dict[str, Mapping[str, Any]] = {
        name: {'type': kind, 'frame': position.frame_name} for name, kind in frames.items()
    }
    fill = 0 if library.strict else FAINT
    problems = {
        name: {
            'levels': [*levels, *([[]] * (fill - len(levels))), ['posture']],
            'ranges': True,
            'velocity': limits.velocity.tolist(),
        }
        for name, levels in LEVELS.items()
    }
    wide = 1e9
    scenario = {
        'urdf': str(folder / 'robot.urdf'),
        'arrays': str(folder / 'arrays.npz'),
        'joints': list(plain.joints),
        'period': 1.0 / rate,
        'gain': float(position.settings[2][0, 0]),
        'tasks': tasks | {'posture': {'type': 'posture'}},
        'problems': problems,
        'pursuit': {
            'steps': round(seconds * rate),
            'low': np.maximum(limits.position_min, -wide).tolist(),
            'high': np.minimum(limits.position_max, wide).tolist(),
            'velocity': limits.velocity.tolist(),
        },
    }
    path = folder / 'scenario.json'
    path.write_text(json.dumps(scenario), encoding='utf-8')
    return path, robot, position.frame_name, goals
