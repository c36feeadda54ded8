"""The command with which people send goals."""

import numpy as np
import pytest
from spare_tasks import SPARE_TASKS
from std_srvs.srv import SetBool

from tp_sim.harness import ClosedLoop, NodeProcess


@pytest.fixture(scope='module')
def loop(config):
    with ClosedLoop(config / 'a3_position_orientation.yaml', SPARE_TASKS) as loop:
        yield loop


def send_goal(loop, *arguments):
    """Exit status and output of the command."""
    process = NodeProcess(
        'tp_controller', 'send_goal', None, loop.environment, arguments=arguments
    )
    loop.client.wait_for(lambda: not process.running, 'send_goal')
    return process.wait(), process.output.strip()


@pytest.mark.parametrize(
    ('arguments', 'desired'),
    [
        (['ee_position', '1.2', '-0.5'], [1.2, -0.5]),
        (['ee_orientation', '-1.5'], [-1.5]),
        (['ee_position', '-.4', '-1e-1'], [-0.4, -0.1]),
        (['hand_pose', '0.2', '1.2', '2.4'], [0.2, 1.2, 2.4]),
        (['hand_rotation', '0', '0', '2.0', '0'], [0.0, 0.0, 1.0, 0.0]),
        (['elbow', '0.3', '-0.4'], [0.3, -0.4]),
        (['ee_orientation', '0.1', '--frame', 'link_2'], [0.7]),
    ],
)
def test_a_goal_for_every_task_type_is_accepted_with_an_answer(loop, arguments, desired):
    status, output = send_goal(loop, *arguments)
    assert status == 0, output
    assert output.startswith(f'{arguments[0]}: accepted, desired ')
    assert np.abs(loop.client.task(arguments[0]).desired) == pytest.approx(np.abs(desired))
    idle = not loop.client.task(arguments[0]).enabled
    assert ('idle' in output) == idle


@pytest.mark.parametrize(
    ('arguments', 'answer'),
    [
        (
            ['hand', '1.0', '0.5'],
            "task: got 'hand'; accepts one of ee_position, ee_orientation, hand_pose",
        ),
        (['ee_position', '1.0'], 'ee_position: got 1 value; accepts 2: x [m], y [m]'),
        (['elbow', '1.0'], 'elbow: got 1 value; accepts 2: joint_2'),
        (['hand_rotation', '1.0'], 'accepts 4: quaternion x, quaternion y'),
        (['ee_position', '1.0', 'nan'], 'ee_position: got [1.0, nan]; accepts finite numbers'),
        (
            ['ee_position', '1.0', '0.5', '--frame', 'map'],
            "ee_position: goal rejected: header.frame_id: got 'map'; accepts '', base, link_1",
        ),
        (['hand_rotation', '0', '0', '0', '0'], 'quaternion'),
    ],
)
def test_a_goal_that_cannot_be_is_refused_in_one_line(loop, arguments, answer):
    before = [list(task.desired) for task in loop.state.tasks]
    status, output = send_goal(loop, *arguments)
    assert status == 2
    assert output.startswith('send_goal: ')
    assert answer in output
    assert len(output.splitlines()) == 1
    assert [list(task.desired) for task in loop.state.tasks] == before


def test_without_a_controller_it_says_so(loop):
    status, output = send_goal(
        loop, 'ee_position', '1', '1', '--controller', 'nobody', '--timeout', '0.5'
    )
    assert status == 3
    assert output == 'send_goal: no controller speaks on /nobody/state (waited 0.5 s)'


def test_a_name_that_no_node_can_have_is_refused(loop):
    status, output = send_goal(loop, 'ee_position', '1', '1', '--controller', 'bad name')
    assert status == 2
    assert 'bad name' in output
    assert 'Traceback' not in output


def test_words_for_numbers_are_refused(loop):
    status, output = send_goal(loop, 'ee_position', 'left', '1')
    assert status == 2
    assert "invalid float value: 'left'" in output


def test_a_goal_for_an_arm_that_is_held_is_accepted_and_that_is_said(loop):
    for held in (True, False):
        request = SetBool.Request(data=held)
        assert loop.client.call(SetBool, 'tp_controller/hold', request).success
        loop.step(1)
        status, output = send_goal(loop, 'ee_position', '1.1', '0.2')
        assert status == 0, output
        note = ' (held: it counts once ~/hold is called with false)' if held else ''
        assert output == f'ee_position: accepted, desired 1.1 0.2{note}'
