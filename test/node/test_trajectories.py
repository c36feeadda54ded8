"""Tasks that follow trajectories."""

import numpy as np
import pytest
from std_srvs.srv import SetBool
from trajectories import circle, frame_trajectory, joint_trajectory

from tp_sim.harness import ClosedLoop, GoalRejected

RATE = 200.0
JOINTS = ['joint_1', 'joint_2', 'joint_3']
START = [0.0, 0.6, 0.3]
SHARED = {'rate': RATE, 'robot': {'limits': {'velocity': [1.0], 'acceleration': [20.0]}}}
CONTROLLER = {
    'timeouts': {'joint_state': 60.0},  # joint states do not stop because the test is slow
    'start': 'hold',
    'solver': {'saturation': 'null_space'},
    'hierarchy': ['ee_position', 'posture'],
    'tasks': {
        'ee_position': {'gain': [3.0]},
        'posture': {'type': 'posture', 'gain': [3.0]},
        'idle': {'type': 'posture'},
    },
}


@pytest.fixture(scope='module')
def running(config):
    changes = {'/**': SHARED, 'tp_controller': CONTROLLER}
    with ClosedLoop(config / 'a4_position_joint.yaml', changes) as loop:
        yield loop


@pytest.fixture
def loop(running):
    running.reset()
    running.set_parameters({'hierarchy': ['ee_position', 'posture']})
    running.step(0)
    for task in ('ee_position', 'posture'):
        running.send_goal(task, running.client.task(task).current)
    running.step(1)
    running.clear_record()
    return running


def follow(loop, task, msg):
    """Send a trajectory and wait until the controller has taken it."""
    before = loop.client.task(task)
    loop.client.publish(f'tp_controller/{task}/trajectory', msg)

    def answered():
        now = loop.client.task(task)
        counts = (now.accepted_goals, now.rejected_goals)
        return counts != (before.accepted_goals, before.rejected_goals)

    loop.client.wait_for(answered, 'an answer to the trajectory')
    if loop.client.task(task).rejected_goals > before.rejected_goals:
        raise GoalRejected(loop.client.task(task).message)


def away(loop, place):
    """Distances (N,) of the end of the arm from where it has to be (N, 2), cycle by cycle."""
    return np.linalg.norm(loop.record.current['ee_position'] - place, axis=1)


@pytest.mark.parametrize('known', [True, False])
def test_a_circle_is_followed_within_a_millimetre(loop, known):
    """Its radius is 0.1 m and its period 5 s; the first two seconds of it, and to rest."""
    times = np.arange(0.0, 2.01, 0.1)
    start = loop.client.task('ee_position').current
    places, velocities = circle(start, 0.1, 5.0, times)
    velocities[-1] = 0.0
    follow(
        loop, 'ee_position', frame_trajectory(times, places, None, velocities if known else None)
    )
    loop.run(2.0)
    after = loop.record.time - loop.record.time[0] - 1.0 / RATE
    inside = (after >= 0.0) & (after <= 1.9)
    errors = away(loop, circle(start, 0.1, 5.0, after)[0])[inside]
    assert np.sqrt(np.mean(errors**2)) < 1e-3
    loop.run(0.5)
    assert away(loop, places[-1])[-1] < 1e-3
    assert np.abs(loop.state.command).max() < 1e-2


def test_joints_follow_by_name_and_the_others_stay(loop):
    loop.set_parameters({'hierarchy': ['posture']})
    times = [0.5, 1.0, 1.5]
    msg = joint_trajectory(['joint_3', 'joint_1'], times, [[0.4, 0.1], [0.6, 0.1], [0.5, 0.3]])
    follow(loop, 'posture', msg)
    loop.run(2.0)
    record = loop.record
    assert record.error_norm['posture'].max() < 1e-3
    assert record.q[-1] == pytest.approx([0.3, 0.6, 0.5], abs=1e-3)
    assert record.q[:, 1] == pytest.approx(np.full(len(record.q), 0.6), abs=1e-3)
    at = record.time - record.time[0]
    for time, joints in zip(times, [[0.1, 0.4], [0.1, 0.6], [0.3, 0.5]], strict=True):
        nearest = np.argmin(np.abs(at - time))
        assert record.q[nearest, [0, 2]] == pytest.approx(joints, abs=0.01)
    acceleration = np.abs(np.diff(record.qd, axis=0)).max() * RATE
    assert acceleration < 5.0


def test_a_newer_trajectory_goes_on_from_the_one_before_without_a_jump(loop):
    loop.set_parameters({'hierarchy': ['posture']})
    follow(loop, 'posture', joint_trajectory(JOINTS, [1.0], [[0.4, 0.6, 0.3]]))
    loop.run(0.5)
    assert loop.state.command[0] > 0.3
    follow(loop, 'posture', joint_trajectory(JOINTS, [1.0], [[0.4, 0.3, 0.3]]))
    loop.run(1.2)
    assert np.abs(np.diff(loop.record.qd, axis=0)).max() < 0.06
    assert loop.record.q[-1] == pytest.approx([0.4, 0.3, 0.3], abs=1e-3)


def test_an_empty_one_stops_the_arm_where_it_comes_to_rest(loop):
    loop.set_parameters({'hierarchy': ['posture']})
    follow(loop, 'posture', joint_trajectory(JOINTS, [1.0], [[0.6, 0.6, 0.3]]))
    loop.run(0.5)
    follow(loop, 'posture', joint_trajectory(JOINTS, [], []))
    loop.run(0.3)
    speeds = loop.record.qd[:, 0]
    assert speeds.min() > -1e-6
    assert abs(speeds[-1]) < 1e-6
    assert 0.3 < loop.record.q[-1, 0] < 0.45


def test_a_point_alone_goes_on_at_its_velocity_until_the_timeout(loop):
    start = loop.client.task('ee_position').current
    msg = frame_trajectory([0.0], [start], None, [[0.0, 0.05]])
    follow(loop, 'ee_position', msg)
    loop.run(0.4)
    assert loop.client.task('ee_position').achieved_velocity == pytest.approx([0, 0.05], abs=2e-3)
    loop.run(0.6)
    end = np.array(start) + np.array([0.0, 0.5 * 0.05])
    assert loop.client.task('ee_position').desired == pytest.approx(end, abs=1e-6)
    assert away(loop, end)[-1] < 1e-3


def begin_later(loop, msg, nanoseconds):
    """Let a trajectory begin so much after the present state; the time of it [ns]."""
    stamp = loop.state.header.stamp
    begins = stamp.sec * 10**9 + stamp.nanosec + nanoseconds
    msg.header.stamp.sec, msg.header.stamp.nanosec = divmod(begins, 10**9)
    return begins


def test_a_start_may_be_later_or_have_passed(loop):
    loop.set_parameters({'hierarchy': ['posture']})
    msg = joint_trajectory(JOINTS, [0.0, 1.0], [START, [0.4, 0.6, 0.3]])
    later = begin_later(loop, msg, 3 * 10**8)
    follow(loop, 'posture', msg)
    loop.run(1.5)
    record = loop.record
    stamps = np.array(list(loop._recorder._states)) - later
    assert np.abs(record.qd[stamps < 0]).max() == 0.0
    assert record.q[np.searchsorted(stamps, 5 * 10**8), 0] == pytest.approx(0.2, abs=1e-3)
    with pytest.raises(GoalRejected, match='got one with which the trajectory ended'):
        follow(loop, 'posture', msg)
    loop.send_goal('posture', START)
    loop.run(0.1)
    msg.points[-1].time_from_start.sec = 3
    follow(loop, 'posture', msg)
    loop.run(2.0)
    assert loop.record.q[-1, 0] == pytest.approx(0.4, abs=1e-3)


def test_the_path_before_goes_on_until_a_later_one_begins(loop):
    loop.set_parameters({'hierarchy': ['posture']})
    follow(loop, 'posture', joint_trajectory(JOINTS, [2.0], [[0.6, 0.6, 0.3]]))
    loop.run(0.5)
    msg = joint_trajectory(JOINTS, [1.5], [START])
    begins = begin_later(loop, msg, 5 * 10**8)
    follow(loop, 'posture', msg)
    loop.run(2.5)
    record = loop.record
    stamps = np.array(list(loop._recorder._states)) - begins
    # The first one alone would be half way at its half.
    assert record.q[np.searchsorted(stamps, 0), 0] == pytest.approx(0.3, abs=1e-3)
    assert np.abs(np.diff(record.qd, axis=0)).max() < 0.05
    assert record.q[-1] == pytest.approx(START, abs=1e-3)


def test_a_feedforward_ends_with_an_empty_trajectory(loop):
    loop.send_feedforward('ee_position', [0.05, 0.0])
    loop.run(0.2)
    assert np.abs(loop.record.qd[-1]).max() > 0.01
    loop.client.publish(
        'tp_controller/ee_position/trajectory', frame_trajectory([], np.empty((0, 2)))
    )
    # It would last for 0.5 s by its time-out.
    loop.run(0.2)
    assert np.abs(loop.record.qd[-1]).max() < 1e-4
    there = loop.record.q[-1]
    loop.run(0.6)
    assert loop.record.q[-1] == pytest.approx(there, abs=1e-4)


def test_a_path_that_is_too_fast_for_numbers_ends_at_rest(loop):
    follow(loop, 'posture', joint_trajectory(JOINTS, [0.001], [[1e8, 0.0, 0.0]]))
    loop.run(1.0)
    assert 'trajectory rejected: feedforward' in loop.client.task('posture').message
    assert np.abs(loop.record.qd[-1]).max() < 1e-4


def test_a_frame_of_the_robot_may_be_named(loop):
    start = np.array(loop.client.task('ee_position').current)
    turn = sum(loop.state.position)
    msg = frame_trajectory([0.5], [[-0.1, 0.1]], frame='link_3')
    follow(loop, 'ee_position', msg)
    loop.run(0.7)
    R = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    end = start + R @ [-0.1, 0.1]
    assert loop.client.task('ee_position').desired == pytest.approx(end, abs=1e-6)


@pytest.mark.parametrize('scaling', [False, True])
def test_a_path_that_limits_hold_up_is_left_or_slowed_down(loop, scaling):
    loop.set_parameters({'tasks.ee_position.time_scaling': scaling})
    start = np.array(loop.client.task('ee_position').current)
    corner, end = start + np.array([-0.3, 0.0]), start + np.array([-0.3, 0.3])
    ways = np.linspace(0.0, 1.0, 6)[1:, None]
    places = np.concatenate([start + ways * (corner - start), corner + ways * (end - corner)])
    follow(loop, 'ee_position', frame_trajectory(0.03 * np.arange(1, 11), places))
    loop.run(3.0)
    place = loop.record.current['ee_position']
    assert np.linalg.norm(place[-1] - end) < 1e-2
    off = np.minimum(np.abs(place[:, 1] - start[1]), np.abs(place[:, 0] - corner[0]))
    assert (off.max() < 0.02) == scaling
    loop.set_parameters({'tasks.ee_position.time_scaling': False})


@pytest.mark.parametrize('scaling', [False, True])
def test_a_path_that_is_faster_than_the_largest_speed_is_left_or_slowed_down(loop, scaling):
    start = np.array(loop.client.task('ee_position').current)
    corner, end = start + np.array([-0.2, 0.0]), start + np.array([-0.2, 0.2])
    loop.set_parameters(
        {'tasks.ee_position.time_scaling': scaling, 'tasks.ee_position.max_speed': [0.2]}
    )
    ways = np.linspace(0.0, 1.0, 6)[1:, None]
    places = np.concatenate([start + ways * (corner - start), corner + ways * (end - corner)])
    # Twice as fast as the task may be.
    follow(loop, 'ee_position', frame_trajectory(0.1 * np.arange(1, 11), places))
    loop.run(4.0)
    place = loop.record.current['ee_position']
    speeds = np.linalg.norm(np.diff(place, axis=0), axis=1) * RATE
    assert speeds.max() < 0.21
    assert np.linalg.norm(place[-1] - end) < 1e-2
    off = np.minimum(np.abs(place[:, 1] - start[1]), np.abs(place[:, 0] - corner[0]))
    assert (off.max() < 0.02) == scaling
    loop.set_parameters(
        {'tasks.ee_position.time_scaling': False, 'tasks.ee_position.max_speed': [100.0]}
    )


def test_goals_holds_and_hierarchies_end_it_and_a_feedforward_is_refused(loop):
    msg = joint_trajectory(JOINTS, [2.0], [[0.6, 0.6, 0.3]])
    loop.set_parameters({'hierarchy': ['posture']})
    follow(loop, 'posture', msg)
    loop.run(0.2)
    with pytest.raises(GoalRejected, match='feedforward: got one while a trajectory runs'):
        loop.send_feedforward('posture', [0.1, 0.0, 0.0])
    loop.send_goal('posture', START)
    loop.run(0.2)
    assert loop.client.task('posture').desired == pytest.approx(START)
    follow(loop, 'posture', msg)
    loop.run(0.2)
    hold = SetBool.Request(data=True)
    assert loop.client.call(SetBool, 'tp_controller/hold', hold).success
    loop.run(0.2)
    with pytest.raises(GoalRejected, match='got one while held by ~/hold'):
        follow(loop, 'posture', msg)
    assert loop.client.call(SetBool, 'tp_controller/hold', SetBool.Request(data=False)).success
    loop.run(0.2)
    assert np.abs(loop.state.command).max() < 1e-6
    follow(loop, 'posture', msg)
    loop.run(0.2)
    loop.set_parameters({'hierarchy': ['ee_position']})
    loop.run(0.1)
    assert 'failed' not in loop.controller.output


ONES = [[1.0] * 3] * 2


@pytest.mark.parametrize(
    ('msg', 'problem'),
    [
        (joint_trajectory(JOINTS, [1, 1], ONES), 'points.time_from_start: got 1 s for point 2,'),
        (joint_trajectory(['a'], [1], [[1.0]]), "joints: got 'a'; accepts some of joint_1, joint"),
        (joint_trajectory(JOINTS, [1], [[1.0]]), 'points.positions: got 1 value for point 1; acc'),
        (joint_trajectory(JOINTS, [1], [[]]), 'points.positions: got none; accepts 3, one for ea'),
        (
            joint_trajectory(JOINTS, [1], [[np.nan] * 3]),
            'points.positions: got [nan, nan, nan] fo',
        ),
        (
            joint_trajectory(JOINTS, [1, 2], ONES, ONES),
            'points.velocities: got [1.0, 1.0, 1.0] at',
        ),
        (joint_trajectory(JOINTS, [0.1 * i for i in range(1001)], ONES * 501), 'points: got 1001'),
    ],
)
def test_a_trajectory_that_cannot_be_is_refused_in_one_line(loop, msg, problem):
    with pytest.raises(GoalRejected) as caught:
        follow(loop, 'posture', msg)
    assert str(caught.value).startswith(f'trajectory rejected: {problem}')
    assert '\n' not in str(caught.value)


@pytest.mark.parametrize(
    ('task', 'changes', 'problem'),
    [
        ('ee_position', {'joint_names': ['hand']}, "joint_names: got ['hand']; accepts none, or"),
        ('ee_position', {'frame': 'map'}, "header.frame_id: got 'map'; accepts ''"),
        ('idle', {}, 'trajectory: got one for a task that is not in the hierarchy'),
    ],
)
def test_what_does_not_fit_the_task_is_refused(loop, task, changes, problem):
    msg = frame_trajectory([1.0], [[1.0, 0.5]])
    if task == 'idle':
        msg = joint_trajectory(JOINTS, [1.0], [[1.0] * 3])
    msg.header.frame_id = changes.get('frame', '')
    if 'joint_names' in changes:
        msg.joint_names = changes['joint_names']
    with pytest.raises(GoalRejected) as caught:
        follow(loop, task, msg)
    assert str(caught.value).startswith(f'trajectory rejected: {problem}')
