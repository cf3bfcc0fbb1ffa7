"""The records of an MCAP file as bytes: which there are, how schemas and channels are written.

Source: MCAP format specification, https://mcap.dev/spec (version 0).
"""

from __future__ import annotations

import re
import struct
import zlib
from dataclasses import dataclass
from typing import final

from mclcli.io.logs.base import Attachment, Channel, MetadataRecord, Recorded

MAGIC = b"\x89MCAP0\r\n"
HEADER, FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, MESSAGE_INDEX, CHUNK_INDEX = 1, 2, 3, 4, 5, 6, 7, 8
ATTACHMENT, ATTACHMENT_INDEX, STATISTICS, METADATA, METADATA_INDEX, SUMMARY_OFFSET, DATA_END = 9, 10, 11, 12, 13, 14, 15
KNOWN = frozenset(range(1, 16))
"""Record kinds of the specification; from 0x80 on they are private and passed over."""
FIXED = {DATA_END: 4, FOOTER: 20}
"""Lengths that the specification fixes [bytes]."""
RECORD = struct.Struct("<BQ")
# Times are unsigned in the specification; read as signed they always fit int64.
MESSAGE_HEAD = struct.Struct("<HIqq")
SHORTEST = {SCHEMA: 0, CHANNEL: 0, MESSAGE: MESSAGE_HEAD.size} | dict.fromkeys(range(0x80, 0x100), 0)
"""Records that may stand in a chunk, and the least length of each [bytes]."""
CHUNK_HEAD = struct.Struct("<qqQI")


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

    def key(self, length: int) -> tuple[int, int, int, int]:
        """What its index says as well, for a chunk whose content has a ``length``."""
        return self.first_ns, self.last_ns, RECORD.size + length, self.size


@final
@dataclass(frozen=True, slots=True)
class ChunkIndex:
    """Where a chunk record starts, its ``key`` (log times [ns], length of the record, size inflated), its messages.

    ``messages`` is None where the chunk has no message indexes.
    """

    start: int
    key: tuple[int, int, int, int]
    messages: int | None


def parse_chunk_head(content: bytes) -> ChunkHead | None:
    """Fields of a chunk record from its content (or the beginning of it), None if they are not all there."""
    try:
        first, last, size, crc = CHUNK_HEAD.unpack_from(content)
        compression, at = _text(content, CHUNK_HEAD.size)
        (length,) = struct.unpack_from("<Q", content, at)
    except (struct.error, ValueError):
        return None
    return ChunkHead(first, last, size, crc, compression, at + 8, length)


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
_DEFINITIONS = frozenset({"ros2msg", "ros1msg", "ros2idl", "omgidl"})


def ros2_name(name: str) -> str:
    """Type name as ROS 2 writes it: ``sensor_msgs/LaserScan`` becomes ``sensor_msgs/msg/LaserScan``.

    So do ``sensor_msgs::msg::LaserScan`` and, as DDS has it, ``sensor_msgs::msg::dds_::LaserScan_``.
    """
    if "::" in name:
        name = name.replace("::", "/")
        name = name.replace("/dds_/", "/").removesuffix("_") if "/dds_/" in name else name
    package, slash, short = name.partition("/")
    return f"{package}/msg/{short}" if slash and "/" not in short else name


def is_latched(qos: str) -> bool:
    """Whether rosbag2's QoS text says transient local (1 in files before Iron, the name after)."""
    return re.search(r"durability:\s*(1|transient_local)\b", qos) is not None


def parse_chunk_index(content: bytes) -> ChunkIndex | None:
    """What a chunk index record says; None if it is malformed."""
    try:
        first, last, start, length, offsets = struct.unpack_from("<qqQQI", content)
        (indexes,) = struct.unpack_from("<Q", content, 36 + offsets)
        _, at = _text(content, 44 + offsets)
        _, size = struct.unpack_from("<QQ", content, at)
    except (struct.error, ValueError):
        return None
    messages = (indexes - 15 * (offsets // 10)) // 16 if indexes else None
    return ChunkIndex(start, (first, last, length, size), messages)


def parse_header(content: bytes) -> tuple[str, str] | None:
    """Profile and library of a header record; None if it is malformed."""
    try:
        profile, at = _text(content, 0)
        return profile, _text(content, at)[0]
    except (struct.error, ValueError):
        return None


def parse_attachment(content: bytes) -> Attachment | None:
    """A file within the file; None if it is malformed or fails its checksum."""
    try:
        log_ns, created_ns = struct.unpack_from("<qq", content)
        name, at = _text(content, 16)
        media, at = _text(content, at)
        (length,) = struct.unpack_from("<Q", content, at)
        (crc,) = struct.unpack_from("<I", content, at + 8 + length)
    except (struct.error, ValueError, OverflowError):
        return None
    if crc and zlib.crc32(memoryview(content)[: at + 8 + length]) != crc:
        return None
    return Attachment(name, media, log_ns, created_ns, content[at + 8 : at + 8 + length])


def parse_metadata(content: bytes) -> MetadataRecord | None:
    """Pairs of texts under a name; None if they are malformed."""
    try:
        name, at = _text(content, 0)
        return MetadataRecord(name, tuple(_text_map(content, at).items()))
    except (struct.error, ValueError):
        return None


def index_entries(content: bytes) -> int:
    """Messages that a message index record lists; 0 if it is malformed."""
    if len(content) < 6:
        return 0
    (length,) = struct.unpack_from("<I", content, 2)
    return int(min(length, len(content) - 6)) // 16


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
