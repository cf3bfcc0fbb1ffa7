"""Records of MCAP files and ROS 1 bags packed by hand, so that any of them can be wrong."""

from __future__ import annotations

import struct
import zlib
from typing import TYPE_CHECKING, Any

from tests.battery import content

if TYPE_CHECKING:
    from random import Random

MAGIC = b"\x89MCAP0\r\n"
HEADER, FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, MESSAGE_INDEX, DATA_END = 1, 2, 3, 4, 5, 6, 7, 15


def text(value: bytes | str) -> bytes:
    """Length and bytes."""
    raw = value.encode() if isinstance(value, str) else value
    return struct.pack("<I", len(raw)) + raw


def record(kind: int, body: bytes, length: int | None = None) -> bytes:
    """One MCAP record, of a declared length that may be a lie."""
    return struct.pack("<BQ", kind, len(body) if length is None else length) + body


def schema(number: int, name: bytes | str, form: str, definition: bytes | str) -> bytes:
    """Schema record."""
    return record(SCHEMA, struct.pack("<H", number) + text(name) + text(form) + text(definition))


def channel(number: int, of: int, topic: bytes | str, encoding: str = "cdr", pairs: bytes = b"") -> bytes:
    """Channel record; ``pairs`` are its metadata as bytes."""
    body = struct.pack("<HH", number, of) + text(topic) + text(encoding) + struct.pack("<I", len(pairs)) + pairs
    return record(CHANNEL, body)


def message(number: int, at: int, data: bytes) -> bytes:
    """Message record."""
    return record(MESSAGE, struct.pack("<HIQQ", number, 0, at, at) + data)


def chunk(plain: bytes, compression: str = "", packed: bytes | None = None, **lies: int) -> bytes:
    """Chunk record; ``lies`` replace its ``size``, ``crc`` or ``length``."""
    data = plain if packed is None else packed
    size, crc = lies.get("size", len(plain)), lies.get("crc", zlib.crc32(plain))
    body = (
        struct.pack("<QQQI", 0, 2**62, size, crc) + text(compression) + struct.pack("<Q", lies.get("length", len(data)))
    )
    return record(CHUNK, body + data)


def mcap(*records: bytes, profile: str = "ros2", end: bool = True) -> bytes:
    """A file of these records, closed unless said otherwise, without summary."""
    tail = record(DATA_END, bytes(4)) + record(FOOTER, bytes(20)) + MAGIC if end else b""
    return MAGIC + record(HEADER, text(profile) + text("by hand")) + b"".join(records) + tail


def drive() -> bytes:
    """Schemas, channels and messages of the drive, as records outside chunks; numbers 1 to 5 are taken."""
    return b"".join(drive_records())


def beside(rng: Random, *records: bytes, **options: Any) -> bytes:
    """A file of the drive, with other records together somewhere among its messages, or behind them."""
    parts = drive_records()
    at = rng.randrange(2 * len(content.TYPES), len(parts) + 1)
    return mcap(*parts[:at], *records, *parts[at:], **options)


def drive_records() -> list[bytes]:
    """The records of the drive; first come those that describe its topics."""
    parts, numbers = [], {}
    for number, (topic, kind) in enumerate(content.TYPES.items(), 1):
        numbers[topic] = number
        parts += [schema(number, kind, "ros2msg", content.definition("cdr", kind)[0]), channel(number, number, topic)]
    return parts + [message(numbers[m.topic], m.log_ns, m.data) for m in content.messages("cdr")]


def fields(**values: bytes) -> bytes:
    """Header of a ROS 1 bag's record."""
    pairs = (name.strip("_").encode() + b"=" + value for name, value in values.items())
    packed = b"".join(struct.pack("<I", len(pair)) + pair for pair in pairs)
    return struct.pack("<I", len(packed)) + packed


def bag_record(data: bytes, length: int | None = None, **values: bytes) -> bytes:
    """One record of a ROS 1 bag, of a declared length that may be a lie."""
    return fields(**values) + struct.pack("<I", len(data) if length is None else length) + data


def bag(*records: bytes) -> bytes:
    """A bag of these records without index."""
    return (
        b"#ROSBAG V2.0\n"
        + bag_record(b" " * 10, op=b"\3", index_pos=bytes(8), conn_count=bytes(4), chunk_count=bytes(4))
        + b"".join(records)
    )


def connection(number: int, topic: str, kind: str, definition: str = "", digest: str = "*") -> bytes:
    """Connection record of a bag."""
    pairs = {"topic": topic, "type": kind, "md5sum": digest, "message_definition": definition}
    packed = fields(**{name: value.encode() for name, value in pairs.items()})
    return bag_record(packed[4:], op=b"\7", conn=struct.pack("<I", number), topic=topic.encode())


def bag_message(number: int, at_ns: int, data: bytes) -> bytes:
    """Message record of a bag."""
    time = struct.pack("<II", at_ns // 10**9, at_ns % 10**9)
    return bag_record(data, op=b"\2", conn=struct.pack("<I", number), time=time)


def bag_drive() -> bytes:
    """Connections and messages of the drive, outside chunks; numbers 1 to 5 are taken."""
    return b"".join(bag_drive_records())


def bag_beside(rng: Random, *records: bytes) -> bytes:
    """A bag of the drive in chunks, with other records together between two of these, or behind them."""
    parts = bag_drive_records()
    runs = [b"".join(parts[at : at + 20]) for at in range(0, len(parts), 20)]
    chunks = [bag_record(run, op=b"\5", compression=b"none", size=struct.pack("<I", len(run))) for run in runs]
    at = rng.randrange(1, len(chunks) + 1)
    return bag(*chunks[:at], *records, *chunks[at:])


def bag_drive_records() -> list[bytes]:
    """The records of the drive; first come its connections."""
    numbers = {topic: number for number, topic in enumerate(content.TYPES, 1)}
    lines = [
        connection(n, t, content.TYPES[t].replace("/msg/", "/"), *content.definition("ros1", content.TYPES[t]))
        for t, n in numbers.items()
    ]
    return lines + [bag_message(numbers[m.topic], m.log_ns, m.data) for m in content.messages("ros1")]
