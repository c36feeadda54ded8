"""Bytes that are sent are the message that they stand for, whatever is between the numbers."""

import math
from array import array

import pytest
from builtin_interfaces.msg import Time
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from visualization_msgs.msg import Marker

from tp_controller.ros.serialized import Serialized, field_view
from tp_controller.ros.state import BLOCKS
from tp_interfaces.msg import ControllerState, LevelState, TaskState


def assert_same(serialized, msg):
    """Bytes are read as those of rclpy are, NaN included."""
    found, expected = serialized.write(), serialize_message(msg)
    kind = type(msg)
    assert repr(deserialize_message(found, kind)) == repr(deserialize_message(expected, kind))


@pytest.mark.parametrize('frame', ['', 'base', 'arm_base'])
@pytest.mark.parametrize('n', [0, 1, 2, 3])
def test_a_command(frame, n):
    msg = JointState(name=['a', 'joint', 'other_joint'][:n])
    msg.header.frame_id = frame
    velocity = field_view(msg, 'velocity', n)
    serialized = Serialized(msg)
    for values, stamp in (
        ([0.25, -1e-300, 3.0], Time(sec=-1, nanosec=5)),
        ([0.0, math.nan, math.inf], Time()),
    ):
        velocity[:] = values[:n]
        msg.header.stamp = stamp
        assert_same(serialized, msg)


def test_a_command_without_a_stamp():
    msg = Float64MultiArray()
    data = field_view(msg, 'data', 3)
    serialized = Serialized(msg)
    for values in ([0.25, -1e-300, 3.0], [0.0, 0.0, 0.0]):
        data[:] = values
        assert_same(serialized, msg)


@pytest.mark.parametrize('frame', ['', 'base', 'a_base', 'an_arm_base'])
@pytest.mark.parametrize('sizes', [(), (1,), (3, 0), (2, 7, 1)])
def test_a_state_of_the_controller(frame, sizes):
    msg = ControllerState(joint_names=['j1', 'joint_2'], position=[0.1, math.nan])
    msg.header.frame_id = frame
    msg.tasks = [task(k) for k in sizes]
    serialized = Serialized(msg, BLOCKS)
    assert_same(serialized, msg)
    for change in CHANGES:
        change(msg)
        assert_same(serialized, msg)
        msg.cycles += 1
        msg.position[0] = -0.5
        assert_same(serialized, msg)


def task(k):
    return TaskState(
        name='task' + k * 'k',
        components=[f'row_{i}' for i in range(k)],
        level=-k,
        error=[0.5] * k,
        distance=[math.inf] * (k // 2),
        error_norm=math.nan,
        accepted_goals=2**63 + k,
    )


def set_numbers(msg):
    msg.status, msg.held, msg.scale, msg.overruns = 3, True, 0.25, 2**64 - 1
    for entry in msg.tasks:
        entry.level, entry.active, entry.error_norm = 4, True, -0.0
        for i in range(len(entry.error)):
            entry.error[i] = i + 0.125


def add_levels(msg):
    msg.levels_stamp = Time(sec=7, nanosec=8)
    msg.levels = [
        LevelState(tasks=['a', 'bc'], blocked_by=['d'], lost_to_levels=[0.1], text='0.1 to d'),
        LevelState(rows=5, rank=4, smallest_singular_value=math.inf),
    ]
    msg.active_limits = ['joint_2 velocity']


def change_a_level(msg):
    msg.levels[0].text = 'another'
    msg.levels[1].lost_to_levels = array('d', [1.0, 2.0])


def refuse_goals(msg):
    for entry in msg.tasks:
        entry.message = 'goal rejected'
        entry.rejected_goals += 1


def replace_arrays(msg):
    msg.command = array('d', [0.5, 0.25, 0.125])
    msg.position = array('d', [1.0, 2.0])
    for entry in msg.tasks:
        entry.desired = array('d', [3.0])


def add_a_task(msg):
    msg.tasks.append(task(2))


def give_warnings(text):
    def change(msg):
        msg.message = text

    return change


CHANGES = (
    set_numbers,
    *(give_warnings(count * 'x') for count in range(9)),
    give_warnings('ä warning, in \N{GREEK SMALL LETTER MU}s'),
    add_levels,
    give_warnings('other'),
    change_a_level,
    refuse_goals,
    replace_arrays,
    add_a_task,
    lambda msg: msg.tasks.clear(),
    lambda msg: setattr(msg, 'levels', []),
)


def test_a_field_that_is_not_handled():
    from geometry_msgs.msg import PoseWithCovariance

    with pytest.raises(TypeError, match=r'double\[36\]'):
        Serialized(PoseWithCovariance())


def test_fields_of_any_size_and_nested_messages():
    msg = Marker(text='text', ns='n')
    msg.frame_locked = True
    msg.color.a = 0.5
    msg.lifetime.sec = 3
    serialized = Serialized(msg, ('ns', 'pose', 'points'))
    assert_same(serialized, msg)
    msg.pose.orientation.w = 0.125
    msg.id = -9
    assert_same(serialized, msg)
