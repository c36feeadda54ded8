"""Pink's side of the step benchmark; runs in the environment that has Pink, without ours.

Set up for speed: the model has only the controlled joints, as on the other side; the
configuration works on its data without a copy; the gains are those of a step of `PERIOD`, so
that the limits seldom bind. A second variant leaves Pink's limits out of the quadratic program.
"""

from pathlib import Path

import pink
import pinocchio as pin
from step_blocks import load_scenario, serve

PERIOD = 1e-3
"""Time [s] from one command to the next."""


def main() -> None:
    scenario = load_scenario()
    model = pin.buildModelFromXML(Path(scenario['urdf']).read_text(encoding='utf-8'))
    joints = list(model.names)[1:]
    held = [model.getJointId(name) for name in joints if name not in scenario['joints']]
    model = pin.buildReducedModel(model, held, pin.neutral(model))
    if list(model.names)[1:] != scenario['joints']:
        raise ValueError(f'the order of the joints is {list(model.names)[1:]}')
    data = model.createData()
    configuration = pink.Configuration(model, data, scenario['posture'], copy_data=False)
    gain = scenario['gain'] * PERIOD
    hand = pink.FrameTask(scenario['frame'], position_cost=1.0, orientation_cost=1.0, gain=gain)
    hand.set_target(pin.XYZQUATToSE3(scenario['goal']))
    posture = pink.PostureTask(cost=1e-3, gain=gain)
    posture.set_target(scenario['posture'])
    tasks = [hand, posture]

    def step(q):
        configuration.update(q)
        return pink.solve_ik(configuration, tasks, PERIOD, solver='daqp')

    def step_without_limits(q):
        configuration.update(q)
        return pink.solve_ik(configuration, tasks, PERIOD, solver='daqp', limits=[])

    serve({'pink': step, 'pink without limits': step_without_limits}, scenario['path'])


if __name__ == '__main__':
    main()
