"""``mcl run``: the same bytes for the same seed, and where and when it starts."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import pytest

from tests.cli.support import (
    FILES,
    SAMPLES,
    Everything,
    Message,
    contents,
    error_against,
    made,
    outputs,
    single_error,
    write_mcap,
)
from tests.io.ros_messages import NO_COVARIANCE, header, pose

if TYPE_CHECKING:
    from pathlib import Path

    from tests.cli.conftest import Runner

# The same again


@pytest.mark.parametrize("words", [(), ("--threads", 2), ("--color", "never", "-vv")])
def test_the_same_seed_gives_the_same_bytes(
    run_short: Runner, tmp_path: Path, everything: Everything, words: tuple[object, ...]
) -> None:
    result = run_short(*outputs(tmp_path / "out"), *words)
    assert result.code == 0
    assert contents(tmp_path / "out") == everything.files


def test_a_cold_cache_gives_the_same_bytes(run_short: Runner, tmp_path: Path, everything: Everything) -> None:
    for folder in ("cold", "warm"):
        assert run_short(*outputs(tmp_path / folder), "--cache-dir", tmp_path / "cache").code == 0
        assert contents(tmp_path / folder) == everything.files
    assert list((tmp_path / "cache" / "fields").iterdir())


def test_another_seed_gives_other_bytes(run_short: Runner, tmp_path: Path, everything: Everything) -> None:
    assert run_short(*outputs(tmp_path / "out"), "--seed", 1).code == 0
    other = contents(tmp_path / "out")
    assert other.keys() == everything.files.keys()
    assert not [name for name in FILES if other[name] == everything.files[name]]


def test_without_an_output_the_track_goes_to_stdout(everything: Everything, short_track: bytes) -> None:
    assert short_track == everything.files["track.csv"]


@pytest.mark.parametrize(("option", "name"), [("-o", "trace.csv"), ("--track", "track.csv"), ("--steps", "steps.csv")])
def test_each_csv_can_go_to_stdout(run_short: Runner, everything: Everything, option: str, name: str) -> None:
    result = run_short(option, "-")
    assert (result.code, result.out) == (0, everything.files[name])


# Where it starts, and when


def test_init_by_numbers(run_short: Runner) -> None:
    truth = SAMPLES / "office.truth.tum"
    near = run_short(init="-7.41,1.66,-83deg,0.1,3deg")
    assert near.code == 0
    assert error_against(near.table, truth) < 0.1
    exact = run_short("--particles", 1, init="-7.41,1.66,-83deg,0,0")
    first = exact.table.rows[0]
    assert [float(text) for text in first[1:4]] == pytest.approx([-7.41, 1.66, math.radians(-83)], abs=1e-9)
    assert first[4:10] == ["2.5e-05", "0", "0", "2.5e-05", "0", "7.61543549e-07"]  # the floor of what is stated


def test_init_by_a_file(run_short: Runner, tmp_path: Path) -> None:
    truth = SAMPLES / "office.truth.tum"
    result = run_short(init=truth)
    assert result.code == 0
    assert error_against(result.table, truth) < 0.1
    (tmp_path / "empty.tum").write_text("# nothing\n")
    assert run_short(init=tmp_path / "empty.tum").code in {1, 2}


def test_init_by_a_topic_uses_its_covariance(office_messages: list[Message], run_short: Runner, tmp_path: Path) -> None:
    sure = NO_COVARIANCE.copy()
    sure[[0, 7, 35]] = 1e-12
    at = header("map", 1_715_697_000, 0)
    operator = made(
        "/here",
        "geometry_msgs/msg/PoseWithCovarianceStamped",
        {"header": at, "pose": {"pose": pose(-7.41, 1.66, -1.45), "covariance": sure}},
    )
    log = write_mcap(tmp_path / "log.mcap", [operator, *office_messages])
    row = run_short("--particles", 10, log=log, init="/here").table.rows[0]
    # the robot stands at first, so that nothing spreads the particles before the first scan
    assert [float(text) for text in row[1:4]] == pytest.approx([-7.41, 1.66, -1.45], abs=1e-4)


def test_a_uniform_start_is_anywhere_and_a_global_one_where_the_scan_is_found(run_short: Runner) -> None:
    spread = {}
    for init in ("uniform", "global"):
        result = run_short("--particles", 2000, "--steps", "-", init=init)
        assert result.code == 0
        spread[init] = result.table["cov_xx"][0]
    assert spread["uniform"] > 0.05
    assert spread["global"] < 0.02


@pytest.mark.parametrize(
    ("init", "said", "code"),
    [
        ("100,100,0", "--init: (100, 100) lies off the map; the map spans x -9.6 to 14.4 m", 2),
        ("1,2", "X,Y,YAW", 2),
        ("1,2,3kg", "kg", 2),
        ("0,0,0,-1,1", "negative", 2),
        ("somewhere", "neither", 2),
        ("/nowhere", "it has /ground_truth, /initialpose, ", 2),
        ("/scan", "states no pose", 2),
    ],
)
def test_an_init_that_is_none(run_short: Runner, init: str, said: str, code: int) -> None:
    assert said in single_error(run_short(init=init), code)


def test_start_and_duration(run_short: Runner) -> None:
    starts = ["4", "@1715697004", "14:30:04", "2024-05-14T14:30:04Z"]
    results = [run_short("--start", at, "--duration", 3, init=SAMPLES / "office.truth.tum") for at in starts]
    assert {result.code for result in results} == {0}
    assert len({result.out for result in results}) == 1
    stamps = results[0].table["stamp"]
    assert len(stamps) == 24
    assert (stamps[0], stamps[-1]) == (1715697004.0625, 1715697006.9375)
    assert "skipped: outside --start and --duration" in results[0].err


@pytest.mark.parametrize(
    "words", [("--duration", "0"), ("--duration", "x"), ("--start", "noon"), ("--start", "99:00:00")]
)
def test_a_window_that_is_none(run_short: Runner, words: tuple[str, str]) -> None:
    assert words[0] in single_error(run_short(*words), 2)


def test_a_window_without_a_scan(run_short: Runner, tmp_path: Path) -> None:
    result = run_short("--start", 100, "--track", tmp_path / "track.csv")
    assert "96 /scan: outside --start and --duration" in single_error(result, 1)
    assert not list(tmp_path.iterdir())
