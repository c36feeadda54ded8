"""The stacks of the benchmarks can be built, and step; the benchmarks themselves are too long."""

import json
from pathlib import Path

import numpy as np
import pytest

BENCHMARKS = Path(__file__).resolve().parents[2] / 'benchmarks'


@pytest.fixture(autouse=True)
def benchmarks(monkeypatch):
    monkeypatch.syspath_prepend(str(BENCHMARKS))


@pytest.fixture
def field_out(benchmarks, monkeypatch, tmp_path):
    from field import cases

    monkeypatch.setattr(cases, 'OUT', tmp_path)
    # the processes of the comparison find it beside them
    monkeypatch.syspath_prepend(str(BENCHMARKS / 'field'))


def test_cases_of_the_comparison_are_stacks_that_step(field_out):
    from field.cases import panda_case, planar_case
    from side_own import Own

    for case in (planar_case(2), panda_case(2, 'table')):
        scenario = json.loads(case.write().read_text(encoding='utf-8'))
        side = Own(scenario, 'recursive', scenario['problems']['step'])
        q = case.states[0].copy()
        side.aim({name: values[0] for name, values in case.goals.items()}, q)
        side.begin(case.velocities[0])
        assert side.step(q).any(), case.name


def test_both_arms_of_the_upper_body_have_the_limits_of_a_panda(benchmarks):
    from field import robots

    from tp_controller.robot import urdf_robot

    one, two = (urdf_robot(arm.urdf, arm.joints) for arm in (robots.panda(), robots.two_pandas()))
    assert two.limits.position_max.tolist() == one.limits.position_max.tolist() * 2


def test_a_leak_is_a_share_of_the_velocity_alone(benchmarks):
    from field.leak import change

    alone = np.array([0.0, 2.0])
    assert change(alone, [alone, np.array([0.0, 1.0])]) == 0.5
    assert change(np.zeros(2), [np.array([0.005, 0.0])], least=0.01) == 0.5


def test_tasks_of_one_frame_are_together_unless_they_are_to_be_separate(field_out):
    import serving
    from field.cases import hand_tasks

    scenario = {'tasks': hand_tasks()}
    problem = {'levels': [['position'], ['orientation'], ['posture']]}
    (hand,) = serving.hands(scenario, problem)
    assert hand.costs(scenario, 'position').tolist() == [1.0, 1.0, 1.0]
    assert hand.costs(scenario, 'orientation') == pytest.approx([np.sqrt(0.1)] * 3)
    assert len(serving.hands(scenario, problem | {'separate': True})) == 2
    assert serving.posture_of(scenario, problem['levels']) == (2, 'posture')


def test_the_table_of_times_says_why_a_library_has_none(benchmarks):
    from field.report import NONE, time_rows
    from field.timing import Times

    found = dict.fromkeys(('PlaCo', 'Pink', 'mink'), 'no acceleration limit')
    found |= {'recursive': Times(np.full(10, 20.0), 0, ''), 'hqp': Times(np.full(10, 40.0), 0, '')}
    found |= {'OInK': Times(np.full(5, 10.0), 1, 'infeasible')}
    rows, notes = time_rows(found)
    assert rows[2] == ['OInK', '10.0', '10.0', '2.00', '4.00', '20.0 %']
    assert rows[3] == ['PlaCo', *[NONE] * 5]
    assert notes[0] == 'OInK without an answer: infeasible'
    assert notes[1] == 'OInK: timed for 5 of 10 steps.'
    assert notes[2] == 'PlaCo: no acceleration limit.'


def test_a_block_of_a_page_is_replaced_between_its_markers(benchmarks):
    from field.report import markdown, replace_block

    page = 'before\n<!-- a -->\nold\n<!-- end of a -->\nafter\n'
    table = markdown(['x', 'y'], [['1', '2']])
    replaced = replace_block(page, 'a', table)
    assert replaced == page.replace('old', '| x | y |\n| --- | ---: |\n| 1 | 2 |')
    with pytest.raises(ValueError, match='no block'):
        replace_block(page, 'b', '')


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


def test_a_change_of_command_is_judged_from_one_command_to_the_next_whatever_the_time(benchmarks):
    from operations import Record, largest_change

    def record(times, values):
        made = Record([], [], '')
        made.times, made.values = np.array(times), np.array(values)[:, None]
        return made

    true = record([0.0, 0.3], [0.5, 0.0])

    def change(times, values, steps=None):
        numbers = np.ones(len(times) - 1) if steps is None else np.array(steps)
        return largest_change(record(times, values), numbers, true, np.array([0.1]))

    assert change([0.0, 0.002, 0.03, 0.035], [0.5, 0.6, 0.7, 0.6]) == pytest.approx(1.0)
    assert change([0.0, 0.05], [0.5, 0.8]) == pytest.approx(3.0)
    assert change([0.0, 0.05], [0.5, 0.8], [3]) == pytest.approx(1.0)
    for begin, share in ((0.5, 5.0), (0.1, 1.0)):
        assert change([0.0, 0.3, 0.305], [0.5, begin, 0.0]) == pytest.approx(share)
    assert change([0.0, 0.28], [0.5, 0.0]) == 0.0
