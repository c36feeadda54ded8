"""Goals that are reached around: looked at ahead, planned beside the cycle, gone by the stack."""

import time
from pathlib import Path

import numpy as np
import pytest
from arm_among_circles import FREE, LEVELS, arm_among_circles
from std_srvs.srv import SetBool
from visualization_msgs.msg import MarkerArray

from tp_interfaces.action import Reach

BEHIND = [0.09, -0.65]
"""The straight way ends at a joint's range and two circles."""
INSIDE = [0.1, 0.97]
"""Inside a circle."""
RANGE = np.array([[-0.5, -2.6, -2.6], [0.5, 2.6, 2.6]])
CIRCLES = {(0.0, 1.0): 0.5, (-0.5, -0.75): 0.4, (0.75, -0.5): 0.275}
Result = Reach.Result


@pytest.fixture(scope='module')
def running(config):
    """An arm among three circles."""
    other = {'type': 'position', 'frame': 'link_3', 'axes': 'xy', 'around': True}
    with arm_among_circles(config, other=other) as loop:
        yield loop


@pytest.fixture
def loop(running):
    running.set_parameters({'hierarchy': LEVELS})
    running.reset()
    running.step(2)
    running.clear_record()
    return running


def start(loop, goal, **more):
    return loop.client.start_reach({'ee_position': goal}, tolerance=1e-3, around=True, **more)


def phases(call):
    """What the feedback said, without repetitions."""
    found = []
    for feedback in call.feedback:
        if not found or found[-1] != feedback.phase:
            found.append(feedback.phase)
    return found


def step_until(loop, condition):
    end = time.monotonic() + 20.0
    while not condition():
        assert time.monotonic() < end
        loop.step(2)


def follows(loop):
    return 'following' in loop.state.message


def check_kept(loop):
    """Ranges, distances, speeds and accelerations of everything that was recorded."""
    record = loop.record
    q = np.array(record.q)
    assert np.all(q >= RANGE[0] - 1e-6)
    assert np.all(q <= RANGE[1] + 1e-6)
    angles = np.cumsum(q, axis=1)
    lengths = np.array([0.75, 0.5, 0.5])
    places = np.stack([np.cos(angles) @ lengths, np.sin(angles) @ lengths], axis=1)
    for center, radius in CIRCLES.items():
        assert np.linalg.norm(places - center, axis=1).min() > radius
    commands = np.array(record.qd)
    assert np.abs(commands).max() <= 3.0 + 1e-6
    assert np.abs(np.diff(commands, axis=0)).max() <= 10.0 / 60.0 + 1e-6


def test_a_goal_that_the_straight_way_leads_to_is_gone_straight(loop):
    call = start(loop, FREE)
    result = loop.finish(call)
    assert result.outcome == Result.REACHED
    assert phases(call) == ['looking ahead', '']
    assert loop.state.tasks[4].name == 'ee_position'
    assert loop.state.tasks[4].enabled


def test_a_goal_behind_is_reached_around_and_nothing_is_broken(loop):
    without = loop.reach({'ee_position': BEHIND}, tolerance=1e-3)
    assert without.outcome == Result.STUCK
    loop.reset()
    loop.step(2)
    loop.clear_record()
    call = start(loop, BEHIND)
    result = loop.finish(call)
    assert result.outcome == Result.REACHED
    assert result.error_norms[0] <= 1e-3
    assert set(phases(call)) >= {'looking ahead', 'following'}
    check_kept(loop)
    assert loop.client.task('ee_position').enabled
    assert loop.client.task('ee_position').desired == pytest.approx(BEHIND)


def test_the_state_and_the_markers_show_the_way(loop):
    arrays = loop.client.collect(MarkerArray, 'tp_controller/markers')
    call = start(loop, BEHIND)
    step_until(loop, lambda: follows(loop))
    assert 'around for ee_position: following' in loop.state.message
    task = loop.client.task('ee_position')
    assert task.level == 4
    assert not task.enabled

    def shown():
        return [m for array in arrays for m in array.markers if m.ns == 'way' and m.points]

    end = time.monotonic() + 10.0
    while not shown() and time.monotonic() < end and call.result is None:
        loop.client.spin_for(0.1)
        loop.step(1)
    way = shown()[-1]
    last = way.points[-1]
    assert [last.x, last.y] == pytest.approx(BEHIND, abs=1e-3)
    assert loop.finish(call).outcome == Result.REACHED


def test_a_goal_without_a_configuration_gets_its_no_and_the_arm_rests(loop):
    place = np.array(loop.client.task('ee_position').current)
    result = loop.finish(start(loop, INSIDE))
    assert result.outcome == Result.STUCK
    assert 'because of obstacle_1' in result.message
    assert 'none found in' in result.message
    loop.run(0.5)
    assert np.abs(loop.client.task('ee_position').current - place).max() < 1e-3


def test_a_new_goal_replaces_one_on_its_way_at_once(loop):
    first = start(loop, BEHIND)
    step_until(loop, lambda: follows(loop))
    second = start(loop, FREE)
    assert loop.finish(first).outcome == Result.REPLACED
    assert loop.finish(second).outcome == Result.REACHED
    check_kept(loop)


def test_a_plain_goal_replaces_one_on_its_way(loop):
    call = start(loop, BEHIND)
    step_until(loop, lambda: follows(loop))
    loop.send_goal('ee_position', FREE)
    assert loop.finish(call).outcome == Result.REPLACED
    loop.run(4.0)
    assert loop.client.task('ee_position').error_norm < 1e-2


@pytest.mark.parametrize('how', ['cancel', 'hold'])
def test_an_arm_on_its_way_comes_to_rest_when_it_is_told(loop, how):
    call = start(loop, BEHIND)
    step_until(loop, lambda: follows(loop))
    loop.step(20)
    if how == 'cancel':
        call.cancel()
        assert loop.finish(call).outcome == Result.CANCELLED
    else:
        hold = SetBool.Request(data=True)
        loop.client.call(SetBool, 'tp_controller/hold', hold)
        assert loop.finish(call).outcome == Result.INTERRUPTED
        loop.run(0.5)
        loop.client.call(SetBool, 'tp_controller/hold', SetBool.Request(data=False))
    # The posture below may still move what the hand leaves free.
    loop.run(0.7)
    place = np.array(loop.client.task('ee_position').current)
    loop.run(0.5)
    assert np.abs(np.array(loop.client.task('ee_position').current) - place).max() < 5e-3
    assert loop.client.task('ee_position').enabled


def test_a_time_limit_counts_while_it_looks(loop):
    result = loop.finish(start(loop, BEHIND, time_limit=0.3))
    assert result.outcome == Result.TIMED_OUT
    loop.run(0.5)
    assert loop.client.task('ee_position').enabled


def test_an_obstacle_that_moves_makes_it_look_again(loop):
    call = start(loop, BEHIND)
    step_until(loop, lambda: follows(loop))
    loop.step(20)
    x, y = loop.client.task('ee_position').current
    # The arm comes from above.
    loop.send_goal('obstacle_1', [x, y - 0.55])
    step_until(loop, lambda: 'following' not in loop.state.message)
    step_until(loop, lambda: follows(loop) or call.result is not None)
    assert loop.finish(call).outcome == Result.REACHED
    loop.send_goal('obstacle_1', [0.0, 1.0])


@pytest.mark.parametrize('speed', [0.0, 1e-2])
def test_an_obstacle_that_does_not_come_nearer_is_no_matter(loop, speed):
    call = start(loop, BEHIND)
    for i in range(100):
        loop.send_goal('obstacle_1', [0.0, 1.0 + speed * i])
        loop.step(3)
        if call.result is not None:
            break
    assert call.result is not None
    assert call.wait().outcome == Result.REACHED
    said = phases(call)
    assert 'looking ahead' not in said[said.index('following') :]
    loop.send_goal('obstacle_1', [0.0, 1.0])


def test_a_goal_by_topic_of_a_task_with_around_is_tried_around_by_itself(loop):
    loop.set_parameters({'hierarchy': [*LEVELS[:4], 'other', 'posture']})
    loop.send_goal('other', BEHIND)
    step_until(loop, lambda: follows(loop))
    step_until(loop, lambda: not follows(loop))
    loop.run(1.0)
    assert loop.client.task('other').error_norm < 1e-2


def test_the_planner_ends_with_the_node(running):
    pid = running.controller.pid
    tasks = Path(f'/proc/{pid}/task').glob('*/children')
    children = [child for task in tasks for child in task.read_text().split()]
    # It was started by the tests before.
    assert children
    running.controller.interrupt()
    running.controller.wait()
    end = time.monotonic() + 10.0
    while any(Path(f'/proc/{child}').exists() for child in children):
        assert time.monotonic() < end
        time.sleep(0.05)
