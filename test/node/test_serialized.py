"""Bytes of commands are those that rclpy makes of the same message."""

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

from tp_controller.ros.serialized import Serialized

VALUES = [[0.25, -1e-300, 3.0], [0.0, 0.0, 0.0]]


@pytest.mark.parametrize('frame', ['', 'base', 'arm_base'])
@pytest.mark.parametrize('n', [1, 2, 3])
def test_a_stamped_message(frame, n):
    names = ['a', 'joint', 'other_joint'][:n]
    serialized = Serialized(_joint_state(frame, names), 'velocity', n)
    for values, stamp in zip(VALUES, (Time(sec=-1, nanosec=5), Time()), strict=True):
        msg = _joint_state(frame, names)
        msg.header.stamp, msg.velocity = stamp, values[:n]
        assert serialized.write(np.array(values[:n]), stamp) == serialize_message(msg)


def test_a_message_without_a_stamp():
    serialized = Serialized(Float64MultiArray(), 'data', 3)
    for values in VALUES:
        expected = serialize_message(Float64MultiArray(data=values))
        assert serialized.write(np.array(values), None) == expected


def _joint_state(frame, names):
    msg = JointState(name=names)
    msg.header.frame_id = frame
    return msg
