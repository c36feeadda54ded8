"""A real arm through the real nodes."""

import numpy as np

from tp_sim.demo.script import read_script
from tp_sim.harness import ClosedLoop


def test_the_hand_of_the_panda_reaches_a_pose(config):
    path = config / 'panda_pose.yaml'
    goals = read_script(path).goals[1]
    with ClosedLoop(path, {'tp_sim': {'rate': 100.0}}) as loop:
        for task, values in goals:
            loop.send_goal(task, values)
        loop.run(3.0)
        record = loop.record
    assert max(record.error_norm[task][-1] for task, _ in goals) < 1e-3
    assert record.q.shape[1] == 7
    assert np.all(np.abs(record.qd) <= [2.175] * 4 + [2.61] * 3)
