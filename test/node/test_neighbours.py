"""Publishers that are not heard are found, at little cost for the cycle."""

import time
from array import array

import pytest
from builtin_interfaces.msg import Time
from geometry_msgs.msg import PointStamped, PoseStamped
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState

from tp_controller.ros.joint_states import JointStateValues
from tp_controller.ros.neighbours import Neighbours
from tp_controller.ros.other_devices import OtherDevices
from tp_controller.ros.polled import subscribe
from tp_controller.ros.warnings import Warnings
from tp_sim.harness import Client, PrivateDomain

TOPICS = [f'task_{i}/goal' for i in range(10)]


class Counted:
    """A node that counts what it looks at in the graph."""

    def __init__(self, node):
        self.node, self.readings, self.looks = node, 0, []
        self.handle = self

    def __getattr__(self, name):
        return getattr(self.node, name)

    def get_count_publishers(self, topic):
        self.looks.append(topic)
        return self.node.handle.get_count_publishers(topic)

    def get_publishers_info_by_topic(self, topic):
        self.readings += 1
        return self.node.get_publishers_info_by_topic(topic)


class Scene:
    """A node with ten inputs, and one that publishes to them."""

    def __init__(self):
        self.domain = PrivateDomain()
        self.client = Client(self.domain)
        self.node = Counted(self.client.make_node('listener'))
        # One participant has one type for a topic.
        self.speaker = Client(self.domain)
        self.other = self.speaker.make_node('speaker')
        self.inputs = [subscribe(self.node.node, PointStamped, topic, 10) for topic in TOPICS]
        self.warnings = Warnings(lambda _: None, lambda _: None)
        self.others = OtherDevices(['joint_1'])
        self.neighbours = Neighbours(
            self.node, '/command', '/joint_states', self.warnings, self.others
        )

    def publish(self, message=PointStamped, **qos):
        for topic in TOPICS:
            self.other.create_publisher(message, topic, QoSProfile(depth=1, **qos))
        # The name of a publisher's node comes a moment after the publisher.
        self.client.wait_for(lambda: all(map(self.names, TOPICS)), 'publishers with their names')

    def names(self, topic):
        infos = self.node.node.get_publishers_info_by_topic(f'/{topic}')
        return [info for info in infos if info.node_name == 'speaker']

    def close(self):
        for node in (self.node.node, self.other):
            node.destroy_node()
        self.client.close()
        self.speaker.close()
        self.domain.close()


@pytest.fixture
def scene():
    made = Scene()
    yield made
    made.close()


def test_publishers_that_are_heard_cost_a_look_at_one_topic_at_a_time(scene):
    scene.publish()
    heard = [topic.handle.get_publisher_count for topic in scene.inputs]
    scene.client.wait_for(lambda: all(count() == 1 for count in heard), 'matches')
    for number in range(1, 81):
        scene.neighbours.listen(scene.inputs, 0.025)
        assert len(scene.node.looks) == number // 4
    assert scene.node.looks == 2 * [f'/{topic}' for topic in TOPICS]
    assert scene.node.readings == 0
    assert not scene.warnings.message


@pytest.mark.parametrize(
    ('spoken', 'told'),
    [
        ({'message': PoseStamped}, 'publishes geometry_msgs/msg/PoseStamped, which is not heard'),
        ({'reliability': ReliabilityPolicy.BEST_EFFORT}, 'publishes as best effort'),
    ],
)
def test_all_that_are_not_heard_are_told_after_one_turn(scene, spoken, told):
    scene.publish(**spoken)
    for number in range(1, 11):
        scene.neighbours.listen(scene.inputs, 0.1)
        assert scene.node.readings == number
    for topic in TOPICS:
        assert f'/{topic}: /speaker {told}' in scene.warnings.message
    scene.neighbours.listen([])


@pytest.mark.parametrize(('names', 'told'), [(['gripper'], False), (['joint_1'], True)])
def test_publishers_of_other_joints_do_not_make_the_arm_jump(scene, names, told):
    for _ in range(2):
        scene.other.create_publisher(JointState, '/joint_states', 1)
    scene.client.wait_for(lambda: scene.node.count_publishers('/joint_states') == 2, 'both')
    for _ in range(2):
        msg = JointStateValues(Time(), names, array('d', [0.0]), array('d'))
        assert scene.others.sent(msg, time.monotonic()) is not told
        scene.neighbours.look()
    assert ('the arm jumps between two states' in scene.warnings.message) is told
    assert not scene.neighbours.alone
