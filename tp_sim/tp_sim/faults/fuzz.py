"""Malformed messages, parameters and service calls for any node, found by asking the graph.

Nothing is sent that could be meant: numbers that are not finite, texts that name nothing, arrays
of wrong lengths, bytes that are no message, parameters of other types. Services without arguments
and those that only take a switch have nothing that could be malformed and are left out, as are
transitions of a managed node that exist.
"""

from __future__ import annotations

import importlib
import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import GetParameters, ListParameters, SetParameters

from tp_sim.harness import Client

TEXTS = (
    '',
    '?',
    'no_such_thing',
    '/' * 300,
    'a' * 10_000,
    '{unclosed: [',
    '!!python/object:os.system {}',
    '\u0001\u007f',
    'null',
    '../../../nowhere/x.yaml',
    '- 1\n- 2',
    '{tasks: 3}',
)
NUMBERS = (math.nan, math.inf, -math.inf)
NOT_FUZZED = ('std_srvs/srv/', 'lifecycle_msgs/srv/Get', 'rcl_interfaces/srv/', 'rosgraph_msgs')
QUIET = ('/parameter_events', '/clock', '/rosout')
AT_ONCE = 8
"""So many calls wait for their answers; a service keeps ten."""
BYTES = 1.0 / 3.0
"""Share of messages that are bytes."""
PER_CALL = 20
"""Parameters of one call."""


class Fuzz:
    """Sends malformed things to a node.

    Parameters
    ----------
    client
        Sends them.
    node
        Full name of the node.
    seed
        Of the random choices.

    Attributes
    ----------
    counts
        What was sent, by kind.
    answered
        Service calls that were answered.
    """

    def __init__(self, client: Client, node: str, seed: int = 5) -> None:
        self._client = client
        self._node = node
        self._rng = np.random.default_rng(seed)
        self.counts: dict[str, int] = {'messages': 0, 'bytes': 0, 'parameters': 0, 'services': 0}
        self.answered = 0

    def messages(self, count: int, left_out: tuple[str, ...] = (), together: int = 20) -> None:
        """Send malformed messages to all topics that the node listens to, a third as bytes.

        Parameters
        ----------
        count
            How many.
        left_out
            Topics that get none.
        together
            How many are sent at once, before a pause of 10 ms.
        """
        node = self._client.node
        name, namespace = _split(self._node)
        topics = node.get_subscriber_names_and_types_by_node(name, namespace)
        publishers = [
            node.create_publisher(_find(types[0]), topic, 100)
            for topic, types in topics
            if topic not in QUIET and topic not in left_out
        ]
        self._client.spin_for(0.5)
        for number in range(count):
            publisher = publishers[number % len(publishers)]
            if self._rng.random() < BYTES:
                publisher.publish(self._rng.bytes(int(self._rng.integers(0, 400))))
                self.counts['bytes'] += 1
            else:
                publisher.publish(self._filled(publisher.msg_type))
                self.counts['messages'] += 1
            if number % together == 0:
                self._client.spin_for(0.01)
        for publisher in publishers:
            node.destroy_publisher(publisher)

    def services(self, count: int) -> None:
        """Call all services of the node with malformed requests."""
        node = self._client.node
        name, namespace = _split(self._node)
        found = [
            (service, _find(types[0]))
            for service, types in node.get_service_names_and_types_by_node(name, namespace)
            if not types[0].startswith(NOT_FUZZED)
        ]
        if not found:
            return
        clients = [node.create_client(kind, service) for service, kind in found]
        calls = (
            (clients[i % len(clients)], self._filled(found[i % len(found)][1].Request))
            for i in range(count)
        )
        self._call(calls, 'services')
        for client in clients:
            node.destroy_client(client)

    def parameters(self, count: int) -> list[str]:
        """Set parameters of the node to values that they cannot have.

        Returns
        -------
        list of str
            Names of those whose values changed all the same; they are set back.
        """
        before = self._values()
        names = list(before)
        client = self._client.node.create_client(SetParameters, f'{self._node}/set_parameters')

        def requests() -> Any:
            for begin in range(0, count, PER_CALL):
                request = SetParameters.Request()
                for i in range(begin, min(begin + PER_CALL, count)):
                    name = names[i % len(names)]
                    request.parameters.append(Parameter(name=name, value=self._wrong_value()))
                yield client, request

        self._call(requests(), '')
        self.counts['parameters'] += count
        after = self._values()
        changed = [name for name in names if repr(after.get(name)) != repr(before[name])]
        if changed:
            request = SetParameters.Request()
            request.parameters = [Parameter(name=name, value=before[name]) for name in changed]
            self._client.call(SetParameters, f'{self._node}/set_parameters', request)
        self._client.node.destroy_client(client)
        return changed

    def _values(self) -> Mapping[str, ParameterValue]:
        listed = self._client.call(
            ListParameters, f'{self._node}/list_parameters', ListParameters.Request()
        )
        names = list(listed.result.names)
        request = GetParameters.Request(names=names)
        values = self._client.call(GetParameters, f'{self._node}/get_parameters', request).values
        return dict(zip(names, values, strict=True))

    def _wrong_value(self) -> ParameterValue:
        kinds: list[Callable[[], ParameterValue]] = [
            lambda: ParameterValue(
                type=ParameterType.PARAMETER_DOUBLE, double_value=self._number()
            ),
            lambda: ParameterValue(
                type=ParameterType.PARAMETER_DOUBLE_ARRAY,
                double_array_value=[self._number() for _ in range(int(self._rng.integers(1, 9)))],
            ),
            lambda: ParameterValue(
                type=ParameterType.PARAMETER_BYTE_ARRAY, byte_array_value=[b'\x00', b'\xff']
            ),
            # An empty text may be meant: an empty list of one.
            lambda: ParameterValue(
                type=ParameterType.PARAMETER_STRING, string_value=self._text() or TEXTS[2]
            ),
            lambda: ParameterValue(
                type=ParameterType.PARAMETER_STRING_ARRAY,
                string_array_value=['none'] * 50,
            ),
        ]
        return kinds[int(self._rng.integers(len(kinds)))]()

    def _call(self, calls: Any, kind: str) -> None:
        waiting: list[Any] = []
        for client, request in calls:
            self._client.wait_for(client.service_is_ready, f'the service {client.srv_name}')
            waiting.append(client.call_async(request))
            if kind:
                self.counts[kind] += 1
            if len(waiting) >= AT_ONCE:
                first = waiting.pop(0)
                self._client.wait_for(first.done, f'an answer of {client.srv_name}')
                self.answered += 1
        for future in waiting:
            self._client.wait_for(future.done, 'an answer of a service')
            self.answered += 1

    def _text(self) -> str:
        return TEXTS[int(self._rng.integers(len(TEXTS)))]

    def _number(self) -> float:
        return NUMBERS[int(self._rng.integers(len(NUMBERS)))]

    def _filled(self, kind: Any) -> Any:
        msg = kind()
        for field, typed in kind.get_fields_and_field_types().items():
            value = self._value(typed)
            if value is not None:
                setattr(msg, field, value)
        return msg

    def _value(self, typed: str) -> Any:
        base, _, rest = typed.partition('[')
        if typed.startswith('sequence<'):
            inner = typed[len('sequence<') :].rstrip('>').split(',')[0].strip()
            return [self._value(inner) for _ in range(int(self._rng.integers(0, 5)))]
        if rest:
            count = int(rest.rstrip(']'))
            if base == 'uint8':
                return np.frombuffer(self._rng.bytes(count), dtype=np.uint8)
            values = [self._value(base) for _ in range(count)]
            return np.array(values) if base in ('double', 'float') else values
        if base in ('double', 'float'):
            return self._number()
        if base == 'boolean':
            return False
        if base in ('string', 'wstring'):
            return self._text()
        if base == 'octet':
            return b'\xff'
        if base in _INTEGERS:
            low, high = _INTEGERS[base]
            # No transition of a managed node, no status, no operation has such a number.
            return int(self._rng.choice([high, high - 1, max(low, 200 if high > 200 else low)]))
        if '/' in base:
            package, name = base.split('/')
            action, _, part = name.rpartition('_')
            if action:
                return self._filled(getattr(_find(f'{package}/action/{action}'), part))
            return self._filled(_find(f'{package}/msg/{name}'))
        return None


_INTEGERS = {
    'int8': (-(2**7), 2**7 - 1),
    'uint8': (0, 2**8 - 1),
    'int16': (-(2**15), 2**15 - 1),
    'uint16': (0, 2**16 - 1),
    'int32': (-(2**31), 2**31 - 1),
    'uint32': (0, 2**32 - 1),
    'int64': (-(2**63), 2**63 - 1),
    'uint64': (0, 2**64 - 1),
}


def _split(node: str) -> tuple[str, str]:
    namespace, _, name = ('/' + node.lstrip('/')).rpartition('/')
    return name, namespace or '/'


def _find(kind: str) -> Any:
    """Class of a type by its name, such as ``std_srvs/srv/SetBool``; parts of actions too."""
    package, folder, name = kind.split('/')
    module = importlib.import_module(f'{package}.{folder}')
    if folder == 'action' and '_' in name:
        action, _, part = name.partition('_')
        inner = getattr(module, action).Impl
        return {
            'SendGoal': inner.SendGoalService,
            'GetResult': inner.GetResultService,
            'FeedbackMessage': inner.FeedbackMessage,
        }[part]
    return getattr(module, name)
