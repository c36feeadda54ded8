"""The command that shows a running controller in the terminal."""

import re

import pytest
from rich.console import Console

from tp_controller import state_words
from tp_controller.ros.diagnostics import STATUS
from tp_controller.ros.watch_table import STYLES, Sight, render
from tp_interfaces.msg import ControllerState, LevelState, TaskState
from tp_sim.harness import ClosedLoop, NodeProcess


def shown(state, width=100, rate=200.0, silence=''):
    console = Console(width=width, force_terminal=False)
    with console.capture() as capture:
        console.print(render(Sight('/arm/tp_controller/state', state, rate, silence)))
    lines = capture.get().splitlines()
    assert max(map(len, lines)) <= width
    return [line.rstrip() for line in lines]


def some_state():
    pillar = TaskState(
        name='pillar', level=0, active=True, distance=[0.2, 0.01], components=['elbow', 'hand']
    )
    hand = TaskState(
        name='hand', level=1, error_norm=0.3, requested_velocity=[0.6, 0.8], active=True
    )
    spare = TaskState(name='spare', level=-1, error_norm=1.0)
    level = LevelState(tasks=['hand'], rows=2, rank=1, text='0.4 to pillar')
    return ControllerState(
        status=ControllerState.RUNNING,
        scale=0.5,
        tasks=[spare, hand, pillar],
        levels=[level],
        active_limits=['joint_2 velocity'],
        message='old states; goal rejected',
    )


def test_levels_are_in_order_with_who_blocks_whom_and_what_limits():
    lines = shown(some_state())
    assert lines[0] == '/arm/tp_controller  RUNNING'
    assert '200 commands/s' in lines[1]
    assert 'scale 0.50' in lines[1]
    rows = {line.split()[1]: line for line in lines if line.split()[:1] in (['0'], ['1'], ['–'])}
    assert list(rows) == ['pillar', 'hand', 'spare']
    assert rows['pillar'].endswith('–    0.0100  0.0000  0.0000  acts, near hand')
    assert rows['hand'].endswith('1 of 2 directions free; loses 0.4 to pillar')
    assert rows['hand'].split()[2:6] == ['0.3000', '–', '1.0000', '0.0000']
    assert rows['spare'].endswith('idle')
    assert 'limits met  joint_2 velocity' in lines
    assert [line.split()[-2:] for line in lines[-2:]] == [['old', 'states'], ['goal', 'rejected']]


@pytest.mark.parametrize('width', [60, 80, 120])
def test_nothing_is_cut_off_at_any_width(width):
    text = ''.join(''.join(shown(some_state(), width)).split())
    assert '1of2directionsfree' in text or width < 80
    assert 'rejected' in text


def test_every_status_has_a_name_here_and_in_diagnostics(repository):
    text = (repository / 'tp_interfaces/msg/ControllerState.msg').read_text(encoding='utf-8')
    statuses = {int(value) for value in re.findall(r'^uint8 [A-Z]+ *= *(\d+)', text, re.MULTILINE)}
    assert len(statuses) == 5
    assert set(state_words.STATUS) == set(STYLES) == set(STATUS) == statuses
    assert state_words.STATUS[state_words.RUNNING] == 'RUNNING'


def test_braking_is_told_beside_the_status_while_joint_states_are_answered():
    state = some_state()
    state.braking = True
    assert shown(state)[0] == '/arm/tp_controller  RUNNING  braking, tasks do not count'
    state.status = ControllerState.HELD
    assert shown(state)[0] == '/arm/tp_controller  HELD'


def test_silence_is_told_above_the_last_state():
    assert shown(None, silence='nothing publishes it') == ['nothing publishes it']
    lines = shown(some_state(), silence='no state for 3 s')
    assert lines[:3] == ['no state for 3 s', 'the last state was:', '/arm/tp_controller  RUNNING']


def once(loop, *arguments, ros_arguments=()):
    environment = loop.environment | {'COLUMNS': '100'}
    process = NodeProcess(
        'tp_controller', 'watch', None, environment, ros_arguments, ['--once', *arguments]
    )
    loop.client.wait_for(lambda: not process.running, 'watch')
    return process.wait(), process.output


def test_once_prints_one_table_in_a_namespace_and_says_where_controllers_are(config):
    with ClosedLoop(config / 'a4_position_joint.yaml', namespace='/arm', lockstep=False) as loop:
        loop.client.wait_for(lambda: loop.state and loop.state.cycles, 'a command')
        status, output = once(loop, ros_arguments=['-r', '__ns:=/arm'])
        assert status == 0, output
        assert output.startswith('/arm/tp_controller  RUNNING')
        assert 'ee_position' in output
        status, output = once(loop, '--timeout', '1.5')
    assert status == 1
    assert output.strip() == (
        'watch: no state for 2 s: nothing publishes /tp_controller/state; there is '
        '/arm/tp_controller (--controller NAME)'
    )
