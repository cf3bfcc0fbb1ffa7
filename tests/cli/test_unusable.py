"""Logs that cannot be run, or in part: every command names topic and reason; `mcl info` offers no line that fails."""

from __future__ import annotations

import json
import re
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from tests.cli.support import OFFICE_MAP, Message, edited, made, mcl, single_error, without, write_mcap
from tests.io.ros_messages import GRID

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from tests.cli.conftest import Runner

NOISE = re.compile(r"(?<![\d.@])\d{1,4}\.\d{9,}|-0\.0\b|\bNone\b")


def changed(messages: list[Message], topic: str, change: Callable[[Any], None]) -> list[Message]:
    """Messages with each of a topic edited."""
    return [edited(message, change) if message.topic == topic else message for message in messages]


def unfilled(message: Any) -> None:
    turn = message.pose.pose.orientation
    turn.x = turn.y = turn.z = turn.w = 0.0


def with_ranges(value: float) -> Callable[[Any], None]:
    def change(message: Any) -> None:
        message.ranges = np.full_like(message.ranges, value)

    return change


def info(log: Path) -> tuple[str, Any]:
    """What info says to people, and as JSON."""
    plain, structured = mcl("info", log), mcl("info", log, "--json")
    assert (plain.code, structured.code) == (0, 0)
    return plain.out.decode(), json.loads(structured.out)


def test_odometry_without_orientation_is_named_by_run_and_info(
    run_short: Runner, office_messages: list[Message], tmp_path: Path
) -> None:
    log = write_mcap(tmp_path / "log.mcap", without(changed(office_messages, "/odom", unfilled), "/tf"))
    reason = "/odom of type nav_msgs/msg/Odometry cannot be used: its quaternion is 0, 0, 0, 0"
    assert reason in single_error(run_short(log=log), 1)
    text, facts = info(log)
    assert f"cannot be run: no odometry can be used: {reason}" in text
    assert "mcl run" not in text
    assert "odometry: none\n" in text
    assert facts["run"] is None
    assert reason in facts["cannot_run"][0]


def test_odometry_that_others_stand_in_for_is_named_all_the_same(
    run_short: Runner, office_messages: list[Message], tmp_path: Path
) -> None:
    log = write_mcap(tmp_path / "log.mcap", changed(office_messages, "/odom", unfilled))
    result = run_short(log=log)
    assert result.code == 0
    assert result.err.count("warning: /odom of type nav_msgs/msg/Odometry cannot be used: its quaternion is 0") == 1
    assert "cannot be used" not in run_short().err


@pytest.mark.parametrize(
    "command", [("score", "--pose", "0,0,0", "--map", OFFICE_MAP), ("locate", "--map", OFFICE_MAP), ("extract",)]
)
def test_scans_that_are_cut_short_are_named_by_every_command(
    office_messages: list[Message], tmp_path: Path, command: tuple[object, ...]
) -> None:
    cut = [
        Message(m.topic, m.type, m.definition, m.log_ns, m.data[:60]) if m.topic == "/scan" else m
        for m in office_messages[:400]
    ]
    log = write_mcap(tmp_path / "log.mcap", cut)
    said = single_error(mcl(command[0], log, *command[1:]), 1)
    assert "/scan of type sensor_msgs/msg/LaserScan cannot be used: it does not parse" in said


def test_all_reasons_are_told_at_once(office_messages: list[Message], tmp_path: Path) -> None:
    log = write_mcap(tmp_path / "log.mcap", [m for m in office_messages if m.topic == "/tf_static"])
    text, facts = info(log)
    assert [line.partition(": ")[0] for line in text.splitlines()[-2:]] == ["cannot be run"] * 2
    assert "no laser scan" in facts["cannot_run"][0]
    assert "no odometry" in facts["cannot_run"][1]
    assert text.startswith("log.mcap: 1 message on 1 topic, ")


def test_frames_that_the_log_does_not_name_are_not_made_up(tmp_path: Path) -> None:
    text, facts = info(write_mcap(tmp_path / "log.mcap", []))
    assert (facts["roles"]["base_frame"], facts["roles"]["odom_frame"], facts["frames"]) == (None, None, {})
    assert "base_link" not in text
    assert "frames: the log has no transforms" in text


def test_a_lidar_that_sits_nowhere_has_its_mount_in_the_line(office_messages: list[Message], tmp_path: Path) -> None:
    text, facts = info(write_mcap(tmp_path / "log.mcap", without(office_messages, "/tf_static")))
    assert "--mount laser=X,Y,YAW" in facts["run"]
    assert facts["cannot_run"] == []
    assert "problem: /scan: no transform from 'base_footprint' to 'laser'" in text


@pytest.mark.parametrize("limit", [np.inf, np.nan, 12.3])
def test_figures_are_those_that_were_meant(office_messages: list[Message], tmp_path: Path, limit: float) -> None:
    def change(message: Any) -> None:
        message.range_min, message.range_max, message.angle_increment = 0.15, limit, 0.017453292

    text, facts = info(write_mcap(tmp_path / "log.mcap", changed(office_messages, "/scan", change)))
    assert not NOISE.search(text)
    lidar = facts["lidars"][0]
    assert (lidar["range_min"], lidar["angle_increment"]) == (0.15, 0.017453292)
    assert lidar["range_max"] == (limit if np.isfinite(limit) else None)
    assert ("ranges from 0.15 m to no limit" in text) != np.isfinite(limit)
    assert not re.search(r"\d\.\d{10,}|-0\.0[,\s\]]", json.dumps(facts["lidars"] + facts["topics"]))


@pytest.mark.parametrize(
    ("fields", "problem"),
    [
        ({"angle_increment": -0.02}, "the increment goes against the sense"),
        ({"angle_increment": 0.0}, "all beams point the same way"),
        ({"angle_max": 99.0}, "they do not fit 360 readings"),
        ({"angle_min": np.nan}, "no beam has a direction"),
        ({"range_max": 0.01}, "is not below range_max"),
        ({"range_max": 0.06, "range_min": 0.05}, "no reading of its first scan is a return"),
    ],
)
def test_scans_that_contradict_themselves_are_a_problem(
    office_messages: list[Message], tmp_path: Path, fields: dict[str, float], problem: str
) -> None:
    def change(message: Any) -> None:
        for name, value in fields.items():
            setattr(message, name, value)

    text, facts = info(write_mcap(tmp_path / "log.mcap", changed(office_messages, "/scan", change)))
    assert any(line.startswith("/scan: ") and problem in line for line in facts["problems"])
    assert problem in text


def test_a_run_without_a_return_says_so(run_short: Runner, office_messages: list[Message], tmp_path: Path) -> None:
    log = write_mcap(tmp_path / "log.mcap", changed(office_messages, "/scan", with_ranges(np.inf)))
    silent = run_short(log=log)
    assert silent.code == 0
    assert "lidar: no beam was scored at any update" in silent.err
    assert "was scored" not in run_short().err


def test_a_map_that_was_never_turned_is_used_with_a_remark(office_messages: list[Message], tmp_path: Path) -> None:
    cells = np.zeros((400, 400), np.int8)
    cells[0] = cells[:, 0] = 100
    place = {"position": {"x": -10.0, "y": -10.0, "z": 0.0}, "orientation": dict.fromkeys("xyzw", 0.0)}
    size = GRID["info"] | {"width": 400, "height": 400, "resolution": 0.05, "origin": place}
    first = min(message.log_ns for message in office_messages)
    grid = made("/map", "nav_msgs/msg/OccupancyGrid", GRID | {"info": size, "data": cells.ravel()}, first)
    log = write_mcap(tmp_path / "log.mcap", [grid, *office_messages])
    result = mcl("run", log, "--init", "0,0,0", "--particles", 50, "--duration", 2)
    assert result.code == 0
    assert result.err.count("/map: the quaternion of the map's origin is 0, 0, 0, 0: taken for no turn") == 1
    assert any("taken for no turn" in line for line in info(log)[1]["problems"])
