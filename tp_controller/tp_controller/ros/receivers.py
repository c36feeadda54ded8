"""Nodes that take commands without names: whether they take them for the same joints."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

from rcl_interfaces.srv import GetParameters
from rclpy.node import Node, NodeNameNonExistentError
from rclpy.topic_endpoint_info import TopicEndpointInfo

from tp_controller.errors import listed
from tp_controller.ros.commands import CommandPublisher
from tp_controller.ros.neighbours import UNNAMED

PERIOD = 0.1
"""Time [s] between two looks."""
RARELY = 1.0
"""Time [s] between two looks at the graph while it does not become clear,"""
PATIENCE = 2.0
"""and after which that is told."""
AGAIN, SELDOM = 0.5, 5.0
"""Times [s] after which a node is asked again, as its answer may be lost: at first,"""
LONG = 10.0
"""and after so long [s] without an answer."""
MOST_CALLS = 10
"""So many questions to one node without an answer are kept."""
NAMES = ('joints', 'interface_name')
"""Parameters of ros2_control's forward_command_controller, and of what derives from it."""


class Receivers:
    """Asks the nodes that subscribe to the command for their parameters.

    A message without names moves the wrong joints where its reader has them in another order,
    and a velocity is a far position where its reader takes positions. Readers that have no such
    parameters are taken as they are.

    The graph is read only after readers have come or gone, which the publisher notices: that takes
    longer the more there are, and so does a client for each. A look without such a change takes
    some microseconds.

    Parameters
    ----------
    node
        Who sends the commands.
    commands
        Publishes them; told to hold them back.
    joints
        Names of the joints, in the order of the command.
    interface
        ``velocity`` or ``position``.
    tell
        Called with `problem` when it changes.

    Attributes
    ----------
    problem
        Why nothing is sent, empty if there is no reason, or none is known yet.
    """

    def __init__(
        self,
        node: Node,
        commands: CommandPublisher,
        joints: Sequence[str],
        interface: str,
        tell: Callable[[str], object],
    ) -> None:
        self._node, self._commands = node, commands
        self._joints, self._interface = list(joints), interface
        self._tell = tell
        self.problem = ''
        self._readers: dict[bytes, _Reader] = {}
        self._known = False
        """Whether all readers were known at some time: later ones do not stop the arm."""
        self._seen: tuple[int, int] | None = None
        """What the publisher knew of its readers when the graph was read last."""
        self._changed = time.monotonic()
        self._again = -math.inf
        """When the graph is read again though nothing has changed."""
        self._unnamed = 0
        self._settled = False
        commands.block(False, True)
        self.look()

    def look(self) -> None:
        """Look who reads the command, and what they answer; to be called every `PERIOD`."""
        now = time.monotonic()
        changed = self._commands.readers != self._seen or now >= self._again
        if not changed and self._settled:
            return
        long = changed
        if changed:
            self._read_graph(now)
        for reader in self._readers.values():
            if long and self._known:
                # The arm may move: one thing that takes long at a time.
                break
            long |= reader.look(now)
        self._conclude(now)

    def close(self) -> None:
        """Ask no more."""
        for reader in self._readers.values():
            reader.close()
        self._readers.clear()

    def _read_graph(self, now: float) -> None:
        """Find the readers that are there."""
        seen = self._commands.readers
        if seen != self._seen:
            self._seen, self._changed = seen, now
        infos = self._node.get_subscriptions_info_by_topic(self._commands.topic)
        present = {bytes(info.endpoint_gid): info for info in infos}
        for gid in self._readers.keys() - present.keys():
            self._readers.pop(gid).close()
        for gid in present.keys() - self._readers.keys():
            if present[gid].node_name not in UNNAMED:
                self._readers[gid] = _Reader(self._node, present[gid], now)
        self._unnamed = len(present) - len(self._readers)
        if not present:
            # There is no arm that whoever comes next could stop.
            self._known = False
        # The publisher may know readers sooner or later than the graph does.
        if not self._unnamed and len(present) == seen[1]:
            self._again = math.inf if self._commands.notices else now + RARELY
        else:
            self._again = now + (0.0 if now < self._changed + PATIENCE else RARELY)

    def _conclude(self, now: float) -> None:
        """Hold commands back, or let them go."""
        readers = list(self._readers.values())
        waiting = [reader for reader in readers if not reader.known]
        self._known |= bool(readers) and not (waiting or self._unnamed)
        self._settled = self._known and all(reader.done for reader in readers)
        found = [text for reader in readers if (text := self._judge(reader))]
        self._commands.block(bool(found), not self._known)
        if not found and not self._known:
            late = [reader for reader in waiting if now > reader.begun + PATIENCE]
            if late:
                names = listed(sorted(reader.name for reader in late))
                found.append(f'{names} did not answer which joints it takes')
            elif now > self._changed + PATIENCE and not waiting:
                unnamed = 'the node of a reader is not known'
                found.append(unnamed if self._unnamed else 'no node reads it')
        if found or self._known:
            topic = self._commands.topic
            self._say(f'{topic}: {"; ".join(found)}: nothing is sent' if found else '')

    def _say(self, problem: str) -> None:
        if problem != self.problem:
            self.problem = problem
            self._tell(problem)

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
    """A node that reads commands.

    Parameters
    ----------
    node
        Who asks it.
    info
        Its subscription.
    now
        Steady time [s].

    Attributes
    ----------
    name
        Full name of the node.
    values
        Its parameters as far as it has answered.
    begun
        Steady time [s] since when it is known.
    known
        Whether no answer is waited for.
    done
        Whether nothing is left to do about it.
    """

    def __init__(self, node: Node, info: TopicEndpointInfo, now: float) -> None:
        self.name = f'{info.node_namespace.rstrip("/")}/{info.node_name}'
        self.values: dict[str, Any] = {}
        self.begun = now
        self.known = self.done = False
        self._node, self._place = node, (info.node_name, info.node_namespace)
        self._client: Any = None
        self._calls: list[Any] = []
        self._again = -math.inf

    def look(self, now: float) -> bool:
        """Go on asking; return whether that took long."""
        if self.done:
            return False
        if len(self.values) == len(NAMES):
            self.close()
            self.done = True
            return True
        made = self._client is None and self._make_client(now)
        if self._client is None or now < self._again or not self._client.service_is_ready():
            return made
        self._again = now + (AGAIN if now < self.begun + LONG else SELDOM)
        # One by one: a node that lacks one of them answers nothing at all to both.
        for name in NAMES:
            if len(self._calls) == MOST_CALLS:
                self._client.remove_pending_request(self._calls.pop(0))
            call = self._client.call_async(GetParameters.Request(names=[name]))
            call.add_done_callback(partial(self._keep, name))
            self._calls.append(call)
        return True

    def _make_client(self, now: float) -> bool:
        """Make a client if the node has the service; return whether it has."""
        service = f'{self.name}/get_parameters'
        try:
            services = dict(self._node.get_service_names_and_types_by_node(*self._place))
        except NodeNameNonExistentError:
            return False
        if service not in services:
            # A node makes this service before it subscribes, and it gets known in this order.
            self.known, self.done = True, now > self.begun + PATIENCE
            return False
        self.known = False
        self._client = self._node.create_client(GetParameters, service)
        return True

    def _keep(self, name: str, call: Any) -> None:
        answer = call.result()
        if answer is None or name in self.values:
            return
        values = [value.string_value or list(value.string_array_value) for value in answer.values]
        self.values[name] = values[0] if values else ''
        self.known = len(self.values) == len(NAMES)

    def close(self) -> None:
        """Ask no more."""
        if self._client is not None:
            for call in self._calls:
                self._client.remove_pending_request(call)
            self._node.destroy_client(self._client)
            self._client = None
