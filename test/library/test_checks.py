"""Checks of parameters before anything moves: each finds its own mistake, and only that."""

import numpy as np
import pytest

from tp_controller import build_settings, read_parameter_file
from tp_controller.checks import NOTE, WARNING, check_parameters, check_settings
from tp_controller.checks.command import main

FINE = {
    'rate': 60.0,
    'robot.joints': ['joint_1', 'joint_2', 'joint_3'],
    'robot.dh.theta': [0.0, 0.0, 0.0],
    'robot.dh.d': [0.0, 0.0, 0.0],
    'robot.dh.a': [0.75, 0.5, 0.5],
    'robot.dh.alpha': [0.0, 0.0, 0.0],
    'robot.dh.types': ['revolute', 'revolute', 'revolute'],
    'robot.limits.velocity': [1.0],
    'hierarchy': ['tip'],
    'tasks.tip.type': 'position',
    'tasks.tip.frame': 'link_3',
    'tasks.tip.axes': 'xy',
    'tasks.tip.target': [1.0, 0.5],
}
RANGES = {'robot.limits.position_min': [-2.0], 'robot.limits.position_max': [2.0]}
HAND_TWICE = {
    'tasks.again.type': 'pose',
    'tasks.again.frame': 'link_3',
    'tasks.again.position_axes': 'xy',
    'tasks.again.orientation_axes': 'z',
}
TIP_AGAIN = {
    'tasks.tip.axes': 'x',
    'tasks.tip.target': [1.0],
    'tasks.tip_again.type': 'position',
    'tasks.tip_again.frame': 'link_3',
    'tasks.tip_again.axes': 'xy',
}
BALL = {
    'tasks.ball.type': 'obstacle',
    'tasks.ball.frame': 'link_3',
    'tasks.ball.axes': 'xy',
    'tasks.ball.center': [1.0, 0.5],
    'tasks.ball.radius': 0.3,
}
BOOM = {'tasks.boom.type': 'joint', 'tasks.boom.joints': ['joint_1']}


def found(changes, start=None):
    values = {key: value for key, value in (FINE | changes).items() if value is not None}
    findings = check_parameters(values, start=start)
    return [str(finding) for finding in findings if finding.severity == WARNING]


@pytest.mark.parametrize(
    ('changes', 'key', 'text'),
    [
        ({'timeouts.joint_state': 0.02}, 'timeouts.joint_state', '1.2 periods'),
        ({'rate': None}, 'rate', 'no value'),
        ({'tasks.tip.gain': [61.0]}, 'tasks.tip.gain', 'overshoots at every step'),
        (
            {'tasks.tip.gain': [40.0], 'robot.limits.acceleration': [5.0]},
            'tasks.tip.gain',
            'K·dt = 0.667',
        ),
        ({'tasks.tip.gain': [4.0], 'robot.delay': [0.2]}, 'tasks.tip.gain', 'accepts up to 1.84'),
        (
            {'tasks.tip.axes': 'xyz', 'tasks.tip.target': None},
            'tasks.tip.axes',
            'no joint moves z of it',
        ),
        ({'tasks.tip.target': [1.8, 0.8]}, 'tasks.tip.target', 'the nearest is 0.22 off'),
        (
            {**HAND_TWICE, 'hierarchy': ['tip', 'again']},
            'tasks.again',
            'x, y is controlled by tip above it',
        ),
        (
            {**HAND_TWICE, 'hierarchy': ['again', 'tip']},
            'hierarchy',
            'tip gets nothing',
        ),
        (
            {**TIP_AGAIN, 'hierarchy': ['tip', 'tip_again']},
            'tasks.tip_again.axes',
            'x is controlled by tip above it: it never gets anything there; accepts y',
        ),
        (
            {**HAND_TWICE, **BOOM, 'hierarchy': ['again', 'boom']},
            'hierarchy',
            'boom gets nothing',
        ),
        (
            {**BALL, 'hierarchy': ['tip', 'ball'], 'tasks.tip.target': None},
            'hierarchy',
            'ball is below or beside tip',
        ),
        (
            {**BALL, 'hierarchy': ['ball', 'tip'], 'tasks.tip.target': [1.0, 0.4]},
            'tasks.tip.target',
            'ball crossed at all',
        ),
        (
            {
                **BALL,
                'hierarchy': ['ball', 'tip'],
                'tasks.tip.target': None,
                'tasks.ball.activation': 0.01,
            },
            'tasks.ball.activation',
            'less than it takes to brake',
        ),
        (
            {**RANGES, **BOOM, 'tasks.boom.target': [2.5]},
            'tasks.boom.target',
            'out of range: joint_1 2.5 (range -2 to 2)',
        ),
        (
            {
                **BOOM,
                'hierarchy': ['tip', 'boom'],
                'tasks.tip.target': [1.7, 0.0],
                'tasks.boom.target': [1.5],
            },
            'hierarchy',
            'targets of tip, boom together',
        ),
    ],
)
def test_every_check_finds_its_mistake_and_nothing_else(changes, key, text):
    lines = found(changes)
    assert len(lines) == 1, lines
    assert lines[0].startswith(f'warning: {key}: ')
    assert text in lines[0]


def test_nothing_is_found_where_nothing_is_wrong():
    assert found({}) == []
    assert found({**BALL, **RANGES, 'hierarchy': ['ball', 'tip'], 'tasks.tip.target': None}) == []


@pytest.mark.parametrize(
    ('changes', 'start', 'text'),
    [
        (RANGES, [2.5, 0.0, 0.0], 'initial_positions: joint_1 starts at 2.5; accepts -2 to 2'),
        (
            BALL | {'hierarchy': ['ball', 'tip'], 'tasks.tip.target': None},
            [0.0, 0.6, 1.5],
            'tasks.ball: these overlap or',
        ),
    ],
)
def test_the_start_is_looked_at(changes, start, text):
    assert found(changes) == []
    (line,) = found(changes, start)
    assert text in line


def test_pairs_that_always_overlap_are_named(config):
    flat = read_parameter_file(config / 'panda_table.yaml', 'tp_controller')
    del flat['tasks.self.ignore']
    flat['hierarchy'] = ['self', 'hand_position']
    flat['robot.capsules.panda_link5'] = [0.0, 0.0, -0.3, 0.0, 0.0, 0.2, 0.3]
    lines = [str(finding) for finding in check_parameters(flat)]
    assert any('tasks.self: these overlap at all 40 random' in line for line in lines)
    assert any('panda_link5 - panda_link7' in line for line in lines)


def test_the_stack_stays_as_it_is(config):
    flat = read_parameter_file(config / 'b3_pressed.yaml', 'tp_controller')
    stacks = [build_settings(flat | {'tasks.ee_position.target': [1.1, -0.6]}) for _ in range(2)]
    list(check_settings(stacks[0], [0.0, 0.8, 0.8]))
    commands = [given.stack.step(np.array([0.0, 0.8, 0.8])).command for given in stacks]
    assert np.array_equal(*commands)


TRUE_WARNINGS = {'d_rr.yaml': 2}
"""Two joints for three rows, and a target that they cannot have: what that experiment is about."""


def test_no_file_has_a_false_alarm(config, capsys):
    for path in sorted(config.glob('*.yaml')):
        status = main([str(path)])
        lines = capsys.readouterr().out.splitlines()
        warnings = [line for line in lines if ': warning: ' in line]
        assert len(warnings) == TRUE_WARNINGS.get(path.name, 0), warnings
        assert status == bool(warnings)
        assert lines[-1].startswith(f'{path}: ')


BAD = """
/**:
  ros__parameters:
    robot:
      joints: [joint_1, joint_2]
      dh: {theta: [0.0, 0.0], d: [0.0, 0.0], a: [1.0, 1.0], alpha: [0.0, 0.0],
           types: [revolute, revolute]}
/**/tp_sim:
  ros__parameters: {initial_positions: [0.0]}
/**/tp_controller:
  ros__parameters:
    solver: {dampin: 0.1, type: recursiv}
    hierarchy: [hand, elbw, twist]
    tasks:
      hand: {type: position, frame: link_4}
      elbow: {type: orientation, frame: link_2, axes: w}
      twist: {type: positon, frame: link_3}
"""


def test_all_errors_are_told_at_once(tmp_path, capsys):
    path = tmp_path / 'bad.yaml'
    path.write_text(BAD, encoding='utf-8')
    assert main([str(path), '--frames']) == 2
    output = capsys.readouterr().out
    for key in (
        'tasks.twist.type: got ',
        'solver.dampin: got an unknown parameter; accepts solver.damping (did you mean that?)',
        'solver.type: got ',
        "hierarchy: got 'elbw'",
        "tasks.hand.frame: got 'link_4'; accepts one of link_1, link_2",
        'tasks.elbow.axes: got ',
        'initial_positions: got [0.0]; accepts 2 finite numbers: joint_1, joint_2',
    ):
        assert f'{path}: error: {key}' in output
    assert output.endswith(f'{path}: 7 errors\n')
    assert 'link_2' in output.partition('Frames')[2]


@pytest.mark.parametrize(
    ('text', 'answer'),
    [
        ('a: [', 'error: file: got '),
        (
            '/**/tp_sim:\n  ros__parameters: {rate: 1.0}\n',
            'no block of that node among /**/tp_sim',
        ),
        ('/**:\n  ros__parameters: {rate: []}\n', 'error: rate: got an empty list'),
    ],
)
def test_a_file_that_is_no_parameter_file_of_the_node_is_refused(tmp_path, capsys, text, answer):
    path = tmp_path / 'bad.yaml'
    path.write_text(text, encoding='utf-8')
    assert main([str(path)]) == 2
    assert answer in capsys.readouterr().out


def test_a_file_without_a_robot_is_checked_with_a_description(config, tmp_path, capsys):
    text = (config / 'panda.yaml').read_text(encoding='utf-8')
    lines = [line for line in text.splitlines() if 'urdf:' not in line]
    path = tmp_path / 'panda.yaml'
    path.write_text('\n'.join(lines), encoding='utf-8')
    assert main([str(path)]) == 1
    assert 'waits for robot_description' in capsys.readouterr().out
    urdf = 'package://example-robot-data/robots/panda_description/urdf/panda.urdf'
    assert main([str(path), '--urdf', urdf]) == 0
    assert 'fine' in capsys.readouterr().out


def test_notes_change_no_status(config, capsys):
    assert main([str(config / 'a1_position.yaml')]) == 0
    assert f'{NOTE}: robot.limits.acceleration: none for joint_1' in capsys.readouterr().out
