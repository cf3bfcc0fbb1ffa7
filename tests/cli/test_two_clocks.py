"""Logs whose stamps and log times are two clocks: seconds into the log count from the first stamp, in every command."""

from __future__ import annotations

import json
import re
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from mclcli.io.recording.recording import open_recording
from tests.battery import content
from tests.battery.bases import mcap_log
from tests.cli.support import mcl, single_error
from tests.io.ros_messages import STORES

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    Clock = Callable[[float, str], float]

STORE = STORES["cdr"]
SIMULATED = 745.25
START_S = content.START_NS / 1e9


def restamped(clock: Clock) -> tuple[content.Known, ...]:
    """The base log with stamps of another clock: seconds of it, of seconds into the drive and the topic."""
    found = []
    for known in content.messages("cdr"):
        kind = content.TYPES[known.topic]
        message: Any = STORE.deserialize_cdr(known.data, kind)
        for part in getattr(message, "transforms", [message]):
            if hasattr(part, "header"):
                at = part.header.stamp.sec - content.START_NS // 10**9 + part.header.stamp.nanosec / 1e9
                stamp_ns = round(clock(at, known.topic) * 1e9)
                part.header.stamp.sec, part.header.stamp.nanosec = stamp_ns // 10**9, stamp_ns % 10**9
        found.append(known._replace(data=bytes(STORE.serialize_cdr(message, kind))))
    return tuple(found)


def log_of(folder: Path, clock: Clock) -> Path:
    (folder / "room.pgm").write_bytes(content.room())
    (folder / "room.yaml").write_text(content.MAP_YAML)
    (folder / "x.mcap").write_bytes(mcap_log("cdr", restamped(clock)))
    return folder / "x.mcap"


def simulated(at: float, topic: str) -> float:
    return 0.0 if topic == "/tf_static" else SIMULATED + at


CLOCKS: dict[str, tuple[Clock, float]] = {  # with what stands at 5 s into the log
    "simulated": (simulated, SIMULATED + 5.0),
    "simulated from 0": (lambda at, _: at, 5.1),  # what is stamped 0 is not stamped
    "simulated slowly": (lambda at, _: SIMULATED + 0.5 * at, SIMULATED + 5.0),
    "never set": (lambda at, _: START_S - 5e8 + at, START_S - 5e8 + 5.0),
    "ahead": (lambda at, _: START_S + 7.5 + at, START_S + 12.5),
    "static transforms stamped long before": (
        lambda at, topic: START_S + (-1e6 if topic == "/tf_static" else at),
        START_S + 5.0,
    ),
    "stamped from the second second on": (lambda at, _: SIMULATED + at if at > 1.0 else 0.0, SIMULATED + 6.1),
}


@pytest.mark.parametrize("name", CLOCKS)
def test_seconds_into_the_log_count_from_the_first_stamp(tmp_path: Path, name: str) -> None:
    clock, expected = CLOCKS[name]
    log = log_of(tmp_path, clock)
    scan = json.loads(mcl("extract", log, "--at", 5, "--format", "json").out)["header"]["stamp"]
    assert scan["sec"] + scan["nanosec"] / 1e9 == pytest.approx(expected, abs=0.11)
    odometry = json.loads(mcl("extract", log, "--topic", "/odom", "--at", 5, "--format", "json").out)["header"]["stamp"]
    assert odometry["sec"] + odometry["nanosec"] / 1e9 == pytest.approx(expected, abs=0.06)
    words = ("run", log, "--map", tmp_path / "room.yaml", "--init", content.INIT, "--particles", 100)
    stamps = mcl(*words, "--start", 2, "--duration", 3).table["stamp"]
    assert stamps[[0, -1]] == pytest.approx([expected - 3.0, expected], abs=0.31)


def test_a_simulated_log_is_told_once_and_is_no_problem(tmp_path: Path) -> None:
    log = log_of(tmp_path, simulated)
    text = mcl("info", log).out.decode()
    line = "clocks: stamps are simulation time: they begin at 745.250 s, log times are the recorder's"
    assert text.count("745.25") == 2  # this line, and where the log begins
    assert line in text
    assert json.loads(mcl("info", log, "--json").out)["problems"] == []


@pytest.mark.parametrize("name", ["simulated slowly", "never set", "ahead", "static transforms stamped long before"])
def test_what_all_stamps_share_is_no_problem_of_a_topic(tmp_path: Path, name: str) -> None:
    facts = json.loads(mcl("info", log_of(tmp_path, CLOCKS[name][0]), "--json").out)
    assert facts["problems"] == []
    assert bool(facts["clocks"]["said"]) is (name != "static transforms stamped long before")


def test_one_sensor_with_another_clock_is_told_and_does_not_count(tmp_path: Path) -> None:
    log = log_of(tmp_path, lambda at, topic: 35.0 + at if topic == "/scan" else START_S + at)
    facts = json.loads(mcl("info", log, "--json").out)
    assert facts["start"] == pytest.approx(START_S)
    assert [problem.partition(":")[0] for problem in facts["problems"]] == ["/scan"]
    other = log_of(tmp_path, lambda at, topic: START_S + at if topic == "/scan" else SIMULATED + at)
    facts = json.loads(mcl("info", other, "--json").out)
    assert facts["start"] == pytest.approx(SIMULATED)
    (problem,) = facts["problems"]
    assert re.fullmatch(r"/scan: stamps are 169999925\d\.\d s after those of other topics \(median\)", problem)


def test_reports_of_a_run_count_from_the_first_stamp(tmp_path: Path) -> None:
    log = log_of(tmp_path, simulated)
    lost = mcl("run", log, "--map", tmp_path / "room.yaml", "--init", "-3,-2,0", "--track", tmp_path / "t.csv")
    told = re.search(r"lost from ([-\d.]+) to ([-\d.]+) s of the log", lost.err)
    assert told
    assert 0.0 <= float(told[1]) < float(told[2]) <= 12.0


@pytest.mark.parametrize("time", ["14:32:05", "2023-11-14T22:13:25", "2023-11-14"])
def test_clock_times_are_refused_where_stamps_are_of_no_calendar(tmp_path: Path, time: str) -> None:
    log = log_of(tmp_path, simulated)
    text = single_error(mcl("extract", log, "--at", time), 2)
    assert (
        f"--at: the log's stamps are of no calendar (they begin at 745.250 s), so '{time}' means nothing there" in text
    )
    words = ("run", log, "--map", tmp_path / "room.yaml", "--init", content.INIT)
    assert "--start: the log's stamps are of no calendar" in single_error(mcl(*words, "--start", time), 2)
    assert mcl("extract", log, "--at", f"@{SIMULATED + 5}").code == 0


def test_damage_is_told_in_seconds_from_the_first_stamp(tmp_path: Path) -> None:
    """A log that began with a minute of nothing but notes."""
    minute = 60 * 10**9
    late = [k if k.topic != "/note" else k._replace(log_ns=k.log_ns - minute) for k in restamped(simulated)]
    path = tmp_path / "x.mcap"
    path.write_bytes(mcap_log("cdr", tuple(sorted(late, key=lambda known: known.log_ns))))
    data = bytearray(path.read_bytes())
    recording = open_recording(path)
    assert recording.clocks.first_logged_ns == content.START_NS
    data[len(data) // 2] ^= 0xFF
    path.write_bytes(data)
    told = re.search(r"\(([-\d.]+)–([-\d.]+) s\) skipped", mcl("info", path).err)
    assert told
    assert 3.0 < float(told[1]) <= float(told[2]) < 9.0


def test_the_two_clocks_of_a_pipe(tmp_path: Path) -> None:
    data = log_of(tmp_path, simulated).read_bytes()
    words = ("run", "-", "--map", tmp_path / "room.yaml", "--init", content.INIT, "--particles", 100)
    stamps = mcl(*words, "--start", 2, "--duration", 3, stdin=data).table["stamp"]
    assert np.all((stamps >= SIMULATED + 2) & (stamps <= SIMULATED + 5))
