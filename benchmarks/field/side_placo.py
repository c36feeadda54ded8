"""PlaCo's side: one quadratic program with weights.

PlaCo's tasks have no gain: a step goes all the way to the target. Each therefore gets the target
that one step at the gain of the others leads to, which is computed outside of the timed step.
"""

from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import placo
from serving import LOWER, CannotDo, Server, axes_of


class Placo:
    """Robot, solver and tasks."""

    def __init__(self, scenario: dict[str, Any], _: str, problem: dict[str, Any]) -> None:
        if problem.get('acceleration'):
            raise CannotDo('no acceleration limit')
        obstacles = bool(problem.get('obstacles'))
        folder = scenario['world_folder'] if obstacles else str(Path(scenario['urdf']).parent)
        flags = placo.Flags.collision_as_visual if obstacles else placo.Flags.ignore_collisions
        robot = placo.RobotWrapper(folder, flags)
        if obstacles:
            robot.load_collision_pairs(str(Path(folder) / 'pairs.json'))
        self._robot = robot
        self._joints = list(scenario['joints'])
        if list(robot.joint_names()) != self._joints:
            raise ValueError(f'the order of the joints is {list(robot.joint_names())}')
        self._period = scenario['period']
        self._share = scenario['gain'] * self._period
        self._solver = placo.KinematicsSolver(robot)
        self._solver.mask_fbase(True)
        self._solver.dt = self._period
        self._solver.enable_joint_limits(bool(problem.get('ranges')))
        self._solver.enable_velocity_limits(bool(problem.get('velocity')))
        for joint, fastest in zip(self._joints, problem.get('velocity') or [], strict=False):
            robot.set_velocity_limit(joint, fastest)
        if obstacles:
            constraint = self._solver.add_avoid_self_collisions_constraint()
            constraint.configure('clearance', 'hard', 1.0)
            constraint.self_collisions_margin = 0.0
            constraint.self_collisions_trigger = 0.25
        self._frames: dict[str, str] = {}
        self._tasks = {}
        for level, names in enumerate(problem['levels']):
            for name in names:
                self._tasks[name] = self._task(scenario, name)
                self._tasks[name].configure(name, 'soft', LOWER**level)

    def _task(self, scenario: dict[str, Any], name: str) -> Any:
        described = scenario['tasks'][name]
        self._frames[name] = described.get('frame', '')
        if described['type'] == 'posture':
            return self._solver.add_joints_task()
        if described['type'] == 'position':
            task = self._solver.add_position_task(described['frame'], np.zeros(3))
        else:
            task = self._solver.add_orientation_task(described['frame'], np.eye(3))
        axes = axes_of(scenario, name)
        if axes != 'xyz':
            task.mask.set_axises(axes, 'task')
        return task

    def _place(self, q: Any) -> None:
        # The floating base, which every robot of PlaCo has, stays where it is.
        self._robot.state.q = np.concatenate([[0, 0, 0, 0, 0, 0, 1.0], q])

    def aim(self, goals: dict[str, Any], q: Any) -> None:
        self._place(q)
        self._robot.update_kinematics()
        for name, goal in goals.items():
            task = self._tasks[name]
            if not self._frames[name]:
                ends = q + self._share * (goal - q)
                task.set_joints(dict(zip(self._joints, map(float, ends), strict=True)))
                continue
            pose = self._robot.get_T_world_frame(self._frames[name])
            if len(goal) == 3:
                task.target_world = pose[:3, 3] + self._share * (goal - pose[:3, 3])
            else:
                there = pin.XYZQUATToSE3(np.array([0, 0, 0, *goal], float)).rotation
                turn = pin.log3(there @ pose[:3, :3].T)
                task.R_world_frame = pin.exp3(self._share * turn) @ pose[:3, :3]

    def begin(self, qd: Any) -> None:
        """Nothing here depends on the last velocity."""

    def step(self, q: Any) -> Any:
        self._place(q)
        self._robot.update_kinematics()
        return self._solver.solve(False)[6:] / self._period


if __name__ == '__main__':
    Server(Placo).run()
