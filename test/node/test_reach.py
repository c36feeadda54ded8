"""Goals that are watched until they are reached, or cannot be."""

import signal

import numpy as np
import pytest
from arm_among_circles import FAST, FREE, LEVELS, PATIENT, arm_among_circles
from std_srvs.srv import SetBool

from tp_interfaces.action import Reach
from tp_interfaces.msg import Cause
from tp_sim.harness import ClosedLoop, NodeProcess

PERIOD = 1.0 / 60.0
Result = Reach.Result


@pytest.fixture(scope='module')
def running(config):
    """An arm among three circles."""
    with arm_among_circles(config, idle={'type': 'posture'}) as loop:
        yield loop


@pytest.fixture
def loop(running):
    running.reset()
    running.step(2)
    # Nothing moves for another reason.
    running.send_goal('posture', running.state.position)
    return running


def sets_off(loop):
    """Let the arm move."""
    loop.run(0.4)
    assert np.abs(loop.state.command).max() > 0.1


def rests(loop):
    """Whether the end of the arm is at rest now and stays there."""
    loop.run(0.4)
    place = np.array(loop.client.task('ee_position').current)
    loop.run(0.3)
    return np.abs(loop.client.task('ee_position').current - place).max() < 1e-4


def test_a_goal_that_is_reached_says_so_and_how_far_it_was_on_the_way(loop):
    call = loop.client.start_reach({'ee_position': FREE}, tolerance=1e-3)
    result = loop.finish(call)
    assert result.outcome == Result.REACHED
    assert result.message == f'reached after {result.time:.3g} s'
    assert result.tasks == ['ee_position']
    assert result.error_norms[0] <= 1e-3
    assert loop.client.task('ee_position').desired == pytest.approx(FREE)
    norms = [feedback.error_norms[0] for feedback in call.feedback]
    assert norms == sorted(norms, reverse=True)
    middle = call.feedback[len(norms) // 2]
    left = result.time - middle.time
    assert middle.time_left == pytest.approx(left, rel=0.2, abs=0.3)


def test_an_arm_that_is_there_already_has_reached_its_goal(loop):
    here = list(loop.client.task('ee_position').current)
    result = loop.reach({'ee_position': here})
    assert result.outcome == Result.REACHED
    assert result.time < 0.2


@pytest.mark.parametrize(
    ('goal', 'kind', 'name'),
    [
        ([0.0, 1.0], Cause.SET_BASED_TASK, 'obstacle_1'),
        ([-1.3, 0.3], Cause.SET_BASED_TASK, 'joint_1_range'),
        ([3.0, 0.0], Cause.SINGULARITY, 'ee_position'),
    ],
)
def test_what_a_goal_is_stuck_at_is_named(loop, goal, kind, name):
    result = loop.reach({'ee_position': goal})
    assert result.outcome == Result.STUCK
    assert (result.causes[0].kind, result.causes[0].name) == (kind, name)
    assert name in result.message
    assert f'ee_position is {result.error_norms[0]:.3g} away' in result.message
    # It does not go on to the goal later.
    assert loop.client.task('ee_position').error_norm < 1e-3
    assert rests(loop)


def test_a_joint_at_its_end_and_a_higher_task_are_named(loop):
    result = loop.reach({'ee_position': FREE, 'posture': [0.0, 5.0, 0.0]})
    assert result.outcome == Result.STUCK
    found = {(cause.task, cause.kind, cause.name) for cause in result.causes}
    assert ('posture', Cause.HIGHER_TASK, 'ee_position') in found
    loop.set_parameters({'hierarchy': ['posture']})
    try:
        result = loop.reach({'posture': [0.0, 5.0, 0.0]})
    finally:
        loop.set_parameters({'hierarchy': LEVELS})
    assert result.outcome == Result.STUCK
    assert (result.causes[0].kind, result.causes[0].name) == (Cause.JOINT_RANGE, 'joint_2')
    assert 'held up by the range of joint_2' in result.message


def test_a_time_limit_ends_it_and_the_arm_stays(loop):
    result = loop.reach({'ee_position': FREE}, time_limit=0.2)
    assert result.outcome == Result.TIMED_OUT
    assert 0.2 <= result.time <= 0.2 + 10 * PERIOD
    assert rests(loop)
    assert np.linalg.norm(loop.client.task('ee_position').desired - np.array(FREE)) > 0.05


def test_cancelled_on_the_way_the_arm_brakes_inside_its_limits_and_never_turns_back(loop):
    call = loop.client.start_reach({'ee_position': FREE})
    sets_off(loop)
    loop.clear_record()
    call.cancel()
    result = loop.finish(call)
    assert result.outcome == Result.CANCELLED
    assert result.message.startswith('cancelled after ')
    assert rests(loop)
    speeds = loop.record.qd
    fastest = np.argmax(np.abs(speeds[0]))
    assert (speeds[:, fastest] * np.sign(speeds[0, fastest]) >= -5e-3).all()


@pytest.mark.parametrize('newer', ['reach', 'topic', 'parameter'])
def test_a_newer_target_replaces_it(loop, newer):
    call = loop.client.start_reach({'ee_position': FREE, 'posture': [0.1, 0.5, 0.5]})
    sets_off(loop)
    if newer == 'reach':
        other = loop.client.start_reach({'ee_position': [1.2, 0.5]}, time_limit=0.1)
        assert loop.finish(other).outcome == Result.TIMED_OUT
    elif newer == 'topic':
        loop.send_goal('ee_position', [1.2, 0.5])
    else:
        loop.set_parameters({'tasks.ee_position.target': [1.2, 0.5]})
    result = loop.finish(call)
    assert result.outcome == Result.REPLACED
    assert 'replaced: ' in result.message
    assert 'ee_position' in result.message
    loop.run(1.0)
    # The other task does not go on to its goal, the newer target stays.
    assert loop.client.task('posture').error_norm < 1e-3
    if newer != 'reach':
        assert list(loop.client.task('ee_position').desired) == [1.2, 0.5]


def test_goals_for_other_tasks_go_on_side_by_side(loop):
    loop.set_parameters({'hierarchy': ['posture']})
    loop.set_parameters({'hierarchy': LEVELS})
    posture = loop.client.start_reach({'posture': loop.client.task('posture').current})
    hand = loop.client.start_reach({'ee_position': loop.client.task('ee_position').current})
    assert loop.finish(hand).outcome == Result.REACHED
    assert loop.finish(posture).outcome == Result.REACHED


@pytest.mark.parametrize(
    ('goal', 'options', 'problem'),
    [
        ({'hand': [1.0]}, {}, "goals.task: got 'hand'; accepts one of ee_position, posture, idle"),
        ({'obstacle_1': [1.0, 1.0]}, {}, 'goals.task: got obstacle_1, which is of type obstacle;'),
        ({'idle': [0.0, 0.0, 0.0]}, {}, 'goals.task: got idle, which is not in the hierarchy and'),
        ({'ee_position': [1.0]}, {}, 'ee_position: got 1 value; accepts 2: x [m], y [m]'),
        ({'ee_position': [1.0, np.nan]}, {}, 'ee_position: got [1.0, nan]; accepts finite'),
        (
            {'ee_position': FREE, 'posture': [0.0] * 3},
            {'frame': 'map'},
            "ee_position.header.frame_id: got 'map'; accepts '', base, link_1",
        ),
        ({}, {}, 'goals: got none; accepts one for each task'),
        ({'ee_position': FREE}, {'tolerance': 0.0}, 'tolerance: got 0.0; accepts a finite number'),
        ({'ee_position': FREE}, {'time_limit': -1.0}, 'time_limit: got -1.0; accepts seconds'),
    ],
)
def test_a_goal_that_cannot_be_is_refused_in_one_line_and_changes_nothing(
    loop, goal, options, problem
):
    before = [list(task.desired) for task in loop.state.tasks]
    result = loop.reach(goal, **options)
    assert result.outcome == Result.REFUSED
    assert result.message.startswith(f'refused: {problem}')
    assert '\n' not in result.message
    loop.step(1)
    assert [list(task.desired) for task in loop.state.tasks] == before


def hold(loop, data):
    assert loop.client.call(SetBool, 'tp_controller/hold', SetBool.Request(data=data)).success


def test_a_hold_ends_it_refuses_others_and_nothing_goes_on_afterwards(loop):
    loop.set_parameters({'resume': 'targets'})
    call = loop.client.start_reach({'ee_position': FREE})
    loop.run(0.3)
    hold(loop, True)
    result = loop.finish(call)
    assert result.outcome == Result.INTERRUPTED
    assert result.message.startswith('interrupted: held by ~/hold after ')
    result = loop.reach({'ee_position': FREE})
    assert result.outcome == Result.REFUSED
    assert 'held by ~/hold' in result.message
    loop.run(0.4)
    hold(loop, False)
    loop.set_parameters({'resume': 'present'})
    assert rests(loop)


def test_a_task_that_leaves_the_hierarchy_ends_it(loop):
    call = loop.client.start_reach({'ee_position': FREE})
    loop.step(5)
    loop.set_parameters({'hierarchy': ['posture']})
    result = loop.finish(call)
    loop.set_parameters({'hierarchy': LEVELS})
    assert result.outcome == Result.INTERRUPTED
    assert result.message.startswith('interrupted: ee_position left the hierarchy')


def test_without_joint_states_it_waits_and_then_says_so(lone_controller):
    controller = lone_controller()
    controller.ask([0.0, 0.6, 0.3])
    call = controller.client.start_reach({'ee_position': [1.0, -0.5]})
    result = call.wait()
    assert result.outcome == Result.INTERRUPTED
    assert result.message.startswith('interrupted: no joint state for 3 s')
    assert call.feedback[-1].held_up_by == 'no joint states come'


# The command for people; joint states have to come by themselves.


@pytest.fixture(scope='module')
def real(config):
    changes = {'/**': FAST, 'tp_controller': PATIENT | {'tasks': {'ee_position': {'gain': [4.0]}}}}
    with ClosedLoop(config / 'b3_pressed.yaml', changes, lockstep=False) as loop:
        yield loop


def send_goal(loop, *arguments):
    return NodeProcess('tp_controller', 'send_goal', None, loop.environment, arguments=arguments)


def ended(real, *processes):
    """Status and last line of each."""
    real.client.wait_for(lambda: not any(process.running for process in processes), 'send_goal')
    return [(process.wait(), process.output.splitlines()[-1]) for process in processes]


def test_the_command_waits_and_its_status_tells(real):
    reached = send_goal(real, 'ee_position', '1.1', '0.8', '--wait', '--tolerance', '0.1')
    others = [
        send_goal(real, 'ee_position', '1', '--wait'),
        send_goal(real, 'ee_position', '1', '1', '--tolerance', '0.1'),
        send_goal(real, 'ee_position', '1', '1', '--wait', '--controller', 'no'),
    ]
    ends = ended(real, reached, *others)
    assert [status for status, _ in ends] == [0, 2, 2, 3]
    assert ends[0][1].startswith('ee_position: reached after ')
    assert ends[1][1].startswith('send_goal: refused: ee_position: got 1 value; accepts 2')
    assert '--tolerance and --time-limit count with --wait' in ends[2][1]
    assert ends[3][1] == 'send_goal: no controller takes goals on /no/reach (waited 5 s)'
    late = send_goal(real, 'ee_position', '0', '1', '--wait', '--time-limit', '0.3')
    status, answer = ended(real, late)[0]
    assert status == 1
    assert answer.startswith('ee_position: timed out after 0.3')


def test_ctrl_c_cancels_and_the_arm_stays(real):
    # On a busy machine the signal comes late: a slow arm is still on its way by then.
    real.set_parameters({'tasks.ee_position.gain': [0.05]})
    process = send_goal(real, 'ee_position', '0', '1', '--wait')
    real.client.wait_for(lambda: ' away' in process.output, 'progress', 20.0)
    process.signal(signal.SIGINT)
    real.client.wait_for(lambda: not process.running, 'send_goal')
    assert process.wait() == 1
    assert process.output.splitlines()[-1].startswith('ee_position: cancelled after ')
