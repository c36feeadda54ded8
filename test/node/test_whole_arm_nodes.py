"""The real nodes with tasks that keep the whole arm clear."""

import numpy as np
import pytest
from visualization_msgs.msg import Marker, MarkerArray

from tp_sim.harness import ClosedLoop


@pytest.fixture(scope='module')
def loop(config):
    with ClosedLoop(config / 'panda_table.yaml') as loop:
        yield loop


def test_a_goal_moves_the_ball_onto_the_arm_which_comes_out(loop):
    loop.send_goal('hand_position', [0.45, 0.0, 0.35])
    loop.run(2.0)
    clear = ('table', 'pillar', 'ball', 'self', 'ranges')
    for name in clear:
        assert loop.record.distance[name].min() >= 0.0, name
    assert loop.record.error_norm['hand_position'][-1] < 0.01
    loop.send_goal('ball', [0.45, 0.0, 0.75])
    assert list(loop.client.task('ball').desired) == [0.45, 0.0, 0.75]
    loop.run(4.0)
    assert loop.record.distance['ball'].min() < -0.01
    for name in clear:
        assert loop.record.distance[name][-1].min() >= 0.0, name


def test_the_state_names_links_and_pairs(loop):
    assert 'panda_link4' in loop.client.task('ball').components
    assert 'panda_hand start' in loop.client.task('table').components
    assert 'panda_link1 - panda_hand' in loop.client.task('self').components


def test_markers_show_every_shape_of_obstacle_and_the_links(loop):
    arrays = loop.client.collect(MarkerArray, 'tp_controller/markers')
    loop.client.wait_for(lambda: bool(arrays), 'markers')
    markers = arrays[-1].markers
    kinds = [marker.type for marker in markers if marker.ns == 'obstacle']
    assert kinds == [Marker.CUBE, Marker.CUBE, Marker.SPHERE]
    table, pillar, ball = (marker for marker in markers if marker.ns == 'obstacle')
    assert table.pose.position.z + 0.5 * table.scale.z == pytest.approx(0.0)
    assert [pillar.scale.x, pillar.scale.y, pillar.scale.z] == [0.15, 0.15, 0.8]
    assert np.hypot(pillar.pose.orientation.z, pillar.pose.orientation.w) == pytest.approx(1.0)
    assert ball.scale.x == pytest.approx(0.24)
    bodies = [marker for marker in markers if marker.ns == 'body']
    assert len({marker.id for marker in bodies}) == len(bodies) >= 30
    assert all(marker.header.frame_id == 'panda_link0' for marker in bodies)
