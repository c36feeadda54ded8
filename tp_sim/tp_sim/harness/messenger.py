"""The harness's own node: publishes, listens, calls services, waits for conditions."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from typing import Any

import rclpy
from rcl_interfaces.srv import SetParametersAtomically
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile
from rclpy.subscription import Subscription
from std_msgs.msg import String

from tp_controller.ros.robot_node import TOPIC, TOPIC_QOS
from tp_interfaces.srv import AddTask, Change, RemoveTask, Step
from tp_sim.harness.domain import PrivateDomain
from tp_sim.harness.errors import GoalRejected, HarnessError

TIMEOUT = 60.0
"""Longest wait [s] for an answer, generous for a loaded machine."""
LOST = 10.0
"""Time [s] after which a service is called once more."""
ONCE = (AddTask, Change, RemoveTask, Step)
"""Services that do something else when they are called again."""


class Messenger:
    """Talks to nodes on a private domain.

    Parameters
    ----------
    domain
        The domain.
    namespace
        Namespace of the robot's nodes.
    alive
        Called while waiting; raises `HarnessError` when waiting is in vain.
    """

    def __init__(
        self, domain: PrivateDomain, namespace: str = '', alive: Callable[[], None] | None = None
    ) -> None:
        self._alive = alive or (lambda: None)
        self._context = Context()
        self._namespace = namespace
        with domain.entered():
            rclpy.init(args=[], context=self._context, domain_id=domain.number)
            self.node: Node = self.make_node('harness')
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self.node)
        self._publishers: dict[str, Publisher] = {}
        self._service_clients: dict[str, Any] = {}

    def make_node(self, name: str) -> Node:
        """Make a node of that name on the domain, which nobody spins."""
        return rclpy.create_node(
            name,
            context=self._context,
            namespace=self._namespace,
            use_global_arguments=False,
            start_parameter_services=False,
        )

    def close(self) -> None:
        """Leave the domain."""
        self._executor.shutdown()
        self.node.destroy_node()
        rclpy.try_shutdown(context=self._context)

    def wait_for(self, condition: Callable[[], bool], what: str, timeout: float = TIMEOUT) -> None:
        """Handle messages until a condition holds.

        Raises
        ------
        HarnessError
            If it does not within ``timeout`` [s].
        """
        end = time.monotonic() + timeout
        while not condition():
            if time.monotonic() > end:
                raise HarnessError(f'waited {timeout:g} s in vain for {what}')
            self._alive()
            self._executor.spin_once(timeout_sec=0.1)

    def spin_for(self, seconds: float) -> None:
        """Handle messages for a time [s]."""
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0.0:
            self._alive()
            self._executor.spin_once(timeout_sec=min(left, 0.1))

    def subscribe(
        self, message_type: type, topic: str, callback: Callable[[Any], None]
    ) -> Subscription:
        """Call back for every message of a topic, none of them dropped here."""
        return self.node.create_subscription(message_type, topic, callback, QoSProfile(depth=5000))

    def collect(self, message_type: type, topic: str) -> list[Any]:
        """List to which every further message of a topic is appended."""
        messages: list[Any] = []
        self.subscribe(message_type, topic, messages.append)
        return messages

    def publish(self, topic: str, msg: Any) -> None:
        """Publish to a topic once somebody listens to it."""
        if topic not in self._publishers:
            self._publishers[topic] = self.node.create_publisher(type(msg), topic, 100)
        publisher = self._publishers[topic]
        self.wait_for(lambda: publisher.get_subscription_count() > 0, f'a listener to {topic}')
        publisher.publish(msg)

    def publish_description(self, text: str) -> None:
        """Publish a URDF as ``robot_description``; who comes later gets it too."""
        if TOPIC not in self._publishers:
            self._publishers[TOPIC] = self.node.create_publisher(String, TOPIC, TOPIC_QOS)
        self._publishers[TOPIC].publish(String(data=text))

    def call(self, service_type: Any, name: str, request: Any, timeout: float = TIMEOUT) -> Any:
        """Call a service and return its response.

        A first answer is lost if its sender does not know its receiver yet, on a busy machine. So
        what may be asked for twice is.

        Raises
        ------
        HarnessError
            If there is none or it does not answer in time.
        """
        if name not in self._service_clients:
            self._service_clients[name] = self.node.create_client(service_type, name)
        client = self._service_clients[name]
        self.wait_for(client.service_is_ready, f'the service {name}', timeout)
        begin = time.monotonic()
        calls = [client.call_async(request)]

        def done() -> bool:
            late = time.monotonic() > begin + LOST * len(calls)
            if late and service_type not in ONCE:
                calls.append(client.call_async(request))
            return any(call.done() for call in calls)

        self.wait_for(done, f'an answer of {name}', timeout)
        return next(call for call in calls if call.done()).result()

    def set_parameters(self, node: str, values: Mapping[str, Any]) -> None:
        """Set parameters of a node, all of them or none.

        Raises
        ------
        GoalRejected
            If the node refuses, with its reason.
        """
        request = SetParametersAtomically.Request()
        request.parameters = [
            Parameter(name, value=value).to_parameter_msg() for name, value in values.items()
        ]
        service = f'{node}/set_parameters_atomically'
        result = self.call(SetParametersAtomically, service, request).result
        if not result.successful:
            raise GoalRejected(result.reason)
