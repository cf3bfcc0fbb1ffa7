"""``mcl score``: the worked example to nine digits, and every way to name a scan."""

from __future__ import annotations

import json
import math
import re
import shutil
import sqlite3
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
from PIL import Image
from rosbags.rosbag1 import Writer as BagWriter
from ruamel.yaml import YAML

from tests.cli.example import LANDMARKS, METHODS, MODEL, NEAR, POSES, SCAN, reference
from tests.cli.support import MAPS, REFERENCE_MAP, SAMPLES, Message, mcl, single_error
from tests.data import shared
from tests.io.ros_messages import STORES
from tests.sensors.example import SET1, SET1_TOTAL, SET1_WEIGHTS, SET2, SET2_WEIGHTS, SET3, Example

if TYPE_CHECKING:
    from mclcli.world import FieldMethod

SET_OF = {2: SET2, 3: SET3}


def seen(number: int) -> tuple[object, ...]:
    return "--landmarks", LANDMARKS, "--bearings", SAMPLES / f"reference_set{number}.bearings.csv"


def nothing_but_how(err: str) -> bool:
    """Whether all that is said is how the poses were scored."""
    return re.fullmatch(r"mcl: scored lidar: \d+ beams at α = 1; as `mcl run` scores: --as-run\n", err) is not None


@pytest.mark.parametrize("method", METHODS)
def test_first_set(method: FieldMethod) -> None:
    table = reference(1, method, *seen(1))
    assert table.names == ["x", "y", "yaw", "log_lidar", "log_vision", "log_weight", "weight"]
    np.testing.assert_allclose(table["log_weight"], SET1_TOTAL, rtol=0, atol=1e-9)
    np.testing.assert_allclose(table["weight"], SET1_WEIGHTS, rtol=0, atol=1e-9)
    np.testing.assert_allclose(np.column_stack([table[n] for n in ("x", "y", "yaw")]), SET1.poses, rtol=0, atol=1e-12)


@pytest.mark.parametrize("method", METHODS)
def test_second_set(method: FieldMethod) -> None:
    table = reference(2, method, *seen(2))
    np.testing.assert_allclose(table["log_lidar"], SET2.lidar[method], rtol=0, atol=1e-9)
    np.testing.assert_allclose(table["log_vision"], SET2.vision, rtol=0, atol=1e-9)
    np.testing.assert_array_equal(table["log_weight"], table["log_lidar"] + table["log_vision"])
    if method == "brushfire":
        np.testing.assert_allclose(table["weight"], SET2_WEIGHTS, rtol=1e-9, atol=0)


@pytest.mark.parametrize("method", METHODS)
def test_third_set(method: FieldMethod) -> None:
    table = reference(3, method)
    assert table.names == ["x", "y", "yaw", "log_lidar", "log_weight", "weight"]
    np.testing.assert_allclose(table["log_lidar"], SET3.lidar[method], rtol=0, atol=1e-9)
    np.testing.assert_array_equal(table["log_weight"], table["log_lidar"])


def altered_map(folder: Path, change: str) -> Path:
    """Copy of the reference map with its cells changed."""
    pixels = np.asarray(Image.open(MAPS / "reference.pgm"))
    changed = {"empty": np.full_like(pixels, 254), "flipped": pixels[::-1], "transposed": pixels[::-1].T[::-1]}[change]
    Image.fromarray(np.ascontiguousarray(changed)).save(folder / "reference.pgm")
    return Path(shutil.copy(REFERENCE_MAP, folder / "reference.yaml"))


def test_an_empty_map_cannot_score(tmp_path: Path) -> None:
    result = mcl("score", SCAN, "--map", altered_map(tmp_path, "empty"), "--poses", POSES, "-q")
    assert "no cell is occupied" in single_error(result, 1)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("number", [2, 3])
@pytest.mark.parametrize("change", ["flipped", "transposed"])
def test_a_map_the_wrong_way_round_misses_by_far(tmp_path: Path, change: str, number: int, method: FieldMethod) -> None:
    example: Example = SET_OF[number]
    table = reference(number, method, grid=altered_map(tmp_path, change))
    assert np.abs(table["log_lidar"] - example.lidar[method]).max() > 0.1


# Naming the scan


def as_json(path: Path) -> bytes:
    return json.dumps(YAML(typ="safe", pure=True).load(path.read_text().removesuffix("---\n"))).encode()


def test_a_scan_as_json_or_on_stdin_scores_the_same(tmp_path: Path) -> None:
    (tmp_path / "scan.json").write_bytes(as_json(SCAN))
    rest = ("--map", REFERENCE_MAP, "--poses", POSES)
    expected = mcl("score", SCAN, *rest)
    assert expected.code == 0
    others = [
        mcl("score", tmp_path / "scan.json", *rest),
        mcl("score", "-", *rest, stdin=SCAN.read_bytes()),
        mcl("score", "-", *rest, stdin=as_json(SCAN)),
    ]
    assert [(other.code, other.out) for other in others] == [(0, expected.out)] * 3


def test_a_bare_scan_is_taken_at_the_base_and_that_is_said() -> None:
    result = mcl("score", SCAN, "--map", REFERENCE_MAP, "--pose", "0.91,-0.81,-65deg")
    assert "taken at the base" in result.err
    mounted = mcl("score", SCAN, "--map", REFERENCE_MAP, "--pose", "0.91,-0.81,-65deg", "--mount", "0,0,0")
    assert mounted.out == result.out
    assert nothing_but_how(mounted.err)


def test_a_mount_of_another_frame_than_the_scans_is_refused() -> None:
    words = ("score", SCAN, "--map", REFERENCE_MAP, "--pose", "0,0,0")
    assert "--mount lidar: the scan is in frame 'laser'" in single_error(mcl(*words, "--mount", "lidar=0,0,0"), 2)


def test_a_mount_moves_the_scan_as_a_pose_would() -> None:
    x, y, yaw = 0.91, -0.81, math.radians(-65)
    table = mcl("score", SCAN, "--map", REFERENCE_MAP, "--pose", f"{x},{y},{yaw}", *MODEL).table
    # base_from_sensor: 0.2 m ahead, turned by 90°; the base stands where that puts the sensor at the pose above
    base = yaw - math.pi / 2
    pose = f"{x - 0.2 * math.cos(base)},{y - 0.2 * math.sin(base)},{base}"
    for mount in ("0.2,0,90deg", "laser=0.2,0,90deg", "20cm,0,0.3,0,0,90deg"):
        mounted = mcl("score", SCAN, "--map", REFERENCE_MAP, "--pose", pose, *MODEL, "--mount", mount)
        np.testing.assert_allclose(mounted.table["log_lidar"], table["log_lidar"], rtol=0, atol=1e-9)
    words = ("score", SCAN, "--map", REFERENCE_MAP, "--pose", pose, *MODEL, "--mount", "other=1,1,1")
    one_of_two = mcl(*words, "--mount", "laser=0.2,0,90deg").table
    np.testing.assert_allclose(one_of_two["log_lidar"], table["log_lidar"], rtol=0, atol=1e-9)


@pytest.mark.parametrize("mount", ["1,2", "1,2,3,4", "a,b,c"])
def test_a_mount_that_is_none(mount: str) -> None:
    single_error(mcl("score", SCAN, "--map", REFERENCE_MAP, "--pose", "0,0,0", "--mount", mount), 2)


@pytest.fixture(scope="module")
def containers(
    office_messages: list[Message], short: Path, tmp_path_factory: pytest.TempPathFactory
) -> dict[str, Path]:
    """The same short log as MCAP, as a rosbag2 database and as a ROS 1 bag."""
    folder = tmp_path_factory.mktemp("containers")
    return {"mcap": short, "db3": as_db3(folder, office_messages), "bag": as_bag(folder / "short.bag", office_messages)}


def as_db3(folder: Path, contents: list[Message]) -> Path:
    """rosbag2's database, as its sqlite3 storage lays it out; without metadata.yaml."""
    path = folder / "short_0.db3"
    names = sorted({(message.topic, message.type) for message in contents})
    with sqlite3.connect(path) as database:
        database.executescript(
            "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL,"
            " serialization_format TEXT NOT NULL, offered_qos_profiles TEXT NOT NULL);"
            "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL, timestamp INTEGER NOT NULL,"
            " data BLOB NOT NULL);"
        )
        rows = [(number, topic, kind, "cdr", "") for number, (topic, kind) in enumerate(names, 1)]
        database.executemany("INSERT INTO topics VALUES (?, ?, ?, ?, ?)", rows)
        numbers = {topic: number for number, topic, *_ in rows}
        database.executemany(
            "INSERT INTO messages(topic_id, timestamp, data) VALUES (?, ?, ?)",
            [(numbers[m.topic], m.log_ns, m.data) for m in contents],
        )
    database.close()
    return path


def as_bag(path: Path, contents: list[Message]) -> Path:
    """ROS 1 bag with the scans, odometry and transforms."""
    store, old = STORES["cdr"], STORES["ros1"]
    with BagWriter(path) as writer:
        connections = {}
        for number, message in enumerate(contents):
            if message.topic not in {"/scan", "/odom", "/tf", "/tf_static"}:
                continue
            if message.topic not in connections:
                connections[message.topic] = writer.add_connection(message.topic, message.type, typestore=old)
            decoded = store.deserialize_cdr(message.data, message.type)
            for part in [decoded, *getattr(decoded, "transforms", [])]:
                if hasattr(part, "header"):
                    stamp = old.types["builtin_interfaces/msg/Time"](
                        sec=part.header.stamp.sec, nanosec=part.header.stamp.nanosec
                    )
                    part.header = old.types["std_msgs/msg/Header"](
                        seq=number, stamp=stamp, frame_id=part.header.frame_id
                    )
            data = bytes(old.serialize_ros1(decoded, message.type))
            writer.write(connections[message.topic], message.log_ns, data)
    return path


@pytest.mark.parametrize("kind", ["mcap", "db3", "bag"])
def test_a_scan_of_a_log(containers: dict[str, Path], kind: str) -> None:
    by_number = mcl("score", containers[kind], "--index", 20, *NEAR)
    assert by_number.code == 0
    assert nothing_but_how(by_number.err)
    # scans come at 8 Hz from 1/16 s on: number 20 is that of 2.5625 s
    by_time = [mcl("score", containers[kind], "--at", at, *NEAR) for at in ("2.55", "@1715697002.6", "14:30:02.55")]
    assert {result.out for result in by_time} == {by_number.out}
    assert mcl("score", containers[kind], "--index", 21, *NEAR).out != by_number.out
    assert by_number.out == mcl("score", containers["mcap"], "--index", 20, *NEAR).out


@pytest.mark.parametrize("form", ["yaml", "json"])
def test_extract_and_score_in_a_pipe_is_score_of_the_log(short: Path, form: str) -> None:
    text = mcl("extract", short, "--at", 3, "--format", form)
    assert text.code == 0
    piped = mcl("score", "-", *NEAR, stdin=text.out)
    assert piped.code == 0
    assert nothing_but_how(piped.err)
    assert piped.out == mcl("score", short, "--at", 3, *NEAR).out


def test_a_scan_that_the_log_does_not_have(short: Path) -> None:
    assert "number 999" in single_error(mcl("score", short, "--index", 999, *NEAR), 2)
    assert "/scan" in single_error(mcl("score", short, "--scan-topic", "/nowhere", *NEAR), 2)
    single_error(mcl("score", short, "--index", 1, "--at", 2, *NEAR), 2)
    assert "one scan" in single_error(mcl("score", SCAN, "--index", 1, "--map", REFERENCE_MAP, "--pose", "0,0,0"), 2)
    assert single_error(mcl("score", "none.yaml", *NEAR), 2).startswith("none.yaml: no such file")


def test_a_yawed_lidar_through_the_pipe() -> None:
    log = shared("olin/macfirst_floor_take_2")
    grid = shared("olin/mac_1st_floor_9_23.yaml")
    matched = np.loadtxt(shared("olin/matched.tum"))[100]
    yaw = 2.0 * math.atan2(matched[6], matched[7])
    text = mcl("extract", log, "--at", f"@{matched[0]:.9f}")
    assert text.code == 0
    around = f"{matched[1]},{matched[2]},{yaw}"
    table = mcl(
        "score", "-", "--map", grid, "--around", around, "--spread", "0.3,20deg", "-n", 3000, stdin=text.out
    ).table
    best = int(table["log_weight"].argmax())
    assert math.hypot(table["x"][best] - matched[1], table["y"][best] - matched[2]) < 0.1
    assert abs(math.remainder(table["yaw"][best] - yaw, math.tau)) < math.radians(3)


def test_scores_say_how_they_were_made_and_as_run_is_how_a_run_makes_them() -> None:
    words = (
        "score",
        SAMPLES / "office.mcap",
        "--at",
        "20",
        "--map",
        MAPS / "office.yaml",
        "--around=-7.45,1.66,-84deg",
    )
    plain, as_run = mcl(*words), mcl(*words, "--as-run")
    assert re.search(r"scored lidar: [1-9]\d\d beams at α = 1; as `mcl run` scores: --as-run", plain.err)
    told = re.search(r"scored lidar: (\d+) beams at α = (0\.\d+); as `mcl run` scores\n", as_run.err)
    assert told is not None
    assert int(told[1]) == 60
    table = as_run.table
    np.testing.assert_allclose(table["log_weight"], float(told[2]) * table["log_lidar"], rtol=1e-2)
    assert "as `mcl run` scores" not in mcl(*words, "-q").err
    given = mcl(*words, "--as-run", "--set", "max_beams=30", "--temperature", "0.25")
    assert "scored lidar: 30 beams at α = 0.25; as `mcl run` scores\n" in given.err
