"""Experiment B: set-based tasks above a position, in lockstep over DDS."""

import numpy as np
import pytest
from geometry_msgs.msg import PointStamped
from visualization_msgs.msg import MarkerArray

from tp_sim.harness import ClosedLoop, GoalRejected

CENTERS = {'obstacle_1': (0.0, 1.0), 'obstacle_2': (-0.5, -0.75), 'obstacle_3': (0.75, -0.5)}
RADII = {'obstacle_1': 0.5, 'obstacle_2': 0.4, 'obstacle_3': 0.275}


@pytest.fixture(scope='module')
def loop(config):
    with ClosedLoop(config / 'b1_obstacles.yaml') as loop:
        yield loop


@pytest.fixture(autouse=True)
def start(loop):
    loop.reset()
    loop.send_goal('obstacle_1', CENTERS['obstacle_1'])
    loop.clear_record()


def clearances(record):
    """Distance of the end of the arm from every circle (N, 3)."""
    angles = np.cumsum(record.q, axis=1)
    tips = np.stack([np.cos(angles), np.sin(angles)], axis=-1) * [[0.75], [0.5], [0.5]]
    ways = tips.sum(axis=1)[:, None] - np.array(list(CENTERS.values()))
    return np.linalg.norm(ways, axis=2) - list(RADII.values())


@pytest.mark.parametrize('goal', [[-0.9, 0.9], [0.0, 1.0], [0.75, -0.5], [-0.6, -1.2]])
def test_b1_the_end_stays_outside_at_every_step(loop, goal):
    loop.send_goal('ee_position', goal)
    loop.run(10.0)
    record = loop.record
    found = clearances(record)
    assert found.min() > 0.0
    for i, name in enumerate(CENTERS):
        assert record.distance[name][:, 0] == pytest.approx(found[:, i], abs=1e-9)
    inside = min(
        float(np.linalg.norm(np.subtract(goal, CENTERS[name]))) - RADII[name] for name in CENTERS
    )
    if inside > 0.16:
        assert record.error_norm['ee_position'][-1] < 0.01
    elif inside < 0.0:
        assert any(record.active[name].any() for name in CENTERS)
        assert record.error_norm['ee_position'][-1] > -inside


def test_b1_a_goal_moves_an_obstacle_onto_the_arm_which_comes_out(loop):
    loop.send_goal('ee_position', [1.2, 0.6])
    loop.run(6.0)
    before = loop.client.task('obstacle_1').distance[0]
    loop.send_goal('obstacle_1', [0.8, 0.6])
    moved = loop.client.task('obstacle_1')
    assert list(moved.desired) == [0.8, 0.6]
    loop.step(1)
    assert loop.client.task('obstacle_1').active
    deep = loop.client.task('obstacle_1').distance[0]
    assert deep == pytest.approx(-0.1, abs=0.01)
    assert before > 0.0
    loop.clear_record()
    loop.run(5.0)
    assert np.all(np.diff(loop.record.distance['obstacle_1'][:, 0]) > -1e-9)
    assert loop.client.task('obstacle_1').distance[0] > 0.0


def test_b1_a_bad_centre_is_refused(loop):
    goal = PointStamped()
    goal.point.x = float('nan')
    with pytest.raises(GoalRejected, match='finite'):
        loop.client.publish_goal('obstacle_1', goal)
    assert list(loop.client.task('obstacle_1').desired) == [0.0, 1.0]


def test_b1_the_markers_show_the_obstacles(loop):
    arrays = loop.client.collect(MarkerArray, 'tp_controller/markers')
    loop.client.wait_for(lambda: bool(arrays), 'markers')
    markers = {marker.id: marker for marker in arrays[-1].markers if marker.ns == 'obstacle'}
    assert len(markers) == 3
    for i, name in enumerate(CENTERS):
        position = markers[i].pose.position
        assert (position.x, position.y) == pytest.approx(CENTERS[name])
        assert markers[i].scale.x == pytest.approx(2.0 * RADII[name])


def test_b2_the_joint_never_leaves_its_range_and_an_unreachable_goal_leaves_an_error(config):
    with ClosedLoop(config / 'b2_joint_limits.yaml') as loop:
        for goal in ([1.0, 1.0], [-1.0, 0.5]):
            loop.send_goal('ee_position', goal)
            loop.run(10.0)
        record = loop.record
    assert np.abs(record.q[:, 0]).max() < 0.5
    assert record.active['joint_1_range'].any()
    assert record.distance['joint_1_range'][:, 0] == pytest.approx(0.5 - np.abs(record.q[:, 0]))
    assert record.error_norm['ee_position'][599] < 0.01
    assert record.error_norm['ee_position'][-1] > 0.1


@pytest.mark.parametrize(
    ('switching', 'warning'),
    [
        ('hysteresis', '0.01 is less than one step can travel, 0.081'),
        ('smooth', '0.01 is less than it takes to brake from full speed, 0.328'),
    ],
)
def test_an_activation_that_is_too_near_is_warned_of(lone_controller, switching, warning):
    task = {'switching': switching, 'activation': 0.01}
    changes = {'tp_controller': {'tasks': {'obstacle_1': task}}}
    controller = lone_controller(changes, name='b1_obstacles')
    warning = f'tasks.obstacle_1.activation: {warning}'
    controller.client.wait_for(lambda: warning in controller.process.output, 'the warning')


@pytest.mark.parametrize('scheme', ['recursive', 'hqp', 'weighted'])
def test_b3_no_limit_is_broken_and_what_stands_in_the_way_is_told(config, scheme):
    # A pause of the machine would bring the arm to rest at once.
    patience = {'joint_state': 5.0}
    changes = {'tp_controller': {'solver': {'type': scheme}, 'timeouts': patience}}
    with ClosedLoop(config / 'b3_pressed.yaml', changes) as loop:
        loop.send_goal('ee_position', [-0.2, 1.1])
        loop.run(8.0)
        record, state = loop.record, loop.client.state
    assert min(record.distance[name].min() for name in CENTERS) >= 0.0
    assert np.abs(record.q[:, 0]).max() <= 0.5
    change = np.abs(np.diff(record.qd, axis=0)).max()
    assert change <= 10.0 / 60.0 * (1.0 + 1e-9)
    assert record.active['obstacle_1'][-1]
    if scheme != 'weighted':
        assert record.active['joint_1_range'][-1]
        levels = {level.tasks[0]: level for level in state.levels}
        assert set(levels['ee_position'].blocked_by) >= {'joint_1_range', 'obstacle_1'}


def test_b3_a_goal_jump_meets_the_acceleration_limits_which_are_named(config):
    with ClosedLoop(config / 'b3_pressed.yaml') as loop:
        loop.send_goal('ee_position', [-0.9, 0.9])
        for _ in range(8):
            # One by one: the explanation is left for later while a further state waits.
            loop.step()
        limits = list(loop.client.state.active_limits)
    assert limits
    assert all(limit.split()[1] == 'acceleration' for limit in limits)
