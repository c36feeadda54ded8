"""Experiment D in lockstep over DDS; its whole table is checked on the library."""

import numpy as np
import pytest

from tp_sim.harness import ClosedLoop


def test_the_arm_with_a_sliding_joint_ends_where_it_should(config):
    changes = {'tp_controller': {'solver': {'damping': 0.01}, 'tasks': {'hand': {'gain': [10.0]}}}}
    with ClosedLoop(config / 'd_prr.yaml', changes) as loop:
        # At this gain the rest of the 10 s changes nothing any more.
        loop.run(2.0)
        record = loop.record
    assert record.error_norm['hand'][-1] == pytest.approx(0.0, abs=1e-6)
    assert np.linalg.norm(record.qd, axis=1).max() == pytest.approx(5.64, rel=5e-3)
