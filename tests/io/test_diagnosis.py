"""What ``mcl info`` says is wrong with a log whose bytes are in order."""

from __future__ import annotations

import json
import struct
from typing import TYPE_CHECKING, Any

import pytest

from mclcli.io.logs.base import Channel, RawMessage
from mclcli.io.recording.clocks import Clocks
from mclcli.io.recording.diagnosis import Diagnosis
from tests.battery import content, drives, records
from tests.battery.bases import base_logs, mcap_log
from tests.battery.drives import Drive
from tests.cli.support import mcl

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

SECOND = 10**9
START = 1000 * SECOND


def problems(times: Sequence[float], lags: Sequence[float] | None = None) -> list[str]:
    """What is said of laser scans logged at these seconds, stamped so many seconds before."""
    diagnosis, channel = Diagnosis(), Channel("/scan", "sensor_msgs/msg/LaserScan", "cdr")
    for number, at in enumerate(times):
        log_ns = START + round(at * SECOND)
        stamp = log_ns - round((lags[number % len(lags)] if lags else 0.0) * SECOND)
        data = b"\0\1\0\0" + struct.pack("<iI", stamp // SECOND, stamp % SECOND) + bytes(40)
        diagnosis.add(RawMessage(channel, log_ns, data))
    return [text.removeprefix("/scan: ") for text in diagnosis.problems(Clocks(START))]


BURSTS = [5.0 * n + 0.1 * k for n in range(6) for k in range(10)]
BETWEEN = "stamps are between -5.0 s and -0.0 s of log time"
EVEN = [0.1 * number for number in range(100)]


@pytest.mark.parametrize(
    ("times", "lags", "said"),
    [
        (EVEN, None, []),
        (EVEN, [0.02, 0.3], []),
        ([3.0 * number for number in range(30)], None, []),
        (EVEN + [13.0 + t for t in EVEN], None, ["gap of 3.1 s at 9.9 s"]),
        (BURSTS, None, [*(f"gap of 4.1 s at {5 * n}.9 s" for n in range(3)), "2 more gaps over 1 s"]),
        (EVEN + [t + 2.0 for t in EVEN], None, ["log time jumps back by 7.9 s at 9.9 s"]),
        (EVEN, [0.0] * 60 + [5.0] * 40, ["stamps jump back by 4.9 s at 5.9 s", BETWEEN]),
        (EVEN, [7.5], ["stamps are 7.5 s before log time (median)"]),
        (EVEN, [-7.5], ["stamps are 7.5 s after log time (median)"]),
        (EVEN, [0.0, 0.0, 1.5], ["stamps jump back by 1.4 s at 0.1 s"]),
    ],
)  # fmt: skip
def test_times(times: list[float], lags: list[float] | None, said: list[str]) -> None:
    found = problems(times, lags)
    assert found[: len(said)] == said
    assert bool(found) is bool(said)


@pytest.mark.parametrize("encoding", ["cdr", "ros1"])
def test_stamps_are_read_from_every_kind_of_message(encoding: str) -> None:
    diagnosis = Diagnosis()
    for known in content.messages(encoding):
        diagnosis.add(RawMessage(Channel(known.topic, content.TYPES[known.topic], encoding), known.log_ns, known.data))
    lags = {topic: diagnosis.times(topic).lag for topic in content.TYPES}
    assert lags == {
        "/tf_static": None,
        "/tf": (0.001, 0.001, 0.001),
        "/odom": (0.0, 0.0, 0.0),
        "/scan": (0.002, 0.002, 0.002),
        "/note": None,
    }
    assert diagnosis.problems(Clocks(content.START_NS)) == []


def facts(folder: Path, name: str, data: bytes) -> Any:
    (folder / name).write_bytes(data)
    return json.loads(mcl("info", folder / name, "--json").out)


@pytest.mark.parametrize("base", base_logs(), ids=lambda base: base.name)
def test_containers_say_whether_they_were_closed_and_have_checksums(tmp_path: Path, base: Any) -> None:
    found = facts(tmp_path, base.name, base.data)
    kind = "MCAP" if "mcap" in base.name else "ROS 1 bag" if "bag" in base.name.split(".")[-1] else "rosbag2 database"
    kind = "rosbag2 database" if "db3" in base.name else kind
    checksums = "yes" if base.checked else "no"
    assert found["checks"] == [{"source": base.name, "kind": kind, "closed": True, "checksums": checksums}]
    assert found["problems"] == []
    if not base.name.endswith(".zstd"):
        cut = facts(tmp_path, base.name, base.data[: len(base.data) // 2])
        assert [file["closed"] for file in cut["checks"]] == [False]


def test_a_log_with_checksums_in_part(tmp_path: Path) -> None:
    own = records.schema(9, "std_msgs/msg/String", "ros2msg", "string data") + records.channel(9, 9, "/own")
    chunks = [records.chunk(own), records.chunk(records.message(9, 5, b""), crc=0)]
    found = facts(tmp_path, "x.mcap", records.mcap(*chunks))
    assert found["checks"][0] == {"source": "x.mcap", "kind": "MCAP", "closed": True, "checksums": "in part"}


def test_a_log_of_which_nothing_came_tells_nothing_of_checksums(tmp_path: Path) -> None:
    found = facts(tmp_path, "x.mcap", base_logs()[0].data[:200])
    assert found["checks"][0] == {"source": "x.mcap", "kind": "MCAP", "closed": False, "checksums": "unknown"}


def test_frames_that_do_not_connect(tmp_path: Path) -> None:
    loose = Drive("", "/tf_static", lambda message, _: setattr(message.transforms[0].header, "frame_id", "elsewhere"))
    (tmp_path / "x.mcap").write_bytes(mcap_log("cdr", drives.edited(loose)))
    text = mcl("info", tmp_path / "x.mcap").out.decode()
    assert "problem: frames: 2 trees that nothing connects, with roots elsewhere, odom" in text
    assert "problem: /scan: no transform from 'base_link' to 'laser'" in text


def test_messages_that_are_not_stamped(tmp_path: Path) -> None:
    bare = Drive("", "/odom", drives.fields(**drives.ZERO))
    found = facts(tmp_path, "x.mcap", mcap_log("cdr", drives.edited(bare)))
    assert found["problems"] == ["/odom: 120 messages are not stamped (0)"]
    rows = {topic["topic"]: topic for topic in found["topics"]}
    assert (rows["/odom"]["not_stamped"], rows["/odom"]["log_time_minus_stamp"]) == (120, None)
    assert rows["/scan"]["interval"] == pytest.approx(0.2)


def test_what_a_person_sees(tmp_path: Path) -> None:
    base = base_logs()[0]
    (tmp_path / "run.mcap").write_bytes(base.data[: len(base.data) // 2])
    text = mcl("info", tmp_path / "run.mcap").out.decode()
    assert "run.mcap: MCAP, not closed, checksums: yes" in text
    assert "damage: run.mcap: file ends in the middle of a record" in text
