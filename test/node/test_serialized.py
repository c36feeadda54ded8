"""Bytes of commands are the message that they stand for, whatever is between the values."""

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from rclpy.serialization import deserialize_message, serialize_message
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
        found = serialized.write(np.array(values[:n]), stamp)
        assert deserialize_message(found, JointState) == msg
        assert len(found) == len(serialize_message(msg))


def test_a_message_without_a_stamp():
    serialized = Serialized(Float64MultiArray(), 'data', 3)
    for values in VALUES:
        found = serialized.write(np.array(values), None)
        assert deserialize_message(found, Float64MultiArray) == Float64MultiArray(data=values)


def _joint_state(frame, names):
    msg = JointState(name=names)
    msg.header.frame_id = frame
    return msg
