"""Writes a recording."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from pathlib import Path
from types import TracebackType
from typing import NamedTuple

from mcap.well_known import MessageEncoding, Profile, SchemaEncoding
from mcap.writer import CompressionType, Writer

from tp_controller.errors import InvalidValue, plural, shown

CHUNK = 32 * 1024
"""Bytes of messages that are compressed together: what a process that is killed loses at most."""
PARAMETERS, DESCRIPTION = 'parameters.yaml', 'robot.urdf'
"""Attachments."""
ABOUT = 'tp_controller'
"""Metadata about the controller."""
NODE = 'controller'
"""Key there: full name of the controller's node."""
DIRECTION, TO, FROM, OTHER = 'direction', 'to controller', 'from controller', 'other'
"""Metadata of a channel: whether the controller listens to its topic or publishes there."""
SUFFIX = '.mcap'


class Contents(NamedTuple):
    """What is in a recording."""

    seconds: float
    """Time [s] from the first to the last message, by when they were received."""
    counts: Mapping[str, int]
    """Messages by topic."""

    @property
    def text(self) -> str:
        """The same in words."""
        topics = plural(len(self.counts), 'topic')
        messages = plural(sum(self.counts.values()), 'message')
        return f'{self.seconds:.1f} s, {messages} on {topics}'


class RecordingWriter:
    """One MCAP file; it can be read up to the last chunk whatever ends the process.

    Parameters
    ----------
    path
        The file, which has to end in ``.mcap``.
    overwrite
        Whether a file that is there may be replaced.

    Raises
    ------
    InvalidValue
        If there is such a file, or it cannot be written.
    """

    def __init__(self, path: str | Path, overwrite: bool = False) -> None:
        self.path = Path(path)
        if self.path.suffix != SUFFIX:
            raise InvalidValue('recording', shown(str(path)), f'a file that ends in {SUFFIX}')
        try:
            self._file = self.path.open('wb' if overwrite else 'xb')
        except FileExistsError:
            got, accepts = f'{shown(str(path))}, which exists', 'a new file, or --overwrite'
            raise InvalidValue('recording', got, accepts) from None
        except OSError as error:
            got = f'{shown(str(path))}: {error.strerror}'
            raise InvalidValue('recording', got, 'a file that can be written') from None
        self._writer = Writer(self._file, CHUNK, CompressionType.ZSTD)
        self._writer.start(Profile.ROS2, 'tp_controller')
        self._schemas: dict[str, int] = {}
        self._topics: dict[int, str] = {}
        self._counts: dict[int, int] = {}
        self._begin = self._end = 0
        self._closed = False

    def __enter__(self) -> RecordingWriter:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def add_topic(
        self, topic: str, message_type: str, definition: str, qos: str = '', direction: str = OTHER
    ) -> int:
        """Begin a topic; return its number for `write`.

        Parameters
        ----------
        topic
            Full name.
        message_type
            Such as ``sensor_msgs/msg/JointState``.
        definition
            Text of its ``.msg`` file, followed by those of all messages in it.
        qos
            YAML of the publishers' quality of service, as rosbag2 has it.
        direction
            Whether the controller listens to it (`TO`) or publishes there (`FROM`).
        """
        schema = self._schemas.get(message_type)
        if schema is None:
            schema = self._schemas[message_type] = self._writer.register_schema(
                message_type, SchemaEncoding.ROS2, definition.encode()
            )
        number = self._writer.register_channel(
            topic, MessageEncoding.CDR, schema, {'offered_qos_profiles': qos, DIRECTION: direction}
        )
        self._topics[number], self._counts[number] = topic, 0
        return number

    def write(self, number: int, data: bytes, received: int, sent: int) -> None:
        """Write a message.

        Parameters
        ----------
        number
            Of its topic.
        data
            The message as CDR.
        received, sent
            Times [ns] when it came and when it was published.
        """
        self._begin = self._begin or received
        self._end = max(self._end, received)
        self._counts[number] += 1
        self._writer.add_message(number, received, data, sent, self._counts[number])

    def attach(self, name: str, media_type: str, text: str) -> None:
        """Attach a text as a file of its own."""
        now = time.time_ns()
        self._writer.add_attachment(now, now, name, media_type, text.encode())

    def describe(self, name: str, facts: Mapping[str, str]) -> None:
        """Add a record of facts by name."""
        self._writer.add_metadata(name, dict(facts))

    def count(self, number: int) -> int:
        """Messages of a topic so far."""
        return self._counts[number]

    def flush(self) -> None:
        """Hand over to the system what is complete so far."""
        self._file.flush()

    @property
    def contents(self) -> Contents:
        """What is in it so far."""
        counts = {self._topics[number]: count for number, count in self._counts.items()}
        return Contents(1e-9 * (self._end - self._begin), counts)

    def close(self) -> None:
        """Finish the file."""
        if not self._closed:
            self._closed = True
            finish: Callable[[], None] = self._writer.finish
            finish()
            self._file.close()

    def discard(self) -> None:
        """Remove the file."""
        self.close()
        self.path.unlink(missing_ok=True)
