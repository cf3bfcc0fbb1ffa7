"""``mcl locate``: every way to name what was seen, what comes back, and what is refused."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np
import pytest
from PIL import Image

from mclcli.cli.locate.scans import thinned
from mclcli.geometry import se2
from mclcli.io.tables.tum import read_tum
from mclcli.sensors.observation import Observation
from tests.cli.support import MAPS, OFFICE, OFFICE_MAP, SAMPLES, START_NS, mcl, single_error
from tests.data import shared
from tests.support import scan_of

if TYPE_CHECKING:
    from pathlib import Path

    from tests.cli.support import Table

TRUTH = read_tum(SAMPLES / "office.truth.tum")
ON_MAP = ("--map", OFFICE_MAP)


def distance(table: Table, row: int = 0) -> tuple[float, float]:
    """How far a row is from the truth of its stamp, [m] and [rad]."""
    stamp = table.texts("stamp")[row]
    at = int(np.argmin(np.abs(TRUTH.stamps_ns - int(stamp.replace(".", "")))))
    pose = np.array([table[name][row] for name in ("x", "y", "yaw")])
    error = se2.between(TRUTH.poses[at], pose)
    return float(np.hypot(error[0], error[1])), abs(float(error[2]))


def assert_right(table: Table, row: int = 0) -> None:
    off, turned = distance(table, row)
    assert off < 0.3
    assert turned < np.radians(5.0)


def test_one_scan_of_a_log_and_the_same_as_text(tmp_path: Path) -> None:
    of_log = mcl("locate", OFFICE, *ON_MAP, "--at", 8)
    assert of_log.code in {0, 5}
    assert_right(of_log.table)
    assert of_log.table["rank"].tolist() == list(range(1, len(of_log.table.rows) + 1))
    text = mcl("extract", OFFICE, "--at", 8).out
    assert mcl("locate", "-", *ON_MAP, stdin=text).out == of_log.out
    (tmp_path / "scan.yaml").write_bytes(text)
    assert mcl("locate", tmp_path / "scan.yaml", *ON_MAP, "-o", tmp_path / "modes.csv").out == b""
    assert (tmp_path / "modes.csv").read_bytes() == of_log.out


def test_a_window_and_json_and_a_picture(tmp_path: Path) -> None:
    result = mcl(
        "locate", OFFICE, *ON_MAP, "--at", 12, "--window", 6, "--json", "--picture", tmp_path / "p.png", "-k", 3
    )
    found = json.loads(result.out)
    assert result.code == (5 if found["ambiguous"] else 0)
    assert 1 <= len(found["modes"]) <= 3
    assert found["beams"] > 90
    assert found["lattice"]["cell"] == 0.05
    assert sum(mode["share"] for mode in found["modes"]) + found["not_on_map"] + found["not_listed"] == pytest.approx(
        1.0
    )
    assert all(mode["share_low"] <= mode["share"] <= mode["share_high"] for mode in found["modes"])
    assert set(found["modes"][0]["evidence"]) == {"ends", "rays", "bearings", "odometry", "volume", "strange"}
    with Image.open(tmp_path / "p.png") as picture:
        assert picture.width > 600


def test_every_so_often_through_the_log() -> None:
    result = mcl("locate", OFFICE, *ON_MAP, "--every", 15, "--window", 3, "-k", 1, "--min-share", 0)
    assert result.code == 0
    stamps = [int(text.replace(".", "")) - START_NS for text in result.table.texts("stamp")]
    assert (np.diff(stamps) >= 15 * 10**9 - 2 * 10**8).all()
    assert len(stamps) >= 3
    for row in range(len(stamps)):
        assert_right(result.table, row)
    assert f"{len(stamps)} scans" in result.err


@pytest.mark.parametrize(
    ("stamps", "every", "expected"),
    [
        ([0, 3, 6, 9, 12, 15, 18, 21], 5, [0, 6, 12, 15, 21]),  # late ones do not shift those after them
        ([7, 11, 12, 13, 17], 5, [7, 12, 17]),
        ([0, 4, 41, 42, 44, 45, 49, 50], 5, [0, 41, 45, 50]),  # one after a gap, not one for each that is missing
        ([3, 4, 9, 10], 1, [3, 4, 9, 10]),
        ([], 5, []),
    ],
)
def test_one_scan_of_each_interval_is_looked_at(stamps: list[int], every: int, expected: list[int]) -> None:
    moments = [(Observation("/scan", scan_of([1.0], stamp_ns=s), np.zeros(3), np.eye(4)),) for s in stamps]
    assert [moment[-1].reading.stamp_ns for moment in thinned(moments, every)] == expected


def test_a_share_below_the_least_asked_for_ends_with_5() -> None:
    assert mcl("locate", OFFICE, *ON_MAP, "--at", 8, "--min-share", 1).code == 5
    assert mcl("locate", OFFICE, *ON_MAP, "--at", 8, "--min-share", 0).code == 0


def test_what_is_to_be_thought_of_it_comes_first_and_only_what_may_help_is_advised() -> None:
    wrong = mcl("locate", OFFICE, "--map", MAPS / "warehouse.yaml", "--at", 40, "--window", 20)
    assert wrong.code == 5
    assert wrong.err.startswith("mcl: not on this map (probability ")
    assert "--window" not in wrong.err
    assert "mcl: give the map of where the robot was" in wrong.err
    scan = mcl("extract", OFFICE, "--at", 8).out
    for words, helps in (((OFFICE, "--at", 8), True), ((OFFICE, "--at", 40, "--window", 31), False), (("-",), False)):
        found = mcl("locate", *words, *ON_MAP, "--min-share", 1, stdin=scan)
        assert found.err.startswith("mcl: ambiguous: "), words
        assert ("a longer --window, --prior or --region" in found.err) is helps, words


def test_prior_and_region_limit_the_search() -> None:
    x, y, _ = TRUTH.poses[int(np.argmin(np.abs(TRUTH.stamps_ns - START_NS - 8 * 10**9)))]
    near = mcl("locate", OFFICE, *ON_MAP, "--at", 8, "--prior", f"{x + 0.5},{y},0,2,180deg", "--min-share", 0)
    assert_right(near.table)
    assert (np.hypot(near.table["x"] - x - 0.5, near.table["y"] - y) < 2.2).all()
    box = mcl("locate", OFFICE, *ON_MAP, "--at", 8, "--region", f"{x - 1},{y + 1},{x + 1},{y - 1}", "--min-share", 0)
    assert (np.abs(box.table["x"] - x) < 1.2).all()


def test_landmarks_of_a_log_take_part() -> None:
    marks = ("--landmarks", SAMPLES / "office.landmarks.csv")
    result = mcl("locate", OFFICE, *ON_MAP, "--at", 20, *marks, "--window", 2, "--json")
    assert (
        json.loads(result.out)["beams"]
        > json.loads(mcl("locate", OFFICE, *ON_MAP, "--at", 20, "--window", 2, "--json").out)["beams"]
    )


@pytest.mark.parametrize(
    ("words", "code", "message"),
    [
        (("nowhere.mcap",), 2, "no such file"),
        ((OFFICE, "--prior", "1,2,3"), 2, "needs four values"),
        ((OFFICE, "--prior", "1,2,3,-1"), 2, "must be greater than 0"),
        ((OFFICE, "--prior", "900,900,0,1"), 2, "leaves no cell where the base may be"),
        ((OFFICE, "--region", "1,2"), 2, "needs four values"),
        ((OFFICE, "--every", "1", "--at", "3"), 2, "leave --at and --index out"),
        ((OFFICE, "--window", "-1"), 2, "is less than 0"),
        ((OFFICE, "--bearings", "x.csv"), 2, "--bearings go with a single scan"),
        ((OFFICE, "--temperature", "ess"), 2, "ess keeps a share of a sample"),
        ((SAMPLES / "reference_set3.yaml", "--window", "2"), 2, "is one scan, not a log"),
        ((SAMPLES / "reference_set3.yaml", "--landmarks", SAMPLES / "office.landmarks.csv"), 2, "go together"),
    ],
)
def test_what_cannot_be_is_refused_in_one_line(words: tuple[object, ...], code: int, message: str) -> None:
    assert message in single_error(mcl("locate", *words, *ON_MAP), code)


def test_a_scan_that_says_nothing_is_refused(tmp_path: Path) -> None:
    scan = {"angle_min": 0.0, "angle_increment": 0.1, "range_min": 0.1, "range_max": 5.0, "ranges": ["inf"] * 5}
    (tmp_path / "blind.json").write_text(json.dumps(scan).replace('"inf"', "Infinity"))
    result = mcl("locate", tmp_path / "blind.json", *ON_MAP)
    assert (result.code, result.out) == (1, b"")
    assert "says nothing about where it was taken" in result.err


@pytest.mark.real
def test_the_first_scans_of_a_real_log_are_found() -> None:
    log, grid = shared("olin/macfirst_floor_take_2"), shared("olin/mac_1st_floor_9_23.yaml")
    table = mcl("locate", log, "--map", grid, "--index", 3, "-k", 1).table
    truth = read_tum(shared("olin/matched.tum"))
    stamp = int(table.texts("stamp")[0].replace(".", ""))
    true = truth.poses[int(np.argmin(np.abs(truth.stamps_ns - stamp)))]
    assert np.hypot(table["x"][0] - true[0], table["y"][0] - true[1]) < 0.3
