"""A pose that an arm cannot have at its speed limits, with a posture below it and without."""

from pathlib import Path

import numpy as np
import pytest

from tp_controller import build_settings, read_parameter_file

CONFIG = Path(__file__).resolve().parents[2] / 'config'
LED_BACK = (203, 279, 453, 474, 881)
"""Draws in which the posture leads an answer back inside the speed limits."""


def stack(scheme, hierarchy):
    values = dict(read_parameter_file(CONFIG / 'panda_pose.yaml', 'tp_controller'))
    del values['robot.limits.acceleration']
    changes = {'solver.type': scheme, 'robot.limits.velocity': [20.0], 'hierarchy': hierarchy}
    return build_settings(values | changes).stack


@pytest.mark.parametrize('scheme', ['recursive', 'hqp'])
def test_a_lower_level_that_leads_back_inside_the_bounds_changes_nothing_above(scheme):
    stacks = [stack(scheme, names) for names in (['hand_pose', 'posture'], ['hand_pose'])]
    limits = stacks[0].robot.limits
    rng = np.random.default_rng(0)
    for i in range(LED_BACK[-1] + 1):
        q, goal = (rng.uniform(limits.position_min, limits.position_max) for _ in range(2))
        gain = 10.0 ** rng.uniform(0.0, 1.0)
        if i not in LED_BACK:
            continue
        achieved = []
        for one in stacks:
            hand = one.tasks['hand_pose']
            one.robot.update(goal)
            hand.hold()
            hand.gain = gain
            one.rest()
            achieved.append(one.step(q).levels[0].achieved)
        np.testing.assert_allclose(*achieved, atol=1e-9)
