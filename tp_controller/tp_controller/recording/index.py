"""Where the messages of an MCAP file are, by its summary, without reading them."""

from __future__ import annotations

import io
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import zstandard
from mcap.exceptions import McapError
from mcap.records import (
    Attachment,
    AttachmentIndex,
    Channel,
    Chunk,
    ChunkIndex,
    Footer,
    Header,
    McapRecord,
    Message,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
)
from mcap.stream_reader import StreamReader, breakup_chunk

BROKEN = (McapError, ValueError, KeyError, struct.error, zstandard.ZstdError)
"""What reading a file raises that is no MCAP file, or breaks off."""
END = 29 + 8
"""Bytes of the footer and of the magic after it."""


class Part(NamedTuple):
    """Records of a file that are read together."""

    start: int
    """Place of the first byte."""
    length: int
    """Number of bytes."""
    channels: frozenset[int]
    """Numbers of the channels with messages in it."""


class Index:
    """What the summary of a file says.

    Attributes
    ----------
    profile
        Of the file.
    channels, schemas
        By number.
    counts
        Messages by number of the channel.
    seconds
        Time [s] from the first to the last message.
    parts
        In their order in the file.
    attachments, metadata
        All of them.
    """

    def __init__(self) -> None:
        self.profile = ''
        self.channels: dict[int, Channel] = {}
        self.schemas: dict[int, Schema] = {}
        self.counts: dict[int, int] = {}
        self.seconds = 0.0
        self.parts: list[Part] = []
        self.attachments: list[Attachment] = []
        self.metadata: list[Metadata] = []


def read_index(path: Path) -> Index | None:
    """Index of a file that was finished, None of any other.

    Raises
    ------
    OSError
        If it cannot be read.
    """
    with path.open('rb') as file:
        try:
            return _read(file)
        except BROKEN:
            return None


def _read(file: io.BufferedReader) -> Index | None:
    found = Index()
    header = next(StreamReader(file).records)
    if file.seek(0, io.SEEK_END) < END:
        return None
    file.seek(-END, io.SEEK_END)
    footer = next(_records(file))
    if not isinstance(header, Header) or not isinstance(footer, Footer):
        return None
    if not footer.summary_start:
        return None
    found.profile = header.profile
    places: list[int] = []
    counted = False
    # Most parts have the same channels.
    sets: dict[frozenset[int], frozenset[int]] = {}
    file.seek(footer.summary_start)
    for record in _records(file):
        if isinstance(record, Channel):
            found.channels[record.id] = record
        elif isinstance(record, Schema):
            found.schemas[record.id] = record
        elif isinstance(record, Statistics):
            found.counts = record.channel_message_counts
            found.seconds = 1e-9 * (record.message_end_time - record.message_start_time)
            counted = True
        elif isinstance(record, ChunkIndex):
            ids = frozenset(record.message_index_offsets)
            ids = sets.setdefault(ids, ids)
            found.parts.append(Part(record.chunk_start_offset, record.chunk_length, ids))
        elif isinstance(record, AttachmentIndex | MetadataIndex):
            places.append(record.offset)
    for place in places:
        file.seek(place)
        record = next(_records(file))
        if isinstance(record, Attachment):
            found.attachments.append(record)
        elif isinstance(record, Metadata):
            found.metadata.append(record)
    found.parts.sort()
    return found if counted else None


def scan(path: Path) -> Iterator[Part]:
    """Parts of a file without an index, up to where it breaks off; all of it is read."""
    with path.open('rb') as file:
        try:
            start = 0
            for record in StreamReader(file, emit_chunks=True).records:
                begin, start = start, file.tell()
                if isinstance(record, Chunk):
                    inside = breakup_chunk(record)
                    ids = {inner.channel_id for inner in inside if isinstance(inner, Message)}
                    yield Part(begin, start - begin, frozenset(ids))
                elif isinstance(record, Message):
                    yield Part(begin, start - begin, frozenset({record.channel_id}))
        except BROKEN:
            return


def read_part(path: Path, part: Part) -> Iterator[Message]:
    """Messages of a part.

    Raises
    ------
    OSError
        If the file cannot be read any more.
    """
    with path.open('rb') as file:
        file.seek(part.start)
        data = file.read(part.length)
    stream = io.BytesIO(data)
    try:
        for record in _records(stream):
            if isinstance(record, Message):
                yield record
    except BROKEN:
        # The end of the part, or of what can be read of it.
        return


def _records(file: io.BufferedReader | io.BytesIO) -> Iterator[McapRecord]:
    return StreamReader(file, skip_magic=True).records
