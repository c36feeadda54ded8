"""Readers of commands without names are asked what they take, at little cost for the cycle."""

import time
from types import SimpleNamespace

import pytest
from rcl_interfaces.msg import ParameterValue
from rcl_interfaces.srv import GetParameters
from rclpy.executors import SingleThreadedExecutor
from std_msgs.msg import Float64MultiArray

from tp_controller.ros import receivers
from tp_controller.ros.commands import CommandPublisher
from tp_controller.ros.receivers import Receivers
from tp_sim.harness import Client, PrivateDomain
from tp_sim.harness.messenger import TIMEOUT

ROBOT = SimpleNamespace(joints=['a', 'b'], n=2, base_frame='base')
TOPIC = 'joint_velocity_command'


class Counted:
    """A node that counts what takes long: readings of the graph, and clients."""

    def __init__(self, node):
        self.node, self.readings, self.clients = node, 0, 0

    def __getattr__(self, name):
        return getattr(self.node, name)

    def get_subscriptions_info_by_topic(self, topic):
        self.readings += 1
        return self.node.get_subscriptions_info_by_topic(topic)

    def create_client(self, *arguments):
        self.clients += 1
        return self.node.create_client(*arguments)


class Scene:
    """Somebody who sends commands, and readers of them."""

    def __init__(self):
        self.domain = PrivateDomain()
        self._client = Client(self.domain)
        self._executor = SingleThreadedExecutor(context=self._client._context)
        self.node = Counted(self.make_node('sender'))
        self.told = []
        self.commands = CommandPublisher(self.node, ROBOT, 'float64_multi_array')
        self.receivers = Receivers(
            self.node, self.commands, ROBOT.joints, 'velocity', self.told.append
        )

    def make_node(self, name):
        node = self._client.make_node(name)
        self._executor.add_node(node)
        return node

    def read(self, name, joints, declared=('joints', 'interface_name')):
        """Make a node that reads commands."""
        node = self.make_node(name)
        values = {
            'joints': ParameterValue(type=9, string_array_value=joints),
            'interface_name': ParameterValue(type=4, string_value='velocity'),
        }

        def answer(request, response):
            # As nodes do: nothing at all if one of the names is none of theirs.
            if set(request.names) <= set(declared):
                response.values = [values[name] for name in request.names]
            return response

        node.create_service(GetParameters, f'{name}/get_parameters', answer)
        node.create_subscription(Float64MultiArray, TOPIC, lambda _: None, 1)
        return node

    def look_until(self, condition):
        """Look until a condition holds; return what each look took long for."""
        costs, end = [], time.monotonic() + TIMEOUT
        while True:
            before = self.node.readings, self.node.clients
            self.receivers.look()
            costs.append((self.node.readings - before[0], self.node.clients - before[1]))
            if condition():
                return costs
            assert time.monotonic() < end
            self._executor.spin_once(timeout_sec=0.01)

    def close(self):
        self._executor.shutdown()
        self._client.close()
        self.domain.close()


@pytest.fixture
def scene():
    scene = Scene()
    yield scene
    scene.close()


def test_nothing_is_looked_up_while_the_readers_stay_the_same(scene, monkeypatch):
    with monkeypatch.context() as patch:
        patch.setattr(receivers, 'PATIENCE', 0.0)
        scene.look_until(lambda: scene.receivers.problem)
    assert scene.told == [f'/{TOPIC}: no node reads it: nothing is sent']
    reader = scene.read('first', ROBOT.joints)
    scene.look_until(lambda: scene.receivers._settled)
    assert not scene.commands.withheld
    assert scene.told[-1] == ''
    # The clients are gone, too: an executor looks at each of them.
    assert not list(scene.node.node.clients)

    before = scene.node.readings, scene.node.clients
    for _ in range(100):
        scene.receivers.look()
    assert (scene.node.readings, scene.node.clients) == before

    # Several at once do not hold up a look, and another one in the place of one is noticed.
    for name in ('second', 'third', 'fourth'):
        scene.read(name, ROBOT.joints)
    costs = scene.look_until(
        lambda: scene.receivers._settled and len(scene.receivers._readers) == 4
    )
    assert max(sum(cost) for cost in costs) == 1
    reader.destroy_node()
    scene.read('wrong', ROBOT.joints[::-1])
    scene.look_until(lambda: scene.receivers.problem)
    assert scene.commands.withheld
    assert scene.told[-1] == (
        f'/{TOPIC}: /wrong has the joints b, a, robot.joints is a, b: nothing is sent'
    )


def test_a_reader_with_one_of_the_parameters_is_asked_for_it(scene):
    reader = scene.read('some', ROBOT.joints[::-1], declared=['joints'])
    scene.look_until(lambda: scene.receivers.problem)
    assert scene.told == [
        f'/{TOPIC}: /some has the joints b, a, robot.joints is a, b: nothing is sent'
    ]
    # Whoever comes when nobody is left has to answer before the first command.
    reader.destroy_node()
    scene.look_until(lambda: not scene.receivers._readers)
    assert scene.commands.waiting
    scene.read('none', [], declared=[])
    scene.look_until(lambda: not scene.commands.withheld)
    assert scene.told[-1] == ''


def test_nothing_of_them_stays_after_a_close(scene):
    reader = scene.make_node('silent')
    reader.create_service(GetParameters, 'silent/get_parameters', lambda _, response: response)
    reader.create_subscription(Float64MultiArray, TOPIC, lambda _: None, 1)
    scene.look_until(lambda: scene.node.clients)
    scene.receivers.close()
    assert not list(scene.node.node.clients)
