"""Tasks seen from other frames and along the axes of others, against independent poses."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from random_stacks import AXES, arms, examples, states, vectors
from references import dh_poses, heading, quaternion_rotation, rotation_vector
from small_arms import planar_robot, robot_of

from tp_controller import InvalidValue
from tp_controller.rotations import quaternion_from_rotation
from tp_controller.tasks import OrientationTask, PoseTask, PositionTask

H = 1e-6


class Scene:
    """An arm in motion, with a controlled frame, a reference and a frame of axes."""

    def __init__(self, block, names, q, qd):
        self.robot = robot_of(block)
        self.block, self.q, self.qd = block, q, qd
        self.frame, self.relative_to, self.axes_frame = names

    def pose(self, name, q):
        """Position and rotation by the matrices of the textbooks; those of the base if None."""
        if name in (None, 'base'):
            return np.zeros(3), np.eye(3)
        pose = dh_poses(self.block['dh'], q)[int(name.removeprefix('link_')) - 1]
        return pose[:3, 3], pose[:3, :3]

    def seen(self, q):
        """Position, rotation and axes (3, 3), all as seen from the reference."""
        p, R = self.pose(self.frame, q)
        o, B = self.pose(self.relative_to, q)
        # Without a frame of axes those of the reference.
        X = self.pose(self.axes_frame, q)[1] if self.axes_frame else B
        return B.T @ (p - o), B.T @ R, B.T @ X

    def at(self, task, q):
        self.robot.update(q)
        task.update()
        return task.error.copy(), task.J.copy()


@st.composite
def scenes(draw):
    block = draw(arms(min_joints=3, max_joints=7))
    n = len(block['joints'])
    links = st.integers(1, n).map('link_{}'.format)
    frame = draw(links)
    relative_to = draw(st.none() | st.just('base') | links.filter(lambda name: name != frame))
    axes_frame = draw(st.none() | st.just('base') | links)
    return Scene(block, (frame, relative_to, axes_frame), draw(states(n)), draw(states(n)))


@given(scenes(), st.sampled_from(AXES), vectors(3, 2))
@examples(100)
def test_a_position_error_is_the_way_left_along_the_axes_and_j_is_its_rate(scene, axes, point):
    task = PositionTask('t', scene.robot, scene.frame, axes, scene.relative_to, scene.axes_frame)
    rows = ['xyz'.index(letter) for letter in sorted(axes)]
    own_axes = task.target_size == 3 and scene.axes_frame is not None
    task.target = point if own_axes else np.array(point)[rows]

    def error(q):
        p, _, X = scene.seen(q)
        return ((X.T if own_axes else np.eye(3)) @ (point - p))[rows]

    found, J = scene.at(task, scene.q)
    np.testing.assert_allclose(found, error(scene.q), atol=1e-9)
    rate = (error(scene.q - H * scene.qd) - error(scene.q + H * scene.qd)) / (2.0 * H)
    np.testing.assert_allclose(J @ scene.qd, rate, atol=1e-5, rtol=1e-6)


@given(scenes(), st.sampled_from(AXES), vectors(4, 1))
@examples(100)
def test_an_orientation_error_is_the_turn_left_along_the_axes(scene, axes, quaternion):
    assume(np.linalg.norm(quaternion) > 0.1)
    task = OrientationTask(
        't', scene.robot, scene.frame, axes, scene.relative_to, scene.axes_frame
    )
    rows = ['xyz'.index(letter) for letter in sorted(axes)]
    _, R, X = scene.seen(scene.q)
    if task.target_size == 1:
        # Where the image of the next axis is normal to the plane there is no heading.
        assume(abs(R['xyz'.index(axes), ('xyz'.index(axes) + 1) % 3]) < 0.99)
        task.target = [0.3]
        found, _ = scene.at(task, scene.q)
        turns = (0.3 - heading(R, axes) - found[0]) / (2.0 * np.pi)
        assert abs(turns - round(turns)) < 1e-9
        return
    task.target = quaternion
    found, J = scene.at(task, scene.q)
    vector = rotation_vector(quaternion_rotation(quaternion) @ R.T)
    assume(np.linalg.norm(vector) < np.pi - 1e-4)
    A = X.T if task.axes is not task.reference else np.eye(3)
    if len(axes) != 2:
        np.testing.assert_allclose(found, (A @ vector)[rows], atol=1e-8)
    ahead, behind = (scene.seen(scene.q + sign * H * scene.qd)[1] for sign in (1.0, -1.0))
    w = rotation_vector(ahead @ behind.T) / (2.0 * H)
    np.testing.assert_allclose(J @ scene.qd, (A @ w)[rows], atol=1e-5, rtol=1e-6)


@given(scenes())
@examples(40)
def test_a_pose_is_its_position_and_its_orientation_from_wherever_it_is_seen(scene):
    views = scene.relative_to, scene.axes_frame
    pose = PoseTask('t', scene.robot, scene.frame, 'xz', 'xyz', *views)
    parts = [
        PositionTask('p', scene.robot, scene.frame, 'xz', *views),
        OrientationTask('o', scene.robot, scene.frame, 'xyz', *views),
    ]
    target = [*[0.3, -0.2, 0.5][: parts[0].target_size], 0.1, 0.2, -0.3, 0.9]
    pose.target = target
    parts[0].target, parts[1].target = target[:-4], target[-4:]
    assert pose.target_components == parts[0].target_components + parts[1].target_components
    found = scene.at(pose, scene.q)
    expected = [scene.at(part, scene.q) for part in parts]
    np.testing.assert_array_equal(found[0], np.concatenate([error for error, _ in expected]))
    np.testing.assert_array_equal(found[1], np.vstack([J for _, J in expected]))


@given(scenes())
@examples(40)
def test_a_held_task_has_no_error_from_wherever_it_is_seen(scene):
    views = scene.relative_to, scene.axes_frame
    for task in (
        PositionTask('p', scene.robot, scene.frame, 'xy', *views),
        OrientationTask('o', scene.robot, scene.frame, 'xyz', *views),
        PoseTask('t', scene.robot, scene.frame, 'y', 'xz', *views),
    ):
        scene.robot.update(scene.q)
        task.hold()
        np.testing.assert_allclose(scene.at(task, scene.q)[0], np.zeros(task.k), atol=1e-7)
        p, R, _ = scene.seen(scene.q)
        np.testing.assert_allclose(task.target, task.target_from_pose(p, R), atol=1e-7)


def test_a_frame_that_moves_with_its_reference_does_not_move():
    robot = planar_robot(1.0, 1.0, 1.0)
    task = PositionTask('t', robot, 'link_3', 'xy', 'link_1')
    task.target = [0.0, 0.0]
    robot.update(np.array([0.3, 0.5, -0.2]))
    task.update()
    np.testing.assert_allclose(task.J[:, 0], np.zeros(2), atol=1e-12)
    assert np.abs(task.J[:, 1:]).max() > 0.1
    assert task.relative_to == 'link_1'


def test_in_the_axes_of_its_own_frame_an_error_turns_with_it():
    """A hand at a quarter turn sees a target above its base to its side."""
    robot = planar_robot(1.0)
    task = PositionTask('t', robot, 'link_1', 'x', axes_frame='link_1')
    task.target = [0.0, 1.5, 0.0]
    robot.update(np.array([np.pi / 2.0]))
    task.update()
    np.testing.assert_allclose(task.error, [0.5], atol=1e-12)
    assert task.target_components == ('x', 'y', 'z')


def test_one_axis_of_another_frame_takes_a_quaternion():
    task = OrientationTask('t', planar_robot(1.0), 'link_1', 'z', axes_frame='link_1')
    assert task.target_components == ('qx', 'qy', 'qz', 'qw')
    task.target = quaternion_from_rotation(np.eye(3))
    task.robot.update(np.array([0.4]))
    task.update()
    np.testing.assert_allclose(task.error, [-0.4], atol=1e-12)


@pytest.mark.parametrize('kind', [PositionTask, OrientationTask])
def test_the_base_by_its_name_is_the_same_as_none(kind):
    robot = planar_robot(1.0, 1.0)
    plain, named = kind('t', robot, 'link_2'), kind('t', robot, 'link_2', 'xyz', 'base', 'base')
    robot.update(np.array([0.3, 0.4]))
    for task in (plain, named):
        task.hold()
        task.update()
    assert named.target_components == plain.target_components
    assert named.relative_to == ''
    np.testing.assert_array_equal(named.J, plain.J)


@pytest.mark.parametrize(
    ('views', 'key', 'accepts'),
    [
        (('elbow', None), 'relative_to', 'base or one of link_1, link_2'),
        ((None, 'elbow'), 'axes_frame', 'base or one of link_1, link_2'),
        (('link_2', None), 'relative_to', 'one of base, link_1'),
    ],
)
def test_a_frame_that_nothing_can_be_seen_from_is_refused(views, key, accepts):
    for kind in (PositionTask, OrientationTask):
        with pytest.raises(InvalidValue) as caught:
            kind('t', planar_robot(1.0, 1.0), 'link_2', 'xyz', *views)
        assert caught.value.key == key
        assert caught.value.accepts == accepts
