"""Real logs, tracked with defaults: how far from their references, and what must not be read to get there."""

from __future__ import annotations

import math
import os
import re
import shutil
import subprocess
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from rosbags.rosbag1 import Reader, Writer
from scipy.ndimage import distance_transform_edt

from benchmarks.accuracy import CASES, Loaded, rmse
from mclcli import open_recording
from mclcli.geometry import se3
from mclcli.io.maps.map_yaml import load_map
from mclcli.records import LaserScan
from mclcli.settings import profiles
from tests.cli.support import Table, error_against, mcl
from tests.data import shared
from tests.io.ros_messages import STORES

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from benchmarks.accuracy import Case
    from mclcli.arrays import FloatArray
    from tests.cli.support import Result

    Run = Callable[..., Result]

pytestmark = pytest.mark.real


def numbers(path: Path) -> FloatArray:
    """x, y, yaw of a TUM file's rows."""
    rows = np.loadtxt(path)
    return np.column_stack((rows[:, 1:3], 2.0 * np.arctan2(rows[:, 6], rows[:, 7])))


def tracked(*words: object) -> Table:
    result = mcl("run", *words, "--track", "-")
    assert result.code == 0, result.err
    return result.table


@pytest.mark.parametrize("seed", [0, 1])
def test_intel(seed: int) -> None:
    truth = shared("intel/truth.tum")
    log, grid = shared("intel/intel.mcap"), shared("intel/intel.yaml")
    table = tracked(log, "--map", grid, "--init", truth, "--seed", seed)
    assert len(table.rows) == 910
    assert error_against(table, truth) <= 0.10


@pytest.fixture(scope="module")
def olin(tmp_path_factory: pytest.TempPathFactory) -> tuple[Table, Table]:
    """Track and steps of the TurtleBot 4, started at the first reference pose."""
    steps = tmp_path_factory.mktemp("olin") / "steps.csv"
    x, y, yaw = numbers(shared("olin/matched.tum"))[0]
    log, grid = shared("olin/macfirst_floor_take_2"), shared("olin/mac_1st_floor_9_23.yaml")
    table = tracked(log, "--map", grid, "--init", f"{x},{y},{yaw}", "--steps", steps)
    return table, Table(steps.read_text())


def test_olin(olin: tuple[Table, Table]) -> None:
    table, _ = olin
    assert len(table.rows) == 354  # of 357: two before odometry starts, one after its end
    assert error_against(table, shared("olin/matched.tum")) <= 0.10


def test_olin_scans_lie_on_the_map(olin: tuple[Table, Table]) -> None:
    """At 95 % of the updates, 85 % of the valid endpoints are within 0.15 m of an occupied cell."""
    _, steps = olin
    grid = load_map(shared("olin/mac_1st_floor_9_23.yaml"))
    far = distance_transform_edt(~grid.occupied) * grid.resolution
    recording = open_recording(shared("olin/macfirst_floor_take_2"))
    parts = recording.roles()
    scans = {scan.stamp_ns: scan for _, scan in recording.events(parts.scan) if isinstance(scan, LaserScan)}
    fits = []
    for text, *pose in zip(steps.texts("stamp"), steps["x"], steps["y"], steps["yaw"], strict=True):
        scan = scans[int(text.replace(".", ""))]
        mount = recording.survey.frames.lookup(parts.base_frame, scan.frame_id, scan.stamp_ns)
        assert mount is not None
        valid = np.isfinite(scan.ranges) & (scan.ranges > scan.range_min) & (scan.ranges < scan.range_max)
        angles = (scan.angle_min + scan.angle_increment * np.arange(scan.ranges.size))[valid]
        ranges = scan.ranges[valid]
        flat, one = np.zeros(ranges.size), np.ones(ranges.size)
        beams = np.stack((ranges * np.cos(angles), ranges * np.sin(angles), flat, one))
        ends = (se3.from_planar(np.array(pose)) @ mount @ beams)[:2].T
        columns, rows = np.floor((ends - grid.origin[:2]) / grid.resolution).astype(int).T
        inside = (columns >= 0) & (columns < grid.width) & (rows >= 0) & (rows < grid.height)
        near = far[rows[inside], columns[inside]] <= 0.15
        fits.append(near.sum() / ranges.size)
    assert len(fits) > 30
    assert np.mean(np.array(fits) >= 0.85) >= 0.95


def test_simpath2() -> None:
    log, grid = shared("birmingham/simpath2.bag"), shared("birmingham/meeting_world.yaml")
    truth = "/base_pose_ground_truth"
    result = mcl("run", log, "--map", grid, "--init", truth, "--truth", truth, "--track", "-")
    assert result.code == 0
    assert reported_error(result.err) <= 0.10


def reported_error(said: str) -> float:
    """RMSE [m] of the summary."""
    found = re.search(r"against the reference: RMSE ([\d.]+) m", said)
    assert found is not None
    return float(found[1])


@pytest.fixture(scope="module")
def trace0() -> Run:
    """Run over the Pioneer's log from the first reference pose."""
    truth = shared("birmingham/trace0.on_map_from_trace0.tum")
    x, y, yaw = numbers(truth)[0]

    def call(grid: str, log: Path | None = None) -> Result:
        log = log or shared("birmingham/trace0.bag")
        return mcl("run", log, "--map", shared(f"birmingham/{grid}.yaml"), "--init", f"{x},{y},{yaw}")

    return call


def test_trace0_on_its_own_map(trace0: Run) -> None:
    result = trace0("map_from_trace0")
    assert result.code == 0
    assert error_against(result.table, shared("birmingham/trace0.on_map_from_trace0.tum")) <= 0.15


def test_trace0_finds_back_after_a_wing_that_the_map_lacks(trace0: Run) -> None:
    result = trace0("map_from_trace1")
    assert result.code == 0
    table, truth = result.table, np.loadtxt(shared("birmingham/trace0.on_map_from_trace0.tum"))
    last = len(table.rows) - 1
    nearest = int(np.abs(truth[:, 0] - table["stamp"][last]).argmin())
    assert math.hypot(table["x"][last] - truth[nearest, 1], table["y"][last] - truth[nearest, 2]) < 0.3


def test_a_recorded_localization_is_never_read(trace0: Run, tmp_path: Path) -> None:
    """The log's map → odom, moved by 7 m, changes nothing."""
    moved = tmp_path / "trace0.bag"
    assert with_localization_moved(shared("birmingham/trace0.bag"), moved) > 100
    expected, result = trace0("map_from_trace0"), trace0("map_from_trace0", moved)
    assert (result.code, result.out) == (0, expected.out)


def with_localization_moved(source: Path, target: Path) -> int:
    """Copy a bag with every map → odom shifted; how many there were."""
    store, count = STORES["ros1"], 0
    with Reader(source) as bag, Writer(target) as copy:
        kinds = {c.topic: c.msgtype for c in bag.connections}  # several nodes speak on /tf
        connections = {topic: copy.add_connection(topic, kind, typestore=store) for topic, kind in kinds.items()}
        for connection, stamp, data in bag.messages():
            written = data
            if connection.topic.strip("/") == "tf":
                message: Any = store.deserialize_ros1(data, connection.msgtype)
                for edge in message.transforms:
                    if edge.header.frame_id.strip("/") == "map":
                        edge.transform.translation.x += 7.0
                        count += 1
                written = bytes(store.serialize_ros1(message, connection.msgtype))
            copy.write(connections[connection.topic], stamp, written)
    return count


@pytest.mark.parametrize("robot", [1, 3])
def test_bearings_only(robot: int) -> None:
    log, landmarks = shared(f"mrclam/dataset6_robot{robot}.mcap"), shared("mrclam/landmarks.yaml")
    result = mcl("run", log, "--landmarks", landmarks, "--init", "/ground_truth", "--truth", "/ground_truth")
    assert result.code == 0
    assert reported_error(result.err) <= 0.20
    assert "sightings have an id that is not in the landmark map" in result.err


def of_one_run(case: Case, data: Path) -> float:
    """RMSE [m] with default settings, from the first reference pose."""
    loaded = Loaded.of(case, data)
    return rmse(loaded.errors(loaded.run(loaded.setup(profiles.build({}, model=case.model), seed=0))))


@pytest.mark.parametrize("robot", [1, 3])
def test_bearings_of_which_every_fifth_has_a_wrong_id(robot: int) -> None:
    case, data = CASES[f"mrclam robot {robot}, 20 % of ids misread"], shared(f"mrclam/dataset6_robot{robot}.mcap")
    assert of_one_run(case, data.parents[1]) <= 0.30


def test_intel_with_the_beam_model() -> None:
    log = shared("intel/intel.mcap")
    assert of_one_run(CASES["intel, beam"], log.parents[1]) <= 0.12


def test_evo_measures_the_same_error(tmp_path: Path) -> None:
    program = os.environ.get("MCL_EVO") or shutil.which("evo_ape")
    if program is None:
        pytest.skip("needs evo_ape on PATH, or its path in MCL_EVO")
    truth, track, csv = shared("intel/truth.tum"), tmp_path / "track.tum", tmp_path / "track.csv"
    log, grid = shared("intel/intel.mcap"), shared("intel/intel.yaml")
    result = mcl("run", log, "--map", grid, "--init", truth, "--track", track, "--track", csv)
    assert result.code == 0
    done = subprocess.run([program, "tum", truth, track], capture_output=True, check=True, text=True)
    found = re.search(r"^\s*rmse\s+([\d.]+)", done.stdout, re.MULTILINE)
    assert found is not None, done.stdout
    assert float(found[1]) == pytest.approx(error_against(Table(csv.read_text()), truth), abs=1e-6)
