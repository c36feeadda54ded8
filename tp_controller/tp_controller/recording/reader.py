"""Reads a recording."""

from __future__ import annotations

import io
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from mcap.records import Attachment, Channel, Header, Message, Metadata, Schema
from mcap.stream_reader import StreamReader
from mcap_ros2.decoder import DecoderFactory

from tp_controller.config import build_settings, parse_parameters
from tp_controller.errors import InvalidValue, listed, shown
from tp_controller.parameters import Flat
from tp_controller.recording.index import BROKEN, Index, Part, read_index, scan
from tp_controller.recording.writer import (
    ABOUT,
    DESCRIPTION,
    DIRECTION,
    FROM,
    NODE,
    PARAMETERS,
    TO,
    Contents,
)
from tp_controller.stack import Stack

STATE = 'tp_interfaces/msg/ControllerState'
JOINT_STATE = 'sensor_msgs/msg/JointState'


class Entry(NamedTuple):
    """A message of a recording."""

    topic: str
    message: Any
    """Has the message's fields as attributes."""
    received: int
    """Time [ns] when it was recorded."""
    sent: int
    """Time [ns] when it was published, by the clock of who did."""


class Recording:
    """An MCAP file that was written by `RecordingWriter`; one that breaks off is read up to there.

    Parameters
    ----------
    path
        The file.

    Raises
    ------
    InvalidValue
        If it cannot be read, is no MCAP file, or there is no controller in it.

    Attributes
    ----------
    path
        The file.
    complete
        Whether the file was finished; else the end is missing.
    types
        Type of the messages by topic.
    contents
        How much of what is in it.
    """

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)
        self.complete = True
        self.types: dict[str, str] = {}
        self._texts: dict[str, str] = {}
        self._facts: dict[str, str] = {}
        self._directions: dict[str, str] = {}
        self._decoders = DecoderFactory()
        self._channels: dict[int, tuple[Channel, Schema]] = {}
        self._index = self._find_index()
        self.contents = self._look() if self._index is None else self._take(self._index)
        if STATE not in self.types.values():
            topics = listed(self.types)
            raise InvalidValue(
                str(path), f'no state of a controller, but {topics}', 'a recording of one'
            )

    def _find_index(self) -> Index | None:
        try:
            return read_index(self.path)
        except OSError as error:
            raise self._unreadable(error) from None

    def _take(self, index: Index) -> Contents:
        """What is in it by its index; messages are not read."""
        self._check_profile(index.profile)
        counts: dict[str, int] = {}
        for number, channel in index.channels.items():
            self._note(channel, index.schemas[channel.schema_id])
            counts[channel.topic] = index.counts.get(number, 0)
        for attachment in index.attachments:
            self._texts[attachment.name] = attachment.data.decode(errors='replace')
        for record in index.metadata:
            self._describe(record)
        return Contents(index.seconds, counts)

    def _note(self, channel: Channel, schema: Schema) -> None:
        self._channels[channel.id] = channel, schema
        self.types[channel.topic] = schema.name
        self._directions[channel.topic] = channel.metadata.get(DIRECTION, '')

    def _describe(self, record: Metadata) -> None:
        if record.name == ABOUT:
            self._facts.update(record.metadata)

    def _check_profile(self, profile: str) -> None:
        if profile != 'ros2':
            got = f'an MCAP file of the profile {shown(profile)}'
            raise InvalidValue(str(self.path), got, 'one of the profile ros2')

    def _unreadable(self, error: OSError) -> InvalidValue:
        return InvalidValue(str(self.path), str(error.strerror), 'a readable file')

    def _look(self) -> Contents:
        """What is in it, message by message."""
        counts: dict[str, int] = {}
        begin = end = 0
        for channel, schema, message in self._raw():
            if message is None:
                counts[channel.topic] = 0
                self._note(channel, schema)
                continue
            counts[channel.topic] += 1
            begin = min(begin or message.log_time, message.log_time)
            end = max(end, message.log_time)
        return Contents(1e-9 * (end - begin), counts)

    def _raw(self) -> Iterator[tuple[Channel, Schema, Message | None]]:
        """Every message, and every channel without one when it begins."""
        schemas: dict[int, Schema] = {}
        channels: dict[int, Channel] = {}
        try:
            with self.path.open('rb') as file:
                for record in StreamReader(io.BufferedReader(file)).records:
                    if isinstance(record, Message):
                        channel = channels[record.channel_id]
                        yield channel, schemas[channel.schema_id], record
                    elif isinstance(record, Schema):
                        schemas[record.id] = record
                    elif isinstance(record, Channel):
                        if record.id not in channels:
                            channels[record.id] = record
                            yield record, schemas[record.schema_id], None
                    elif isinstance(record, Attachment):
                        self._texts[record.name] = record.data.decode(errors='replace')
                    elif isinstance(record, Metadata):
                        self._describe(record)
                    elif isinstance(record, Header):
                        self._check_profile(record.profile)
        except OSError as error:
            raise self._unreadable(error) from None
        except InvalidValue:
            raise
        except BROKEN as error:
            if not channels:
                got = f'no MCAP file ({type(error).__name__})'
                raise InvalidValue(str(self.path), got, 'a recording (.mcap)') from None
            self.complete = False

    @property
    def controller(self) -> str:
        """Full name of the controller's node."""
        topic = self.topic_of(STATE, FROM)
        return self._facts.get(NODE, topic.removesuffix('/state'))

    @property
    def facts(self) -> Mapping[str, str]:
        """What it says about the controller: node, versions, machine."""
        return self._facts

    @property
    def parameters(self) -> Flat:
        """Parameters of the controller by dotted key when the recording began."""
        node = self.controller.rpartition('/')[2]
        return parse_parameters(self._texts.get(PARAMETERS, '{}'), str(self.path), node)

    @property
    def parameter_text(self) -> str:
        """The same as the text of a parameter file; empty if they are not there."""
        return self._texts.get(PARAMETERS, '')

    @property
    def description(self) -> str | None:
        """URDF of the robot, None without one."""
        return self._texts.get(DESCRIPTION)

    def stack(self) -> Stack:
        """Robot and tasks as its parameters describe them.

        Raises
        ------
        InvalidValue
            If the parameters are not there or cannot be used.
        """
        if not self.parameter_text:
            raise InvalidValue(str(self.path), f'no {PARAMETERS}', 'a recording with parameters')
        return build_settings(self.parameters, self.description, find_rate=True).stack

    def topic_of(self, message_type: str, direction: str) -> str:
        """Topic of a type that the controller listens to, or publishes; empty without one.

        Of several, one that belongs to no task.
        """
        found = [
            topic
            for topic, kind in self.types.items()
            if kind == message_type and self._directions[topic] in (direction, '')
        ]
        return min(
            found, key=lambda topic: (topic.endswith('/goal'), topic.count('/')), default=''
        )

    @property
    def joint_states(self) -> str:
        """Topic of the joint states."""
        return self.topic_of(JOINT_STATE, TO)

    @property
    def state(self) -> str:
        """Topic of the controller's state."""
        return self.topic_of(STATE, FROM)

    def messages(self, topics: Sequence[str]) -> Iterator[Entry]:
        """Messages of some topics in the order in which they were recorded."""
        wanted = frozenset(topics)
        for channel, schema, message in self._raw():
            if message is None or channel.topic not in wanted:
                continue
            decode = self._decoder(channel, schema)
            yield Entry(
                channel.topic, decode(message.data), message.log_time, message.publish_time
            )

    def _decoder(self, channel: Channel, schema: Schema) -> Callable[[bytes], Any]:
        decode = self._decoders.decoder_for(channel.message_encoding, schema)
        if decode is None:
            got = f'{channel.topic}: {channel.message_encoding}, {schema.encoding}'
            raise InvalidValue(str(self.path), got, 'cdr and ros2msg')
        return decode

    def parts(self, topic: str) -> dict[int, list[Part]]:
        """Parts of the file with messages of a topic, by the number of its channel."""
        parts = list(scan(self.path)) if self._index is None else self._index.parts
        return {
            number: [part for part in parts if number in part.channels]
            for number, (channel, _) in self._channels.items()
            if channel.topic == topic
        }

    def decoder(self, number: int) -> Callable[[bytes], Any]:
        """What makes messages of the bytes of a channel."""
        return self._decoder(*self._channels[number])

    def states(self) -> list[Any]:
        """States of the controller, one for each cycle that published one, in their order."""
        return [entry.message for entry in self.messages([self.state])]
