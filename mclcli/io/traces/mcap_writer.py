"""Writing MCAP: chunks compressed with zstd and checksummed, then indexes and a summary.

Records are written by the library ``mcap``, all but messages: those go into their chunk without a copy, and chunks are
compressed as hard as their writer says.
Source: MCAP format specification, https://mcap.dev/spec (version 0).
"""

from __future__ import annotations

import struct
import zlib
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Protocol, final

from mcap import records as rec
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode

from mclcli.io.logs.mcap_records import MAGIC

if TYPE_CHECKING:
    from collections.abc import Mapping

    from mclcli.io.traces.sinks import BinarySink

_SUMMARY = (
    *(Opcode.SCHEMA, Opcode.CHANNEL, Opcode.STATISTICS),
    *(Opcode.CHUNK_INDEX, Opcode.ATTACHMENT_INDEX, Opcode.METADATA_INDEX),
)  # kinds of records there, in order
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

    __slots__ = ("_at", "_chunk", "_compressor", "_counts", "_sink", "_span", "_summary")

    def __init__(self, sink: BinarySink, compressor: Compressor, *, profile: str, library: str) -> None:
        self._sink, self._at, self._compressor = sink, 0, compressor
        self._chunk = _Chunk()
        self._summary: dict[Opcode, list[rec.McapRecord]] = {kind: [] for kind in _SUMMARY}
        self._counts: dict[int, int] = {}
        self._span: tuple[int, int] | None = None
        self._write(MAGIC, _encoded(rec.Header(profile, library)))

    def add_metadata(self, name: str, pairs: Mapping[str, str]) -> None:
        """Write pairs of texts under a name."""
        record, at = _encoded(rec.Metadata(name, dict(pairs))), self._at
        self._write(record)
        self._summary[Opcode.METADATA_INDEX].append(rec.MetadataIndex(at, len(record), name))

    def attach(self, name: str, media_type: str, data: bytes, *, log_ns: int = 0, created_ns: int = 0) -> None:
        """Write a file within the file; times [ns], 0 for none."""
        logged, created = log_ns % (1 << 64), created_ns % (1 << 64)  # read as signed, see ``mcap_records``
        record, at = _encoded(rec.Attachment(created, logged, name, media_type, data)), self._at
        self._write(record)
        self._summary[Opcode.ATTACHMENT_INDEX].append(
            rec.AttachmentIndex(at, len(record), logged, created, len(data), name, media_type)
        )

    def register_schema(self, name: str, form: str, data: bytes) -> int:
        """Number of a new schema."""
        number = len(self._summary[Opcode.SCHEMA]) + 1
        self._register(Opcode.SCHEMA, rec.Schema(number, data, form, name))
        return number

    def register_channel(self, topic: str, encoding: str, schema: int, metadata: Mapping[str, str]) -> int:
        """Number of a new channel; schema 0 is none."""
        number = len(self._summary[Opcode.CHANNEL]) + 1
        self._register(Opcode.CHANNEL, rec.Channel(number, topic, encoding, dict(metadata), schema))
        return number

    def add_message(
        self, channel: int, log_time_ns: int, publish_ns: int, data: bytes, sequence: int | None = None
    ) -> None:
        """Append one message to the chunk; without a sequence number it gets one that counts the channel's from 0."""
        count = self._counts.get(channel, 0)
        self._counts[channel] = count + 1
        sequence = count if sequence is None else sequence
        self._chunk.index.setdefault(channel, []).append((log_time_ns, self._chunk.size))
        head = _MESSAGE_START.pack(Opcode.MESSAGE, 22 + len(data), channel, sequence, log_time_ns, publish_ns)
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
        self._write(_encoded(rec.DataEnd(0)))
        start, summary = self._at, RecordBuilder()
        offsets: list[rec.SummaryOffset] = []
        self._summary[Opcode.STATISTICS] = [self._statistics()]
        for kind, group in self._summary.items():
            begin = summary.count
            for record in group:
                record.write(summary)
            offsets.append(rec.SummaryOffset(kind, start + begin, summary.count - begin))
        offset_start = start + summary.count
        for offset in (*offsets, rec.Footer(start, offset_start, 0)):
            offset.write(summary)
        plain: bytes = summary.end()[:-4]  # type: ignore[no-untyped-call]  # all but the checksum, which covers it
        self._write(plain, struct.pack("<I", zlib.crc32(plain)), MAGIC)
        self._sink.flush()

    def _register(self, kind: Opcode, record: rec.McapRecord) -> None:
        """Put a description into the chunk, and into the summary."""
        self._summary[kind].append(record)
        self._chunk.put(_encoded(record))

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
        begin, offsets = self._at, dict[int, int]()
        self._write(_encoded(rec.Chunk("zstd", packed, last, first, zlib.crc32(plain), len(plain))))
        end = self._at
        for channel, entries in chunk.index.items():
            offsets[channel] = self._at
            self._write(_encoded(rec.MessageIndex(channel, entries)))
        self._summary[Opcode.CHUNK_INDEX].append(
            rec.ChunkIndex(
                chunk_length=end - begin,
                chunk_start_offset=begin,
                compression="zstd",
                compressed_size=len(packed),
                message_end_time=last,
                message_index_length=self._at - end,
                message_index_offsets=offsets,
                message_start_time=first,
                uncompressed_size=len(plain),
            )
        )

    def _statistics(self) -> rec.Statistics:
        count = {kind: len(group) for kind, group in self._summary.items()}
        first, last = self._span or (0, 0)
        return rec.Statistics(
            attachment_count=count[Opcode.ATTACHMENT_INDEX],
            channel_count=count[Opcode.CHANNEL],
            channel_message_counts=self._counts,
            chunk_count=count[Opcode.CHUNK_INDEX],
            message_count=sum(self._counts.values()),
            message_end_time=last,
            message_start_time=first,
            metadata_count=count[Opcode.METADATA_INDEX],
            schema_count=count[Opcode.SCHEMA],
        )


def _encoded(record: rec.McapRecord) -> bytes:
    builder = RecordBuilder()
    record.write(builder)
    return bytes(builder.end())  # type: ignore[no-untyped-call]
