"""Robots with tasks of every kind, for tests of the step as values."""

import sys
from pathlib import Path

import numpy as np

from tp_controller import (
    GazeTask,
    JointLimitsTask,
    JointTask,
    ManipulabilityObjective,
    ManipulabilityTask,
    Measures,
    ObstacleTask,
    OrientationTask,
    PoseTask,
    PositionTask,
    PostureTask,
    Robot,
    SelfCollisionTask,
    Switching,
    WholeArmTask,
)

sys.path.append(str(Path(__file__).resolve().parents[2] / 'examples' / 'own_task'))
from own_task.frame_distance import FrameDistanceTask

PERIOD = 0.01
UPRIGHT = [0.1, 0.2, 0.3, 0.9]


def spatial(n=6, acceleration=None, position=2.6):
    """A spatial arm of n joints with capsules along its links."""
    limits = {'velocity': 1.5, 'position_min': -position, 'position_max': position}
    if acceleration is not None:
        limits['acceleration'] = acceleration
    return Robot.from_dh(
        [0.3, 0.4, 0.35, 0.2, 0.25, 0.2, 0.15][:n],
        [1.2, -0.4, 0.7, -1.1, 0.6, 0.3, -0.5][:n],
        [0.2, 0.1, 0.0, 0.15, 0.1, 0.05, 0.1][:n],
        limits=limits,
        link_radius=0.04,
    )


def every_task(robot):
    """One task of every kind, by name."""
    hysteresis = Switching('hysteresis', 0.3, 0.5)
    tasks = [
        PositionTask('tip', robot, 'link_6', target=[0.4, 0.3, 0.5], gain=2.0),
        OrientationTask('turn', robot, 'link_6', target=UPRIGHT),
        OrientationTask('tilt', robot, 'link_5', axes='xy', target=UPRIGHT),
        PoseTask('pose', robot, 'link_6', target=[0.4, 0.1, 0.6, *UPRIGHT]),
        GazeTask('gaze', robot, 'link_6', target=[1.0, 2.0, 0.5]),
        JointTask('elbow', robot, ['joint_2', 'joint_3'], feedforward=[0.1, -0.2]),
        PostureTask('posture', robot),
        ManipulabilityTask('skill', robot, ManipulabilityObjective(robot, 'link_6')),
        FrameDistanceTask('gap', robot, 'link_6', 'link_2'),
        JointLimitsTask('ends', robot, lower=[-2.0], upper=[2.0], period=PERIOD),
        JointLimitsTask(
            'jumpy', robot, lower=[-1.5], upper=[1.5], period=PERIOD, switching=hysteresis
        ),
        ObstacleTask('ball', robot, 'link_6', [0.5, 0.2, 0.4], 0.2, period=PERIOD),
        WholeArmTask(
            'wall', robot, [0.6, 0.0, 0.3], 'sphere', Measures(radius=0.15), period=PERIOD
        ),
        SelfCollisionTask('self', robot, period=PERIOD),
    ]
    return {task.name: task for task in tasks}


HIERARCHIES = (
    ['tip', 'posture'],
    ['ends', 'tip', 'turn', 'posture'],
    ['ends + ball', 'tip + elbow', 'posture'],
    ['jumpy', 'tip', 'turn'],
    ['ball + tip', 'gap', 'ends', 'posture'],
    ['ends', 'wall', 'self', 'pose', 'posture'],
    ['gaze + ball', 'jumpy + elbow', 'tilt'],
)


def near_edges(rng, n=6):
    """A configuration (n,), sometimes near the ends of ranges."""
    q = rng.uniform(-1.9, 1.9, n)
    edge = rng.random(n) < 0.25
    q[edge] = np.sign(q[edge]) * rng.uniform(1.4, 2.55, edge.sum())
    return q
