"""Other nodes that publish what only one may publish, or what cannot be heard."""

from __future__ import annotations

import time
from collections.abc import Sequence

from rclpy.node import Node
from rclpy.qos import ReliabilityPolicy
from rclpy.subscription import Subscription
from rclpy.topic_endpoint_info import TopicEndpointInfo

from tp_controller.ros.other_devices import OtherDevices
from tp_controller.ros.warnings import Warnings

ROUNDING = 1e-9
"""Share of a look that rounding may take."""
UNNAMED = ('_NODE_NAME_UNKNOWN_', '_CREATED_BY_BARE_DDS_APP_')
"""Names of nodes that are not known yet, and of readers and publishers without a node."""


class Neighbours:
    """Finds second publishers of the command and of the joint states.

    Parameters
    ----------
    node
        The controller's node.
    command_topic, state_topic
        Full names of the topics.
    warnings
        Where they are told.
    others
        Other devices that publish joint states of their own.
    """

    def __init__(
        self,
        node: Node,
        command_topic: str,
        state_topic: str,
        warnings: Warnings,
        others: OtherDevices,
    ) -> None:
        self._node, self._others = node, others
        self._topics = {
            command_topic: 'two controllers move one arm',
            state_topic: 'the arm jumps between two states',
        }
        self._warnings = warnings
        self._state_topic = state_topic
        self._found: dict[str, bool] = {}
        self._turn, self._due = -1, 0.0

    @property
    def alone(self) -> bool:
        """Whether one node at most publishes joint states."""
        return not self._found.get(self._state_topic, False)

    def look(self) -> None:
        """Look for them, and warn of those that are there for the second time in a row."""
        for topic, hazard in self._topics.items():
            seen, count = self._found.get(topic, False), self._node.count_publishers(topic)
            self._found[topic] = count > 1
            # Each of the other devices has a publisher of its own.
            others = self._others.count(time.monotonic()) if topic == self._state_topic else 0
            if count - others > 1 and seen:
                self._warnings.warn(topic, f'{topic} has {self._names(topic)}: {hazard}')

    def listen(self, subscriptions: Sequence[Subscription], share: float = 1.0) -> None:
        """Warn of publishers that polled subscriptions do not hear.

        A look at a topic takes some microseconds as long as all its publishers are heard.

        Parameters
        ----------
        subscriptions
            All of them.
        share
            Which share of them is looked at now; the others follow in turn.
        """
        self._due += share * len(subscriptions) + ROUNDING
        looks, self._due = divmod(self._due, 1.0)
        for _ in range(int(looks)):
            self._turn = (self._turn + 1) % len(subscriptions)
            handle = subscriptions[self._turn].handle
            there = self._node.handle.get_count_publishers(handle.get_topic_name())
            if there > handle.get_publisher_count():
                self._tell_unheard(subscriptions[self._turn])

    def _tell_unheard(self, subscription: Subscription) -> None:
        """Warn of those that do not fit; others have come just now."""
        topic, known = str(subscription.topic_name), _type_name(subscription.msg_type)
        for info in self._node.get_publishers_info_by_topic(topic):
            if info.topic_type != known:
                self._warnings.warn(
                    f'{topic} type',
                    f'{topic}: {_name(info)} publishes {info.topic_type}, which is not '
                    f'heard; it takes {known}',
                )
            elif info.qos_profile.reliability == ReliabilityPolicy.BEST_EFFORT:
                self._warnings.warn(
                    f'{topic} reliability',
                    f'{topic}: {_name(info)} publishes as best effort, which is not heard; '
                    f'reliable is',
                )

    def _names(self, topic: str) -> str:
        names = publishers(self._node, topic)
        return f'{len(names)} publishers, {", ".join(names)}'


def publishers(node: Node, topic: str) -> list[str]:
    """Full names of the nodes that publish a topic, in order."""
    return sorted(_name(info) for info in node.get_publishers_info_by_topic(topic))


def _name(info: TopicEndpointInfo) -> str:
    """Full name of a publisher's node; others learn it a moment after its topics."""
    if info.node_name in UNNAMED:
        return 'a node whose name is not known'
    return f'{info.node_namespace.rstrip("/")}/{info.node_name}'


def _type_name(message_type: type) -> str:
    """Name of a message type as ROS tells it: package/msg/Name."""
    return f'{message_type.__module__.split(".")[0]}/msg/{message_type.__name__}'
