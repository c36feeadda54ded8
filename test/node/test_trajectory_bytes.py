"""Trajectories are read from bytes as rclpy reads them; many points are no more work than few."""

import contextlib
import gc
import sys
from collections import Counter

import numpy as np
import pytest
from builtin_interfaces.msg import Duration
from geometry_msgs.msg import Quaternion, Transform, Twist, Vector3
from hypothesis import given
from hypothesis import strategies as st
from rclpy.serialization import serialize_message
from trajectories import frame_trajectory, joint_trajectory
from trajectory_msgs.msg import (
    JointTrajectory,
    JointTrajectoryPoint,
    MultiDOFJointTrajectory,
    MultiDOFJointTrajectoryPoint,
)

from tp_controller.config import build_settings, read_parameter_file
from tp_controller.errors import InvalidValue
from tp_controller.ros import trajectory_bytes
from tp_controller.ros.codecs import GOALS
from tp_controller.ros.goals import GoalReader
from tp_controller.ros.trajectory_bytes import FIELDS, TrajectoryMessage
from tp_controller.ros.trajectory_messages import Begin
from tp_controller.rotations import rotation_from_quaternion, rotations_from_quaternions

texts = st.text(st.characters(codec='utf-8', exclude_characters='\0'), max_size=9)
BEGIN = Begin(0.0, None, 0.0, 0.0, 1.0)


def filled(random, kind, size):
    """Entries of a list of a point, with different numbers."""

    def some(count):
        return [random.uniform(-9.0, 9.0) for _ in range(count)]

    if kind == 'transforms':
        places = [Vector3(**dict(zip('xyz', some(3), strict=True))) for _ in range(size)]
        turns = [Quaternion(**dict(zip('xyzw', some(4), strict=True))) for _ in range(size)]
        return [
            Transform(translation=place, rotation=turn)
            for place, turn in zip(places, turns, strict=True)
        ]
    linear, angular = (
        [Vector3(**dict(zip('xyz', some(3), strict=True))) for _ in range(size)] for _ in range(2)
    )
    return [Twist(linear=v, angular=w) for v, w in zip(linear, angular, strict=True)]


@st.composite
def messages(draw):
    """Trajectories; in some of them a point has more or less than the ones before."""
    random = draw(st.randoms(use_true_random=False))
    kind = draw(st.sampled_from(list(FIELDS)))
    msg = kind(joint_names=draw(st.lists(texts, max_size=3)))
    msg.header.frame_id = draw(texts)
    msg.header.stamp.sec, msg.header.stamp.nanosec = -5, draw(st.integers(0, 10**9 - 1))
    sizes = draw(st.fixed_dictionaries({name: st.integers(0, 3) for name in FIELDS[kind]}))
    for _ in range(draw(st.integers(0, 6))):
        if draw(st.integers(0, 4)) == 0:
            sizes = {**sizes, draw(st.sampled_from(list(sizes))): draw(st.integers(0, 3))}
        time = Duration(sec=random.randint(-9, 9), nanosec=random.randint(0, 10**9 - 1))
        if kind is JointTrajectory:
            point = JointTrajectoryPoint(time_from_start=time)
            for name, size in sizes.items():
                setattr(point, name, [random.uniform(-9.0, 9.0) for _ in range(size)])
        else:
            point = MultiDOFJointTrajectoryPoint(time_from_start=time)
            for name, size in sizes.items():
                setattr(point, name, filled(random, name, size))
        msg.points.append(point)
    return msg


def flat(entries):
    """Numbers of a list of a point."""
    found = []
    for entry in entries:
        if isinstance(entry, float):
            found.append(entry)
            continue
        for part in entry.get_fields_and_field_types():
            value = getattr(entry, part)
            found += [getattr(value, axis) for axis in value.get_fields_and_field_types()]
    return found


@given(msg=messages())
def test_numbers_are_those_that_rclpy_reads(msg):
    read = TrajectoryMessage(serialize_message(msg), type(msg))
    assert read.header == msg.header
    assert read.joint_names == msg.joint_names
    assert len(read.points) == len(msg.points)
    assert list(read.points) == msg.points
    fields = FIELDS[type(msg)]
    values = read.values
    all_sizes = [
        {name: width * len(getattr(point, name)) for name, width in fields.items()}
        for point in msg.points
    ]
    alike = next((i for i, s in enumerate(all_sizes) if s != all_sizes[0]), len(msg.points))
    unlike = None if alike == len(msg.points) else (alike, all_sizes[alike])
    assert values.unlike == unlike
    times = [point.time_from_start for point in msg.points[:alike]]
    assert values.times.tolist() == [time.sec + 1e-9 * time.nanosec for time in times]
    for name, size in values.sizes.items():
        rows = [flat(getattr(point, name)) for point in msg.points[:alike]]
        assert all(len(row) == size for row in rows)
        if size:
            assert values.columns[name].tolist() == rows


@given(msg=messages(), place=st.floats(0.0, 1.0))
def test_of_other_bytes_nothing_but_a_refusal_comes(msg, place):
    data = serialize_message(msg)
    cut = int(place * len(data))
    for broken in (data[:cut], data[:cut] + b'\xff' * 4 + data[cut + 4 :]):
        found = 0
        with contextlib.suppress(InvalidValue):
            found = len(TrajectoryMessage(broken, type(msg)).values.times)
        assert found <= len(msg.points)


@pytest.fixture(scope='module')
def panda(config):
    parameters = read_parameter_file(config / 'panda.yaml', 'tp_controller')
    stack = build_settings(parameters).stack
    stack.step(0.5 * (stack.robot.limits.position_min + stack.robot.limits.position_max))
    frames = GoalReader(stack.robot)
    frames.robot_seen = True
    return stack, frames


def work(monkeypatch, panda, msg):
    """What is called to make a path of a message's bytes: a count by name."""
    stack, frames = panda
    joints = isinstance(msg, JointTrajectory)
    task = stack.tasks['posture' if joints else 'hand_orientation']
    data, done = serialize_message(msg), Counter()
    monkeypatch.setattr(trajectory_bytes, 'deserialize_message', None)

    def note(frame, event, argument):
        done[frame.f_code.co_name if event == 'call' else event] += 1

    gc.disable()
    sys.setprofile(note)
    try:
        GOALS[task.type].path(task, TrajectoryMessage(data, type(msg)), frames, BEGIN)
    finally:
        sys.setprofile(None)
        gc.enable()
    return done


@pytest.mark.parametrize('kind', [JointTrajectory, MultiDOFJointTrajectory])
def test_a_thousand_points_are_no_more_work_than_ten(monkeypatch, panda, kind):
    def made(count):
        times = np.arange(1.0, count + 1.0)
        if kind is JointTrajectory:
            rows = np.zeros((count, 7))
            return joint_trajectory(panda[0].robot.joints, times, rows, rows, rows)
        turns = np.tile([0.0, 0.0, 1.0, 0.0], (count, 1))
        return frame_trajectory(times, np.zeros((count, 3)), turns, np.zeros((count, 3)))

    _, few, many = (work(monkeypatch, panda, made(count)) for count in (10, 10, 1000))
    assert few == many
    assert sum(few.values()) > 50


def test_quaternions_at_once_are_the_rotations_of_each():
    quaternions = np.random.default_rng(1).normal(size=(20, 4))
    expected = [rotation_from_quaternion(quaternion) for quaternion in quaternions]
    np.testing.assert_allclose(rotations_from_quaternions(quaternions), expected, atol=1e-14)
