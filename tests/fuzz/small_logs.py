"""The smallest logs of every kind: what the fuzzing of logs begins with."""

from __future__ import annotations

import contextlib
import io
import sqlite3
import struct
import tempfile
from pathlib import Path

import lz4.frame
import zstandard
from mcap.writer import CompressionType, Writer
from rosbags.rosbag1 import Writer as BagWriter

from tests.battery import records as r
from tests.io.ros_messages import STORES, build

STRING = "std_msgs/msg/String"
AT = 1_700_000_000 * 10**9
STAMPS = (AT, AT + 10**9, AT + 2 * 10**9)


def mcaps() -> list[bytes]:
    """Closed and unclosed, chunked or not, of every compression."""
    loose = r.schema(1, STRING, "ros2msg", "string data\n") + r.channel(1, 1, "/a")
    loose += b"".join(r.message(1, at, text("cdr")) for at in STAMPS)
    packed = [("", loose), ("zstd", zstandard.compress(loose)), ("lz4", lz4.frame.compress(loose))]
    index = r.record(r.MESSAGE_INDEX, struct.pack("<HIQQ", 1, 16, AT, 9))
    chunks = [r.mcap(r.chunk(loose, name, data), index) for name, data in packed]
    unchecked = r.mcap(r.chunk(loose, crc=0), r.chunk(loose, crc=0), end=False)
    damaged = r.mcap(r.chunk(loose), r.record(9, bytes(40), 2**40), r.chunk(loose))
    return [r.mcap(loose), *chunks, unchecked, damaged, *(_written(c) for c in CompressionType), _written(None)]


def _written(compression: CompressionType | None) -> bytes:
    """By mcap's own writer, with statistics, indexes and a summary; without chunks for None."""
    stream = io.BytesIO()
    if compression is None:
        writer = Writer(stream, use_chunking=False, enable_data_crcs=True)
    else:
        writer = Writer(stream, chunk_size=40, compression=compression)
    writer.start(profile="ros2")
    schema = writer.register_schema(STRING, "ros2msg", b"string data\n")
    channels = [writer.register_channel(topic, "cdr", schema) for topic in ("/a", "/b")]
    for number, at in enumerate(STAMPS):
        writer.add_message(channels[number % 2], at, text("cdr"), at, number)
    writer.finish()  # type: ignore[no-untyped-call]
    return stream.getvalue()


def bags() -> list[bytes]:
    """With and without index and chunks, of every compression."""
    line = r.connection(1, "/a", "std_msgs/String", "string data\n", "992ce8a1687cec8c8bd883ec73ca41d1")
    loose = line + b"".join(r.bag_message(1, at, text("ros1")) for at in STAMPS)
    chunk = r.bag_record(loose, op=b"\5", compression=b"none", size=struct.pack("<I", len(loose)))
    written = [_bag(form) for form in (None, BagWriter.CompressionFormat.BZ2, BagWriter.CompressionFormat.LZ4)]
    return [r.bag(loose), r.bag(chunk, chunk), *(data.replace(b" " * 3000, b"") for data in written)]


def _bag(compression: BagWriter.CompressionFormat | None) -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        writer = BagWriter(Path(folder) / "x.bag")
        if compression is not None:
            writer.set_compression(compression)
        writer.chunk_threshold = 1
        with writer:
            line = writer.add_connection("/a", STRING, typestore=STORES["ros1"])
            for at in STAMPS:
                writer.write(line, at, text("ros1"))
        return (Path(folder) / "x.bag").read_bytes()


def databases() -> list[bytes]:
    """As rosbag2 of two ages lays them out, in pages of 512 bytes."""
    return [_database(definitions=False), _database(definitions=True)]


def _database(*, definitions: bool) -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "x.db3"
        with contextlib.closing(sqlite3.connect(path)) as database:
            database.executescript(
                "PRAGMA page_size=512;"
                "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT, type TEXT, encoding TEXT, qos TEXT);"
                "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, data BLOB);"
            )
            if definitions:
                database.executescript(
                    "CREATE TABLE message_definitions(id INTEGER PRIMARY KEY, topic_type TEXT, encoding TEXT,"
                    " encoded_message_definition TEXT, type_description_hash TEXT);"
                    f"INSERT INTO message_definitions VALUES (1, '{STRING}', 'ros2msg', 'string data', '');"
                )
            database.execute("INSERT INTO topics VALUES (1, '/a', ?, 'cdr', '')", (STRING,))
            rows = [(1, at, text("cdr")) for at in STAMPS]
            database.executemany("INSERT INTO messages(topic_id, timestamp, data) VALUES (?, ?, ?)", rows)
            database.commit()
        return path.read_bytes()


def text(encoding: str) -> bytes:
    """A message of type String."""
    store = STORES[encoding]
    serialize = store.serialize_ros1 if encoding == "ros1" else store.serialize_cdr
    return bytes(serialize(build(encoding, STRING, {"data": "note"}), STRING))
