"""Losses and copies that no broken byte shows: chunks cut out, chunks twice, records turned into others."""

from __future__ import annotations

import io
import re
import struct
from typing import TYPE_CHECKING, Any

import pytest
from mcap.writer import CompressionType, IndexType

from mclcli.io.logs.bag1_file import Bag1File
from mclcli.io.logs.base import Tally
from mclcli.io.logs.mcap_file import McapFile
from mclcli.io.logs.source import ByteSource
from tests.battery import damaged, records
from tests.battery.bases import base_logs
from tests.battery.damages import damages
from tests.io.logs import look, mcap_bytes, numbers, ros1_bag, seeded

if TYPE_CHECKING:
    from pathlib import Path

    from tests.io.logs import Seen

COUNT = 120
STAMPS = [10**9 + number * 10**7 for number in range(COUNT)]
PLAIN: dict[str, Any] = {"use_statistics": False, "enable_crcs": False, "data_crc": False}
INDEXED = {**PLAIN, "index_types": IndexType.ALL}
BARE = {**PLAIN, "index_types": IndexType.NONE}
ALL = list(range(COUNT))


def read(data: bytes, *, pipe: bool = False) -> Seen:
    def start() -> ByteSource:
        return ByteSource(io.BytesIO(data), None if pipe else len(data))

    return look(Bag1File("x.bag", start) if data[:7] == b"#ROSBAG" else McapFile("x.mcap", start))


def lost(seen: Seen) -> int:
    """Messages said to be lost, less those that were read after all."""
    return sum(damage.messages or 0 for damage in seen.damages)


def spans(data: bytes) -> list[tuple[int, int, int]]:
    """Kind, first and last byte of each record outside chunks."""
    found, at = [], 8
    while at + 9 <= len(data) - 8:
        kind, length = struct.unpack_from("<BQ", data, at)
        found.append((kind, at, at + 9 + length))
        at += 9 + length
    return found


def chunks(data: bytes) -> list[tuple[int, int]]:
    return [(start, stop) for kind, start, stop in spans(data) if kind == records.CHUNK]


@pytest.mark.parametrize("pipe", [False, True])
@pytest.mark.parametrize("options", [INDEXED, BARE, {"use_statistics": False}, {}])
@pytest.mark.parametrize("compression", [CompressionType.NONE, CompressionType.LZ4])
@pytest.mark.parametrize("which", [3, -2])
def test_a_chunk_that_was_cut_out_is_missed(
    options: dict[str, Any], compression: CompressionType, which: int, *, pipe: bool
) -> None:
    data = mcap_bytes(STAMPS, compression=compression, **options)
    start, stop = chunks(data)[which]
    assert read(data).damages == []
    seen = read(data[:start] + data[stop:], pipe=pipe)
    found = numbers(seen)
    assert len(found) < COUNT
    assert lost(seen) == COUNT - len(found)


@pytest.mark.parametrize("options", [INDEXED, BARE, {}])
@pytest.mark.parametrize("to", [0, 5, -1])
@pytest.mark.parametrize("pipe", [False, True])
def test_a_chunk_that_is_there_twice_is_read_once_and_told(options: dict[str, Any], to: int, *, pipe: bool) -> None:
    data = mcap_bytes(STAMPS, **options)
    start, stop = chunks(data)[2]
    at = chunks(data)[to][0]
    seen = read(data[:at] + data[start:stop] + data[at:], pipe=pipe)
    assert sorted(numbers(seen)) == ALL
    assert any("repeats the one at byte" in damage.what for damage in seen.damages)
    assert lost(seen) == 0
    assert any(not damage.lossless for damage in seen.damages)


@pytest.mark.parametrize("kind", [0, 1, 3, 4, 7, 8, 9, 12, 14, 0x10, 0x86])
@pytest.mark.parametrize("options", [INDEXED, BARE])
def test_a_chunk_turned_into_another_record_is_missed(kind: int, options: dict[str, Any]) -> None:
    data = bytearray(mcap_bytes(STAMPS, **options))
    data[chunks(bytes(data))[3][0]] = kind
    seen = read(bytes(data))
    assert len(numbers(seen)) > COUNT - 12
    assert (len(seen.messages) == COUNT) is (options is INDEXED), "the index says where the chunk is"
    assert lost(seen) == COUNT - len(seen.messages)
    assert any(not damage.lossless for damage in seen.damages)


@pytest.mark.parametrize("kind", [3, 4, 6, 9, 0x85])
@pytest.mark.parametrize("chunked", [False, True])
def test_a_message_turned_into_another_record_is_missed(kind: int, *, chunked: bool) -> None:
    options = {**BARE, "compression": CompressionType.NONE}
    data = bytearray(mcap_bytes(STAMPS, chunked=chunked, **options))
    (at,) = (
        match.start()
        for match in re.finditer(rb"\x05" + struct.pack("<Q", 222), data)
        if data[match.start() + 31] == 50
    )
    data[at] = kind
    seen = read(bytes(data))
    assert numbers(seen) == [number for number in ALL if number != 50]
    assert any(not damage.lossless for damage in seen.damages)
    assert lost(seen) == 1


@pytest.mark.parametrize("delta", [1, 7, 3000])
@pytest.mark.parametrize("compression", [CompressionType.NONE, CompressionType.ZSTD])
@pytest.mark.parametrize("what", [records.CHUNK, records.MESSAGE_INDEX])
def test_chunks_beside_a_record_of_wrong_length_are_read(delta: int, compression: CompressionType, what: int) -> None:
    data = bytearray(mcap_bytes(STAMPS, compression=compression))
    at = [start for kind, start, _ in spans(bytes(data)) if kind == what][4]
    (length,) = struct.unpack_from("<Q", data, at + 1)
    struct.pack_into("<Q", data, at + 1, length + delta)
    seen = read(bytes(data))
    assert len(numbers(seen)) >= COUNT - 10
    assert any(not damage.lossless for damage in seen.damages)


@pytest.mark.parametrize("compression", [None, "lz4"])
def test_bags_tell_chunks_that_are_missing_or_there_twice(compression: str | None, tmp_path: Path) -> None:
    from rosbags.rosbag1 import Writer

    data = ros1_bag(tmp_path / "x.bag", COUNT, None if compression is None else Writer.CompressionFormat.LZ4)
    heads = [match.start() for match in re.finditer(rb"compression=", data)]
    starts = [data.rindex(struct.pack("<I", 41 - (compression == "lz4")), 0, at) for at in heads]
    gone = read(data[: starts[3]] + data[starts[4] :])
    assert lost(gone) == COUNT - len(numbers(gone)) > 0
    twice = read(data[: starts[3]] + data[starts[3] : starts[4]] + data[starts[3] :])
    assert numbers(twice) == ALL
    assert [damage.messages for damage in twice.damages if not damage.lossless] == [0]


def test_numbers_that_count_nothing_are_no_evidence() -> None:
    one = records.schema(1, "std_msgs/msg/String", "ros2msg", "string data") + records.channel(1, 1, "/a")
    body = b"".join(
        records.record(records.MESSAGE, struct.pack("<HIQQ", 1, number * number * 1000, 10**9 + number, 0) + b"x")
        for number in range(50)
    )
    seen = read(records.mcap(one + body))
    assert (len(seen.messages), seen.damages) == (50, [])


def test_unclosed_files_do_not_claim_to_be_whole_where_they_are_not() -> None:
    data = mcap_bytes(STAMPS)
    stop = chunks(data)[-1][1]
    assert any("every message in it was read" in damage.what for damage in read(data[:stop]).damages)
    hurt = bytearray(data[:stop])
    hurt[chunks(data)[3][0] + 80] ^= 1
    damages = read(bytes(hurt)).damages
    assert any("was not closed" in damage.what for damage in damages)
    assert not any("every message" in damage.what for damage in damages)


@pytest.mark.parametrize("padding", [1, 49, 70_000])
def test_zeros_between_the_records_of_a_bag_are_no_damage(padding: int, tmp_path: Path) -> None:
    data = bytearray(ros1_bag(tmp_path / "x.bag", COUNT))
    at = data.index(b"index_pos=") + 10
    (index,) = struct.unpack_from("<Q", data, at)
    struct.pack_into("<Q", data, at, index + padding)
    seen = read(bytes(data[:index]) + bytes(padding) + bytes(data[index:]))
    assert (numbers(seen), seen.damages) == (ALL, [])
    first = data.index(b"compression=") - 8
    assert lost(read(bytes(data[:first]) + bytes(index - first) + bytes(data[index:]))) == COUNT, (
        "zeros over messages are"
    )


FOOTER = records.record(records.FOOTER, bytes(20))


@pytest.mark.parametrize("pipe", [False, True])
@pytest.mark.parametrize("chunked", [False, True])
@pytest.mark.parametrize("what", [FOOTER, FOOTER + records.MAGIC, FOOTER + bytes(3)])
def test_a_footer_in_the_middle_of_a_file_does_not_end_it(what: bytes, *, chunked: bool, pipe: bool) -> None:
    data = mcap_bytes(STAMPS, chunked=chunked, **INDEXED)
    at = chunks(data)[4][0] if chunked else [start for kind, start, _ in spans(data) if kind == records.MESSAGE][50]
    seen = read(data[:at] + what + data[at:], pipe=pipe)
    assert numbers(seen) == ALL
    assert any("is not the end" in damage.what and not damage.lossless for damage in seen.damages)


@pytest.mark.parametrize("length", [20, 21])
def test_a_record_turned_into_a_footer_does_not_end_a_file(length: int) -> None:
    data = mcap_bytes(STAMPS, **INDEXED)
    at = chunks(data)[4][0]
    hurt = records.record(records.FOOTER, records.text("n" * (length - 8)) + bytes(4))  # it was metadata
    seen = read(data[:at] + hurt + data[at:])
    assert numbers(seen) == ALL
    assert any(not damage.lossless for damage in seen.damages)


@pytest.mark.parametrize("chunked", [False, True])
def test_what_stands_behind_a_moved_end_is_read(*, chunked: bool) -> None:
    data = mcap_bytes(STAMPS, chunked=chunked)
    end = next(start for kind, start, _ in spans(data) if kind == records.DATA_END)
    at = chunks(data)[4][0] if chunked else [start for kind, start, _ in spans(data) if kind == records.MESSAGE][50]
    seen = read(data[:at] + data[end:] + data[at:end])
    assert numbers(seen) == ALL
    assert any(not damage.lossless for damage in seen.damages)


@pytest.mark.parametrize("pipe", [False, True])
def test_copies_behind_the_end_of_a_whole_file_are_ignored(*, pipe: bool) -> None:
    data = mcap_bytes(STAMPS)
    start, stop = chunks(data)[4]
    seen = read(data + data[start:stop], pipe=pipe)
    assert (numbers(seen), [damage.lossless for damage in seen.damages]) == (ALL, [True])


@pytest.mark.parametrize("kind", range(16))
@pytest.mark.parametrize("what", [records.CHUNK, records.MESSAGE_INDEX])
def test_a_chunk_whose_head_was_swallowed_is_read_whatever_its_bytes_look_like(kind: int, what: int) -> None:
    """Where the record before it says that it ends stands a byte of a time: of any value, as that of any record."""
    stamps = [kind * 0x0101010101010101 + number * 10**5 for number in range(COUNT)]
    data = bytearray(mcap_bytes(stamps))
    (before,) = (i for i, (_, start, _) in enumerate(spans(bytes(data))) if start == chunks(bytes(data))[4][0])
    at = max(start for number, start, _ in spans(bytes(data))[:before] if number == what)
    end = next(stop for _, start, stop in spans(bytes(data)) if start == at)
    into = 9 + 6 if what == records.MESSAGE_INDEX else -1
    if what == records.CHUNK:  # cut its indexes out, so that a chunk follows
        del data[end : chunks(bytes(data))[4][0]]
        into = 9 + 6
    assert data[end + into] == kind
    struct.pack_into("<Q", data, at + 1, end - at - 9 + into)
    found = numbers(read(bytes(data)))
    assert set(ALL) - set(found) <= set(range(18, 40)) if what == records.CHUNK else found == ALL


@pytest.mark.parametrize("bag", [False, True])
def test_a_damaged_chunk_is_told_where_its_index_is_damaged_too(tmp_path: Path, *, bag: bool) -> None:
    from rosbags.rosbag1 import Writer

    if bag:
        data = bytearray(ros1_bag(tmp_path / "x.bag", COUNT, Writer.CompressionFormat.BZ2))
        at = data.index(b"compression=")
        data[at + 60] ^= 1
        data[data.index(b"count=", at) + 9] = 127
    else:
        data = bytearray(mcap_bytes(STAMPS))
        start, stop = chunks(bytes(data))[2]
        data[start + 80] ^= 1
        data[stop + 5] = 1
    told = [damage.what for damage in read(bytes(data)).damages]
    assert any("chunk at byte" in what for what in told)
    assert any("framing is broken" in what for what in told)


@pytest.mark.parametrize("pipe", [False, True])
@pytest.mark.parametrize("which", [0, 1])
def test_a_count_from_indexes_of_which_one_is_broken_is_a_least_one(which: int, *, pipe: bool) -> None:
    """Each chunk has an index for /a and one for /b."""
    data = bytearray(mcap_bytes(STAMPS, use_statistics=False))
    kinds = [kind for kind, *_ in spans(bytes(data))]
    third = [number for number, kind in enumerate(kinds) if kind == records.CHUNK][2]
    _, start, stop = spans(bytes(data))[third]
    assert kinds[third + 1 : third + 3] == [records.MESSAGE_INDEX, records.MESSAGE_INDEX]
    broken = spans(bytes(data))[third + 1 + which][1]
    data[(start + stop) // 2] ^= 0x10  # the chunk fails its checksum
    data[broken + 8] = 0x7F  # an index of 2⁶² bytes
    seen = read(bytes(data), pipe=pipe)
    (counted,) = (damage for damage in seen.damages if damage.messages and not damage.in_all)
    assert counted.least
    assert "; at least" in counted.describe(None)
    assert Tally(damages=[counted]).lost() == (counted.messages, True)
    assert lost(seen) == COUNT - len(numbers(seen))  # the index of chunks settles it


def test_a_count_from_whole_indexes_is_the_number_lost() -> None:
    data = bytearray(mcap_bytes(STAMPS, use_statistics=False))
    start, stop = chunks(bytes(data))[2]
    data[(start + stop) // 2] ^= 0x10
    seen = read(bytes(data))
    assert not any(damage.least for damage in seen.damages)
    assert lost(seen) == COUNT - len(numbers(seen)) > 0


@pytest.mark.parametrize(
    ("name", "damage", "seed"),
    [
        ("plain.bag", "dropped span 27", 1),  # a record goes on into the next chunk, whose messages then seem loose
        ("rosbag2.mcap.zstd", "bit in the body 53", 2),  # a frame decodes to others' bytes: indexes are broken as well
    ],
)
def test_what_the_battery_has_found_stays_right(name: str, damage: str, seed: int, tmp_path: Path) -> None:
    (base,) = (base for base in base_logs() if base.name == name)
    data = dict(damages(1.0))[damage](base.data, seeded(f"{seed} {name}, {damage}"))
    path = tmp_path / name
    path.write_bytes(data)
    problems, _ = damaged.compare(base, *damaged.read_all(path), data)
    assert problems == []
