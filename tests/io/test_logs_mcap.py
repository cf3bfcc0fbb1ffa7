from __future__ import annotations

import io
import struct
from collections import Counter
from typing import TYPE_CHECKING
from unittest import mock

import pytest
from mcap.reader import make_reader
from mcap.records import Chunk, MessageIndex
from mcap.stream_reader import StreamReader
from mcap.writer import CompressionType

from mclcli.io.logs import holding, mcap_contents, mcap_file, open_log
from mclcli.io.logs.base import Channel, PassedOver, Recorded, Tally, Wish
from mclcli.io.logs.mcap_file import McapFile
from mclcli.io.logs.source import ByteSource
from tests.battery import records
from tests.data import shared
from tests.io.logs import Seen, look, look_at, mcap_bytes, numbers, seeded

if TYPE_CHECKING:
    from pathlib import Path

STAMPS = [10**9 + k * 10**7 for k in range(60)]
ALL = list(range(60))
COMPRESSIONS = [CompressionType.NONE, CompressionType.LZ4, CompressionType.ZSTD]


def container(data: bytes, *, pipe: bool = False) -> McapFile:
    return McapFile("x.mcap", lambda: ByteSource(io.BytesIO(data), None if pipe else len(data)))


def read(data: bytes, *, pipe: bool = False) -> Seen:
    return look(container(data, pipe=pipe))


def chunks_of(data: bytes) -> list[tuple[int, int]]:
    """(Start, stop) of each chunk record."""
    spans, at = [], 8
    while data[at] != 2:
        (length,) = struct.unpack_from("<Q", data, at + 1)
        if data[at] == 6:
            spans.append((at, at + 9 + length))
        at += 9 + length
    return spans


@pytest.mark.parametrize("pipe", [False, True])
@pytest.mark.parametrize("chunked", [False, True])
@pytest.mark.parametrize("compression", COMPRESSIONS)
def test_healthy_files_give_every_message_and_no_damage(
    compression: CompressionType,
    chunked: bool,  # noqa: FBT001
    pipe: bool,  # noqa: FBT001
) -> None:
    seen = read(mcap_bytes(STAMPS, compression=compression, chunked=chunked), pipe=pipe)
    assert numbers(seen) == ALL
    assert [message.log_time_ns for message in seen.messages] == STAMPS
    assert seen.damages == []


def test_intel_agrees_with_mcaps_own_reader() -> None:
    path = shared("intel/intel.mcap")
    with path.open("rb") as stream:
        theirs = [(c.topic, m.log_time, m.data) for _, c, m in make_reader(stream).iter_messages(log_time_order=True)]
    assert Counter(look_at(path).stamped) == Counter(theirs)


@pytest.mark.parametrize("compression", COMPRESSIONS)
def test_a_cut_file_gives_at_least_all_whole_chunks_before_the_cut(compression: CompressionType) -> None:
    data = mcap_bytes(STAMPS, compression=compression)
    spans = chunks_of(data)
    reader = StreamReader(io.BytesIO(data), emit_chunks=True)
    ends = [record.message_end_time for record in reader.records if isinstance(record, Chunk)]
    for cut in seeded(7).sample(range(9, spans[-1][1]), 60):
        seen = read(data[:cut])
        found = numbers(seen)
        assert found == list(range(len(found)))
        last = max((end for (_, stop), end in zip(spans, ends, strict=True) if stop <= cut), default=0)
        assert len(found) >= sum(stamp <= last for stamp in STAMPS)
        assert seen.damages, f"a cut at byte {cut} went unnoticed"


def test_a_cut_uncompressed_file_gives_exactly_the_messages_that_are_there() -> None:
    data = mcap_bytes(STAMPS, compression=CompressionType.NONE)
    ends = [data.index(bytes(m.data)) + len(m.data) for m in read(data).messages]
    for cut in seeded(8).sample(range(9, chunks_of(data)[-1][1]), 80):
        assert len(numbers(read(data[:cut]))) == sum(end <= cut for end in ends)
        assert len(numbers(read(data[:cut], pipe=True))) == sum(end <= cut for end in ends)


def test_an_unchunked_file_cut_anywhere_gives_exactly_the_messages_that_are_there() -> None:
    data = mcap_bytes(STAMPS, chunked=False)
    ends = [data.index(bytes(m.data)) + len(m.data) for m in read(data).messages]
    for cut in seeded(9).sample(range(9, ends[-1]), 80):
        assert len(numbers(read(data[:cut]))) == sum(end <= cut for end in ends)


def test_compressed_chunks_are_recovered_as_far_as_whole_blocks_go() -> None:
    data = mcap_bytes([10**9 + k for k in range(4000)], chunk_size=10**6)
    (start, stop) = chunks_of(data)[0]
    seen = read(data[: start + (stop - start) * 3 // 4])
    found = numbers(seen)
    assert 500 < len(found) < 4000
    assert found == list(range(len(found)))
    assert f"{len(found)} messages of its last chunk were recovered unverified" in seen.damages[0].what
    assert not seen.damages[0].lossless


def test_an_unclosed_file_gives_all_it_has_and_says_so() -> None:
    data = mcap_bytes(STAMPS)
    seen = read(data[: chunks_of(data)[-1][1]])
    assert numbers(seen) == ALL
    assert [damage.lossless for damage in seen.damages] == [False], "what should have followed is unknown"
    assert "not closed" in seen.damages[0].what


@pytest.mark.parametrize("compression", COMPRESSIONS)
def test_a_chunk_that_fails_its_checksum_is_dropped_whole_and_counted(compression: CompressionType) -> None:
    data = bytearray(mcap_bytes(STAMPS, compression=compression))
    start, stop = chunks_of(bytes(data))[2]
    healthy = read(bytes(data))
    records = list(StreamReader(io.BytesIO(bytes(data)), emit_chunks=True).records)
    place = [k for k, record in enumerate(records) if isinstance(record, Chunk)][2]
    chunk = records[place]
    assert isinstance(chunk, Chunk)
    inside = [m for m in healthy.messages if chunk.message_start_time <= m.log_time_ns <= chunk.message_end_time]
    assert isinstance(records[place + 1], MessageIndex)
    data[stop - 300] ^= 0x10
    seen = read(bytes(data))
    assert numbers(seen) == [n for n in ALL if STAMPS[n] not in {m.log_time_ns for m in inside}]
    (damage,) = seen.damages
    assert damage.offset == start
    assert (damage.messages, damage.lossless) == (len(inside), False)
    assert (damage.first_ns, damage.last_ns) == (chunk.message_start_time, chunk.message_end_time)


def test_a_chunk_that_is_gone_is_missed_beside_one_that_is_damaged() -> None:
    data = bytearray(mcap_bytes(STAMPS, compression=CompressionType.NONE, data_crc=False))
    starts = [start for start, _ in chunks_of(bytes(data))]
    data[chunks_of(bytes(data))[4][1] - 300] ^= 0x10
    del data[starts[2] : starts[3]]
    seen = read(bytes(data))
    broken, gone = seen.damages
    assert broken.messages is not None
    assert gone.messages == 60 - len(seen.messages) - broken.messages
    assert gone.what == "chunk indexes name a chunk that is not there"


def test_the_warning_reads_as_promised() -> None:
    data = bytearray(mcap_bytes(STAMPS, compression=CompressionType.NONE))
    start, stop = chunks_of(bytes(data))[1]
    data[stop - 300] ^= 0x10
    (damage,) = read(bytes(data)).damages
    text = damage.describe(STAMPS[0])
    assert text == f"x.mcap: chunk at byte {start} fails its checksum; 9 messages (0.1–0.2 s) skipped"


def test_channels_lost_with_their_chunk_are_learnt_from_the_summary() -> None:
    data = bytearray(mcap_bytes(STAMPS))
    _, stop = chunks_of(bytes(data))[0]
    data[stop - 300] ^= 0x10
    seen = read(bytes(data))
    assert numbers(seen) == ALL[-len(seen.messages) :]
    assert len(seen.messages) > 40
    assert read(bytes(data), pipe=True) == seen, "what comes through a pipe is held until it is described"


def test_a_pipe_holds_no_more_than_its_limit(monkeypatch: pytest.MonkeyPatch) -> None:
    data = bytearray(mcap_bytes(STAMPS))
    data[chunks_of(bytes(data))[0][1] - 300] ^= 0x10
    monkeypatch.setattr(holding, "HELD_LIMIT", 1000)
    seen = read(bytes(data), pipe=True)
    assert seen.messages == []
    assert [damage.messages for damage in seen.damages] == [9, 51], "it must say what it lost"


def test_reading_resumes_after_broken_framing() -> None:
    data = bytearray(mcap_bytes(STAMPS))
    spans = chunks_of(bytes(data))
    data[spans[1][0] : spans[1][0] + 30] = seeded(3).randbytes(30)
    for pipe in (False, True):
        seen = read(bytes(data), pipe=pipe)
        found = numbers(seen)
        assert found[-1] == 59
        assert len(found) >= 60 - 10
        assert any("framing is broken" in damage.what for damage in seen.damages)


def test_reading_resumes_in_an_unchunked_file() -> None:
    data = bytearray(mcap_bytes(STAMPS, chunked=False))
    at = data.index(read(bytes(data)).messages[20].data)
    del data[at + 50 : at + 90]
    seen = read(bytes(data))
    good = [m for m in seen.messages if m.data[:4] != struct.pack("<I", 20)]
    assert len(good) >= 58
    assert seen.damages


def test_an_altered_byte_outside_the_chunks_is_noticed_by_the_data_checksum() -> None:
    data = bytearray(mcap_bytes(STAMPS, chunked=False, data_crc=True))
    at = data.index(read(bytes(data)).messages[20].data)
    data[at + 100] ^= 1
    assert [damage.what.partition(";")[0] for damage in read(bytes(data)).damages] == [
        "data section fails its checksum"
    ]


def test_every_flipped_bit_in_a_checked_file_is_noticed() -> None:
    data = mcap_bytes(STAMPS[:12], data_crc=True, chunk_size=700)
    healthy = read(data).stamped
    rng = seeded(11)
    for _ in range(400):
        hurt = bytearray(data)
        at = rng.randrange(8, len(data))
        hurt[at] ^= 1 << rng.randrange(8)
        seen = read(bytes(hurt))
        assert set(seen.stamped) <= set(healthy) or seen.damages
        assert seen.stamped == healthy or seen.damages, f"byte {at}: a loss went unnoticed"


def test_declared_sizes_allocate_nothing() -> None:
    data = bytearray(mcap_bytes(STAMPS))
    start, _ = chunks_of(bytes(data))[1]
    struct.pack_into("<Q", data, start + 9 + 16, 1 << 50)
    assert "more than 256 MiB" in read(bytes(data)).damages[0].what
    struct.pack_into("<Q", data, start + 1, 1 << 60)
    assert len(numbers(read(bytes(data)))) > 40
    assert len(numbers(read(bytes(data), pipe=True))) > 40


def test_bytes_after_the_end_and_a_lost_closing_mark_cost_nothing() -> None:
    data = mcap_bytes(STAMPS)
    for changed in (data + b"\0" * 10, data[:-3], data[:-60]):
        seen = read(changed)
        assert numbers(seen) == ALL
        assert [damage.lossless for damage in seen.damages] == [True]


def test_unwanted_channels_are_counted_and_not_read() -> None:
    items = list(container(mcap_bytes(STAMPS)).items(Wish(lambda channel: channel.topic == "/a")))
    passed = [item for item in items if isinstance(item, PassedOver)]
    assert sum(item.messages for item in passed) == 30
    assert {item.channel.topic for item in passed} == {"/b"}
    assert (passed[0].messages, passed[0].first_ns) == (1, STAMPS[1]), "the first one is told at once"
    assert max(item.last_ns for item in passed) == STAMPS[-1]


def test_a_damaged_file_never_raises_and_never_hangs(tmp_path: Path) -> None:
    data = mcap_bytes(STAMPS, compression=CompressionType.LZ4)
    rng = seeded(5)
    for _ in range(150):
        hurt = bytearray(data)
        at, length = rng.randrange(8, len(data)), rng.randrange(1, 400)
        match rng.randrange(3):
            case 0:
                del hurt[at : at + length]
            case 1:
                hurt[at : at + length] = bytes(length)
            case _:
                hurt[at:at] = rng.randbytes(length)
        path = tmp_path / "hurt.mcap"
        path.write_bytes(hurt)
        seen = look_at(path)
        assert seen.damages or numbers(seen) == ALL


def test_many_channels_take_no_longer_each(tmp_path: Path) -> None:
    channels = b"".join(records.channel(number, 9, f"/t{number}") for number in range(6, 20_000))
    (tmp_path / "x.mcap").write_bytes(records.mcap(records.schema(9, "a/B", "ros2msg", ""), channels))
    log, tally = open_log([tmp_path / "x.mcap"]), Tally()
    with mock.patch.object(Channel, "__eq__", side_effect=AssertionError("compared one by one")):
        assert list(log.messages(None, tally)) == []
    assert len(tally.channels) == 19_994


@pytest.mark.parametrize("pipe", [False, True])
def test_a_second_log_in_the_same_file_is_a_loss(pipe: bool) -> None:  # noqa: FBT001
    seen = read(mcap_bytes(STAMPS) * 2, pipe=pipe)
    assert numbers(seen) == ALL
    assert [damage.lossless for damage in seen.damages] == [False]
    assert f"another log follows at byte {len(mcap_bytes(STAMPS))}" in seen.damages[0].what


def test_records_too_large_for_the_memory_are_passed_over(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mcap_file, "RECORD_LIMIT", 5000)
    for compression in COMPRESSIONS:
        seen = read(
            mcap_bytes(STAMPS[:8], chunk_size=1) + mcap_bytes(STAMPS, compression=compression, chunk_size=10**6)
        )
        assert numbers(seen) == ALL[:8]
    large = records.mcap(records.drive(), records.record(records.MESSAGE, bytes(6000)))
    for pipe in (False, True):
        seen = read(large, pipe=pipe)
        assert len(seen.messages) == 313
        assert [damage.what for damage in seen.damages] == [
            f"record at byte {8 + 9 + 19 + len(records.drive())} has 0 MiB, more than 256; it is skipped"
        ]


def test_large_messages_are_views_of_their_chunk(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mcap_contents, "LARGE", 200)
    for compression in COMPRESSIONS:
        seen = read(mcap_bytes(STAMPS, compression=compression))
        assert numbers(seen) == ALL
        assert {type(message.data).__name__ for message in seen.messages} == {"memoryview"}


def test_publish_times_and_schemas_are_kept() -> None:
    data = records.mcap(
        records.schema(1, "a/B", "jsonschema", "{}"),
        records.channel(1, 1, "/a", "json", records.text("k") + records.text("v")),
        records.message(1, 5, b"{}"),
    )
    (message,) = read(data).messages
    assert (message.log_time_ns, message.publish_ns, message.channel.definition) == (5, 5, "")
    assert message.channel.recorded == Recorded("a/B", "jsonschema", b"{}", (("k", "v"),))
