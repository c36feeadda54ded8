"""Markers for RViz."""

import numpy as np
import pytest
from visualization_msgs.msg import Marker, MarkerArray

from tp_sim.harness import ClosedLoop


def coordinates(points):
    return np.array([[point.x, point.y, point.z] for point in points])


def test_markers_show_the_arm_the_path_and_the_target(config):
    with ClosedLoop(config / 'a1_position.yaml', lockstep=False) as loop:
        arrays = loop.client.collect(MarkerArray, 'tp_controller/markers')
        loop.run(3.0)
        loop.client.wait_for(lambda: len(arrays) > 15, 'markers')
    markers = {(marker.ns, marker.id): marker for marker in arrays[-1].markers}
    assert all(marker.header.frame_id == 'base' for marker in markers.values())
    arm = coordinates(markers['robot', 0].points)
    segments = arm.reshape(-1, 2, 3)
    lengths = np.linalg.norm(segments[:, 1] - segments[:, 0], axis=1)
    assert lengths == pytest.approx([0.75, 0.5, 0.5])
    assert np.array_equal(segments[1:, 0], segments[:-1, 1])
    assert arm[0] == pytest.approx([0.0, 0.0, 0.0])
    path = coordinates(markers['path', 0].points)
    assert path[-1] == pytest.approx(arm[-1])
    assert len(path) > 10
    target = markers['target', 0]
    assert target.action == Marker.ADD
    assert coordinates(target.points) == pytest.approx(np.array([[1.0, 0.5, 0.0]]))
