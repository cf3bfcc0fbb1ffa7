from __future__ import annotations

import hashlib
import io
import logging
import os
import subprocess
import sys
import threading
from typing import TYPE_CHECKING

import pytest
import zstandard
from mcap.reader import make_reader
from rosbags.rosbag2 import Reader as Rosbag2Reader

from mclcli.errors import InputError, UsageError
from mclcli.io.logs import open_log
from mclcli.io.logs.base import Tally
from mclcli.io.logs.source import ByteSource
from tests.data import shared
from tests.io.logs import look_at, mcap_bytes, numbers, ros1_bag

if TYPE_CHECKING:
    from pathlib import Path

BAG2 = "formats/rosbag2"
PY = f"{BAG2}/rosbag2_py/test/resources"
STAMPS = [10**9 + k * 10**7 for k in range(60)]

FORMATS = {
    "formats/mcap/example.mcap": {"mouse": 111},
    "formats/mcap/example_logs.mcap": {"mouse": 111, "/rosout": 1000},
    "formats/rosbag1/ccny-laser_scan_matcher-demo.bag": {"/scan": 360},
    "formats/rosbag1/example-unsorted-chunks.bag": {"foo": 3},
    "formats/rosbag1/no-messages.bag": {},
    f"{BAG2}/ros2bag/test/resources/empty_bag": {},
    f"{BAG2}/rosbag2_cpp/test/rosbag2_cpp/bags/only_topics.mcap": {"/parameter_events": 7},
    f"{BAG2}/rosbag2_cpp/test/rosbag2_cpp/bags/topics_and_services.db3": {
        "/parameter_events": 7,
        "/add_two_ints/_service_event": 6,
    },
    f"{PY}/mcap/convert_b": {"a_empty": 25, "c_strings": 50},
    f"{PY}/mcap/talker": {"/rosout": 10, "/topic": 10},
    f"{PY}/sqlite3/talker": {"/rosout": 10, "/topic": 10},
    f"{PY}/sqlite3/reindex_test_bags/multiple_files": {"/chatter": 3177},
    f"{BAG2}/rosbag2_tests/resources/mcap/cdr_test": {"/test_topic": 3, "/array_topic": 4},
    f"{BAG2}/rosbag2_tests/resources/sqlite3/cdr_test": {"/test_topic": 3, "/array_topic": 4},
    f"{BAG2}/rosbag2_transport/test/resources/mcap/test_bag_for_seek": {"topic1": 5},
    f"{BAG2}/rosbag2_transport/test/resources/sqlite3/test_bag_for_seek": {"topic1": 5},
    "birmingham/trace0.bag": {"/tf": 2876, "/odom": 958, "/base_scan": 958},
    "intel/intel.mcap": {"/tf_static": 1, "/odom": 910, "/tf": 910, "/scan": 910, "/ground_truth": 910},
}


@pytest.mark.parametrize("relative", FORMATS)
def test_what_comes_out_of_each_real_log(relative: str) -> None:
    seen = look_at(shared(relative))
    assert seen.counts == FORMATS[relative]
    assert seen.damages == []


@pytest.mark.parametrize("kind", ["mcap", "sqlite3"])
def test_split_folders_are_one_log_in_time_order(kind: str) -> None:
    folder = shared(f"{PY}/{kind}/wbag")
    seen = look_at(folder)
    assert len(seen.messages) == 6074
    stamps = [message.log_time_ns for message in seen.messages]
    assert stamps == sorted(stamps)
    theirs = []
    for path in sorted(folder.glob("*.mcap")):
        with path.open("rb") as stream:
            theirs += [(c.topic, m.log_time, m.data) for _, c, m in make_reader(stream).iter_messages()]
    assert not theirs or sorted(seen.stamped) == sorted(theirs)


def test_olin_agrees_with_rosbags_own_reader(tmp_path: Path) -> None:
    folder = shared("olin/macfirst_floor_take_2")
    for path in folder.iterdir():  # a copy, because their reader writes beside the database
        (tmp_path / path.name).write_bytes(path.read_bytes())
    with Rosbag2Reader(tmp_path) as reader:
        theirs = [(connection.topic, stamp, bytes(data)) for connection, stamp, data in reader.messages()]
    assert sorted(look_at(folder).stamped) == sorted(theirs)
    assert sorted(look_at(folder / "macfirst_floor_take_2_0.db3").stamped) == sorted(theirs)
    assert sorted(path.name for path in folder.iterdir()) == ["macfirst_floor_take_2_0.db3", "metadata.yaml"]


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "is empty"),
        (b"version https://git-lfs.github.com/spec/v1\noid sha256:00\nsize 1\n", "Git LFS pointer"),
        (b"\n <!DOCTYPE html><html><body>404</body></html>", "web page"),
        (b"\0" * 100, "begins with zeros"),
        (b"#ROSBAG V1.2\n", "version"),
        (b"\x1f\x8b\x08aaaa", "gzip"),
        (b"hello", "is not a log"),
        (zstandard.compress(b"hello"), "is not a log"),
        (zstandard.compress(b"hello")[:9], "does not decompress"),
        (zstandard.compress(zstandard.compress(b"hello")), "compressed twice"),
    ],
)
def test_what_is_no_log_is_named(tmp_path: Path, content: bytes, words: str) -> None:
    path = tmp_path / "run.mcap"
    path.write_bytes(content)
    with pytest.raises(InputError, match=words) as caught:
        open_log([path])
    assert str(caught.value).startswith("run.mcap: ")
    assert "\n" not in str(caught.value)


def test_missing_files_and_empty_folders_are_named(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"nix\.bag: no such file"):
        open_log([tmp_path / "nix.bag"])
    with pytest.raises(InputError, match="folder holds no log"):
        open_log([tmp_path])
    with pytest.raises(UsageError, match="cannot be combined"):
        open_log(["-", tmp_path])


def test_the_suffix_does_not_matter(tmp_path: Path) -> None:
    (tmp_path / "x.txt").write_bytes(mcap_bytes(STAMPS))
    assert numbers(look_at(tmp_path / "x.txt")) == list(range(60))


def test_folders_without_metadata_are_read_in_the_order_of_their_numbers(tmp_path: Path) -> None:
    for part, name in enumerate(["x_1.mcap", "x_2.mcap", "x_10.mcap"]):
        (tmp_path / name).write_bytes(mcap_bytes([10**10 * part + k for k in range(5)]))
    log = open_log([tmp_path])
    assert log.names == ("x_1.mcap", "x_2.mcap", "x_10.mcap")
    assert len(list(log.messages(None, Tally()))) == 15


def test_a_split_that_metadata_lists_in_vain_is_a_loss(tmp_path: Path) -> None:
    (tmp_path / "x_0.mcap").write_bytes(mcap_bytes(STAMPS))
    (tmp_path / "metadata.yaml").write_text(
        "rosbag2_bagfile_information:\n  relative_file_paths:\n    - old/x_0.mcap\n    - x_1.mcap\n  duration: 1\n"
    )
    tally = Tally()
    assert len(list(open_log([tmp_path]).messages(None, tally))) == 60
    assert [damage.what for damage in tally.damages] == ["x_1.mcap, listed in metadata.yaml, is not there"]
    assert tally.lossy


def test_files_compressed_as_a_whole_are_unpacked(tmp_path: Path) -> None:
    packed = zstandard.compress(mcap_bytes(STAMPS))
    (tmp_path / "x_0.mcap.zstd").write_bytes(packed)
    (tmp_path / "metadata.yaml").write_text("a:\n  relative_file_paths:\n    - x_0.mcap\n")
    log = open_log([tmp_path])
    for _ in range(2):
        assert len(list(log.messages(None, Tally()))) == 60
    packed = zstandard.compress(mcap_bytes([10**9 + k for k in range(4000)]))
    (tmp_path / "cut.mcap.zstd").write_bytes(packed[: len(packed) // 2])
    seen = look_at(tmp_path / "cut.mcap.zstd")
    assert numbers(seen) == list(range(len(seen.messages)))
    assert len(seen.messages) > 1000
    assert any(not damage.lossless for damage in seen.damages)


def test_a_pipe_is_streamed_once(tmp_path: Path) -> None:
    for data in (mcap_bytes(STAMPS), ros1_bag(tmp_path / "x.bag", 60)):
        inlet, outlet = os.pipe()
        feeder = threading.Thread(target=_feed, args=(outlet, data))
        feeder.start()
        with os.fdopen(inlet, "rb") as stdin:
            log = open_log(["-"], stdin=stdin)
            assert (log.seekable, log.names, log.digest(), log.paths) == (False, ("stdin",), "", ())
            assert len(list(log.messages(None, Tally()))) == 60
            feeder.join()
            with pytest.raises(InputError, match="can be read once"):
                list(log.messages(None, Tally()))


def _feed(outlet: int, data: bytes) -> None:
    with os.fdopen(outlet, "wb") as stream:
        stream.write(data)


def test_a_database_on_stdin_is_refused_by_name() -> None:
    with pytest.raises(InputError, match=r"stdin: is a rosbag2 database \(\.db3\)"):
        open_log(["-"], stdin=io.BytesIO(b"SQLite format 3\0" + bytes(100)))


def test_every_message_is_counted_read_or_skipped(tmp_path: Path) -> None:
    (tmp_path / "x.mcap").write_bytes(mcap_bytes(STAMPS))
    tally = Tally()
    list(open_log([tmp_path / "x.mcap"]).messages(frozenset({"/a"}), tally))
    assert tally.read == {"/a": 30}
    assert tally.skipped == {"/b": {"not needed": 30}}
    assert [channel.topic for channel in tally.channels] == ["/a", "/b"]
    assert (tally.first_ns, tally.last_ns, tally.lossy) == (STAMPS[0], STAMPS[-1], False)


def test_damage_is_warned_of_or_with_strict_the_end(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    (tmp_path / "x.mcap").write_bytes(mcap_bytes(STAMPS)[:-700])
    log = open_log([tmp_path / "x.mcap"])
    with caplog.at_level(logging.WARNING, logger="mclcli"):
        list(log.messages(None, Tally()))
    assert len(caplog.messages) == 1
    assert caplog.messages[0].startswith("x.mcap: ")
    with pytest.raises(InputError, match=r"x\.mcap: .*; leave --strict out"):
        list(log.messages(None, Tally(), strict=True))


def test_the_digest_is_that_of_the_contents(tmp_path: Path) -> None:
    parts = [mcap_bytes(STAMPS), mcap_bytes(STAMPS[:9])]
    for number, data in enumerate(parts):
        (tmp_path / f"{number}.mcap").write_bytes(data)
    assert open_log([tmp_path]).digest() == hashlib.sha256(b"".join(parts)).hexdigest()
    assert open_log([tmp_path]).paths == (tmp_path / "0.mcap", tmp_path / "1.mcap")


def test_late_messages_of_a_log_are_noted_and_warned_of_once(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    stamps = [10**9 * second for second in (1, 9, 11, 2, 3, 12)]
    (tmp_path / "x.mcap").write_bytes(mcap_bytes(stamps))
    tally = Tally()
    messages = list(open_log([tmp_path / "x.mcap"]).messages(None, tally))
    assert [m.log_time_ns // 10**9 for m in messages] == [1, 9, 2, 3, 11, 12]
    assert [list(row.values()) for row in tally.notes.values()] == [[1], [1]]
    assert len(caplog.messages) == 1


def test_opening_a_log_imports_no_decoder() -> None:
    code = "import sys, mclcli.io.logs; print([m for m in ('rosbags', 'numpy', 'sqlite3', 'mcap') if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


@pytest.mark.parametrize("count", [2, 40])
def test_many_splits_are_one_log_with_few_files_open(
    tmp_path: Path, count: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Splits of 3 s each, the last second of one within the first of the next; their messages in order of time."""
    for part in range(count):
        stamps = [10**9 * (2 * part + 1) + k * 10**8 + part for k in range(30)]
        (tmp_path / f"x_{part}.mcap").write_bytes(mcap_bytes(stamps))
    opened, most = 0, 0
    start, end = ByteSource.__enter__, ByteSource.__exit__

    def enter(source: ByteSource) -> ByteSource:
        nonlocal opened, most
        opened += 1
        most = max(most, opened)
        return start(source)

    def leave(source: ByteSource, *error: object) -> None:
        nonlocal opened
        opened -= 1
        end(source, *error)

    monkeypatch.setattr(ByteSource, "__enter__", enter)
    monkeypatch.setattr(ByteSource, "__exit__", leave)
    tally = Tally()
    stamps = [message.log_time_ns for message in open_log([tmp_path]).messages(None, tally)]
    assert len(stamps) == 30 * count
    assert stamps == sorted(stamps)
    assert tally.damages == []
    assert tally.notes == {}
    assert most <= 4
