"""mink's side, on MuJoCo: one quadratic program with weights, solved by DAQP.

A frame that has a position and an orientation has one task for both.
"""

from pathlib import Path
from typing import Any

import mink
import mujoco
import numpy as np
from serving import CannotDo, Server, cost_of, hands, posture_of

COMPILER = (
    '<mujoco><compiler fusestatic="false" discardvisual="false" strippath="false" '
    'boundmass="0.001" boundinertia="0.001"/></mujoco>'
)
APPROACH = 100.0
"""Largest speed of approach per distance [1/s]."""
SEEN = 0.25
"""Distance [m] from which on two shapes have a row."""


class Mink:
    """Configuration, tasks and limits."""

    def __init__(self, scenario: dict[str, Any], _: str, problem: dict[str, Any]) -> None:
        if problem.get('acceleration'):
            raise CannotDo('no acceleration limit')
        model, groups = model_of(scenario, bool(problem.get('obstacles')))
        names = [model.joint(i).name for i in range(model.njnt)]
        if names != scenario['joints']:
            raise ValueError(f'the order of the joints is {names}')
        self._period = scenario['period']
        gain = scenario['gain'] * self._period
        self._configuration = mink.Configuration(model)
        self._limits: list[Any] = []
        if problem.get('ranges'):
            self._limits.append(mink.ConfigurationLimit(model, gain=1.0))
        if problem.get('velocity'):
            fastest = dict(zip(names, problem['velocity'], strict=True))
            self._limits.append(mink.VelocityLimit(model, fastest))
        if problem.get('obstacles'):
            pairs = scenario['pairs'] + scenario['world_pairs']
            self._limits.append(
                mink.CollisionAvoidanceLimit(
                    model,
                    [(groups[first], groups[second]) for first, second in pairs],
                    # The row bounds a displacement by gain / period times the distance.
                    gain=APPROACH * self._period**2,
                    minimum_distance_from_collisions=0.0,
                    collision_detection_distance=SEEN,
                )
            )
        self._hands = [
            (
                mink.FrameTask(
                    hand.frame,
                    'body',
                    hand.costs(scenario, 'position'),
                    hand.costs(scenario, 'orientation'),
                    gain=gain,
                ),
                hand.names,
            )
            for hand in hands(scenario, problem)
        ]
        self._tasks = [task for task, _ in self._hands]
        self._posture = posture_of(scenario, problem['levels'])
        if self._posture:
            self._tasks.append(mink.PostureTask(model, cost=cost_of(self._posture[0]), gain=gain))

    def aim(self, goals: dict[str, Any], q: Any) -> None:
        self._configuration.update(q)
        for task, names in self._hands:
            # What a frame has no task for stays as it is.
            pose = self._configuration.get_transform_frame_to_world(task.frame_name, 'body')
            turn, position = pose.rotation(), pose.translation()
            if 'position' in names:
                position = goals[names['position']]
            if 'orientation' in names:
                turn = mink.SO3(np.roll(goals[names['orientation']], 1))
            task.set_target(mink.SE3.from_rotation_and_translation(turn, position))
        if self._posture:
            self._tasks[-1].set_target(np.array(goals[self._posture[1]]))

    def begin(self, qd: Any) -> None:
        """Nothing here depends on the last velocity."""

    def step(self, q: Any) -> Any:
        self._configuration.update(q)
        return mink.solve_ik(
            self._configuration, self._tasks, self._period, solver='daqp', limits=self._limits
        )


def model_of(scenario: dict[str, Any], obstacles: bool) -> tuple[Any, dict[str, list[str]]]:
    """MuJoCo's model, and the names of shapes by link and of the surroundings."""
    text = Path(scenario['urdf']).read_text(encoding='utf-8')
    spec = mujoco.MjSpec.from_string(text.replace('</robot>', COMPILER + '</robot>'))
    groups: dict[str, list[str]] = {}
    for body in spec.bodies:
        for i, geom in enumerate(body.geoms):
            geom.name = f'{body.name}_shape_{i}'
            groups.setdefault(body.name, []).append(geom.name)
    if obstacles:
        for shape in scenario['world']:
            groups[shape['name']] = [shape['name']]
            if shape['shape'] == 'sphere':
                kind, size = mujoco.mjtGeom.mjGEOM_SPHERE, [shape['radius'], 0.0, 0.0]
            else:
                kind, size = mujoco.mjtGeom.mjGEOM_BOX, [side / 2 for side in shape['size']]
            spec.worldbody.add_geom(name=shape['name'], type=kind, size=size, pos=shape['center'])
        tip = scenario.get('tip')
        if tip:
            size = [tip['radius'], 0.0, 0.0]
            sphere = mujoco.mjtGeom.mjGEOM_SPHERE
            spec.body(tip['frame']).add_geom(name='tip_shape', type=sphere, size=size)
            groups[tip['frame']] = ['tip_shape']
    return spec.compile(), groups


if __name__ == '__main__':
    Server(Mink).run()
