"""Nodes that take commands without names: whether they take them for the same joints."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from typing import Any

from rcl_interfaces.srv import GetParameters
from rclpy.node import Node

from tp_controller.errors import listed
from tp_controller.ros.warnings import Warnings

PERIOD = 0.1
"""Time [s] between two looks."""
AGAIN = 0.5
"""Time [s] after which a node is asked again: its answer may be lost at first."""
PATIENCE = 2.0
"""Time [s] without an answer that is told."""
UNKNOWN = '_UNKNOWN_'
"""In the name of a node that is not known yet."""
SUBJECT = 'receivers'
NAMES = ('joints', 'interface_name')
"""Parameters of ros2_control's forward_command_controller, and of what derives from it."""


class Receivers:
    """Asks the nodes that subscribe to the command for their parameters.

    A message without names moves the wrong joints where its reader has them in another order,
    and a velocity is a far position where its reader takes positions. Readers that have no such
    parameters are taken as they are.

    Parameters
    ----------
    node
        The controller's node.
    topic
        Full name of the command's topic.
    joints
        Names of the joints, in the order of the command.
    interface
        ``velocity`` or ``position``.
    warnings
        Where it is told what does not fit.
    block
        Called with whether commands have to be held back, and whether that is not known yet.
    """

    def __init__(
        self,
        node: Node,
        topic: str,
        joints: Sequence[str],
        interface: str,
        warnings: Warnings,
        block: Callable[[bool, bool], object],
    ) -> None:
        self._node, self._topic = node, topic
        self._joints, self._interface = list(joints), interface
        self._warnings, self._block = warnings, block
        self._readers: dict[bytes, _Reader] = {}
        self._known = False
        """Whether all readers were known at some time: later ones do not stop the arm."""
        block(False, True)
        self.look()

    def look(self) -> None:
        """Look who reads the command, and what they answer."""
        infos = self._node.get_subscriptions_info_by_topic(self._topic)
        present = {bytes(info.endpoint_gid): info for info in infos}
        for gid in self._readers.keys() - present.keys():
            self._readers.pop(gid).close(self._node)
        for gid in present.keys() - self._readers.keys():
            info = present[gid]
            if UNKNOWN not in info.node_name:
                self._readers[gid] = _Reader(self._node, info.node_name, info.node_namespace)
        open_ones = [reader for reader in self._readers.values() if not reader.look()]
        named = len(self._readers) == len(present)
        self._known |= bool(self._readers) and named and not open_ones
        found = [text for reader in self._readers.values() if (text := self._judge(reader))]
        for text in found:
            self._warnings.warn(SUBJECT, f'{self._topic}: {text}: nothing is sent', lasting=True)
        if not found and self._known:
            self._warnings.clear(SUBJECT)
        self._block(bool(found), not self._known)
        now = time.monotonic()
        silent = [reader.name for reader in open_ones if reader.begun < now - PATIENCE]
        if silent and not self._known and not found:
            text = f'{listed(silent)} did not answer which joints it takes'
            self._warnings.warn(SUBJECT, f'{self._topic}: {text}: nothing is sent', lasting=True)

    def _judge(self, reader: _Reader) -> str:
        """What does not fit; empty if all does."""
        joints, interface = (reader.values.get(name) for name in NAMES)
        if isinstance(interface, str) and interface and interface != self._interface:
            return (
                f'{reader.name} has the interface_name {interface}, command.type gives '
                f'{self._interface}'
            )
        if joints and joints != self._joints:
            return (
                f'{reader.name} has the joints {listed(joints)}, robot.joints is '
                f'{listed(self._joints)}'
            )
        return ''


class _Reader:
    """A node that reads commands."""

    def __init__(self, node: Node, name: str, namespace: str) -> None:
        self.name, self.values = f'{namespace.rstrip("/")}/{name}', dict[str, Any]()
        service = f'{self.name}/get_parameters'
        # A node makes this service before it subscribes, and it gets known in this order.
        services = node.get_service_names_and_types_by_node(name, namespace)
        self._silent = service not in dict(services)
        self._client: Any = node.create_client(GetParameters, service)
        self._calls: list[Any] = []
        self._answered = False
        self.begun, self._again = time.monotonic(), -math.inf

    def look(self) -> bool:
        """Go on asking; return whether nothing more is waited for."""
        now = time.monotonic()
        if self._answered or now < self._again:
            return self._answered
        if not self._client.service_is_ready():
            return self._silent
        self._again = now + AGAIN
        call = self._client.call_async(GetParameters.Request(names=list(NAMES)))
        call.add_done_callback(self._keep)
        self._calls.append(call)
        return False

    def _keep(self, call: Any) -> None:
        answer = call.result()
        if answer is None or self._answered:
            return
        self._answered = True
        for name, value in zip(NAMES, answer.values, strict=False):
            self.values[name] = value.string_value or list(value.string_array_value)
        for other in self._calls:
            self._client.remove_pending_request(other)

    def close(self, node: Node) -> None:
        """Ask no more."""
        node.destroy_client(self._client)
