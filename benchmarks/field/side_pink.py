"""Pink's side: one quadratic program with weights, solved by DAQP.

Set up for speed: the configuration works on its data without a copy, and a frame that has a
position and an orientation has one task for both.
"""

from pathlib import Path
from typing import Any

import numpy as np
import pink
import pinocchio as pin
from pink.barriers import BodySphericalBarrier, SelfCollisionBarrier
from pink.limits import AccelerationLimit, ConfigurationLimit, VelocityLimit
from serving import Server, cost_of, hands, posture_of

BARRIER = {'gain': 100.0, 'safe_displacement_gain': 0.0}
"""Approach rate [1/s] and no pull towards standstill, which would slow all tasks."""


class Pink:
    """Configuration, tasks, limits and barriers."""

    def __init__(self, scenario: dict[str, Any], _: str, problem: dict[str, Any]) -> None:
        text = Path(scenario['urdf']).read_text(encoding='utf-8')
        model = pin.buildModelFromXML(text)
        if list(model.names)[1:] != scenario['joints']:
            raise ValueError(f'the order of the joints is {list(model.names)[1:]}')
        self._period = scenario['period']
        gain = scenario['gain'] * self._period
        self._barriers: list[Any] = []
        shapes = None
        if problem.get('obstacles') and scenario.get('tip'):
            self._keep_tip_clear(model, scenario)
        elif problem.get('obstacles'):
            shapes = whole_arm(model, text, scenario)
            self._barriers = [SelfCollisionBarrier(scenario['rows'], d_min=0.0, **BARRIER)]
        self._configuration = pink.Configuration(
            model, model.createData(), pin.neutral(model), copy_data=False, collision_model=shapes
        )
        self._limits: list[Any] = []
        if problem.get('ranges'):
            self._limits.append(ConfigurationLimit(model, config_limit_gain=1.0))
        if problem.get('velocity'):
            model.velocityLimit = np.array(problem['velocity'])
            self._limits.append(VelocityLimit(model))
        self._acceleration = None
        if problem.get('acceleration'):
            self._acceleration = AccelerationLimit(model, np.array(problem['acceleration']))
            self._limits.append(self._acceleration)
        self._hands = [
            (
                pink.FrameTask(
                    hand.frame,
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
            task = pink.PostureTask(cost=cost_of(self._posture[0]), gain=gain)
            self._tasks.append(task)

    def _keep_tip_clear(self, model: Any, scenario: dict[str, Any]) -> None:
        tip = scenario['tip']
        for shape in scenario['world']:
            pose = pin.SE3(np.eye(3), np.array(shape['center']))
            model.addFrame(pin.Frame(shape['name'], 0, 0, pose, pin.FrameType.OP_FRAME))
            self._barriers.append(
                BodySphericalBarrier(
                    (tip['frame'], shape['name']), shape['radius'] + tip['radius'], **BARRIER
                )
            )

    def aim(self, goals: dict[str, Any], q: Any) -> None:
        self._configuration.update(q)
        for task, names in self._hands:
            # What a frame has no task for stays as it is.
            pose = self._configuration.get_transform_frame_to_world(task.frame)
            if 'position' in names:
                pose.translation = goals[names['position']]
            if 'orientation' in names:
                turn = np.array([0.0, 0.0, 0.0, *goals[names['orientation']]])
                pose.rotation = pin.XYZQUATToSE3(turn).rotation
            task.set_target(pose)
        if self._posture:
            self._tasks[-1].set_target(np.array(goals[self._posture[1]]))

    def begin(self, qd: Any) -> None:
        if self._acceleration is not None:
            self._acceleration.set_last_integration(qd, self._period)

    def step(self, q: Any) -> Any:
        self._configuration.update(q)
        return pink.solve_ik(
            self._configuration,
            self._tasks,
            self._period,
            solver='daqp',
            limits=self._limits,
            barriers=self._barriers,
            safety_break=False,
        )


def whole_arm(model: Any, text: str, scenario: dict[str, Any]) -> Any:
    """Shapes of the arm and its surroundings, with the pairs that are to stay apart."""
    shapes = pin.buildGeomFromUrdfString(model, text, pin.GeometryType.COLLISION)
    links: dict[str, list[int]] = {}
    for i, shape in enumerate(shapes.geometryObjects):
        links.setdefault(model.frames[shape.parentFrame].name, []).append(i)
    import coal

    for shape in scenario['world']:
        form = coal.Sphere(shape['radius']) if 'radius' in shape else coal.Box(*shape['size'])
        pose = pin.SE3(np.eye(3), np.array(shape['center']))
        links[shape['name']] = [
            shapes.addGeometryObject(pin.GeometryObject(shape['name'], 0, 0, pose, form))
        ]
    for first, second in scenario['pairs'] + scenario['world_pairs']:
        for i in links[first]:
            for j in links[second]:
                shapes.addCollisionPair(pin.CollisionPair(i, j))
    return shapes


if __name__ == '__main__':
    Server(Pink).run()
