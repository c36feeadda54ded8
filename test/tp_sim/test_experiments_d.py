"""Experiment D in lockstep over DDS; its whole table is checked on the library."""

import numpy as np
import pytest

from tp_sim.harness import ClosedLoop


@pytest.mark.parametrize(
    ('arm', 'damping', 'error', 'speed'),
    [('d_rr', 0.0, 0.130167, 3.81), ('d_prr', 0.01, 0.0, 5.64)],
)
def test_the_arms_end_where_they_should(config, arm, damping, error, speed):
    changes = {
        'tp_controller': {'solver': {'damping': damping}, 'tasks': {'hand': {'gain': [10.0]}}}
    }
    with ClosedLoop(config / f'{arm}.yaml', changes) as loop:
        # At this gain the rest of the 10 s changes nothing any more.
        loop.run(3.0)
        record = loop.record
    assert record.error_norm['hand'][-1] == pytest.approx(error, abs=1e-6)
    assert np.linalg.norm(record.qd, axis=1).max() == pytest.approx(speed, rel=5e-3)
