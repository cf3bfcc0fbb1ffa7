"""A whole MCAP file by its own index: when every message came, and single chunks, without the rest being read.

For files of which reading every byte takes long. What is not closed, not indexed or contradicts itself has no index
here; it is read from front to back (``mcap_file``), which also says what is wrong with it.
Source: MCAP format specification, https://mcap.dev/spec.
"""

from __future__ import annotations

import io
import os
import struct
import zlib
from dataclasses import dataclass
from typing import TYPE_CHECKING, BinaryIO, final

import numpy as np
from mcap.data_stream import RecordBuilder
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, ChunkIndex, McapRecord, Schema, Statistics
from mcap.stream_reader import StreamReader

from mclcli.io.logs import mcap_records as rec
from mclcli.io.logs.base import RawMessage
from mclcli.io.logs.inflate import RECORD_LIMIT, Budget, CorruptError, inflate

if TYPE_CHECKING:
    from pathlib import Path

    from mclcli.arrays import IntArray
    from mclcli.io.logs import base

LIMIT = 1 << 26
"""Largest summary, and largest index of one chunk, that is looked into [bytes]."""
_TAIL = struct.Struct("<BQQQI8s")
_ENTRY = np.dtype([("time", "<i8"), ("offset", "<u8")])


@final
@dataclass(frozen=True, slots=True, eq=False)
class IndexedChunk:
    """A chunk's record: where it starts and how long it is [bytes]; log times [ns] of its messages by channel."""

    start: int
    length: int
    times: dict[int, IntArray]

    @property
    def span_ns(self) -> tuple[int, int]:
        """First and last log time."""
        return min(int(t.min()) for t in self.times.values()), max(int(t.max()) for t in self.times.values())


@final
@dataclass(frozen=True, slots=True, eq=False)
class McapIndex:
    """Channels of a file by number, and its chunks in file order, those without messages left out."""

    path: Path
    channels: dict[int, base.Channel]
    chunks: tuple[IndexedChunk, ...]

    def messages(self, chunk: IndexedChunk) -> tuple[list[RawMessage], bool]:
        """Messages of one chunk, and whether a checksum covers them. Raises OSError, CorruptError (see ``inflate``)."""
        if chunk.length > RECORD_LIMIT:
            raise CorruptError(f"has {chunk.length >> 20} MiB, more than {RECORD_LIMIT >> 20}")
        with self.path.open("rb") as stream:
            stream.seek(chunk.start)
            record = stream.read(chunk.length)
        head = rec.parse_chunk_head(record[9:])
        if record[:1] != bytes([Opcode.CHUNK]) or head is None or 9 + head.data_at + head.data_length != len(record):
            raise CorruptError("is malformed")
        plain = bytes(inflate(memoryview(record)[9 + head.data_at :], head.compression, head.size, Budget()))
        if head.crc and zlib.crc32(plain) != head.crc:
            raise CorruptError("fails its checksum")
        found = self._records(plain)
        if len(found) != sum(times.size for times in chunk.times.values()):
            raise CorruptError("does not hold the messages that its index lists")
        return found, head.crc != 0

    def _records(self, plain: bytes) -> list[RawMessage]:
        """Messages among the records of a chunk."""
        found, at = [], 0
        while at < len(plain):
            kind, length = rec.RECORD.unpack_from(plain, at) if at + 9 <= len(plain) else (0, len(plain))
            stop = at + 9 + length
            if stop > len(plain) or (kind == Opcode.MESSAGE and length < rec.MESSAGE_HEAD.size):
                raise CorruptError("is broken inside")
            if kind == Opcode.MESSAGE:
                number, _, stamp, published = rec.MESSAGE_HEAD.unpack_from(plain, at + 9)
                if number not in self.channels:
                    raise CorruptError("has messages of channels that nothing describes")
                found.append(RawMessage(self.channels[number], stamp, plain[at + 31 : stop], published))
            at = stop
        return found


def read_index(path: Path) -> McapIndex | None:
    """Index of a file; None unless it is a closed MCAP whose summary is whole and lists all of its messages.

    Raises OSError.
    """
    try:
        with path.open("rb") as stream:
            start, summary = _read_summary(stream)
            records = list(StreamReader(io.BytesIO(summary), skip_magic=True, emit_chunks=True).records)
            chunks = _chunks(stream, [r for r in records if isinstance(r, ChunkIndex)], start)
            channels = _channels(records)
    except (McapError, ValueError, struct.error):
        return None
    totals = [(r.message_count, r.chunk_count) for r in records if isinstance(r, Statistics)]
    numbers = {number for chunk in chunks for number in chunk.times}
    messages = sum(times.size for chunk in chunks for times in chunk.times.values())
    if totals != [(messages, len(chunks))] or not numbers <= channels.keys():
        return None
    return McapIndex(path, channels, tuple(chunk for chunk in chunks if chunk.times))


def _read_summary(stream: BinaryIO) -> tuple[int, bytes]:
    """Where the summary starts, and it with all that follows; ValueError or struct.error if it is not whole."""
    size = stream.seek(0, os.SEEK_END)
    stream.seek(max(size - _TAIL.size, 0))
    kind, length, start, _, crc, magic = _TAIL.unpack(stream.read())
    if (kind, length, magic) != (Opcode.FOOTER, 20, rec.MAGIC) or not 0 < size - start <= LIMIT or start == 0:
        raise ValueError("no summary")
    stream.seek(start)
    summary = stream.read()
    if crc not in {0, zlib.crc32(summary[:-12])}:
        raise ValueError("summary fails its checksum")
    return start, summary


def _chunks(stream: BinaryIO, listed: list[ChunkIndex], end: int) -> list[IndexedChunk]:
    """Chunks in file order with the log times of their messages; ValueError if they overlap or pass byte ``end``."""
    chunks, free = [], len(rec.MAGIC)
    for entry in sorted(listed, key=lambda entry: entry.chunk_start_offset):
        start, after = entry.chunk_start_offset, entry.chunk_start_offset + entry.chunk_length
        if start < free or after + entry.message_index_length > end or entry.message_index_length > LIMIT:
            raise ValueError("an index that makes no sense")
        free = after + entry.message_index_length
        stream.seek(after)
        chunks.append(IndexedChunk(start, entry.chunk_length, _times(stream.read(entry.message_index_length))))
    return chunks


def _times(indexes: bytes) -> dict[int, IntArray]:
    """Log times by channel in a run of message index records, taken whole: the library reads them number by number."""
    times: dict[int, IntArray] = {}
    at = 0
    while at < len(indexes):
        kind, length, channel, size = struct.unpack_from("<BQHI", indexes, at)
        if kind != Opcode.MESSAGE_INDEX or length != 6 + size or channel in times:
            raise ValueError("an index that makes no sense")
        entries = np.frombuffer(indexes, _ENTRY, size // _ENTRY.itemsize, at + 15)
        if entries.size:
            times[channel] = entries["time"].astype(np.int64)
        at += 9 + length
    return times


def _channels(records: list[McapRecord]) -> dict[int, base.Channel]:
    """Channels by number, described as a reading from front to back describes them."""
    schemas = dict(filter(None, (rec.parse_schema(_content(r)) for r in records if isinstance(r, Schema))))
    return dict(filter(None, (rec.parse_channel(_content(r), schemas) for r in records if isinstance(r, Channel))))


def _content(record: McapRecord) -> bytes:
    builder = RecordBuilder()
    record.write(builder)
    return bytes(builder.end()[9:])  # type: ignore[no-untyped-call]
