"""The records of a ROS 1 bag as bytes: headers made of named fields, connections, chunks.

Source: ROS wiki, Bags/Format/2.0.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import TYPE_CHECKING, final

from mclcli.io.logs.base import Channel, Recorded
from mclcli.io.logs.mcap_records import ros2_name

if TYPE_CHECKING:
    from collections.abc import Iterator

MAGIC = b"#ROSBAG V2.0\n"
MESSAGE, BAG_HEADER, INDEX, CHUNK, CHUNK_INFO, CONNECTION = 2, 3, 4, 5, 6, 7
HEADER_LIMIT = 1 << 16
"""Longest record header believed [bytes]; real ones have less than a hundred, and a topic name."""
LENGTH = struct.Struct("<I")
STAMP = struct.Struct("<II")

Fields = dict[bytes, bytes]


@final
@dataclass(frozen=True, slots=True)
class Head:
    """A record's header fields and the numbers most records need; ``kind`` 0 means it makes no sense."""

    kind: int
    fields: Fields

    def number(self, name: bytes) -> int:
        """Unsigned number in a field of any width; 0 if it is missing."""
        return int.from_bytes(self.fields.get(name, b"")[:8], "little")

    def text(self, name: bytes) -> str:
        """Text of a field; '' if it is missing."""
        return self.fields.get(name, b"").decode("utf-8", "replace")

    @property
    def stamp_ns(self) -> int:
        """Time field of a message record [ns]."""
        return stamp_ns(self.fields.get(b"time", b""))


def parse_head(data: bytes, at: int, stop: int) -> Head:
    """Header fields between two positions: ``length name=value`` each."""
    fields: Fields = {}
    while at + 4 <= stop:
        (length,) = LENGTH.unpack_from(data, at)
        at += 4
        if at + length > stop:
            return Head(0, fields)
        name, equals, value = data[at : at + length].partition(b"=")
        if not equals:
            return Head(0, fields)
        fields[name] = value
        at += length
    kind = fields.get(b"op", b"")
    return Head(kind[0] if len(kind) == 1 and at == stop else 0, fields)


def walk(data: bytes, at: int = 0) -> Iterator[tuple[Head, int, int]]:
    """Header of each whole record in a run of them, and where its data start and stop; ends at the first broken one."""
    end = len(data)
    while at + 8 <= end:
        start = at + 8 + LENGTH.unpack_from(data, at)[0]
        if start > end:
            return
        head = parse_head(data, at + 4, start - 4)
        at = start + LENGTH.unpack_from(data, start - 4)[0]
        if at > end or head.kind == 0:
            return
        yield head, start, at


def stamp_ns(value: bytes) -> int:
    """ROS 1 time, seconds and nanoseconds as two unsigned 32-bit numbers [ns]; 0 if it is no such thing."""
    if len(value) != STAMP.size:
        return 0
    seconds, nanoseconds = STAMP.unpack(value)
    return int(seconds) * 10**9 + int(nanoseconds)


def parse_connection(head: Head, data: bytes) -> Channel | None:
    """Channel that a connection record describes; None if it is malformed."""
    more = parse_head(data + b"\x04\x00\x00\x00op=\x07", 0, len(data) + 8)
    if more.kind != CONNECTION or b"topic" not in head.fields or b"conn" not in head.fields:
        return None
    pairs = tuple((name, more.text(name.encode())) for name in _KEPT if name.encode() in more.fields)
    kind, text = more.text(b"type"), more.fields.get(b"message_definition", b"")
    return Channel(
        topic=head.text(b"topic"),
        type=ros2_name(kind),
        encoding="ros1",
        definition=text.decode("utf-8", "replace"),
        digest=more.text(b"md5sum"),
        latched=more.fields.get(b"latching") == b"1",
        recorded=Recorded(kind, "ros1msg", text, pairs),
    )


_KEPT = ("callerid", "latching", "md5sum")


def fits(head: Head, size: int) -> bool:
    """Whether a record of this kind has the fields that it needs, and data of a length that fits them."""
    if not _NEEDED[head.kind] <= head.fields.keys():
        return False
    count = head.number(b"count")
    if head.kind == INDEX:
        return size in {12 * count, 20 * count}
    return head.kind != CHUNK_INFO or size == 8 * count


_NEEDED: dict[int, set[bytes]] = {
    MESSAGE: {b"conn", b"time"},
    BAG_HEADER: {b"index_pos"},
    INDEX: {b"conn", b"count"},
    CHUNK: {b"compression", b"size"},
    CHUNK_INFO: {b"chunk_pos", b"count"},
    CONNECTION: {b"conn", b"topic"},
}
KINDS = _NEEDED.keys()
"""Kinds of records that there are."""


def index_entries(head: Head) -> int:
    """Bytes of an index record's data: 12 an entry, whatever length the record itself states.

    Bags of 2010 state 20 bytes an entry where 12 are there.
    """
    return 12 * head.number(b"count")
