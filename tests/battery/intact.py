"""What must come out of a damaged log: the messages of chunks that stand in it byte for byte, wherever they are."""

from __future__ import annotations

import bz2
import struct
from collections import Counter
from functools import cache
from typing import TYPE_CHECKING, NamedTuple

import lz4.frame
import zstandard

from tests.battery import records as r
from tests.battery.bases import base_logs

if TYPE_CHECKING:
    from collections.abc import Iterator

    from tests.battery.bases import Base

    Stamped = tuple[str, int, bytes]

_OPEN = {"": bytes, "none": bytes, "zstd": zstandard.decompress, "lz4": lz4.frame.decompress, "bz2": bz2.decompress}


class Chunk(NamedTuple):
    """A chunk of a base log: where its record stands and ends, its contents, and the messages in it."""

    start: int
    stop: int
    plain: bytes
    messages: tuple[Stamped, ...]


class Parts(NamedTuple):
    """The chunks of a base log, and the records that describe each topic."""

    chunks: tuple[Chunk, ...]
    described: dict[str, tuple[bytes, ...]]


def required(base: Base, data: bytes) -> Counter[Stamped]:
    """Messages of all chunks of a base log that are whole in the damaged data, of topics that something describes."""
    parts = parts_of(base.name)
    whole = [chunk for chunk in parts.chunks if base.data[chunk.start : chunk.stop] in data]
    texts = [data, *(chunk.plain for chunk in whole)]
    topics = {
        topic
        for topic, records in parts.described.items()
        if all(any(record in text for text in texts) for record in records)
    }
    return Counter(message for chunk in whole for message in chunk.messages if message[0] in topics)


@cache
def parts_of(name: str) -> Parts:
    """Parts of the base log of this name; none of one without chunks."""
    base = next(base for base in base_logs() if base.name == name)
    if name.endswith(".mcap"):
        return _of_mcap(base.data)
    return _of_bag(base.data) if name.endswith(".bag") else Parts((), {})


def mcap_records(data: bytes, at: int = len(r.MAGIC)) -> Iterator[tuple[int, int, int]]:
    """Kind of each record of an MCAP, where it starts, and where it stops."""
    while at + 9 <= len(data):
        kind, length = struct.unpack_from("<BQ", data, at)
        if at + 9 + length > len(data):
            return
        yield kind, at, at + 9 + length
        at += 9 + length


def _of_mcap(data: bytes) -> Parts:
    chunks: list[Chunk] = []
    schemas: dict[int, bytes] = {}
    channels: dict[int, str] = {}
    described: dict[str, tuple[bytes, ...]] = {}
    for kind, start, stop in mcap_records(data):
        if kind != r.CHUNK:
            continue
        size, at = 8 + 8 + 8 + 4, start + 9
        (length,) = struct.unpack_from("<I", data, at + size)
        name = data[at + size + 4 : at + size + 4 + length].decode()
        plain = _OPEN[name](data[at + size + 4 + length + 8 : stop])
        messages = []
        for inner, begin, end in mcap_records(plain, 0):
            record = plain[begin:end]
            if inner == r.SCHEMA:
                schemas[struct.unpack_from("<H", record, 9)[0]] = record
            elif inner == r.CHANNEL:
                number, schema, length = struct.unpack_from("<HHI", record, 9)
                channels[number] = topic = record[17 : 17 + length].decode()
                described[topic] = (record, schemas[schema])
            elif inner == r.MESSAGE:
                number, _, log_ns = struct.unpack_from("<HIQ", record, 9)
                messages.append((channels[number], log_ns, record[31:]))
        chunks.append(Chunk(start, stop, plain, tuple(messages)))
    return Parts(tuple(chunks), described)


def bag_records(data: bytes, at: int = 0) -> Iterator[tuple[dict[str, bytes], int, int, int]]:
    """Header fields of each record of a bag, where it starts, where its data start, and where it stops."""
    while at + 8 <= len(data):
        (length,) = struct.unpack_from("<I", data, at)
        fields, inner = {}, at + 4
        while inner < at + 4 + length:
            (size,) = struct.unpack_from("<I", data, inner)
            name, _, value = data[inner + 4 : inner + 4 + size].partition(b"=")
            fields[name.decode()] = value
            inner += 4 + size
        (size,) = struct.unpack_from("<I", data, inner)
        yield fields, at, inner + 4, inner + 4 + size
        at = inner + 4 + size


def _of_bag(data: bytes) -> Parts:
    chunks: list[Chunk] = []
    topics: dict[bytes, str] = {}
    described: dict[str, tuple[bytes, ...]] = {}
    for fields, start, inside, stop in bag_records(data, len(b"#ROSBAG V2.0\n")):
        if fields["op"] != b"\5":
            continue
        plain, messages = _OPEN[fields["compression"].decode()](data[inside:stop]), []
        for inner, begin, at, end in bag_records(plain):
            if inner["op"] == b"\7":
                topics[inner["conn"]] = topic = inner["topic"].decode()
                described[topic] = (plain[begin:end],)
            elif inner["op"] == b"\2":
                seconds, nanoseconds = struct.unpack("<II", inner["time"])
                messages.append((topics[inner["conn"]], seconds * 10**9 + nanoseconds, plain[at:end]))
        chunks.append(Chunk(start, stop, plain, tuple(messages)))
    return Parts(tuple(chunks), described)
