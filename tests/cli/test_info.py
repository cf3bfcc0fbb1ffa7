"""``mcl info`` and ``mcl extract``: what they say, and that other commands can read it."""

from __future__ import annotations

import json
import shlex
from typing import TYPE_CHECKING, Any

import pytest
from ruamel.yaml import YAML

from tests.cli.support import (
    OFFICE,
    OFFICE_MAP,
    SAMPLES,
    START_NS,
    Message,
    edited,
    mcl,
    single_error,
    without,
    write_mcap,
)
from tests.data import shared

if TYPE_CHECKING:
    from pathlib import Path


def facts(log: Path) -> Any:
    result = mcl("info", log, "--json")
    assert result.code == 0
    return json.loads(result.out)


@pytest.mark.parametrize(
    ("name", "scans", "beams", "base"), [("office", 950, 360, "base_footprint"), ("warehouse", 545, 271, "base_link")]
)
def test_samples_as_json(name: str, scans: int, beams: int, base: str) -> None:
    found = facts(SAMPLES / f"{name}.mcap")
    topics = {topic["topic"]: topic for topic in found["topics"]}
    assert topics["/scan"]["messages"] == scans
    assert {name: topic["role"] for name, topic in topics.items() if topic["role"]} == {
        "/ground_truth": "truth",
        "/landmarks": "vision",
        "/odom": "odometry",
        "/scan": "scan",
    }
    assert found["messages"] == sum(topic["messages"] for topic in found["topics"])
    assert found["lidars"][0]["beams"] == beams
    assert found["roles"]["base_frame"] == base
    assert found["roles"]["odom_frame"] == "odom"
    assert found["start_utc"] == "2024-05-14T14:30:00.000+00:00"
    assert found["damage"] == []
    assert "--init /initialpose " in found["run"]  # as the robot was told, rather than by the reference


def test_the_mount_of_the_lidar() -> None:
    office, warehouse = (facts(SAMPLES / f"{n}.mcap")["lidars"][0]["base_from_sensor"] for n in ("office", "warehouse"))
    assert office == pytest.approx([0.14, -0.04, 0.29, 0, 0, 0.35], abs=1e-6)
    assert abs(warehouse[3]) == pytest.approx(3.14159265, abs=1e-6)


def test_a_sample_for_people() -> None:
    result = mcl("info", OFFICE)
    assert (result.code, result.err) == (0, "")
    text = result.out.decode()
    assert text.startswith("office.mcap: 10337 messages on 7 topics, 118.8 s from 2024-05-14T14:30:00")
    assert "roll 0.0, pitch" in text
    assert "odom > base_footprint > base_link > laser" in text


def test_the_line_it_suggests_runs(short: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    line = mcl("info", short).out.decode().splitlines()[-1]
    words = shlex.split(line.replace("MAP.yaml", str(OFFICE_MAP)))
    words[words.index("LANDMARKS.csv")] = str(SAMPLES / "office.landmarks.csv")
    assert words[0] == "mcl"
    assert mcl(*words[1:], "--particles", 100).code == 0
    assert sorted(path.name for path in tmp_path.iterdir()) == ["track.csv", "track.png"]


def test_info_of_a_stream(short: Path) -> None:
    from_file, streamed = (mcl("info", short, "--json"), mcl("info", "-", "--json", stdin=short.read_bytes()))
    assert streamed.code == 0
    ours, theirs = json.loads(from_file.out), json.loads(streamed.out)
    for name in ("topics", "lidars", "frames", "roles", "duration"):
        assert theirs[name] == ours[name]


def test_info_of_a_damaged_log(short: Path, tmp_path: Path) -> None:
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(short.read_bytes()[:80_000])
    result = mcl("info", cut, "--json")
    assert result.code == 3
    assert len(json.loads(result.out)["damage"]) == 1
    assert "damage: cut.mcap: " in mcl("info", cut).out.decode()


def test_info_of_every_kind_of_log_there_is() -> None:
    root = shared("formats")
    logs = sorted(path for suffix in ("*.mcap", "*.db3", "*.bag") for path in root.rglob(suffix))
    assert len(logs) > 20
    for log in logs:
        plain, structured = mcl("info", log), mcl("info", log, "--json")
        expected = 1 if log.name == "empty-file.bag" else 0
        assert (log.name, plain.code, structured.code) == (log.name, expected, expected)
        if not expected:
            assert json.loads(structured.out)["files"] == [log.name]


def test_a_log_without_messages(tmp_path: Path) -> None:
    log = write_mcap(tmp_path / "log.mcap", [])
    assert facts(log)["messages"] == 0
    assert mcl("info", log).code == 0


def test_frames_in_a_circle_end(office_messages: list[Message], tmp_path: Path) -> None:
    """The lidar's frame and its parent are each other's parents."""

    def close_the_circle(message: Any) -> None:
        edge = next(t for t in message.transforms if t.child_frame_id == "laser")
        edge.child_frame_id, edge.header.frame_id = edge.header.frame_id, edge.child_frame_id

    (statics,) = [m for m in office_messages if m.topic == "/tf_static"]
    circle = [statics, edited(statics, close_the_circle)]
    log = write_mcap(tmp_path / "log.mcap", [*circle, *without(office_messages, "/tf_static")])
    result = mcl("info", log)
    assert result.code == 0
    (line,) = [line for line in result.out.decode().splitlines() if line.startswith("frames: ")]
    assert line.count("laser") == 1


# extract


def test_a_scan_as_yaml_and_json_is_the_same_scan(short: Path) -> None:
    as_yaml, as_json = (mcl("extract", short, "--index", 3, "--format", form) for form in ("yaml", "json"))
    assert (as_yaml.code, as_json.code) == (0, 0)
    read, other = YAML(typ="safe", pure=True).load(as_yaml.out), json.loads(as_json.out)
    assert [repr(x) for x in read["ranges"]] == [repr(float(x)) for x in other["ranges"]]
    assert read["mcl"] == other["mcl"]
    assert read["mcl"]["base_frame"] == "base_footprint"
    assert read["mcl"]["base_from_sensor"] == pytest.approx([0.14, -0.04, 0.29, 0, 0, 0.35], abs=1e-6)
    assert read["header"] == {"stamp": {"sec": 1715697000, "nanosec": 437500000}, "frame_id": "laser"}


@pytest.mark.parametrize("form", ["yaml", "json"])
@pytest.mark.parametrize("topic", ["/odom", "/tf", "/tf_static", "/landmarks", "/ground_truth", "/initialpose"])
def test_any_other_message(short: Path, topic: str, form: str) -> None:
    result = mcl("extract", short, "--topic", topic, "--format", form)
    assert (result.code, result.err) == (0, "")
    load = json.loads if form == "json" else YAML(typ="safe", pure=True).load
    message = load(result.out.decode())
    assert "transforms" in message or message["header"]["stamp"]["sec"] == 1715697000


def test_a_mount_given_is_the_mount_written(short: Path) -> None:
    result = mcl("extract", short, "--mount", "1,2,90deg", "--format", "json")
    assert json.loads(result.out)["mcl"]["base_from_sensor"] == pytest.approx([1, 2, 0, 0, 0, 1.5707963267948966])


def test_a_scan_without_a_transform_comes_without_its_mount(office_messages: list[Message], tmp_path: Path) -> None:
    log = write_mcap(tmp_path / "log.mcap", [m for m in office_messages if m.topic != "/tf_static"])
    result = mcl("extract", log, "--format", "json")
    assert result.code == 0
    assert "mcl: warning: no transform" in result.err
    assert "base_from_sensor" not in json.loads(result.out).get("mcl", {})


@pytest.mark.parametrize(
    ("topic", "at", "said"),
    [
        ("/scan", "9999", "from 0.062 to 11.938 s into the log"),
        ("/scan", "12.2", "from 0.062 to 11.938 s into the log"),
        ("/scan", "-1", "from 0.062 to 11.938 s into the log"),
        ("/odom", "9999", "s into the log"),
        ("/initialpose", "5", "the topic has one message, at "),
    ],
)
def test_a_time_without_a_message_is_an_error_that_names_the_times_there_are(
    short: Path, topic: str, at: str, said: str
) -> None:
    assert said in single_error(mcl("extract", short, "--topic", topic, "--at", at), 2)


def test_a_time_within_two_periods_of_a_message_gets_that(short: Path) -> None:
    last = mcl("extract", short, "--at", 12.1)
    assert (last.code, last.err) == (0, "")
    assert last.out == mcl("extract", short, "--at", 11.938).out


def test_a_time_within_a_gap_is_an_error_that_names_the_gap(office_messages: list[Message], tmp_path: Path) -> None:
    kept = [m for m in office_messages if not 3 * 10**9 < m.log_ns - START_NS < 6 * 10**9]
    text = single_error(mcl("extract", write_mcap(tmp_path / "gap.mcap", kept), "--at", 4.5), 2)
    assert "a gap there, from 2.938 to 6.062 s into the log" in text


def test_messages_that_are_none(short: Path) -> None:
    assert "it has /ground_truth" in single_error(mcl("extract", short, "--topic", "/none"), 2)
    assert "999" in single_error(mcl("extract", short, "--index", 999), 2)
    single_error(mcl("extract", short, "--index", 1, "--at", 1), 2)
