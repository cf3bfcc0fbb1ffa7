"""``mcl run`` over logs of every shape: streamed, split, in a folder, cut off, damaged."""

from __future__ import annotations

import math
import shutil
from typing import TYPE_CHECKING

import numpy as np
import pytest

from mclcli.io.maps.map_yaml import load_map
from tests.cli.support import (
    OFFICE_MAP,
    SAMPLES,
    START_NS,
    Message,
    Table,
    error_against,
    made,
    mcl,
    single_error,
    without,
    write_mcap,
)
from tests.io.ros_messages import header

if TYPE_CHECKING:
    from pathlib import Path

    from tests.cli.conftest import Runner


# Ways in


def test_a_stream_is_the_file(run_short: Runner, short: Path, short_track: bytes) -> None:
    result = run_short(log="-", stdin=short.read_bytes())
    assert (result.code, result.out) == (0, short_track)


def test_a_stream_longer_than_what_is_looked_at_first(run_short: Runner) -> None:
    log = SAMPLES / "office.mcap"
    words = ("--duration", 25)
    expected = run_short(*words, log=log)
    assert len(expected.table.rows) == 200
    assert run_short(*words, log="-", stdin=log.read_bytes()).out == expected.out


def test_a_file_split_in_two_is_one_log(
    run_short: Runner, office_messages: list[Message], short_track: bytes, tmp_path: Path
) -> None:
    middle = START_NS + 5 * 10**9
    first = write_mcap(tmp_path / "a.mcap", [m for m in office_messages if m.log_ns < middle])
    second = write_mcap(tmp_path / "b.mcap", [m for m in office_messages if m.log_ns >= middle])
    assert run_short(second, log=first).out == short_track
    assert run_short(first, log=second).out == short_track
    alone = run_short(log=first)
    assert alone.code == 0
    assert short_track.startswith(alone.out)
    assert len(alone.out) < len(short_track) / 2


def test_a_rosbag2_folder(run_short: Runner, short: Path, short_track: bytes, tmp_path: Path) -> None:
    bag = tmp_path / "bag"
    bag.mkdir()
    shutil.copy(short, bag / "bag_0.mcap")
    assert run_short(log=bag).out == short_track
    (bag / "metadata.yaml").write_text(
        "rosbag2_bagfile_information:\n  version: 5\n  storage_identifier: mcap\n  relative_file_paths:\n"
        "    - bag_0.mcap\n"
    )
    assert run_short(log=bag).out == short_track


def test_the_map_of_the_log(office_messages: list[Message], short_track: bytes, tmp_path: Path) -> None:
    grid = load_map(OFFICE_MAP)
    x, y, yaw = (float(value) for value in grid.origin)
    turn = {"x": 0.0, "y": 0.0, "z": math.sin(yaw / 2), "w": math.cos(yaw / 2)}
    info = {
        "map_load_time": {"sec": 0, "nanosec": 0},
        "resolution": grid.resolution,
        "width": grid.width,
        "height": grid.height,
        "origin": {"position": {"x": x, "y": y, "z": 0.0}, "orientation": turn},
    }
    values = {"header": header("map"), "info": info, "data": np.ascontiguousarray(grid.cells.ravel())}
    log = write_mcap(tmp_path / "log.mcap", [made("/map", "nav_msgs/msg/OccupancyGrid", values), *office_messages])
    result = mcl("run", log, "--init", "/initialpose", "--particles", 300)
    assert result.code == 0
    assert "mcl: map: from the log's topic /map" in result.err
    np.testing.assert_allclose(result.table["x"][:20], Table(short_track.decode())["x"][:20], rtol=0, atol=1e-3)
    assert error_against(result.table, SAMPLES / "office.truth.tum") < 0.15


def test_odometry_from_tf(run_short: Runner, office_messages: list[Message], tmp_path: Path) -> None:
    asked = run_short("--odom", "tf")
    assert asked.code == 0
    only = write_mcap(tmp_path / "log.mcap", without(office_messages, "/odom"))
    found = run_short(log=only)
    assert found.code == 0
    assert found.out == asked.out
    assert error_against(found.table, SAMPLES / "office.truth.tum") < 0.15


def test_truth_is_never_read(
    run_short: Runner, office_messages: list[Message], short_track: bytes, tmp_path: Path
) -> None:
    log = write_mcap(tmp_path / "log.mcap", without(office_messages, "/ground_truth"))
    assert run_short(log=log).out == short_track
    assert run_short("--truth", SAMPLES / "office.truth.tum").out == short_track


# Damage


@pytest.mark.parametrize("share", [0.5, 0.7, 0.9])
def test_a_log_that_was_cut_off(
    run_short: Runner, short: Path, short_track: bytes, tmp_path: Path, share: float
) -> None:
    raw = short.read_bytes()
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(raw[: int(len(raw) * share)])
    result = run_short(log=cut)
    assert result.code == 3
    assert "mcl: warning: cut.mcap: " in result.err
    assert short_track.startswith(result.out)
    assert len(result.out) > 0.8 * share * len(short_track) - 6000
    target = tmp_path / "strict.csv"
    strict = run_short("--strict", "--track", target, log=cut)
    assert "leave --strict out" in single_error(strict, 1)
    assert [path.name for path in tmp_path.iterdir()] == ["cut.mcap"]
    streamed = run_short(log="-", stdin=cut.read_bytes())
    assert (streamed.code, streamed.out) == (3, result.out)


def test_a_log_cut_off_after_its_data_is_complete(
    run_short: Runner, short: Path, short_track: bytes, tmp_path: Path
) -> None:
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(short.read_bytes()[:-20])
    result = run_short(log=cut)
    assert (result.code, result.out) == (0, short_track)
    assert "mcl: warning: cut.mcap: " in result.err


def test_a_damaged_chunk_is_left_out_and_said(
    run_short: Runner, office_messages: list[Message], short_track: bytes, tmp_path: Path
) -> None:
    log = write_mcap(tmp_path / "log.mcap", office_messages, chunk_size=8192)
    whole = run_short(log=log)
    assert (whole.code, whole.out) == (0, short_track)
    raw = bytearray(log.read_bytes())
    raw[len(raw) // 2] ^= 0x10
    log.write_bytes(bytes(raw))
    result = run_short(log=log)
    assert result.code == 3
    assert "mcl: warning: log.mcap: chunk at byte " in result.err
    assert " messages (" in result.err
    early = len(short_track) // 3
    assert result.out[:early] == short_track[:early]
    assert result.table.rows[-1][0] == Table(short_track.decode()).rows[-1][0]
