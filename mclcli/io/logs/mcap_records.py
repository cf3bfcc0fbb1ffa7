"""The records of an MCAP file as bytes: which there are, how schemas and channels are written.

Source: MCAP format specification, https://mcap.dev/spec (version 0).
"""

from __future__ import annotations

import re
import struct
import zlib
from dataclasses import dataclass
from typing import TYPE_CHECKING, final

from mclcli.io.logs.base import Channel, Recorded

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from mclcli.io.logs.source import ByteSource

MAGIC = b"\x89MCAP0\r\n"
FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, MESSAGE_INDEX, STATISTICS, DATA_END = 2, 3, 4, 5, 6, 7, 11, 15
KNOWN = frozenset(range(1, 16))
"""Record kinds of the specification; from 0x80 on they are private and passed over."""
READ = frozenset({FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, MESSAGE_INDEX, STATISTICS, DATA_END})
"""Record kinds whose contents are looked at; the others are passed over."""
FIXED = {DATA_END: 4, FOOTER: 20}
"""Lengths that the specification fixes [bytes]."""
RECORD = struct.Struct("<BQ")
# Times are unsigned in the specification; read as signed they always fit int64.
MESSAGE_HEAD = struct.Struct("<HIqq")
SHORTEST = {SCHEMA: 0, CHANNEL: 0, MESSAGE: MESSAGE_HEAD.size} | dict.fromkeys(range(0x80, 0x100), 0)
"""Records that may stand in a chunk, and the least length of each [bytes]."""
CHUNK_HEAD = struct.Struct("<qqQI")
_TAIL = struct.Struct("<BQQQI8s")
_HEAD_LIMIT = 64  # bytes that hold the head of any chunk
SUMMARY_LIMIT = 1 << 26
"""Largest summary section that is looked into [bytes]."""
CHUNK_START = re.compile(rb"\x06.{36}(?:\x00{4}|\x04\x00\x00\x00zstd|\x03\x00\x00\x00lz4)", re.DOTALL)
"""What the start of a chunk record looks like, for finding one after broken framing."""


@final
@dataclass(frozen=True, slots=True)
class ChunkHead:
    """A chunk record's fields; ``data_at`` is where its (compressed) records start in the record's content."""

    first_ns: int
    last_ns: int
    size: int
    crc: int
    compression: str
    data_at: int
    data_length: int


def parse_chunk_head(content: bytes) -> ChunkHead | None:
    """Fields of a chunk record from its content (or the beginning of it), None if they are not all there."""
    try:
        first, last, size, crc = CHUNK_HEAD.unpack_from(content)
        compression, at = _text(content, CHUNK_HEAD.size)
        (length,) = struct.unpack_from("<Q", content, at)
    except (struct.error, ValueError):
        return None
    return ChunkHead(first, last, size, crc, compression, at + 8, length)


def chunk_start(match: re.Match[bytes], left: int) -> int | None:
    """Position of a chunk record in the window that was searched, if the match is one: its two lengths agree."""
    begin, window = match.start(), match.string
    (length,) = struct.unpack_from("<Q", window, begin + 1)
    head = parse_chunk_head(window[begin + 9 : begin + 9 + _HEAD_LIMIT])
    if head is None or length != head.data_at + head.data_length or begin + 9 + length > left:
        return None
    return begin


def peek_chunk(src: ByteSource) -> ChunkHead | None:
    """Head of the chunk record that comes next, if one does."""
    ahead = src.read(RECORD.size + _HEAD_LIMIT)
    src.unread(ahead)
    return parse_chunk_head(ahead[RECORD.size :]) if ahead[:1] == bytes([CHUNK]) else None


def parse_schema(content: bytes) -> tuple[int, Recorded] | None:
    """Schema id, and what the record says; None if it is malformed."""
    try:
        (number,) = struct.unpack_from("<H", content)
        name, at = _text(content, 2)
        form, at = _text(content, at)
        schema, _ = _bytes(content, at)
    except (struct.error, ValueError):
        return None
    return number, Recorded(name, form, schema)


def parse_channel(content: bytes, schemas: dict[int, Recorded]) -> tuple[int, Channel] | None:
    """Channel id and channel; None if the record is malformed."""
    try:
        number, schema = struct.unpack_from("<HH", content)
        topic, at = _text(content, 4)
        encoding, at = _text(content, at)
        metadata = _text_map(content, at)
    except (struct.error, ValueError):
        return None
    of = schemas.get(schema, _NO_SCHEMA)
    described = Recorded(of.name, of.form, of.schema, tuple(metadata.items()))
    definition = described.schema.decode("utf-8", "replace") if described.form in _DEFINITIONS else ""
    latched = is_latched(metadata.get("offered_qos_profiles", "")) or metadata.get("latching") in {"1", "true"}
    digest = metadata.get("md5sum", "")
    return number, Channel(topic, ros2_name(described.name), encoding, definition, digest, latched, described)


_NO_SCHEMA = Recorded("", "", b"")
_DEFINITIONS = frozenset({"ros2msg", "ros1msg", "ros2idl"})


def ros2_name(name: str) -> str:
    """Type name as ROS 2 writes it: ``sensor_msgs/LaserScan`` becomes ``sensor_msgs/msg/LaserScan``."""
    package, slash, short = name.partition("/")
    return f"{package}/msg/{short}" if slash and "/" not in short else name


def is_latched(qos: str) -> bool:
    """Whether rosbag2's QoS text says transient local (1 in files before Iron, the name after)."""
    return re.search(r"durability:\s*(1|transient_local)\b", qos) is not None


def index_entries(content: bytes) -> int:
    """Messages that a message index record lists; 0 if it is malformed."""
    if len(content) < 6:
        return 0
    (length,) = struct.unpack_from("<I", content, 2)
    return int(min(length, len(content) - 6)) // 16


def messages_like(numbers: Iterable[int]) -> re.Pattern[bytes]:
    """What the start of a message record of one of these channels looks like, below 16 MiB."""
    channels = b"|".join(re.escape(struct.pack("<H", number)) for number in numbers)
    return re.compile(rb"\x05...\x00{5}(?:" + channels + rb")", re.DOTALL)


def message_start(match: re.Match[bytes], left: int) -> int | None:
    """Position of a message record in the window that was searched, if the match is one: another record follows it."""
    begin, window = match.start(), match.string
    (length,) = struct.unpack_from("<Q", window, begin + 1)
    after = begin + 9 + length
    if length < MESSAGE_HEAD.size or after + 9 > min(left, len(window)):
        return None
    kind, length = RECORD.unpack_from(window, after)
    return begin if kind in KNOWN and after + 9 + length <= left else None


def read_summary(src: ByteSource) -> bytes:
    """Records of the summary section of a closed file, verified; b'' where there is none or it is damaged."""
    if src.size is None or src.size < _TAIL.size + len(MAGIC):
        return b""
    src.go_to(src.size - _TAIL.size)
    kind, length, start, _, crc, magic = _TAIL.unpack(src.read(_TAIL.size))
    stop = src.size - _TAIL.size
    if (kind, length, magic) != (FOOTER, 20, MAGIC) or not stop - SUMMARY_LIMIT <= start < stop or start == 0:
        return b""
    src.go_to(start)
    summary = src.read(stop - start + 25)
    return summary[:-25] if crc in {0, zlib.crc32(summary)} else b""


def parse_definitions(records: bytes) -> Iterator[tuple[int, Channel]]:
    """Channels described by a run of records."""
    schemas: dict[int, Recorded] = {}
    at = 0
    while at + RECORD.size <= len(records):
        kind, length = RECORD.unpack_from(records, at)
        content = records[at + 9 : at + 9 + length]
        at += 9 + length
        if kind == SCHEMA and (schema := parse_schema(content)):
            schemas[schema[0]] = schema[1]
        elif kind == CHANNEL and (channel := parse_channel(content, schemas)):
            yield channel


def _bytes(content: bytes, at: int) -> tuple[bytes, int]:
    (length,) = struct.unpack_from("<I", content, at)
    stop = at + 4 + length
    if stop > len(content):
        raise ValueError("string longer than its record")
    return content[at + 4 : stop], stop


def _text(content: bytes, at: int) -> tuple[str, int]:
    raw, stop = _bytes(content, at)
    return raw.decode("utf-8", "replace"), stop


def _text_map(content: bytes, at: int) -> dict[str, str]:
    (length,) = struct.unpack_from("<I", content, at)
    at, stop = at + 4, at + 4 + length
    pairs: dict[str, str] = {}
    while at < stop:
        key, at = _text(content, at)
        pairs[key], at = _text(content, at)
    return pairs
