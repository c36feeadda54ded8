"""RoboPlan OInK's side: levels by null-space projection, one quadratic program of ProxQP.

A frame task of OInK has six rows, and all six count when lower levels are projected; a cost of
zero leaves out only what it asks for.
"""

import itertools
from pathlib import Path
from typing import Any

import numpy as np
from roboplan import core
from roboplan import optimal_ik as oink
from serving import Server

SEEN = 0.25
"""Distance [m] from which on two shapes are looked at closely."""


class Oink:
    """Scene, solver, tasks and constraints."""

    def __init__(self, scenario: dict[str, Any], _: str, problem: dict[str, Any]) -> None:
        urdf = Path(scenario['urdf'])
        if problem.get('obstacles'):
            urdf = Path(scenario['world_folder']) / 'robot.urdf'
        text = urdf.read_text(encoding='utf-8')
        scene = core.Scene('scene', core.loadUrdfSceneDescriptionFromXml(text))
        if list(scene.getJointNames()) != scenario['joints']:
            raise ValueError(f'the order of the joints is {scene.getJointNames()}')
        self._scene, self._period = scene, scenario['period']
        self._barriers: list[Any] = []
        if problem.get('obstacles'):
            keep_apart(scene, scenario)
        self._solver = oink.Oink(scene)
        if problem.get('obstacles'):
            self._keep_clear(scenario)
        self._constraints: list[Any] = []
        if problem.get('ranges'):
            self._constraints.append(oink.PositionLimit(self._solver, 1.0))
        if problem.get('velocity'):
            fastest = np.array(problem['velocity'])
            self._constraints.append(oink.VelocityLimit(self._solver, self._period, fastest))
        self._acceleration = None
        if problem.get('acceleration'):
            most = np.array(problem['acceleration'])
            self._acceleration = oink.AccelerationLimit(self._solver, self._period, most)
            self._constraints.append(self._acceleration)
        self._tasks: dict[str, Any] = {}
        for level, names in enumerate(problem['levels']):
            self._add_level(scenario, names, level + 1)
        self._list = list(dict.fromkeys(self._tasks.values()))
        self._change = np.zeros(len(scenario['joints']))

    def _add_level(self, scenario: dict[str, Any], names: list[str], priority: int) -> None:
        """Add tasks of one priority; position and orientation of a frame are one task."""
        gain, n = scenario['gain'] * self._period, len(scenario['joints'])
        frames: dict[str, list[str]] = {}
        for name in names:
            frames.setdefault(scenario['tasks'][name].get('frame', ''), []).append(name)
        for frame, members in frames.items():
            if frame:
                kinds = [scenario['tasks'][name]['type'] for name in members]
                pose = core.CartesianConfiguration('', frame, np.eye(4))
                options = oink.FrameTaskOptions(
                    position_cost=float('position' in kinds),
                    orientation_cost=float('orientation' in kinds),
                    task_gain=gain,
                    priority=priority,
                )
                task = oink.FrameTask(self._solver, self._scene, pose, options)
            else:
                options = oink.ConfigurationTaskOptions(task_gain=gain, priority=priority)
                task = oink.ConfigurationTask(self._solver, np.zeros(n), np.ones(n), options)
            self._tasks |= dict.fromkeys(members, task)

    def _keep_clear(self, scenario: dict[str, Any]) -> None:
        rows = len(scenario['world']) if scenario.get('tip') else scenario['rows']
        # Approach rate [1/s] and no pull towards standstill, which would slow all tasks.
        options = oink.SelfCollisionBarrierOptions(
            n_collision_pairs=rows, gain=100.0, safe_displacement_gain=0.0, d_min=0.0, d_max=SEEN
        )
        barrier = oink.SelfCollisionBarrier(self._solver, self._scene, self._period, options)
        self._barriers = [barrier]

    def aim(self, goals: dict[str, Any], q: Any) -> None:
        poses: dict[Any, Any] = {}
        for name, goal in goals.items():
            task = self._tasks[name]
            if isinstance(task, oink.ConfigurationTask):
                task.setTargetConfiguration(np.array(goal))
                continue
            pose = poses.setdefault(task, np.eye(4))
            if len(goal) == 3:
                pose[:3, 3] = goal
            else:
                pose[:3, :3] = rotation_of(goal)
        for task, pose in poses.items():
            task.setTargetFrameTransform(pose)

    def begin(self, qd: Any) -> None:
        if self._acceleration is not None:
            self._acceleration.setLastVelocity(qd)

    def step(self, q: Any) -> Any:
        self._scene.setJointPositions(q)
        self._solver.solveIk(
            self._scene, self._list, self._constraints, self._barriers, self._change
        )
        return self._change / self._period


def keep_apart(scene: Any, scenario: dict[str, Any]) -> None:
    """Let only the pairs of the scenario count."""
    pairs = [tuple(pair) for pair in scenario['pairs'] + scenario['world_pairs']]
    bodies = sorted({name for pair in pairs for name in pair})
    others = [
        (first, second)
        for first, second in itertools.combinations(bodies, 2)
        if (first, second) not in pairs and (second, first) not in pairs
    ]
    scene.setCollisions(others, False)


def rotation_of(quaternion: Any) -> Any:
    """Rotation matrix of a quaternion x y z w."""
    x, y, z, w = quaternion / np.linalg.norm(quaternion)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


if __name__ == '__main__':
    Server(Oink).run()
