"""Poses that a log states in other frames than the map's, or as transforms: starts, references, beliefs."""

from __future__ import annotations

import dataclasses
import itertools
import json
import re
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from mclcli.geometry import se2
from mclcli.io.recording.recorded_poses import read_trajectory
from tests.cli.support import OFFICE, SAMPLES, START_NS, edited, error_against, made, mcl, single_error, write_mcap
from tests.io.test_recorded_poses import stamp

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from mclcli.arrays import FloatArray
    from tests.cli.conftest import Runner
    from tests.cli.support import Message

TRUTH = SAMPLES / "office.truth.tum"
WORLD_FROM_MAP = np.array([5.0, -3.0, 0.9])
AGAINST = re.compile(r"against the reference: (RMSE .*)")


def drift(seconds: float) -> FloatArray:
    """Where odometry's frame is in the map."""
    return np.array([2.0 + 0.1 * seconds, -1.0, 0.5 + 0.02 * seconds])


def placed(pose: FloatArray) -> dict[str, dict[str, float]]:
    """A pose as the values of a geometry_msgs/Transform."""
    x, y, yaw = (float(value) for value in pose)
    return {"translation": {"x": x, "y": y}, "rotation": {"z": np.sin(yaw / 2), "w": np.cos(yaw / 2)}}


def told(seconds: float, parent: str, child: str, pose: FloatArray) -> dict[str, Any]:
    """A pose as the values of a geometry_msgs/TransformStamped."""
    header = {"stamp": stamp(seconds), "frame_id": parent}
    return {"header": header, "child_frame_id": child, "transform": placed(pose)}


def sent(topic: str, seconds: float, *edges: dict[str, Any]) -> Message:
    """Transforms as one message."""
    return made(topic, "tf2_msgs/msg/TFMessage", {"transforms": list(edges)}, START_NS + round(seconds * 1e9))


def moving() -> list[Message]:
    """The map's frame above odometry's, ten times a second."""
    return [sent("/tf", 0.1 * i, told(0.1 * i, "map", "odom", drift(0.1 * i))) for i in range(120)]


def joined(folder: Path, *parts: list[Message]) -> Path:
    return write_mcap(folder / "log.mcap", sorted(itertools.chain(*parts), key=lambda message: message.log_ns))


def moved(
    contents: list[Message], topic: str, frame: str, frame_from_map: Callable[[float], FloatArray]
) -> list[Message]:
    """The messages with the poses of a topic told in another frame."""

    def move(message: Any) -> None:
        pose = message.pose if hasattr(message.pose, "position") else message.pose.pose
        seconds = message.header.stamp.sec + 1e-9 * message.header.stamp.nanosec - START_NS * 1e-9
        yaw = 2.0 * np.arctan2(pose.orientation.z, pose.orientation.w)
        x, y, yaw = se2.compose(frame_from_map(seconds), np.array([pose.position.x, pose.position.y, yaw]))
        pose.position.x, pose.position.y = float(x), float(y)
        pose.orientation.z, pose.orientation.w = float(np.sin(yaw / 2)), float(np.cos(yaw / 2))
        message.header.frame_id = frame

    return [edited(message, move) if message.topic == topic else message for message in contents]


def in_odom(contents: list[Message]) -> list[Message]:
    """As if the operator's display had shown odometry's frame."""
    return moved(contents, "/initialpose", "odom", lambda seconds: se2.inverse(drift(seconds)))


WORLD = [sent("/tf_static", 0.0, told(0.0, "world", "map", WORLD_FROM_MAP))]


@pytest.mark.parametrize("words", [(), ("--follow-initialpose",)])
def test_a_start_told_in_odometrys_frame(
    office_messages: list[Message], run_short: Runner, tmp_path: Path, words: tuple[str, ...]
) -> None:
    log = joined(tmp_path, in_odom(office_messages), moving())
    result = run_short(*words, log=log)
    assert result.code == 0
    assert "/initialpose: 1 pose in frame 'odom' brought to 'map' by the transforms at their stamps" in result.err
    assert error_against(result.table, TRUTH) < 0.3


@pytest.mark.parametrize("words", [(), ("--follow-initialpose",)])
def test_a_start_in_a_frame_that_nothing_joins_is_refused(
    office_messages: list[Message], run_short: Runner, tmp_path: Path, words: tuple[str, ...]
) -> None:
    log = joined(tmp_path, in_odom(office_messages))
    error = single_error(run_short(*words, log=log), 1)
    assert "frame 'odom'" in error
    assert "no transform joins 'map' and 'odom'; frames in the log: base_footprint" in error
    assert "--set global_frame_id=odom" in error


def test_poses_of_an_operator_that_cannot_be_brought_to_the_map_are_passed_over(
    office_messages: list[Message], run_short: Runner, short_track: bytes, tmp_path: Path
) -> None:
    (first,) = [message for message in office_messages if message.topic == "/initialpose"]
    (second,) = in_odom([dataclasses.replace(first, log_ns=START_NS + 6 * 10**9)])
    result = run_short("--follow-initialpose", log=joined(tmp_path, office_messages, [second]))
    assert "the filter began anew once" in result.err
    assert "/initialpose: 1 pose in frame 'odom' left out: no transform joins 'map' and 'odom'" in result.err
    assert len(result.table.rows) == len(short_track.splitlines()) - 1


@pytest.mark.parametrize("piped", [False, True])
def test_a_reference_and_a_belief_told_in_the_world(
    office_messages: list[Message], run_short: Runner, tmp_path: Path, *, piped: bool
) -> None:
    log = joined(tmp_path, WORLD, moved(office_messages, "/ground_truth", "world", lambda _: WORLD_FROM_MAP))
    words = ("--truth", "/ground_truth", "--versus", "/ground_truth")
    plain = run_short(*words)
    found = run_short(*words, log="-", stdin=log.read_bytes()) if piped else run_short(*words, log=log)
    lines = [line for line in found.err.splitlines() if "in frame" in line]
    assert len(lines) == 2
    assert all(re.search(r"/ground_truth: \d+ poses in frame 'world' brought to 'map'", line) for line in lines)
    assert AGAINST.findall(found.err) == AGAINST.findall(plain.err)
    assert "never apart" in found.err


def test_a_reference_that_nothing_joins_to_the_map(
    office_messages: list[Message], run_short: Runner, short_track: bytes, tmp_path: Path
) -> None:
    renamed = moved(office_messages, "/ground_truth", "world", lambda _: np.zeros(3))
    alone = joined(tmp_path, renamed)
    assert (
        "poses in frame 'world' taken for the map's: the log knows no other"
        in run_short("--truth", "ground_truth", log=alone).err
    )
    log = joined(tmp_path, renamed, moving())
    error = single_error(run_short("--truth", "/ground_truth", log=log), 1)
    assert "topic '/ground_truth' states poses in frame 'world'; no transform joins 'map' and 'world'" in error
    assert AGAINST.search(run_short("--truth", "/ground_truth", "--set", "global_frame_id=world", log=log).err)
    source = ("eval", "-", "--truth", f"{log}:/ground_truth")
    assert "--map-frame world" in single_error(mcl(*source, stdin=short_track), 1)
    for words in (("--map-frame", "world"), ("--align",)):
        assert mcl(*source, *words, "--max-error", "0.5", stdin=short_track).code == 0


def as_transforms(parent: str, child: str, parent_from_map: FloatArray) -> list[Message]:
    """The sample's truth as transforms: on a topic each, and in /tf."""
    truth = read_trajectory(f"{OFFICE}:/ground_truth")
    messages = []
    for stamp_ns, pose in zip(truth.stamps_ns, truth.poses, strict=True):
        seconds = (int(stamp_ns) - START_NS) * 1e-9
        if seconds < 12.0:
            edge = told(seconds, parent, child, se2.compose(parent_from_map, pose))
            messages.append(made("/mocap/robot", "geometry_msgs/msg/TransformStamped", edge, int(stamp_ns)))
            messages += [sent(topic, seconds, edge) for topic in ("/vehicle/gt", "/tf")]
    return messages


@pytest.mark.parametrize("source", ["/mocap/robot", "vehicle/gt", "tf:world:robot", "tf:/world:/robot"])
def test_references_told_as_transforms(
    office_messages: list[Message], run_short: Runner, short_track: bytes, tmp_path: Path, source: str
) -> None:
    log = joined(tmp_path, WORLD, office_messages, as_transforms("world", "robot", WORLD_FROM_MAP))
    asked = [mcl("eval", "-", "--truth", truth, "--json", stdin=short_track) for truth in (TRUTH, f"{log}:{source}")]
    errors = [json.loads(result.out)["tracks"][0]["ape"]["translation"]["rmse"] for result in asked]
    assert errors[1] == pytest.approx(errors[0], abs=2e-3)
    assert AGAINST.search(run_short("--truth", source, "--init", source, log=log).err)


def test_a_topic_with_several_bodies_names_them(tmp_path: Path) -> None:
    both = [told(0.0, "world", name, np.zeros(3)) for name in ("cart", "robot")]
    log = joined(tmp_path, [sent("/vehicle/gt", 0.0, *both)])
    error = single_error(mcl("eval", TRUTH, "--truth", f"{log}:/vehicle/gt"), 2)
    assert "states poses of 2 frames; name one: tf:world:cart, tf:world:robot" in error


def test_bodies_that_take_turns_on_a_topic_are_told_apart(tmp_path: Path) -> None:
    turns = [sent("/vehicle/gt", 0.1 * i, told(0.1 * i, "world", f"body{i % 2}", np.zeros(3))) for i in range(9)]
    error = single_error(mcl("eval", TRUTH, "--truth", f"{joined(tmp_path, turns)}:/vehicle/gt"), 1)
    assert "'/vehicle/gt' states poses of 'body0' in 'world', and of 'body1' in 'world'; name one as tf:" in error


def test_a_reference_of_another_frame_of_the_robot(
    office_messages: list[Message], short_track: bytes, tmp_path: Path
) -> None:
    """A topic that tells where the lidar was is no accusation of a track of the base."""
    truth = read_trajectory(f"{OFFICE}:/ground_truth")
    base_from_laser = np.array([0.3, -0.2, 1.0])
    mount = [sent("/tf_static", 0.0, told(0.0, "base_link", "marker", base_from_laser))]
    seen = []
    for stamp_ns, pose in zip(truth.stamps_ns, truth.poses, strict=True):
        edge = told((int(stamp_ns) - START_NS) * 1e-9, "map", "marker", se2.compose(pose, base_from_laser))
        seen.append(made("/mocap/marker", "geometry_msgs/msg/TransformStamped", edge, int(stamp_ns)))
    log = joined(tmp_path, office_messages, mount, seen)
    assert mcl("eval", "-", "--truth", f"{log}:/mocap/marker", "--max-error", "0.2", stdin=short_track).code == 0


@pytest.mark.parametrize("slash", ["", "/"])
def test_topics_are_the_same_with_and_without_a_slash(
    office_messages: list[Message], run_short: Runner, short_track: bytes, tmp_path: Path, slash: str
) -> None:
    bare = [dataclasses.replace(message, topic=message.topic.lstrip("/")) for message in office_messages]
    recorded = joined(tmp_path, office_messages).rename(tmp_path / "slashed.mcap")
    log = joined(tmp_path, bare)
    names = {"--scan": "scan", "--odom": "odom", "--truth": "ground_truth", "--versus": "ground_truth"}
    words = [word for option, name in names.items() for word in (option, slash + name)]
    rows = [line for line in short_track.decode().splitlines() if not line.startswith("#")][1:]
    for path in (log, recorded):
        result = run_short(*words, "--set", f"scan_topic={slash}scan", log=path, init=f"{slash}initialpose")
        assert AGAINST.search(result.err)
        assert [",".join(row) for row in result.table.rows] == rows
        assert mcl("eval", "-", "--truth", f"{path}:{slash}ground_truth", stdin=short_track).code == 0
        for topic in ("scan", "odom"):
            assert mcl("extract", path, "--topic", f"{slash}{topic}", "--index", 1).code == 0
        assert mcl("extract", path, "--topic", f"{slash}scan", "--at", 1).out == mcl("extract", path, "--at", 1).out


def test_a_file_comes_before_a_topic_without_its_slash(
    run_short: Runner, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "ground_truth").write_text("no poses\n")
    assert "ground_truth" in single_error(run_short("--truth", "ground_truth"), 1)
    assert run_short("--truth", "/ground_truth").code == 0
