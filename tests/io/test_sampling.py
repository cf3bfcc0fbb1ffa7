"""Surveys of indexed MCAP from a sample: what the whole log says, as far as it was read, and never more."""

from __future__ import annotations

import dataclasses
import io
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
import pytest
import zstandard
from mcap.reader import make_reader
from mcap.writer import IndexType, Writer

from mclcli.io.logs import open_log
from mclcli.io.logs.base import Tally
from mclcli.io.logs.mcap_index import read_index
from mclcli.io.recording import roles, sampling
from mclcli.io.recording.clocks import Clocks
from mclcli.io.recording.diagnosis import Diagnosis
from mclcli.io.recording.recording import Recording
from tests.cli.support import OFFICE, SAMPLES, mcl, messages, write_mcap

if TYPE_CHECKING:
    from pathlib import Path

sample_any = partial(sampling.sample, above=0)


def chunks_of(path: Path) -> list[tuple[int, int]]:
    """(start, length) of the chunks of a file, by the library."""
    summary = make_reader(io.BytesIO(path.read_bytes())).get_summary()
    assert summary is not None
    return sorted((c.chunk_start_offset, c.chunk_length) for c in summary.chunk_indexes)


def damaged(path: Path, at: int, to: Path) -> Path:
    """A copy with one byte inverted."""
    data = bytearray(path.read_bytes())
    data[at] ^= 0xFF
    to.write_bytes(data)
    return to


@pytest.mark.parametrize("name", ["office", "warehouse"])
def test_a_sample_says_what_the_whole_log_says(name: str) -> None:
    log, deep, quick = open_log([SAMPLES / f"{name}.mcap"]), Diagnosis(), Diagnosis()
    whole, found = Recording(log, whole=True, diagnosis=deep), sample_any(log, quick)
    assert found is not None
    assert roles.assign(found.survey) == roles.assign(whole.survey)
    assert found.survey.span_ns == whole.survey.span_ns
    assert found.survey.topics.keys() == whole.survey.topics.keys()
    for topic, theirs in whole.survey.topics.items():
        ours = found.survey.topics[topic]
        for field in ("channel", "count", "first_ns", "last_ns", "longest_gap_ns", "problem"):
            assert getattr(ours, field) == getattr(theirs, field), (topic, field)
        assert quick.times(topic).interval == deep.times(topic).interval
    assert found.survey.frames.frames == whole.survey.frames.frames
    assert quick.problems(Clocks(0)) == deep.problems(Clocks(0))
    assert not found.tally.lossy


def test_info_of_a_large_log(monkeypatch: pytest.MonkeyPatch) -> None:
    whole = mcl("info", OFFICE).out.decode().splitlines()
    monkeypatch.setattr(sampling, "sample", sample_any)
    monkeypatch.setattr(sampling, "SAMPLES", 3)
    result = mcl("info", OFFICE)
    assert result.code == 0
    total = len(chunks_of(OFFICE))
    assert f" of {total} chunks verified, the rest not read" in result.out.decode()
    assert "checksums: 0 of" not in result.out.decode()
    ours = result.out.decode().splitlines()
    assert [line for line in ours if "checksums" not in line] == [line for line in whole if "checksums" not in line]
    assert mcl("info", OFFICE, "--deep").out.decode().splitlines() == whole


def test_messages_compressed_one_by_one_are_unpacked(tmp_path: Path) -> None:
    known = messages(OFFICE)[:300]
    packed = [dataclasses.replace(message, data=zstandard.compress(message.data)) for message in known]
    packed[0] = dataclasses.replace(packed[0], data=packed[0].data[:20])
    paths = [write_mcap(tmp_path / f"{name}.mcap", logs) for name, logs in (("plain", known[1:]), ("packed", packed))]
    plain, unpacked = (sample_any(open_log([path]), Diagnosis()) for path in paths)
    assert plain is not None
    assert unpacked is not None
    assert roles.assign(unpacked.survey) == roles.assign(plain.survey)
    assert unpacked.tally.skipped == {packed[0].topic: {"compressed (zstd), and cannot be decompressed": 1}}
    assert (unpacked.tally.lossy, plain.tally.lossy) == (True, False)


def test_only_damage_that_was_met_counts(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(sampling, "sample", sample_any)
    monkeypatch.setattr(sampling, "SAMPLES", 2)
    chunks = chunks_of(OFFICE)
    codes = set()
    for number, (start, length) in enumerate(chunks):
        hurt = damaged(OFFICE, start + length // 2, tmp_path / f"{number}.mcap")
        found, deep = mcl("info", hurt), mcl("info", hurt, "--deep")
        assert deep.code == 3
        codes.add(found.code)
        assert (f"chunk at byte {start} " in found.out.decode()) == (found.code == 3)
        if number in {0, len(chunks) - 1}:
            assert found.code == 3
    assert codes == {0, 3}


@pytest.mark.parametrize(
    "options",
    [
        {"use_chunking": False},
        {"index_types": IndexType.ALL & ~IndexType.MESSAGE},
        {"index_types": IndexType.ALL & ~IndexType.CHUNK},
        {"use_statistics": False},
        {"repeat_channels": False},
    ],
)
def test_files_without_a_whole_index_are_read_whole(options: dict[str, object], tmp_path: Path) -> None:
    path = tmp_path / "log.mcap"
    with path.open("wb") as stream:
        writer = Writer(stream, chunk_size=100, **options)  # type: ignore[arg-type]
        writer.start()
        channel = writer.register_channel("/a", "cdr", 0)
        for number in range(20):
            writer.add_message(channel, number, bytes(30), number)
        writer.finish()  # type: ignore[no-untyped-call]
    assert read_index(path) is None
    assert sample_any(open_log([path]), Diagnosis()) is None


def test_no_damage_to_the_index_is_believed(tmp_path: Path) -> None:
    data = OFFICE.read_bytes()
    start, length = chunks_of(OFFICE)[-1]
    whole = read_index(OFFICE)
    assert whole is not None
    for at in range(start + length, len(data), 101):
        hurt = damaged(OFFICE, at, tmp_path / "hurt.mcap")
        index = read_index(hurt)
        assert index is None or all(
            (a.start, a.length, a.times.keys()) == (b.start, b.length, b.times.keys())
            for a, b in zip(index.chunks, whole.chunks, strict=True)
        )
    for size in (0, 8, 30, len(data) // 2, len(data) - 1):
        (tmp_path / "cut.mcap").write_bytes(data[:size])
        assert read_index(tmp_path / "cut.mcap") is None


def test_small_logs_streams_and_other_files_are_not_sampled(tmp_path: Path) -> None:
    assert sampling.sample(open_log([OFFICE]), Diagnosis()) is None
    assert sample_any(open_log(["-"], stdin=io.BytesIO(OFFICE.read_bytes())), Diagnosis()) is None
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(OFFICE.read_bytes()[:100_000])
    assert sample_any(open_log([OFFICE, cut]), Diagnosis()) is None


def test_a_log_in_several_files(tmp_path: Path) -> None:
    other = tmp_path / "other.mcap"
    other.write_bytes((SAMPLES / "warehouse.mcap").read_bytes())
    log, diagnosis = open_log([OFFICE, other]), Diagnosis()
    found, whole = sample_any(log, diagnosis), Recording(log, whole=True)
    assert found is not None
    counts = {name: topic.count for name, topic in found.survey.topics.items()}
    assert counts == {name: topic.count for name, topic in whole.survey.topics.items()}
    assert [file.source for file in found.tally.files] == ["office.mcap", "other.mcap"]
    assert all(dataclasses.asdict(file)["closed"] for file in found.tally.files)


def test_what_a_sample_says_of_stamps_is_said_of_the_sample() -> None:
    log, diagnosis = open_log([OFFICE]), Diagnosis()
    for number, message in enumerate(log.messages(frozenset({"/scan"}), Tally())):
        if number % 10 == 0:
            stamp = bytes(8) if number else message.data[4:12]
            diagnosis.add(message._replace(data=message.data[:4] + stamp + message.data[12:]))
    assert "/scan: 94 messages are not stamped (0)" in diagnosis.problems(Clocks(0))
    diagnosis.count_all("/scan", np.arange(950) * 125_000_000)
    assert diagnosis.times("/scan").interval == 0.125
    assert "/scan: 94 of the messages read are not stamped (0)" in diagnosis.problems(Clocks(0))
