"""``mcl recover``: what stands beside the messages, messages compressed one by one, and those that none describes."""

from __future__ import annotations

import io
import sqlite3
from contextlib import closing
from typing import TYPE_CHECKING, Any

import pytest
import zstandard
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer

from mclcli.io.messages.decoding import DECODABLE
from tests.battery import content, records
from tests.battery.bases import base_logs, mcap_log
from tests.cli.support import mcl, single_error

if TYPE_CHECKING:
    from pathlib import Path

BASES = {base.name: base for base in base_logs()}


def recover(folder: Path, data: bytes, name: str = "x.mcap") -> tuple[Any, bytes]:
    """Outcome of saving a log, and what was written."""
    (folder / name).write_bytes(data)
    result = mcl("recover", folder / name, "-o", folder / "good.mcap")
    return result, (folder / "good.mcap").read_bytes()


def with_extras(messages: int) -> bytes:
    stream = io.BytesIO()
    writer = Writer(stream, compression=CompressionType.LZ4)
    writer.start(profile="x-own", library="a recorder 1.2")
    schema = writer.register_schema("a/msg/A", "ros2msg", b"uint8 a\n")
    channels = [writer.register_channel("/a", "cdr", schema, {"callerid": f"/node{n}"}) for n in range(2)]
    for number in range(messages):
        writer.add_message(channels[number % 2], 10**9 + number, bytes([number]), 10**9 + number, 1000 + 7 * number)
    writer.add_attachment(
        create_time=5, log_time=6, name="room.yaml", media_type="text/yaml", data=b"resolution: 0.05\n"
    )
    writer.add_metadata("robot", {"serial": "17"})
    writer.add_metadata("rosbag2", {"serialized_metadata": "version: 9\ncompression_mode: MESSAGE\n"})
    writer.finish()  # type: ignore[no-untyped-call]
    return stream.getvalue()


@pytest.mark.parametrize("messages", [0, 40])
@pytest.mark.parametrize("pipe", [False, True])
def test_what_stands_beside_the_messages_is_saved(tmp_path: Path, messages: int, *, pipe: bool) -> None:
    data = with_extras(messages)
    if pipe:
        result = mcl("recover", "-", "-o", "-", stdin=data)
        good = result.out
    else:
        result, good = recover(tmp_path, data)
    assert result.code == 0
    assert "1 attachment saved" in result.err
    assert "2 metadata records saved" in result.err
    reader, theirs = make_reader(io.BytesIO(good), validate_crcs=True), make_reader(io.BytesIO(data))
    assert list(reader.iter_attachments()) == list(theirs.iter_attachments())
    assert {record.name: record.metadata for record in reader.iter_metadata()} == {
        "robot": {"serial": "17"},
        "rosbag2": {"serialized_metadata": 'version: 9\ncompression_mode: ""\n'},
    }
    header = reader.get_header()
    assert header.profile == "x-own"
    assert header.library.startswith("a recorder 1.2; mclcli ")
    told = [
        [
            (c.topic, c.metadata, m.sequence, m.log_time, m.data)
            for _, c, m in make_reader(io.BytesIO(file)).iter_messages()
        ]
        for file in (data, good)
    ]
    assert told[0] == told[1]


def test_a_damaged_attachment_is_named(tmp_path: Path) -> None:
    data = bytearray(with_extras(40))
    data[data.index(b"resolution") + 3] ^= 1
    result, good = recover(tmp_path, bytes(data))
    assert result.code == 3
    assert "attachment at byte" in result.err
    assert list(make_reader(io.BytesIO(good)).iter_attachments()) == []


def packed_db3(folder: Path) -> bytes:
    """rosbag2 database whose messages are compressed one by one."""
    path = folder / "packed.db3"
    path.write_bytes(BASES["rosbag2.db3"].data)
    with closing(sqlite3.connect(path)) as database:
        rows = database.execute("SELECT id, data FROM messages").fetchall()
        database.executemany("UPDATE messages SET data = ? WHERE id = ?", [(zstandard.compress(d), n) for n, d in rows])
        database.commit()
    return path.read_bytes()


def packed_mcap(_: Path) -> bytes:
    known = tuple(known._replace(data=zstandard.compress(known.data)) for known in content.messages("cdr"))
    return mcap_log("cdr", known)


@pytest.mark.parametrize("name", ["x.db3", "x.mcap"])
def test_messages_compressed_one_by_one_are_unpacked(tmp_path: Path, name: str) -> None:
    data = (packed_db3 if name == "x.db3" else packed_mcap)(tmp_path)
    result, good = recover(tmp_path, data, name)
    assert result.code == 0
    assert [(c.topic, m.log_time, m.data) for _, c, m in make_reader(io.BytesIO(good)).iter_messages()] == BASES[
        "rosbag2.db3"
    ].stamped
    told = mcl("info", tmp_path / name)
    assert told.code == 0
    assert "/scan" in told.out.decode()
    assert "jump" not in told.out.decode()


def test_a_compressed_message_that_is_damaged_is_counted(tmp_path: Path) -> None:
    path = tmp_path / "x.db3"
    path.write_bytes(packed_db3(tmp_path))
    with closing(sqlite3.connect(path)) as database:
        database.execute("UPDATE messages SET data = substr(data, 1, 20) WHERE id = 100")
        database.commit()
    result, good = recover(tmp_path, path.read_bytes(), "x.db3")
    assert result.code == 3
    assert "1 message not saved: compressed (zstd), and cannot be decompressed" in result.err
    assert sum(1 for _ in make_reader(io.BytesIO(good)).iter_messages()) == 312


def without_definitions(encoding: str) -> bytes:
    """The drive in chunks, with no schema and no channel anywhere."""
    kinds = list(content.TYPES)
    body = [records.message(kinds.index(m.topic) + 1, m.log_ns, m.data) for m in content.messages(encoding)]
    return records.mcap(*(records.chunk(b"".join(body[at : at + 20])) for at in range(0, len(body), 20)), profile="")


@pytest.mark.parametrize("encoding", ["cdr", "ros1"])
def test_messages_that_nothing_describes_are_saved_by_what_they_parse_as(tmp_path: Path, encoding: str) -> None:
    result, good = recover(tmp_path, without_definitions(encoding))
    assert result.code == 3
    assert "nothing in the log describes them, they parse as sensor_msgs/msg/LaserScan" in result.err
    read = list(make_reader(io.BytesIO(good), validate_crcs=True).iter_messages())
    kinds = {f"/unknown/{n}": kind for n, kind in enumerate(content.TYPES.values(), 1) if kind in DECODABLE}
    assert {channel.topic: schema and schema.name.replace("/msg/", "/") for schema, channel, _ in read} == {
        topic: kind.replace("/msg/", "/") for topic, kind in kinds.items()
    }
    assert [m.data for _, _, m in read] == [
        known.data for known in content.messages(encoding) if content.TYPES[known.topic] in DECODABLE
    ]


def test_a_run_does_not_guess(tmp_path: Path) -> None:
    (tmp_path / "x.mcap").write_bytes(without_definitions("cdr"))
    (tmp_path / "room.pgm").write_bytes(content.room())
    (tmp_path / "room.yaml").write_text(content.MAP_YAML)
    single_error(mcl("run", tmp_path / "x.mcap", "--map", tmp_path / "room.yaml", "--init", content.INIT), 1)
    told = mcl("info", tmp_path / "x.mcap")
    assert told.code == 3
    assert "/unknown" not in told.out.decode()
    assert "313 messages skipped" in told.err


def test_what_parses_as_nothing_is_not_saved(tmp_path: Path) -> None:
    (tmp_path / "x.mcap").write_bytes(records.mcap(records.chunk(records.message(1, 10**9, b"\0\1\0\0what"))))
    single_error(mcl("recover", tmp_path / "x.mcap", "-o", tmp_path / "good.mcap"), 1)
