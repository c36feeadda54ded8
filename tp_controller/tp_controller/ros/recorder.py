"""Takes what a controller hears and says, as bytes, into a recording."""

from __future__ import annotations

import platform
import time
from collections.abc import Callable, Iterator
from importlib.metadata import PackageNotFoundError, version
from typing import Any, NamedTuple

from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.serialization import serialize_message
from rclpy.topic_endpoint_info import TopicEndpointInfo
from std_msgs.msg import String

from tp_controller.config import describe_robot, parameter_text, read_parameters
from tp_controller.errors import InvalidValue, TaskPriorityError
from tp_controller.recording import RecordingWriter
from tp_controller.recording.writer import ABOUT, DESCRIPTION, FROM, NODE, OTHER, PARAMETERS, TO
from tp_controller.ros.message_definitions import full_definition, message_class
from tp_controller.ros.polled import subscribe, taker
from tp_controller.ros.remote_parameters import RemoteParameters
from tp_controller.ros.robot_node import TOPIC, TOPIC_QOS

LOOK_PERIOD = 0.1
"""Time [s] between two looks for topics that have come."""
FLUSH_PERIOD = 1.0
"""Time [s] between two writes to the disk."""
DEPTH = 2000
"""Messages of a topic that wait while the process is not scheduled: 2 s at 1 kHz."""
DESCRIPTION_TYPE = 'std_msgs/msg/String'
STATE = 'tp_interfaces/msg/ControllerState'
EVENTS, EVENTS_TYPE = '/parameter_events', 'rcl_interfaces/msg/ParameterEvent'
LIBRARIES = ('numpy', 'pin', 'numba', 'daqp')


class _Topic(NamedTuple):
    number: int
    subscription: Any
    take: Callable[[], tuple[bytes, dict[str, Any]] | None]


class Recorder:
    """Records every topic that a controller publishes or listens to, and its parameters.

    Topics are found in the graph, whatever namespace or remapping they have, also those that
    come later. Messages are taken as bytes: nobody makes them anew.

    Parameters
    ----------
    node
        Listens; nobody else spins it.
    controller
        Name of the controller's node, full or in the node's namespace.
    writer
        Where it goes.
    lossless
        Whether the controller has to send again what gets lost on the way. That takes a tenth of
        its cpu time at 500 Hz; on one machine nothing gets lost while the recorder runs.
    """

    def __init__(
        self, node: Node, controller: str, writer: RecordingWriter, lossless: bool = False
    ) -> None:
        self._node, self._writer, self._lossless = node, writer, lossless
        # As a topic the name gets the namespace; a node's name has no method for that.
        self.controller = node.resolve_topic_name(controller)
        namespace, _, self._name = self.controller.rpartition('/')
        self._namespace = namespace or '/'
        self._executor = SingleThreadedExecutor(context=node.context)
        self._executor.add_node(node)
        self._parameters = RemoteParameters(node, self.controller)
        self._topics: dict[str, _Topic] = {}
        self._failed: dict[str, str] = {}
        self._look_at = self._flush_at = self._spin_at = 0.0
        self._described = self._drawable = False
        self._description = ''
        self._states: set[int] = set()
        """Numbers of topics with the controller's state."""
        self._tried: str | None = None
        self._description_topic = f'{namespace}/{TOPIC}'
        self._subscription = node.create_subscription(
            String, self._description_topic, self._on_description, TOPIC_QOS
        )
        self._add(EVENTS, EVENTS_TYPE, OTHER)

    @property
    def seen(self) -> bool:
        """Whether any message of the controller's state is in the recording."""
        return any(self._writer.count(number) for number in self._states)

    @property
    def ready(self) -> bool:
        """Whether the controller's parameters and a state of it are in the recording."""
        return self._described and self.seen

    def take_notes(self) -> Iterator[str]:
        """What cannot be recorded, and why; each once."""
        while self._failed:
            topic, why = self._failed.popitem()
            yield f'{topic} is not recorded: {why}'
            self._topics.setdefault(topic, _Topic(0, None, _nothing))

    def work(self) -> bool:
        """Record what waits; look for topics from time to time.

        Returns
        -------
        bool
            Whether anything waited.
        """
        now = time.monotonic()
        if now >= self._look_at:
            self._look_at = now + LOOK_PERIOD
            self._look()
        found = False
        for topic in self._topics.values():
            # Not for ever: others wait as well.
            for _ in range(DEPTH):
                taken = topic.take()
                if taken is None:
                    break
                data, info = taken
                received = time.time_ns()
                sent = info.get('source_timestamp') or received
                self._writer.write(topic.number, bytes(data), received, sent)
                found = True
        if now >= self._spin_at:
            # Answers come at the beginning; later there is little to hear.
            self._spin_at = now + (LOOK_PERIOD if self._described else 0.0)
            self._executor.spin_once(timeout_sec=0.0)
            self._parameters.work()
        if self._parameters.complete and not self._described:
            self._describe()
        if self._described and not self._drawable and self._description != self._tried:
            self._attach_robot()
        if now >= self._flush_at:
            self._flush_at = now + FLUSH_PERIOD
            self._writer.flush()
        return found

    def finish(self) -> None:
        """Record the rest; to be called once, before the writer is closed."""
        self.work()
        if not self._described and self._parameters.values:
            self._describe()
            self._attach_robot()
        self._executor.shutdown()

    def _look(self) -> None:
        own = (self._name, self._namespace)
        graph = self._node
        if own not in graph.get_node_names_and_namespaces():
            return
        directions = (
            (FROM, graph.get_publisher_names_and_types_by_node),
            (TO, graph.get_subscriber_names_and_types_by_node),
        )
        for direction, ask in directions:
            for topic, types in ask(*own):
                # What actions are made of has no file for its definition.
                if topic not in self._topics and '/_' not in topic:
                    self._try(topic, types[0], direction)
        description = self._description_topic
        if description not in self._topics and graph.count_publishers(description):
            self._try(description, DESCRIPTION_TYPE, OTHER)

    def _try(self, topic: str, message_type: str, direction: str) -> None:
        if topic in self._failed:
            return
        try:
            self._add(topic, message_type, direction)
        except InvalidValue as error:
            self._failed[topic] = str(error)

    def _add(self, topic: str, message_type: str, direction: str) -> None:
        kind, definition = message_class(message_type), full_definition(message_type)
        publishers = self._node.get_publishers_info_by_topic(topic)
        # The acknowledgements of a reliable subscription are work for who publishes.
        quick = direction == FROM and not self._lossless
        qos = _fitting(publishers, quick)
        subscription = subscribe(self._node, kind, topic, qos, raw=True)
        offered = '\n'.join(_qos_text(publisher.qos_profile) for publisher in publishers)
        number = self._writer.add_topic(topic, message_type, definition, offered, direction)
        self._topics[topic] = _Topic(number, subscription, taker(subscription))
        if message_type == STATE and direction == FROM:
            self._states.add(number)

    def _on_description(self, msg: String) -> None:
        self._description = msg.data

    def _describe(self) -> None:
        """Attach the parameters as they are at the beginning."""
        self._described = True
        writer = self._writer
        text = parameter_text(self._parameters.values, self._name)
        writer.describe(ABOUT, {NODE: self.controller, **_versions()})
        writer.attach(PARAMETERS, 'application/yaml', text)

    def _attach_robot(self) -> None:
        """Attach the URDF, if it is known: a controller may still wait for its robot."""
        self._tried = self._description
        try:
            values = read_parameters(self._parameters.values)
            urdf = describe_robot(values, self._description or None)
        except TaskPriorityError:
            return
        self._drawable = True
        writer = self._writer
        writer.attach(DESCRIPTION, 'application/xml', urdf)
        if self._description_topic not in self._topics:
            # For what draws the robot from this topic alone; nobody publishes it here.
            number = writer.add_topic(
                self._description_topic, DESCRIPTION_TYPE, full_definition(DESCRIPTION_TYPE)
            )
            now = time.time_ns()
            writer.write(number, serialize_message(String(data=urdf)), now, now)
            self._topics[self._description_topic] = _Topic(number, None, _nothing)


def _nothing() -> None:
    """Stand in for a topic that nobody listens to."""


def _fitting(publishers: list[TopicEndpointInfo], quick: bool) -> QoSProfile:
    """Quality of service that every publisher of a topic can offer; `quick`: no repeats."""
    profiles = [publisher.qos_profile for publisher in publishers]
    reliable = all(p.reliability == ReliabilityPolicy.RELIABLE for p in profiles)
    reliable = reliable and not quick
    kept = bool(profiles) and all(
        p.durability == DurabilityPolicy.TRANSIENT_LOCAL for p in profiles
    )
    return QoSProfile(
        depth=DEPTH,
        reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if kept else DurabilityPolicy.VOLATILE,
    )


def _qos_text(profile: QoSProfile) -> str:
    """Quality of service as rosbag2 writes it."""
    return (
        f'- history: {profile.history.name.lower()}\n'
        f'  depth: {profile.depth}\n'
        f'  reliability: {profile.reliability.name.lower()}\n'
        f'  durability: {profile.durability.name.lower()}'
    )


def _versions() -> dict[str, str]:
    """What the results may depend on in their last bits."""
    found = {'machine': platform.machine(), 'python': platform.python_version()}
    for library in LIBRARIES:
        try:
            found[library] = version(library)
        except PackageNotFoundError:
            continue
    return found
