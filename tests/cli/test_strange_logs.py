"""Logs of strangers, made up: several robots, lidars and maps, mounts that move, run from the command line."""

from __future__ import annotations

import json
import math
from typing import TYPE_CHECKING

import numpy as np
import pytest
from PIL import Image

from tests.cli.support import START_NS, Table, mcl, single_error, write_mcap
from tests.io import drives
from tests.io.drives import GRID, SCAN, TF, Drive, at, every, in_order

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable
    from pathlib import Path

    from tests.cli.support import Message
    from tests.io.drives import Pose

NEAR = 0.25
ONE, TWO = Drive("/robot1"), Drive("/robot2", lead=3.0, mount=(-0.2, 0.0, 3.0))


@pytest.fixture
def room(tmp_path: Path) -> Path:
    """The room's map as map_server writes it."""
    Image.fromarray(np.where(drives.room().occupied, 0, 254).astype(np.uint8)[::-1]).save(tmp_path / "room.png")
    path = tmp_path / "room.yaml"
    path.write_text(
        "image: room.png\nresolution: 0.05\norigin: [0, 0, 0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n"
    )
    return path


def log(folder: Path, *parts: Iterable[Message]) -> Path:
    return write_mcap(folder / "log.mcap", in_order(*parts))


def start(lead: float = 0.0) -> str:
    return ",".join(f"{value:.4f}" for value in drives.pose(lead)) + ",0.05,0.05"


def farthest(track: Table, pose: Callable[[float], Pose] = drives.pose) -> float:
    """Largest distance [m] of a track from where the robot was."""
    seconds = [int(text.replace(".", "")) / 1e9 - START_NS / 1e9 for text in track.texts("stamp")]
    truth = np.array([pose(t)[:2] for t in seconds])
    return float(np.hypot(track["x"] - truth[:, 0], track["y"] - truth[:, 1]).max())


@pytest.mark.parametrize("number", [1, 2])
def test_the_robot_that_is_named_is_run(number: int, room: Path, tmp_path: Path) -> None:
    path, lead = log(tmp_path, ONE.messages(), TWO.messages()), (ONE, TWO)[number - 1].lead
    result = mcl("run", path, "--map", room, "--robot", f"robot{number}", "--init", start(lead), "--particles", 300)
    assert result.code == 0, result.err
    assert farthest(result.table, lambda t: drives.pose(t + lead)) < NEAR


def test_without_a_name_the_first_scan_at_the_start_decides_or_nothing_does(room: Path, tmp_path: Path) -> None:
    path = log(tmp_path, ONE.messages(), TWO.messages())
    result = mcl("run", path, "--map", room, "--init", start(TWO.lead), "--particles", 300)
    assert "robot: robot2, the only one whose first scan fits at --init" in result.err
    assert farthest(result.table, lambda t: drives.pose(t + TWO.lead)) < NEAR
    said = single_error(mcl("run", path, "--map", room, "--init", "uniform"), 2)
    assert said == "the log has 2 robots, robot1, robot2; say which one is meant with --robot NAME"


def test_info_names_the_robots(tmp_path: Path) -> None:
    path = log(tmp_path, ONE.messages(), TWO.messages())
    facts = json.loads(mcl("info", path, "--json").out)
    assert [robot["name"] for robot in facts["robots"]] == ["robot1", "robot2"]
    assert facts["robots"][1]["odometry"] == ["/robot2/odom", "tf"]
    assert facts["problems"] == []
    assert "--robot robot1" in facts["run"]
    assert "robot robot2: /robot2/scan, /robot2/odom, tf (--robot robot2)" in mcl("info", path).out.decode()


def test_robots_that_share_their_transforms_are_not_loose_frames(tmp_path: Path) -> None:
    shared = [Drive(f"/{name}", f"{name}/", lead=lead, tf_space="") for name, lead in (("tb1", 0.0), ("tb2", 3.0))]
    loose = [at(0.0, "/tf_static", TF, drives.transform(0.0, "shelf", "box", (1.0, 0.0, 0.0)))]
    path = log(tmp_path, *(drive.messages() for drive in shared))
    assert json.loads(mcl("info", path, "--json").out)["problems"] == []
    path = log(tmp_path, *(drive.messages() for drive in shared), loose)
    (problem,) = json.loads(mcl("info", path, "--json").out)["problems"]
    assert "roots shelf, tb1/odom" in problem


def test_all_lidars_take_part(room: Path, tmp_path: Path) -> None:
    rear: Pose = (-0.2, 0.0, math.pi)
    second = every(0.2, 10.0, lambda t: at(t, "/rear", SCAN, drives.scan(t, rear, "rear")))
    static = [at(0.0, "/tf_static", TF, drives.transform(0.0, "base_link", "rear", rear))]
    path = log(tmp_path, Drive().messages(), second, static)
    result = mcl("run", path, "--map", room, "--scan", "all", "--init", start(), "--particles", 300)
    assert "lidar_1 /scan: " in result.err
    assert "lidar_2 /rear: " in result.err
    assert farthest(result.table) < NEAR


def growing() -> list[Message]:
    parts = ((0.0, 60), (4.0, 120), (6.0, None))
    return [at(t, "/map", GRID, drives.grid(columns=columns)) for t, columns in parts]


@pytest.mark.parametrize(
    ("update", "said"), [("auto", "the last of 3"), ("last", "the last of 3"), ("first", "the first of 3")]
)
def test_a_map_that_grows(update: str, said: str, tmp_path: Path) -> None:
    path = log(tmp_path, Drive().messages(), growing())
    result = mcl("run", path, "--set", f"map_update={update}", "--init", start(), "--particles", 300)
    assert f"map: from the log's topic /map, {said} messages" in result.err
    if update == "first":
        assert "lies off the map" in result.err
    else:
        assert farthest(result.table) < NEAR


def test_the_map_in_force_is_followed(tmp_path: Path) -> None:
    whole = [at(0.0, "/map", GRID, drives.grid())]
    again = [at(5.0, "/map", GRID, drives.grid()), at(7.0, "/map", GRID, drives.grid(columns=159))]
    path = log(tmp_path, Drive().messages(), whole, again)
    result = mcl("run", path, "--set", "map_update=follow", "--init", start(), "--particles", 300)
    assert "/map: the map changed once" in result.err
    assert farthest(result.table) < NEAR
    steady = mcl("run", log(tmp_path, Drive().messages(), whole), "--init", start(), "--particles", 300)
    assert result.table.rows[:20] == steady.table.rows[:20]
    assert result.table.rows != steady.table.rows


def panned(t: float) -> Pose:
    return 0.1, 0.0, 0.8 * math.sin(t)


def test_a_lidar_that_pans_is_where_it_was_at_the_scan(room: Path, tmp_path: Path) -> None:
    others = [message for message in Drive().messages() if message.topic not in {"/tf_static", "/scan"}]
    mount = every(0.02, 10.0, lambda t: at(t, "/tf", TF, drives.transform(t, "base_link", "laser", panned(t))))
    scans = every(0.2, 9.9, lambda t: at(t, "/scan", SCAN, drives.scan(t, panned(t), "laser")))
    path = log(tmp_path, others, mount, scans)
    assert farthest(mcl("run", path, "--map", room, "--init", start(), "--particles", 300).table) < NEAR
    extracted = json.loads(mcl("extract", path, "--at", 5, "--format", "json").out)
    assert extracted["mcl"]["base_from_sensor"][5] == pytest.approx(panned(5.0)[2], abs=0.01)
    pose = ",".join(f"{value:.4f}" for value in drives.pose(5.0))
    good, bad = (mcl("score", path, "--map", room, "--at", at_, "--pose", pose).table["log_lidar"][0] for at_ in (5, 2))
    assert good > bad + 10.0
    lidar = json.loads(mcl("info", path, "--json").out)["lidars"][0]
    assert lidar["mount_moves_by"] == pytest.approx([0.0, 0.8], abs=0.02)
    assert "it moves on the base, by up to 0.000 m and 4" in mcl("info", path).out.decode()
