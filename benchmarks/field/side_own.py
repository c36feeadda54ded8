"""Our side of the comparison; the variants are the solvers."""

import math
from typing import Any

from serving import Server

from tp_controller.config import build_settings

SOLVER = {'inverse': 'adaptive', 'damping': 0.05, 'singular_region': 0.05}


def parameters_of(
    scenario: dict[str, Any], variant: str, problem: dict[str, Any]
) -> dict[str, Any]:
    """Parameters as in a file, for `tp_controller.config.build_settings`."""
    limits = {}
    for key in ('velocity', 'acceleration'):
        if problem.get(key):
            limits[key] = problem[key]
    gain, tasks = [scenario['gain']], {}
    hierarchy = [' + '.join(names) for names in problem['levels']]
    for names in problem['levels']:
        for name in names:
            tasks[name] = dict(scenario['tasks'][name]) | {'gain': gain}
    obstacles = obstacles_of(scenario) if problem.get('obstacles') else {}
    return {
        'rate': 1.0 / scenario['period'],
        'robot': {'urdf': scenario['urdf'], 'joints': scenario['joints']}
        | ({'limits': limits} if limits else {}),
        'solver': SOLVER | {'type': variant},
        'hierarchy': [*([' + '.join(obstacles)] if obstacles else []), *hierarchy],
        'tasks': obstacles | tasks,
    }


def obstacles_of(scenario: dict[str, Any]) -> dict[str, Any]:
    """Tasks that keep the tip, or the whole arm, clear of the surroundings."""
    tasks: dict[str, Any] = {}
    tip = scenario.get('tip')
    for shape in scenario['world']:
        task = {'type': 'obstacle', 'center': shape['center']}
        if tip:
            task |= {'frame': tip['frame'], 'radius': shape['radius'] + tip['radius']}
        else:
            task |= {'whole_arm': True, 'shape': shape['shape']}
            task |= {key: shape[key] for key in ('radius', 'size') if key in shape}
        tasks[shape['name']] = task
    if not tip:
        pairs = [f'{first} {second}' for first, second in scenario['pairs']]
        tasks['self'] = {'type': 'self_collision', 'pairs': pairs}
    return tasks


class Own:
    """A stack; goals are set where they change."""

    def __init__(self, scenario: dict[str, Any], variant: str, problem: dict[str, Any]) -> None:
        self._stack = build_settings(parameters_of(scenario, variant, problem)).stack
        self._axes = {
            name: ['xyz'.index(axis) for axis in task['axes']]
            for name, task in scenario['tasks'].items()
            if task['type'] == 'position' and 'axes' in task
        }
        self._turns = {name for name, task in scenario['tasks'].items() if task.get('axes') == 'z'}
        self._qd: Any = None
        self._accelerates = bool(problem.get('acceleration'))

    def aim(self, goals: dict[str, Any], q: Any) -> None:
        for name, goal in goals.items():
            target = goal
            if name in self._axes:
                target = goal[self._axes[name]]
            elif name in self._turns:
                # angle about z of the quaternion x y z w
                target = [2.0 * math.atan2(goal[2], goal[3])]
            self._stack.tasks[name].target = target

    def begin(self, qd: Any) -> None:
        if self._accelerates:
            self._stack.rest()
            self._qd = qd

    def step(self, q: Any) -> Any:
        return self._stack.step(q, qd=self._qd).command


if __name__ == '__main__':
    Server(Own).run()
