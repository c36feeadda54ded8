"""What the ``ros2`` command does with topics, services, actions and parameters, through rclpy.

The command itself has no wheel. Texts are read as it reads them, and quality of service is chosen
as it chooses it.
"""

import importlib
import re
import shlex

import yaml
from lifecycle_msgs.srv import ChangeState, GetState
from rclpy.action import ActionClient
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

from tp_interfaces.action import Reach
from tp_interfaces.msg import ControllerState

NEEDED = {'activate': 'inactive', 'configure': 'unconfigured', 'deactivate': 'active'}
"""State in which a transition is there."""
WAYS = {
    ('active', 'inactive'): ('deactivate',),
    ('active', 'unconfigured'): ('deactivate', 'cleanup'),
    ('inactive', 'active'): ('activate',),
    ('inactive', 'unconfigured'): ('cleanup',),
    ('unconfigured', 'inactive'): ('configure',),
    ('unconfigured', 'active'): ('configure', 'activate'),
}


class Ros2:
    """Does what commands say, and raises AssertionError where it fails.

    Parameters
    ----------
    client
        `tp_sim.harness.Client` of the domain.
    """

    def __init__(self, client):
        self.client, self.node = client, client.node
        # Hundreds of states a second are made for nobody else.
        client.ignore_state()

    def __call__(self, command, outcome=Reach.Result.REACHED):
        words = shlex.split(command, comments=True)[1:]
        plain = [word for word in words if not word.startswith('-')]
        kind, verb, *rest = plain
        if kind == 'topic' and verb in ('echo', 'hz'):
            self._hear(rest[0], words)
        elif kind == 'topic' and verb == 'info':
            self.client.wait_for(
                lambda: self.node.count_publishers(rest[0]) == 1, f'a publisher of {rest[0]}'
            )
        elif kind == 'topic' and verb == 'pub':
            self._publish(*rest)
        elif kind == 'service':
            self._serve(*rest)
        elif kind == 'action':
            self._act(*rest, outcome=outcome)
        elif kind == 'param' and verb == 'set':
            self.client.set_parameters(rest[0].strip('/'), {rest[1]: yaml.safe_load(rest[2])})
        elif kind == 'lifecycle':
            self.bring_to(NEEDED.get(rest[-1], self.lifecycle()))
            if verb == 'set':
                self._change_state(rest[1])
        else:
            assert (kind, verb) in {('node', 'list'), ('topic', 'list')}, command

    def _hear(self, topic, words):
        topic = '/' + topic.lstrip('/')
        self.client.wait_for(lambda: self.node.count_publishers(topic), f'a publisher of {topic}')
        publishers = self.node.get_publishers_info_by_topic(topic)
        heard = []
        subscription = self.node.create_subscription(
            _class(publishers[0].topic_type), topic, heard.append, quality(words, publishers)
        )
        self.client.wait_for(lambda: heard, f'a message of {topic}', 20.0)
        self.node.destroy_subscription(subscription)
        if '--field' in words:
            assert hasattr(heard[0], words[words.index('--field') + 1])

    def _publish(self, topic, kind, text):
        task = topic.split('/')[2]
        before = now = self.task(task)
        self.client.publish(topic, filled(_class(kind)(), yaml.safe_load(text)))
        while now.accepted_goals == before.accepted_goals:
            assert now.rejected_goals == before.rejected_goals, now.message
            now = self.task(task)

    def state(self):
        """A state of the controller from now on."""
        heard = []
        subscription = self.node.create_subscription(
            ControllerState, 'tp_controller/state', heard.append, 1
        )
        self.client.wait_for(lambda: heard, 'a state of the controller')
        self.node.destroy_subscription(subscription)
        return heard[-1]

    def task(self, name):
        """State of a task from now on."""
        return next(task for task in self.state().tasks if task.name == name)

    def _serve(self, name, kind, text='{}'):
        service = _class(kind)
        request = filled(service.Request(), yaml.safe_load(text))
        answer = self.client.call(service, name, request)
        assert answer.success, answer.message

    def _act(self, name, kind, text, outcome):
        action = _class(kind)
        goal = filled(action.Goal(), yaml.safe_load(text))
        client = ActionClient(self.node, action, name)
        self.client.wait_for(client.server_is_ready, name)
        sent = client.send_goal_async(goal)
        self.client.wait_for(sent.done, f'an answer of {name}')
        result = sent.result().get_result_async()
        self.client.wait_for(result.done, f'the result of {name}')
        found = result.result().result
        assert found.outcome == outcome, found.message

    def lifecycle(self):
        """State of the controller as a managed node."""
        answer = self.client.call(GetState, 'tp_controller/get_state', GetState.Request())
        return answer.current_state.label

    def bring_to(self, state):
        """Bring the controller to a state."""
        for label in WAYS.get((self.lifecycle(), state), ()):
            self._change_state(label)

    def _change_state(self, label):
        request = ChangeState.Request()
        request.transition.label = label
        assert self.client.call(ChangeState, 'tp_controller/change_state', request).success, label


def _class(name):
    """Class of an interface such as std_msgs/msg/String."""
    package, kind, leaf = name.split('/')
    return getattr(importlib.import_module(f'{package}.{kind}'), leaf)


def quality(words, publishers):
    """Quality of service of ``ros2 topic echo``."""
    options = {words[i]: words[i + 1] for i in range(len(words)) if words[i].startswith('--qos-')}
    if options:
        # Any option puts what is meant for sensors in the place of what fits the publishers.
        found = {'reliability': 'best_effort', 'durability': 'volatile'}
        found.update({key[6:]: value for key, value in options.items()})
        reliable = found['reliability'] == 'reliable'
        kept = found['durability'] == 'transient_local'
    else:
        qualities = [one.qos_profile for one in publishers]
        reliable = all(one.reliability == ReliabilityPolicy.RELIABLE for one in qualities)
        kept = all(one.durability == DurabilityPolicy.TRANSIENT_LOCAL for one in qualities)
    return QoSProfile(
        depth=5,
        reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if kept else DurabilityPolicy.VOLATILE,
    )


def filled(message, values):
    """A message with values by field, level by level, as YAML gives them."""
    types = message.get_fields_and_field_types()
    for key, value in (values or {}).items():
        assert key in types, f'{type(message).__name__} has no {key}'
        inner = re.search(r'(\w+)/(\w+)', types[key])
        if inner:
            make = _class(f'{inner[1]}/msg/{inner[2]}')
            found = [filled(make(), part) for part in value] if 'sequence' in types[key] else None
            setattr(message, key, filled(make(), value) if found is None else found)
        elif 'double' in types[key] or 'float' in types[key]:
            numbers = [float(part) for part in value] if isinstance(value, list) else float(value)
            setattr(message, key, numbers)
        else:
            setattr(message, key, value)
    return message
