"""Helpers for tests of logs: small logs written by other people's writers, and what a container yields."""

from __future__ import annotations

import io
import random
import struct
from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from mcap.writer import CompressionType, Writer

from mclcli.io.logs import open_log
from mclcli.io.logs.base import Damage, RawMessage, Tally

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from mclcli.io.logs.base import Container

HEADER = "std_msgs/Header header\n"
SCAN = "sensor_msgs/msg/LaserScan"


def seeded(seed: int | str) -> random.Random:
    """Random numbers that are the same every time."""
    return random.Random(seed)  # noqa: S311 - damage, not secrets


@dataclass(frozen=True)
class Seen:
    """What came out of a container or a log."""

    messages: list[RawMessage]
    damages: list[Damage]

    @property
    def counts(self) -> dict[str, int]:
        return dict(Counter(message.channel.topic for message in self.messages))

    @property
    def stamped(self) -> list[tuple[str, int, bytes]]:
        return [(m.channel.topic, m.log_time_ns, m.data) for m in self.messages]


def look(container: Container) -> Seen:
    """Everything a container yields, in file order."""
    items = list(container.items())
    return Seen([i for i in items if isinstance(i, RawMessage)], [i for i in items if isinstance(i, Damage)])


def look_at(*paths: Path) -> Seen:
    """Everything a log yields, in log-time order."""
    tally = Tally()
    messages = list(open_log(paths).messages(None, tally))
    return Seen(messages, tally.damages)


def mcap_bytes(
    stamps: Sequence[int],
    *,
    compression: CompressionType = CompressionType.ZSTD,
    chunk_size: int = 2000,
    chunked: bool = True,
    data_crc: bool = True,
    **options: Any,
) -> bytes:
    """MCAP with messages alternating on /a and /b, their payload telling their number; ``options`` are the writer's."""
    stream = io.BytesIO()
    writer = Writer(
        stream,
        compression=compression,
        chunk_size=chunk_size,
        use_chunking=chunked,
        enable_data_crcs=data_crc,
        **options,
    )
    writer.start(profile="ros2")
    schema = writer.register_schema("std_msgs/msg/String", "ros2msg", b"string data\n")
    channels = [writer.register_channel(topic, "cdr", schema) for topic in ("/a", "/b")]
    for number, stamp in enumerate(stamps):
        writer.add_message(channels[number % 2], stamp, payload(number), stamp, number)
    writer.finish()  # type: ignore[no-untyped-call]
    return stream.getvalue()


def payload(number: int) -> bytes:
    """Contents of the numbered message: 200 bytes that hardly compress."""
    return struct.pack("<I", number) + bytes((number * 73 + k * k * 31 + (k * number) % 251) % 256 for k in range(196))


def numbers(seen: Seen) -> list[int]:
    """Numbers of the messages that came out, each verified byte by byte."""
    found: list[int] = [struct.unpack_from("<I", message.data)[0] for message in seen.messages]
    for number, message in zip(found, seen.messages, strict=True):
        assert message.data == payload(number)
    return found


def ros1_bag(path: Path, count: int, compression: Any = None, *, chunk: int = 1500) -> bytes:
    """ROS 1 bag with numbered messages on /a, written by rosbags."""
    from rosbags.rosbag1 import Writer as BagWriter
    from rosbags.typesys import Stores, get_typestore

    writer = BagWriter(path)
    if compression is not None:
        writer.set_compression(compression)
    writer.chunk_threshold = chunk
    with writer:
        store = get_typestore(Stores.ROS1_NOETIC)
        connection = writer.add_connection("/a", "std_msgs/msg/String", typestore=store)
        for number in range(count):
            writer.write(connection, 10**9 + number * 10**7, payload(number))
    return path.read_bytes()
