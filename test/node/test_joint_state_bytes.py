"""Joint states are read from bytes as rclpy reads them."""

import math

import numpy as np
import pytest
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState

from tp_controller.errors import InvalidValue
from tp_controller.ros import joint_state_bytes
from tp_controller.ros.joint_state_bytes import JointStateDecoder
from tp_controller.ros.joint_states import JointStateReader


@pytest.fixture
def ordinary(monkeypatch):
    """Joint states that rclpy has read."""
    found = []
    read = joint_state_bytes.deserialize_message

    def keep(data, kind):
        found.append(data)
        return read(data, kind)

    monkeypatch.setattr(joint_state_bytes, 'deserialize_message', keep)
    return found


def joint_state(names, position, velocity=(), effort=(), stamp=(5, 6), frame=''):
    msg = JointState(name=names, position=position, velocity=velocity, effort=effort)
    msg.header.frame_id = frame
    msg.header.stamp.sec, msg.header.stamp.nanosec = stamp
    return msg


def assert_same(decoder, msg):
    found = decoder.read(serialize_message(msg))
    assert found.stamp == msg.header.stamp
    assert list(found.name) == msg.name
    assert found.position.tobytes() == msg.position.tobytes()
    assert found.velocity.tobytes() == msg.velocity.tobytes()


@pytest.mark.parametrize('frame', ['', 'b', 'base', 'arm_base'])
@pytest.mark.parametrize('n', [0, 1, 2, 3])
@pytest.mark.parametrize('more', ['', 'velocity', 'effort'])
def test_numbers_that_change(ordinary, frame, n, more):
    decoder = JointStateDecoder()
    names = ['a', 'joint', 'other_joint'][:n]
    given = {more: [0.5] * n} if more else {}
    for i in range(5):
        position = [i + 0.25, -1e-300, math.nan][:n]
        msg = joint_state(names, position, stamp=(i - 2, i), frame=frame, **given)
        assert_same(decoder, msg)
        given = {key: [i + 0.5] * n for key in given}
    assert len(ordinary) == 1


def test_several_publishers(ordinary):
    decoder = JointStateDecoder()
    for i in range(5):
        assert_same(decoder, joint_state(['a', 'b'], [0.5, i]))
        assert_same(decoder, joint_state(['gripper'], [i]))
        # As many bytes, other names.
        assert_same(decoder, joint_state(['a', 'c'], [i, 0.5]))
    assert len(ordinary) == 3


def test_what_is_laid_out_otherwise_is_read_by_rclpy(ordinary):
    decoder = JointStateDecoder()
    states = (
        joint_state(['a', 'b'], [1.0, 2.0], [3.0, 4.0]),
        joint_state(['b', 'a'], [1.0, 2.0], [3.0, 4.0]),
        joint_state(['a', 'b'], [1.0, 2.0], [], [3.0, 4.0]),
        joint_state(['a', 'b'], [1.0], [2.0, 3.0, 4.0]),
        joint_state(['a', 'b'], [], [1.0, 2.0, 3.0, 4.0]),
        joint_state(['ab'], [1.0, 2.0], [3.0, 4.0], frame='abc'),
        joint_state(['a', 'c'], [1.0, 2.0], [3.0, 4.0]),
    )
    for msg in states:
        assert_same(decoder, msg)
    assert len(ordinary) == len(states)


def test_gaps_do_not_matter(ordinary):
    decoder = JointStateDecoder()
    msg = joint_state(['a', 'b'], [1.0, 2.0], frame='b')
    data = serialize_message(msg)
    # Behind the stamp: length and string of the frame, then two bytes up to the next length.
    gap = 4 + 8 + 4 + 2
    for filling in (b'\0\0', b'xy', b'\xff\xff'):
        found = decoder.read(data[:gap] + filling + data[gap + 2 :])
        assert found.name == ['a', 'b']
        assert found.position.tolist() == [1.0, 2.0]
    assert len(ordinary) == 1


def test_bytes_that_are_no_joint_state():
    decoder = JointStateDecoder()
    data = serialize_message(joint_state(['a', 'b'], [1.0, 2.0], [3.0, 4.0]))
    decoder.read(data)
    reader, q = JointStateReader(['a', 'b']), np.zeros(2)
    for wrong in (b'', data[:40], data[:12] + b'\xff' * (len(data) - 12)):
        with pytest.raises(InvalidValue, match="no 'a' in"):
            reader.read(decoder.read(wrong), q)
    reader.read(decoder.read(data), q)
    assert q.tolist() == [1.0, 2.0]


def test_other_byte_order_is_read_by_rclpy(ordinary):
    decoder = JointStateDecoder()
    big = b'\0\0\0\0' + b''.join(
        (
            (7).to_bytes(4, 'big'),
            (8).to_bytes(4, 'big'),
            (1).to_bytes(4, 'big') + b'\0\0\0\0',
            (1).to_bytes(4, 'big'),
            (2).to_bytes(4, 'big') + b'a\0\0\0',
            (1).to_bytes(4, 'big'),
            np.array([1.5], '>f8').tobytes(),
            bytes(8),
        )
    )
    for _ in range(2):
        found = decoder.read(big)
        assert (found.stamp.sec, found.stamp.nanosec) == (7, 8)
        assert (found.name, found.position.tolist()) == (['a'], [1.5])
    assert len(ordinary) == 2
