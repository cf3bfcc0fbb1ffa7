"""The twelve base logs: the same drive in every container and compression, by other people's writers."""

from __future__ import annotations

import contextlib
import io
import sqlite3
import tempfile
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import zstandard
from mcap.writer import CompressionType, Writer
from rosbags.rosbag1 import Writer as BagWriter

from tests.battery import content
from tests.io.ros_messages import STORES

if TYPE_CHECKING:
    from collections.abc import Callable

    from tests.battery.content import Known

CHUNK = 6000
FORMAT = BagWriter.CompressionFormat


class Base(NamedTuple):
    """A base log: its bytes, what is in it, and whether its format can tell altered bytes."""

    name: str
    data: bytes
    known: tuple[Known, ...]
    checked: bool

    @property
    def stamped(self) -> list[tuple[str, int, bytes]]:
        """What is in it as plain tuples."""
        return [(topic, log_ns, data) for topic, log_ns, data in self.known]


@cache
def base_logs() -> tuple[Base, ...]:
    """All twelve."""
    none, lz4, zstd = CompressionType.NONE, CompressionType.LZ4, CompressionType.ZSTD
    makers: list[tuple[str, str, bool, Callable[[], bytes]]] = [
        ("zstd.mcap", "cdr", True, lambda: mcap_log("cdr", compression=zstd)),
        ("lz4.mcap", "cdr", True, lambda: mcap_log("cdr", compression=lz4)),
        ("plain.mcap", "cdr", True, lambda: mcap_log("cdr", compression=none)),
        ("unchunked.mcap", "cdr", True, lambda: mcap_log("cdr", use_chunking=False, enable_data_crcs=True)),
        ("ros1.mcap", "ros1", True, lambda: mcap_log("ros1", compression=zstd)),
        ("unchecked.mcap", "cdr", False, lambda: mcap_log("cdr", compression=lz4, enable_crcs=False)),
        ("plain.bag", "ros1", False, lambda: bag_log(None)),
        ("bz2.bag", "ros1", False, lambda: bag_log(FORMAT.BZ2)),
        ("lz4.bag", "ros1", False, lambda: bag_log(FORMAT.LZ4)),
        ("rosbag2.db3", "cdr", False, db3_log),
        ("rosbag2.db3.zstd", "cdr", False, lambda: zstandard.compress(db3_log())),
        ("rosbag2.mcap.zstd", "cdr", True, lambda: zstandard.compress(mcap_log("cdr", compression=none))),
    ]
    return tuple(Base(name, make(), content.messages(encoding), checked) for name, encoding, checked, make in makers)


def mcap_log(encoding: str, known: tuple[Known, ...] | None = None, **options: Any) -> bytes:
    """MCAP by mcap's own writer, in small chunks."""
    stream = io.BytesIO()
    writer = Writer(stream, chunk_size=CHUNK, **options)
    writer.start(profile="ros1" if encoding == "ros1" else "ros2")
    channels: dict[str, int] = {}
    for number, message in enumerate(content.messages(encoding) if known is None else known):
        if message.topic not in channels:
            kind = content.TYPES[message.topic]
            text, digest = content.definition(encoding, kind)
            name, form = (kind.replace("/msg/", "/"), "ros1msg") if encoding == "ros1" else (kind, "ros2msg")
            schema = writer.register_schema(name, form, text.encode())
            more = {"md5sum": digest} if encoding == "ros1" else {}
            channels[message.topic] = writer.register_channel(message.topic, encoding, schema, more)
        writer.add_message(channels[message.topic], message.log_ns, message.data, message.log_ns, number)
    writer.finish()  # type: ignore[no-untyped-call]
    return stream.getvalue()


def bag_log(compression: Any) -> bytes:
    """ROS 1 bag by rosbags' writer, in small chunks."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "x.bag"
        writer = BagWriter(path)
        if compression is not None:
            writer.set_compression(compression)
        writer.chunk_threshold = CHUNK
        with writer:
            store = STORES["ros1"]
            lines = {t: writer.add_connection(t, kind, typestore=store) for t, kind in content.TYPES.items()}
            for message in content.messages("ros1"):
                writer.write(lines[message.topic], message.log_ns, message.data)
        return path.read_bytes()


def db3_log() -> bytes:
    """Database as rosbag2 (Iron and later) lays it out, by SQLite itself."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "x.db3"
        with contextlib.closing(sqlite3.connect(path)) as database:
            fill_database(database)
        return path.read_bytes()


def fill_database(database: sqlite3.Connection) -> None:
    """Create rosbag2's tables and put the drive in."""
    database.executescript(
        "CREATE TABLE schema(schema_version INTEGER PRIMARY KEY, ros_distro TEXT NOT NULL);"
        "CREATE TABLE metadata(id INTEGER PRIMARY KEY, metadata_version INTEGER NOT NULL, metadata TEXT NOT NULL);"
        "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL,"
        " serialization_format TEXT NOT NULL, offered_qos_profiles TEXT NOT NULL, type_description_hash TEXT NOT NULL);"
        "CREATE TABLE message_definitions(id INTEGER PRIMARY KEY, topic_type TEXT NOT NULL, encoding TEXT NOT NULL,"
        " encoded_message_definition TEXT NOT NULL, type_description_hash TEXT NOT NULL);"
        "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL, timestamp INTEGER NOT NULL,"
        " data BLOB NOT NULL);"
        "CREATE INDEX timestamp_idx ON messages (timestamp ASC);"
        "INSERT INTO schema VALUES (4, 'jazzy');"
    )
    topics = list(content.TYPES)
    for number, (topic, kind) in enumerate(content.TYPES.items(), 1):
        database.execute("INSERT INTO topics VALUES (?, ?, ?, 'cdr', '', '')", (number, topic, kind))
        text, _ = content.definition("cdr", kind)
        database.execute("INSERT INTO message_definitions VALUES (?, ?, 'ros2msg', ?, '')", (number, kind, text))
    rows = [(topics.index(m.topic) + 1, m.log_ns, m.data) for m in content.messages("cdr")]
    database.executemany("INSERT INTO messages(topic_id, timestamp, data) VALUES (?, ?, ?)", rows)
    database.commit()
