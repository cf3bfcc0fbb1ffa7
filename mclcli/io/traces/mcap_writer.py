"""Writing MCAP: chunks compressed with zstd and checksummed, then indexes and a summary.

Source: MCAP format specification, https://mcap.dev/spec (version 0). Records, their order and their bytes are those of
the library ``mcap``, but for how hard a chunk is compressed.
"""

from __future__ import annotations

import struct
import zlib
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Protocol, final

from mclcli.io.logs import mcap_records as rec

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from mclcli.io.traces.sinks import BinarySink

_HEADER, _CHUNK_INDEX, _SUMMARY_OFFSET = 1, 8, 14
_ATTACHMENT, _ATTACHMENT_INDEX = 9, 10
_METADATA, _METADATA_INDEX = 12, 13
_MESSAGE_START = struct.Struct("<BQHIQQ")


class Compressor(Protocol):
    """Compresses whole chunks with zstd; one for each file, since it keeps its tables from chunk to chunk."""

    def compress(self, data: bytes, /) -> bytes:
        """One frame, which states its size."""
        ...


def standard() -> Compressor:
    """A compressor for any messages."""
    import zstandard

    return zstandard.ZstdCompressor()


def for_clouds() -> Compressor:
    """A compressor for chunks of particle clouds: it looks for long repetitions only, and at every other place.

    What makes a cloud small is that another message repeats it. The standard compressor saves another 13 % and takes
    1.7 times as long.
    """
    import zstandard

    fast = zstandard.ZstdCompressionParameters(
        window_log=21,
        hash_log=17,
        chain_log=17,
        search_log=1,
        min_match=7,
        target_length=2,
        strategy=zstandard.STRATEGY_FAST,
    )
    return zstandard.ZstdCompressor(compression_params=fast)


@final
@dataclass(slots=True)
class _Chunk:
    """Records of a chunk in the making, their size, and where each channel's messages stand: (log time, offset)."""

    parts: list[bytes] = field(default_factory=list)
    size: int = 0
    index: dict[int, list[tuple[int, int]]] = field(default_factory=dict)

    def put(self, *parts: bytes) -> None:
        """Append the parts of a record."""
        self.parts += parts
        self.size += sum(map(len, parts))


@final
class McapWriter:
    """One file, written front to back: register channels, add messages, end chunks, and finish.

    Channels and schemas stand in the chunk in which they are registered, and in the summary.
    """

    __slots__ = (
        "_at",
        "_attachments",
        "_channels",
        "_chunk",
        "_compressor",
        "_counts",
        "_indexes",
        "_metadata",
        "_schemas",
        "_sink",
        "_span",
    )

    def __init__(self, sink: BinarySink, compressor: Compressor, *, profile: str, library: str) -> None:
        self._sink, self._at, self._compressor = sink, 0, compressor
        self._chunk = _Chunk()
        self._schemas: list[bytes] = []
        self._channels: list[bytes] = []
        self._indexes: list[bytes] = []
        self._attachments: list[bytes] = []
        self._metadata: list[bytes] = []
        self._counts: dict[int, int] = {}
        self._span: tuple[int, int] | None = None
        self._write(rec.MAGIC, _record(_HEADER, _text(profile), _text(library)))

    def add_metadata(self, name: str, pairs: Mapping[str, str]) -> None:
        """Write pairs of texts under a name."""
        record, at = _record(_METADATA, _text(name), _map(pairs)), self._at
        self._write(record)
        self._metadata.append(_record(_METADATA_INDEX, struct.pack("<QQ", at, len(record)), _text(name)))

    def attach(self, name: str, media_type: str, data: bytes, *, log_ns: int = 0, created_ns: int = 0) -> None:
        """Write a file within the file; times [ns], 0 for none."""
        described = _text(name) + _text(media_type)
        body = struct.pack("<qq", log_ns, created_ns) + described + struct.pack("<Q", len(data)) + data
        record, at = _record(_ATTACHMENT, body, struct.pack("<I", zlib.crc32(body))), self._at
        self._write(record)
        head = struct.pack("<QQqqQ", at, len(record), log_ns, created_ns, len(data))
        self._attachments.append(_record(_ATTACHMENT_INDEX, head, described))

    def register_schema(self, name: str, form: str, data: bytes) -> int:
        """Number of a new schema."""
        number = len(self._schemas) + 1
        self._schemas.append(_record(rec.SCHEMA, struct.pack("<H", number), _text(name), _text(form), _bytes(data)))
        self._chunk.put(self._schemas[-1])
        return number

    def register_channel(self, topic: str, encoding: str, schema: int, metadata: Mapping[str, str]) -> int:
        """Number of a new channel; schema 0 is none."""
        number = len(self._channels) + 1
        head = struct.pack("<HH", number, schema)
        self._channels.append(_record(rec.CHANNEL, head, _text(topic), _text(encoding), _map(metadata)))
        self._chunk.put(self._channels[-1])
        return number

    def add_message(
        self, channel: int, log_time_ns: int, publish_ns: int, data: bytes, sequence: int | None = None
    ) -> None:
        """Append one message to the chunk; without a sequence number it gets one that counts the channel's from 0."""
        count = self._counts.get(channel, 0)
        self._counts[channel] = count + 1
        sequence = count if sequence is None else sequence
        self._chunk.index.setdefault(channel, []).append((log_time_ns, self._chunk.size))
        head = _MESSAGE_START.pack(rec.MESSAGE, 22 + len(data), channel, sequence, log_time_ns, publish_ns)
        self._chunk.put(head, data)

    def end_chunk(self) -> None:
        """Write the messages since the last chunk, if any, and hand everything to the system."""
        if self._chunk.index:
            chunk, self._chunk = self._chunk, _Chunk()
            self._write_chunk(chunk)
        self._sink.flush()

    def finish(self) -> None:
        """Write what is pending, and the summary. The sink stays open."""
        self.end_chunk()
        self._write(_record(rec.DATA_END, bytes(4)))
        start, summary, offsets = self._at, bytearray(), []
        for kind, records in self._summary():
            at = len(summary)
            summary += b"".join(records)
            offsets.append(_record(_SUMMARY_OFFSET, struct.pack("<BQQ", kind, start + at, len(summary) - at)))
        foot = struct.pack("<BQQQ", rec.FOOTER, 20, start, start + len(summary))
        summary += b"".join(offsets)
        crc = zlib.crc32(foot, zlib.crc32(summary))
        self._write(bytes(summary), foot, struct.pack("<I", crc), rec.MAGIC)
        self._sink.flush()

    def _write(self, *parts: bytes) -> None:
        for part in parts:
            self._sink.write(part)
            self._at += len(part)

    def _write_chunk(self, chunk: _Chunk) -> None:
        plain = b"".join(chunk.parts)
        packed = self._compressor.compress(plain)
        times = [entry[0] for entries in chunk.index.values() for entry in entries]
        first, last = min(times), max(times)
        self._span = (first, last) if self._span is None else (min(first, self._span[0]), max(last, self._span[1]))
        head = rec.CHUNK_HEAD.pack(first, last, len(plain), zlib.crc32(plain)) + _text("zstd")
        begin = self._at
        self._write(_start(rec.CHUNK, len(head) + 8 + len(packed)) + head + struct.pack("<Q", len(packed)), packed)
        end, offsets = self._at, []
        for channel, entries in chunk.index.items():
            offsets.append(struct.pack("<HQ", channel, self._at))
            self._write(_message_index(channel, entries))
        about = struct.pack("<QQQQ", first, last, begin, end - begin) + _bytes(b"".join(offsets))
        sizes = struct.pack("<QQ", len(packed), len(plain))
        self._indexes.append(_record(_CHUNK_INDEX, about, struct.pack("<Q", self._at - end), _text("zstd"), sizes))

    def _summary(self) -> list[tuple[int, list[bytes]]]:
        """Groups of the summary: a kind of record, and all of them."""
        return [
            (rec.SCHEMA, self._schemas),
            (rec.CHANNEL, self._channels),
            (rec.STATISTICS, [self._statistics()]),
            (_CHUNK_INDEX, self._indexes),
            (_ATTACHMENT_INDEX, self._attachments),
            (_METADATA_INDEX, self._metadata),
        ]

    def _statistics(self) -> bytes:
        counts = b"".join(struct.pack("<HQ", *item) for item in self._counts.items())
        parts = (self._schemas, self._channels, self._attachments, self._metadata, self._indexes)
        numbers = struct.pack("<QHIIII", sum(self._counts.values()), *map(len, parts))
        return _record(rec.STATISTICS, numbers, struct.pack("<QQ", *(self._span or (0, 0))), _bytes(counts))


def _start(kind: int, length: int) -> bytes:
    return rec.RECORD.pack(kind, length)


def _record(kind: int, *parts: bytes) -> bytes:
    body = b"".join(parts)
    return _start(kind, len(body)) + body


def _bytes(data: bytes) -> bytes:
    return struct.pack("<I", len(data)) + data


def _text(text: str) -> bytes:
    return _bytes(text.encode())


def _map(pairs: Mapping[str, str]) -> bytes:
    return _bytes(b"".join(_text(key) + _text(value) for key, value in pairs.items()))


def _message_index(channel: int, entries: Iterable[tuple[int, int]]) -> bytes:
    listed = b"".join(struct.pack("<QQ", *entry) for entry in entries)
    return _record(rec.MESSAGE_INDEX, struct.pack("<H", channel), _bytes(listed))
