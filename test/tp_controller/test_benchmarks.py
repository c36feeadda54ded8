"""The stacks of the benchmarks can be built, and step; the benchmarks themselves are too long."""

from pathlib import Path

import numpy as np
import pytest

BENCHMARKS = Path(__file__).resolve().parents[2] / 'benchmarks'


@pytest.fixture(autouse=True)
def benchmarks(monkeypatch):
    monkeypatch.syspath_prepend(str(BENCHMARKS))


def test_the_step_beside_pink():
    import step_own
    import step_time

    scenario = {
        'urdf': step_time.URDF,
        'joints': step_time.JOINTS,
        'frame': step_time.FRAME,
        'goal': np.array([0.4, 0.2, 0.5, 0.0, 0.0, 0.0, 1.0]),
        'posture': np.array(step_time.POSTURE),
        'gain': 1.0,
    }
    assert step_own.stack_of(scenario).step(np.array(step_time.GOAL)).command.any()


@pytest.mark.parametrize(('scheme', 'bounded'), [('recursive', False), ('hqp', True)])
def test_the_cost_of_bounds(scheme, bounded):
    import hqp_time

    side = hqp_time.Side(scheme, bounded)
    side.stack.tasks['place'].target = hqp_time.GOALS[0]
    assert side.stack.step(side.q).command.any()


def test_the_schemes():
    import schemes

    stack = schemes.stack_of('recursive', 'dls')
    assert stack.step(np.array(schemes.POSTURE)).command.any()


@pytest.mark.parametrize('arm', ['panda', 'random'])
def test_what_lower_levels_cost(arm):
    import priority_leak

    found = priority_leak.leaks(arm, 'recursive, dls', 2.0, 1, 0)
    assert max(found) < priority_leak.MOST


def test_goals_out_of_reach(monkeypatch):
    import unreachable

    monkeypatch.setattr(unreachable, 'WATCH', 1.0)
    monkeypatch.setattr(unreachable, 'LATEST', 6.0)
    assert unreachable.chase('planar', 'null_space', 0).passed
