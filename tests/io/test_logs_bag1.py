from __future__ import annotations

import io
import struct
from typing import TYPE_CHECKING

import pytest
from rosbags.rosbag1 import Reader, Writer

from mclcli.io.logs import bag1_file
from mclcli.io.logs.bag1_file import Bag1File
from mclcli.io.logs.source import ByteSource
from tests.data import shared
from tests.io.logs import Seen, look, look_at, numbers, ros1_bag, seeded

if TYPE_CHECKING:
    from pathlib import Path

FORMATS = [None, Writer.CompressionFormat.BZ2, Writer.CompressionFormat.LZ4]
ALL = list(range(40))


def read(data: bytes, *, pipe: bool = False) -> Seen:
    return look(Bag1File("x.bag", lambda: ByteSource(io.BytesIO(data), None if pipe else len(data))))


def index_at(data: bytes) -> int:
    (position,) = struct.unpack_from("<Q", data, data.index(b"index_pos=") + len("index_pos="))
    return int(position)


@pytest.mark.parametrize("pipe", [False, True])
@pytest.mark.parametrize("compression", FORMATS)
def test_healthy_bags_give_every_message(tmp_path: Path, compression: object, pipe: bool) -> None:  # noqa: FBT001
    seen = read(ros1_bag(tmp_path / "x.bag", 40, compression), pipe=pipe)
    assert numbers(seen) == ALL
    assert [message.log_time_ns for message in seen.messages] == [10**9 + k * 10**7 for k in ALL]
    assert seen.damages == []


@pytest.mark.parametrize("name", ["example-bz2.bag", "example-lz4.bag"])
def test_real_bags_agree_with_rosbags_own_reader(name: str) -> None:
    path = shared(f"formats/rosbag1/{name}")
    with Reader(path) as reader:
        theirs = [(connection.topic, stamp, bytes(data)) for connection, stamp, data in reader.messages()]
        kinds = {connection.topic: (connection.msgtype, connection.digest) for connection in reader.connections}
    seen = look_at(path)
    assert sorted(seen.stamped) == sorted(theirs)
    assert {m.channel.topic: (m.channel.type, m.channel.digest) for m in seen.messages} == kinds


def test_an_uncompressed_bag_cut_anywhere_gives_exactly_the_messages_that_are_there(tmp_path: Path) -> None:
    data = ros1_bag(tmp_path / "x.bag", 40)
    ends = [data.index(m.data) + len(m.data) for m in read(data).messages]
    for cut in seeded(4).sample(range(14, index_at(data)), 80):
        seen = read(data[:cut])
        assert len(numbers(seen)) == sum(end <= cut for end in ends)
        assert any(not damage.lossless for damage in seen.damages), f"a cut at byte {cut} went unnoticed"


@pytest.mark.parametrize("compression", FORMATS[1:])
def test_a_cut_compressed_bag_gives_all_whole_chunks(tmp_path: Path, compression: object) -> None:
    data = ros1_bag(tmp_path / "x.bag", 40, compression)
    with Reader(tmp_path / "x.bag") as reader:
        chunks = [(info.pos, sum(info.connection_counts.values())) for info in reader.chunk_infos]
    for cut in seeded(4).sample(range(4200, index_at(data)), 30):
        found = numbers(read(data[:cut]))
        begun = [count for position, count in chunks if position < cut]
        assert found == list(range(len(found)))
        assert len(found) >= sum(begun[:-1]), "every chunk before the one that was cut"


def test_a_bag_without_its_index_is_whole_and_unclosed(tmp_path: Path) -> None:
    data = bytearray(ros1_bag(tmp_path / "x.bag", 40))
    end = index_at(bytes(data))
    struct.pack_into("<Q", data, data.index(b"index_pos=") + len("index_pos="), 0)
    seen = read(bytes(data[:end]))
    assert numbers(seen) == ALL
    assert [damage.lossless for damage in seen.damages] == [False], "what should have followed is unknown"


@pytest.mark.parametrize("compression", FORMATS[1:])
def test_a_chunk_that_does_not_decompress_is_dropped_and_counted(tmp_path: Path, compression: object) -> None:
    data = bytearray(ros1_bag(tmp_path / "x.bag", 40, compression))
    starts = [k for k in range(len(data)) if data.startswith(b"compression=", k)]
    for k in range(starts[1] + 60, starts[1] + 160):
        data[k] ^= 0x55
    seen = read(bytes(data))
    lost = [number for number in ALL if number not in numbers(seen)]
    (damage,) = seen.damages
    assert lost
    assert (damage.messages, damage.lossless) == (len(lost), False)
    assert (damage.first_ns, damage.last_ns) == (10**9 + lost[0] * 10**7, 10**9 + lost[-1] * 10**7)


def test_reading_resumes_at_the_next_chunk(tmp_path: Path) -> None:
    data = bytearray(ros1_bag(tmp_path / "x.bag", 40))
    starts = [k for k in range(len(data)) if data.startswith(b"compression=", k)]
    data[starts[1] - 12 : starts[1] + 20] = seeded(2).randbytes(32)
    for pipe in (False, True):
        seen = read(bytes(data), pipe=pipe)
        assert numbers(seen)[-1] == 39
        assert 30 <= len(numbers(seen)) < 40
        assert any("framing is broken" in damage.what for damage in seen.damages)


def test_a_connection_lost_with_its_chunk_is_learnt_from_the_index(tmp_path: Path) -> None:
    data = bytearray(ros1_bag(tmp_path / "x.bag", 40, Writer.CompressionFormat.LZ4))
    start = data.index(b"compression=")
    data[start + 60 : start + 160] = bytes(100)
    seen = read(bytes(data))
    assert numbers(seen) == ALL[-len(seen.messages) :]
    assert len(seen.messages) > 30


def test_bags_whose_index_states_wrong_lengths_read_in_full() -> None:
    seen = look_at(shared("formats/rosbag1/ccny-laser_scan_matcher-demo.bag"))
    assert seen.counts == {"/scan": 360}
    assert seen.damages == []


def test_a_bag_damaged_anywhere_never_raises_and_never_loses_silently(tmp_path: Path) -> None:
    data = ros1_bag(tmp_path / "x.bag", 40, Writer.CompressionFormat.BZ2)
    end = index_at(data)
    rng = seeded(6)
    for _ in range(200):
        hurt = bytearray(data)
        at, length = rng.randrange(14, end), rng.randrange(1, 300)
        match rng.randrange(4):
            case 0:
                del hurt[at : at + length]
            case 1:
                hurt[at : at + length] = bytes(length)
            case 2:
                hurt[at:at] = rng.randbytes(length)
            case _:
                hurt[at] ^= 1 << rng.randrange(8)
        seen = read(bytes(hurt))
        assert len(seen.messages) >= 40 or seen.damages


def test_a_second_bag_in_the_same_file_is_a_loss(tmp_path: Path) -> None:
    seen = read(ros1_bag(tmp_path / "x.bag", 40) * 2)
    assert numbers(seen) == ALL
    assert [(damage.lossless, "another log follows" in damage.what) for damage in seen.damages] == [(False, True)]


def test_records_too_large_for_the_memory_are_passed_over(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bag1_file, "RECORD_LIMIT", 5000)
    data = ros1_bag(tmp_path / "x.bag", 40, chunk=10**6)
    for pipe in (False, True):
        seen = read(data, pipe=pipe)
        assert seen.messages == []
        assert [damage.what.partition(" has ")[2] for damage in seen.damages[:-1]] == [
            "0 MiB, more than 256; it is skipped"
        ]
        assert seen.damages[-1].messages == 40
