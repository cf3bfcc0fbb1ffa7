"""``mcl recover``: what it saves is what was there, and any reader takes it."""

from __future__ import annotations

import io
import shutil
import signal
import sqlite3
import subprocess
import sys
import time
from contextlib import closing
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any, cast

import pytest
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

from mclcli.io.traces.chunked_mcap import NUMBERED_QOS
from tests.battery import content
from tests.battery.bases import base_logs, mcap_log
from tests.cli.support import OFFICE, mcl, process, single_error
from tests.data import shared

if TYPE_CHECKING:
    from tests.battery.bases import Base

BASES = {base.name: base for base in base_logs()}
STORE = get_typestore(Stores.ROS2_HUMBLE)
QOS = NUMBERED_QOS.format(depth=10, durability=2)  # as numbers, as before Iron


def saved(data: bytes) -> list[tuple[str, int, bytes]]:
    """Messages of an MCAP in order, every checksum verified."""
    read = make_reader(io.BytesIO(data), validate_crcs=True).iter_messages()
    return [(channel.topic, message.log_time, message.data) for _, channel, message in read]


def summary(data: bytes) -> Any:
    found = make_reader(io.BytesIO(data)).get_summary()
    assert found is not None
    return found


@pytest.fixture(params=sorted(BASES))
def base(request: pytest.FixtureRequest, tmp_path: Path) -> Base:
    found = BASES[request.param]
    (tmp_path / found.name).write_bytes(found.data)
    return found


def test_a_healthy_log_is_saved_to_the_byte(base: Base, tmp_path: Path) -> None:
    result = mcl("recover", tmp_path / base.name, "-o", tmp_path / "good.mcap")
    assert (result.code, result.out) == (0, b"")
    data = (tmp_path / "good.mcap").read_bytes()
    assert saved(data) == base.stamped
    assert summary(data).statistics.message_count == len(base.known)
    assert "313 messages; lost: none" in result.err


def test_a_cut_log_is_saved_as_far_as_it_goes(base: Base, tmp_path: Path) -> None:
    share = 0.95 if base.name.endswith(".zstd") else 0.7  # zstd gives whole blocks of 128 KiB
    (tmp_path / base.name).write_bytes(base.data[: int(share * len(base.data))])
    result = mcl("recover", tmp_path / base.name, "-o", tmp_path / "good.mcap")
    assert result.code == 3
    found = saved((tmp_path / "good.mcap").read_bytes())
    assert 100 < len(found) < len(base.known)
    assert set(found) <= set(base.stamped)


@pytest.mark.parametrize(
    ("name", "profile", "encoding", "form"),
    [
        ("plain.bag", "ros1", "ros1", "ros1msg"),
        ("ros1.mcap", "ros1", "ros1", "ros1msg"),
        ("rosbag2.db3", "ros2", "cdr", "ros2msg"),
    ],
)
def test_ros_1_stays_ros_1(tmp_path: Path, name: str, profile: str, encoding: str, form: str) -> None:
    (tmp_path / name).write_bytes(BASES[name].data)
    assert mcl("recover", tmp_path / name, "-o", tmp_path / "good.mcap").code == 0
    data = (tmp_path / "good.mcap").read_bytes()
    found = summary(data)
    assert make_reader(io.BytesIO(data)).get_header().profile == profile
    assert {channel.message_encoding for channel in found.channels.values()} == {encoding}
    kinds = {kind.replace("/msg/", "/") if encoding == "ros1" else kind: kind for kind in content.TYPES.values()}
    for schema in found.schemas.values():
        assert schema.encoding == form
        assert schema.data.decode().strip() == content.definition(encoding, kinds[schema.name])[0].strip()


def test_a_chunk_that_is_damaged_costs_its_own_messages_only(tmp_path: Path) -> None:
    base = BASES["plain.mcap"]
    hurt = bytearray(base.data)
    hurt[len(hurt) // 2] ^= 1
    (tmp_path / "run.mcap").write_bytes(hurt)
    result = mcl("recover", tmp_path / "run.mcap", "-o", tmp_path / "good.mcap")
    found = saved((tmp_path / "good.mcap").read_bytes())
    assert result.code == 3
    assert len(found) > 290
    assert f"lost: {313 - len(found)}\n" in result.err


def test_nothing_to_save_leaves_no_file(tmp_path: Path) -> None:
    (tmp_path / "empty.mcap").write_bytes(mcap_log("cdr", ()))
    (tmp_path / "page.mcap").write_bytes(b"<html></html>")
    for name in ("empty", "page"):
        single_error(mcl("recover", tmp_path / f"{name}.mcap", "-o", tmp_path / "good.mcap"), 1)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["empty.mcap", "page.mcap"]


def test_the_output_is_never_the_input(tmp_path: Path) -> None:
    (tmp_path / "run.mcap").write_bytes(BASES["zstd.mcap"].data)
    (tmp_path / "link.mcap").symlink_to("run.mcap")
    for name in ("run.mcap", "link.mcap"):
        assert "one of the inputs" in single_error(mcl("recover", tmp_path / "run.mcap", "-o", tmp_path / name), 2)
    assert (tmp_path / "run.mcap").read_bytes() == BASES["zstd.mcap"].data


def test_from_a_pipe_into_a_pipe() -> None:
    base = BASES["bz2.bag"]
    result = mcl("recover", "-", "-o", "-", stdin=base.data)
    assert result.code == 0
    assert saved(result.out) == base.stamped


def test_times_and_channels_are_kept(tmp_path: Path) -> None:
    path = shared("formats/mcap/example.mcap")
    assert mcl("recover", path, "-o", tmp_path / "good.mcap").code == 0
    theirs, ours = (
        [
            (s and (s.name, s.encoding, s.data), c.message_encoding, c.metadata, m.log_time, m.publish_time, m.data)
            for s, c, m in make_reader(io.BytesIO(data)).iter_messages()
        ]
        for data in (path.read_bytes(), (tmp_path / "good.mcap").read_bytes())
    )
    assert ours == theirs


def test_rows_that_mcap_cannot_date_are_counted(tmp_path: Path) -> None:
    path = tmp_path / "x.db3"
    path.write_bytes(BASES["rosbag2.db3"].data)
    with closing(sqlite3.connect(path)) as database:
        database.execute("UPDATE messages SET timestamp = -5 WHERE id = 100")
        database.commit()
    result = mcl("recover", path, "-o", tmp_path / "good.mcap")
    assert result.code == 3
    assert "1 message not saved: log time outside 1970…2262" in result.err
    assert len(saved((tmp_path / "good.mcap").read_bytes())) == 312


def test_an_older_database_gets_the_definitions_that_it_lacks(tmp_path: Path) -> None:
    path = tmp_path / "x.db3"
    path.write_bytes(BASES["rosbag2.db3"].data)
    with closing(sqlite3.connect(path)) as database:
        database.execute("DROP TABLE message_definitions")
        database.execute("INSERT INTO topics VALUES (9, '/own', 'a_msgs/msg/Own', 'cdr', ?, '')", (QOS,))
        database.execute("INSERT INTO messages(topic_id, timestamp, data) VALUES (9, 1700000001000000000, x'0001')")
        database.commit()
    assert mcl("recover", path, "-o", tmp_path / "good.mcap").code == 0
    found = summary((tmp_path / "good.mcap").read_bytes())
    schemas = {schema.name: (schema.encoding, schema.data.decode()) for schema in found.schemas.values()}
    assert schemas["sensor_msgs/msg/LaserScan"] == (
        "ros2msg",
        content.definition("cdr", "sensor_msgs/msg/LaserScan")[0],
    )
    assert schemas["a_msgs/msg/Own"] == ("", "")
    assert dict(found.channels)[max(found.channels)].metadata == {"offered_qos_profiles": QOS}
    assert "rosbag2" in {index.name for index in found.metadata_indexes}, "numbers in QoS need rosbag2's version"
    with AnyReader([tmp_path / "good.mcap"]) as reader:
        assert sum(1 for _ in reader.messages()) == 314


@pytest.mark.parametrize(
    "relative", ["olin/macfirst_floor_take_2", "formats/rosbag2/rosbag2_py/test/resources/mcap/wbag"]
)
def test_rosbags_reads_what_was_saved(tmp_path: Path, relative: str) -> None:
    copy = Path(shutil.copytree(shared(relative), tmp_path / "log"))
    assert mcl("recover", copy, "-o", tmp_path / "good.mcap").code == 0
    found = []
    for path in (copy, tmp_path / "good.mcap"):
        with AnyReader([path], default_typestore=STORE) as reader:
            found.append(sorted((c.topic, c.msgtype, stamp, bytes(data)) for c, stamp, data in reader.messages()))
    assert found[0] == found[1]


@pytest.mark.parametrize("name", sorted(BASES))
def test_rerun_finds_no_fault(tmp_path: Path, name: str) -> None:
    program = shutil.which("rerun", path=str(Path(sys.executable).parent)) or shutil.which("rerun")
    if program is None:
        pytest.skip("needs the program rerun (rerun-sdk)")
    (tmp_path / name).write_bytes(
        BASES[name].data[: int(len(BASES[name].data) * (0.95 if "zstd" in name[-5:] else 0.6))]
    )
    assert mcl("recover", tmp_path / name, "-o", tmp_path / "good.mcap").code == 3
    words = [program, "mcap", "check", str(tmp_path / "good.mcap")]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.count("ok ") == 5, done.stdout


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143), (signal.SIGHUP, 129)])
def test_an_interrupt_keeps_what_was_saved(tmp_path: Path, number: signal.Signals, code: int) -> None:
    started = process("recover", "-", "-o", tmp_path / "good.mcap", stdin=subprocess.PIPE)
    stdin = cast("IO[bytes]", started.stdin)
    data = OFFICE.read_bytes()
    stdin.write(data[: len(data) // 2])
    stdin.flush()
    while not any(path.stat().st_size for path in tmp_path.iterdir()):
        time.sleep(0.01)  # until the first chunk is there; the stream stays open
    started.send_signal(number)
    assert started.wait() == code
    stdin.close()
    assert [path.name for path in tmp_path.iterdir()] == ["good.mcap.part"]
    assert len(saved((tmp_path / "good.mcap.part").read_bytes())) > 100
    assert "good.mcap.part" in cast("IO[bytes]", started.stderr).read().decode()
    cast("IO[bytes]", started.stderr).close()
    cast("IO[bytes]", started.stdout).close()
