"""``mcl run``: where it says the robot was, and what it writes."""

from __future__ import annotations

import gzip
import json
import math
import re
from typing import TYPE_CHECKING

import numpy as np
import pytest
from PIL import Image

from mclcli.io.traces.output import Output
from mclcli.sensors.models import LIDAR_MODELS
from mclcli.settings.profiles import PROFILES
from tests.cli.support import (
    MAPS,
    OFFICE_MAP,
    SAMPLES,
    START_NS,
    Everything,
    Message,
    Table,
    decoded,
    error_against,
    mcl,
    messages,
)

if TYPE_CHECKING:
    from pathlib import Path

    from tests.cli.conftest import Runner

COVARIANCE = ["cov_xx", "cov_xy", "cov_xyaw", "cov_yy", "cov_yyaw", "cov_yawyaw"]
TRACK = ["stamp", "x", "y", "yaw", *COVARIANCE, "updated", "segment"]
FACTS = ["step", "stamp", "n", "ess", "log_evidence", "alpha_lidar", "resampled", "degenerate", "beams_used"]
PLACES = [f"{name}_{number}" for number in (1, 2) for name in ("weight", "x", "y", "yaw")]
ENDS = ["segment", "converged", "reliability", "injected", "lost", "modes", *PLACES, "beams_lidar"]
STEPS = [*FACTS, "x", "y", "yaw", *COVARIANCE, *ENDS]
WEIGHTS = ["step", "stamp", "particle", "x", "y", "yaw", "log_lidar", "log_weight", "weight"]
SCANS = 96  # in 12 s at 8 Hz


# Accuracy


@pytest.mark.parametrize(("name", "bound"), [("office", 0.08), ("warehouse", 0.12)])
def test_a_sample_is_tracked(tmp_path: Path, name: str, bound: float) -> None:
    log, grid, truth = SAMPLES / f"{name}.mcap", MAPS / f"{name}.yaml", SAMPLES / f"{name}.truth.tum"
    picture = tmp_path / "track.png"
    words = ("--init", "/initialpose", "--truth", truth, "--track", "-", "--picture", picture)
    result = mcl("run", log, "--map", grid, *words)
    assert result.code == 0
    error = error_against(result.table, truth)
    assert error < bound
    assert f"against the reference: RMSE {error:.3f} m" in result.err
    with Image.open(picture) as drawn:
        assert drawn.format == "PNG"
        assert len(drawn.convert("RGB").getcolors(1 << 24) or []) > 10


@pytest.mark.parametrize("model", list(LIDAR_MODELS))
@pytest.mark.parametrize("profile", list(PROFILES))
def test_lost_is_said_of_the_lost_alone_whatever_profile_and_model(run_short: Runner, profile: str, model: str) -> None:
    words = ("--profile", profile, "--model", model, "--track", "-")
    assert "probably lost" not in run_short(*words).err
    lost = run_short(*words, init="4,-4,0,0.1,3deg").err
    told = re.search(r"probably lost, or off the map, at (\d+) of (\d+) updates", lost)
    assert told is not None
    assert int(told[1]) >= 0.8 * int(told[2])


@pytest.mark.parametrize("name", ["office", "warehouse"])
def test_a_sample_is_tracked_by_landmarks_alone(name: str) -> None:
    log, truth = SAMPLES / f"{name}.mcap", SAMPLES / f"{name}.truth.tum"
    words = ("--landmarks", SAMPLES / f"{name}.landmarks.csv", "--init", "/initialpose", "--duration", 40)
    result = mcl("run", log, *words, "--particles", 1000)
    assert result.code == 0
    assert error_against(result.table, truth) < 0.4


# Formats


def test_columns(everything: Everything) -> None:
    assert everything.table("track.csv").names == TRACK
    assert everything.table("steps.csv").names == STEPS
    assert everything.table("trace.csv").names == WEIGHTS


def test_two_sensors_have_columns_of_their_own(short: Path, tmp_path: Path) -> None:
    words = ("--map", OFFICE_MAP, "--landmarks", SAMPLES / "office.landmarks.csv", "--init", "/initialpose")
    outs = ("-o", tmp_path / "trace.csv", "--steps", tmp_path / "steps.csv")
    result = mcl("run", short, *words, *outs, "--particles", 50)
    assert result.code == 0
    assert Table((tmp_path / "trace.csv").read_text()).names[6:8] == ["log_lidar", "log_vision"]
    steps = Table((tmp_path / "steps.csv").read_text())
    assert steps.names[5:7] == ["alpha_lidar", "alpha_vision"]
    assert set(steps["alpha_vision"]) == {0.15}


def test_the_track_has_a_row_per_scan(everything: Everything, office_messages: list[Message]) -> None:
    table = everything.table("track.csv")
    scans = [decoded(m).header.stamp for m in office_messages if m.topic == "/scan"]
    assert table.texts("stamp") == [f"{stamp.sec}.{stamp.nanosec:09d}" for stamp in scans]
    assert len(scans) == SCANS


def test_updates_of_the_track_are_the_steps(everything: Everything) -> None:
    track, steps = everything.table("track.csv"), everything.table("steps.csv")
    updated = track["updated"] == 1
    assert 10 < updated.sum() < SCANS
    assert [s for s, u in zip(track.texts("stamp"), updated, strict=True) if u] == steps.texts("stamp")
    for name in TRACK[1:10]:
        np.testing.assert_array_equal(track[name][updated], steps[name])
    np.testing.assert_array_equal(steps["step"], np.arange(len(steps.rows)))


def test_between_updates_the_track_follows_odometry(everything: Everything, office_messages: list[Message]) -> None:
    """The motion from the last update on is that of odometry, in the frame of the base then."""
    odometry = [decoded(m) for m in office_messages if m.topic == "/odom"]
    stamps = np.array([o.header.stamp.sec * 10**9 + o.header.stamp.nanosec for o in odometry], dtype=np.float64)
    xy = np.array([(o.pose.pose.position.x, o.pose.pose.position.y) for o in odometry])
    table = everything.table("track.csv")
    at = np.array([float(int(text.replace(".", ""))) for text in table.texts("stamp")])
    moved = np.column_stack([np.interp(at - START_NS, stamps - START_NS, xy[:, axis]) for axis in (0, 1)])
    last = 0
    for row in range(len(table.rows)):
        last = row if table["updated"][row] else last
        driven = math.dist(moved[row], moved[last])
        said = math.hypot(table["x"][row] - table["x"][last], table["y"][row] - table["y"][last])
        assert said == pytest.approx(driven, abs=2e-3)


def test_tum_says_what_the_csv_says(everything: Everything) -> None:
    table = everything.table("track.csv")
    rows = [line.split() for line in everything.files["track.tum"].decode().splitlines()]
    assert [row[0] for row in rows] == table.texts("stamp")
    numbers = np.array(rows, dtype=np.float64)
    np.testing.assert_array_equal(numbers[:, 1], table["x"])
    np.testing.assert_array_equal(numbers[:, 2], table["y"])
    np.testing.assert_allclose(2 * np.arctan2(numbers[:, 6], numbers[:, 7]), table["yaw"], rtol=0, atol=1e-8)
    np.testing.assert_array_equal(numbers[:, 3:6], 0.0)


def test_weights_sum_to_one_and_are_the_softmax(everything: Everything) -> None:
    trace, steps = everything.table("trace.csv"), everything.table("steps.csv")
    assert len(trace.rows) == 300 * len(steps.rows)
    weight, log_weight = (trace[name].reshape(-1, 300) for name in ("weight", "log_weight"))
    np.testing.assert_allclose(weight.sum(axis=1), 1.0, rtol=0, atol=1e-6)
    softmax = np.exp(log_weight - log_weight.max(axis=1, keepdims=True))
    np.testing.assert_allclose(weight, softmax / softmax.sum(axis=1, keepdims=True), rtol=1e-6)
    np.testing.assert_allclose(1 / (weight**2).sum(axis=1), steps["ess"], rtol=1e-6)
    np.testing.assert_array_equal(trace["particle"].reshape(-1, 300), np.tile(np.arange(300.0), (len(steps.rows), 1)))
    mean = (weight * trace["x"].reshape(-1, 300)).sum(axis=1)
    np.testing.assert_allclose(mean, steps["x"], rtol=0, atol=1e-6)


def test_a_log_weight_is_the_carried_weight_plus_the_tempered_likelihood(everything: Everything) -> None:
    trace, steps = everything.table("trace.csv"), everything.table("steps.csv")
    alpha = np.repeat(steps["alpha_lidar"], 300)
    carried = (trace["log_weight"] - alpha * trace["log_lidar"]).reshape(-1, 300)
    weight = trace["weight"].reshape(-1, 300)
    before = np.full(300, 1 / 300)
    for step in range(len(steps.rows)):
        shown = before > 1e-300
        np.testing.assert_allclose(carried[step][shown], np.log(before[shown]), rtol=0, atol=1e-6)
        before = np.full(300, 1 / 300) if steps["resampled"][step] else weight[step]
        evidence = np.log(np.exp(carried[step] + trace["log_lidar"].reshape(-1, 300)[step]).sum())
        assert evidence == pytest.approx(steps["log_evidence"][step], abs=1e-6)


@pytest.mark.parametrize("alpha", ["0.2", "1"])
def test_the_temperature_is_written_down(run_short: Runner, tmp_path: Path, alpha: str) -> None:
    result = run_short("--temperature", alpha, "--steps", tmp_path / "steps.csv")
    assert result.code == 0
    assert set(Table((tmp_path / "steps.csv").read_text())["alpha_lidar"]) == {float(alpha)}


def test_auto_reports_how_many_beams_are_independent(run_short: Runner, tmp_path: Path) -> None:
    result = run_short("--temperature", "auto", "--steps", tmp_path / "steps.csv")
    steps = Table((tmp_path / "steps.csv").read_text())
    k_eff, beams = (steps["alpha_lidar"] * steps["beams_lidar"]).mean(), steps["beams_lidar"].mean()
    assert f"K_eff {k_eff:.1f} of {beams:.1f} an update" in result.err
    np.testing.assert_array_equal(steps["beams_lidar"], steps["beams_used"])


def test_an_ess_below_half_resamples(run_short: Runner) -> None:
    steps = run_short("--steps", "-", "--temperature", 0.05).table
    np.testing.assert_array_equal(steps["resampled"] == 1, steps["ess"] < 150)
    assert 0 < steps["resampled"].sum() < len(steps.rows)
    assert set(steps["beams_used"]) <= set(range(61))
    assert set(steps["n"]) == {300.0}


def test_the_first_scan_is_an_update(everything: Everything) -> None:
    assert everything.table("track.csv").texts("updated")[0] == "1"


def test_the_metadata_repeat_the_run(everything: Everything) -> None:
    first = everything.files["trace.csv"].splitlines()[0].decode()
    metadata = json.loads(first.removeprefix("# "))
    assert metadata["seed"] == 0
    assert metadata["parameters"]["max_particles"] == 300
    assert metadata["topics"] == {"lidar": "/scan"}
    assert metadata["logs"] == ["short.mcap"]
    assert metadata["argv"] == (
        ["run", "short.mcap", "--map", "office.yaml", "--init", "/initialpose", "--particles", "300"]
    )  # fmt: skip
    assert len(metadata["map_sha256"]) == len(metadata["log_sha256"]) == 64


def test_the_compressed_trace_is_the_trace(everything: Everything) -> None:
    assert gzip.decompress(everything.files["trace.csv.gz"]) == everything.files["trace.csv"]


def test_the_mcap_says_what_the_csv_says(everything: Everything, tmp_path: Path) -> None:
    (tmp_path / "trace.mcap").write_bytes(everything.files["trace.mcap"])
    found = messages(tmp_path / "trace.mcap")
    assert found[0].topic == "/map"
    poses = [decoded(m) for m in found if m.topic == "/mcl/pose"]
    clouds = [decoded(m) for m in found if m.topic == "/particlecloud"]
    track, trace = everything.table("track.csv"), everything.table("trace.csv")
    assert [p.pose.position.x for p in poses] == pytest.approx(list(track["x"]), abs=2.0**-20)
    cloud = [particle.position.y for message in clouds for particle in message.poses]
    assert cloud == pytest.approx(list(trace["y"]), abs=2.0**-20)


def test_the_mcap_is_itself_a_log_to_run(everything: Everything, tmp_path: Path) -> None:
    """Its /map, /scan and transforms are those of the log; odometry comes from tf."""
    (tmp_path / "trace.mcap").write_bytes(everything.files["trace.mcap"])
    track = everything.table("track.csv")
    start = ",".join(track.rows[0][1:4])
    result = mcl("run", tmp_path / "trace.mcap", "--init", start, "--particles", 300)
    assert result.code == 0
    assert error_against(result.table, SAMPLES / "office.truth.tum") < 0.15


def test_an_interrupt_as_soon_as_a_file_is_there_leaves_nothing(
    run_short: Runner, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    enter = Output.__enter__

    def interrupted(output: Output) -> Output:
        enter(output)
        raise KeyboardInterrupt

    monkeypatch.setattr(Output, "__enter__", interrupted)
    assert run_short("-o", tmp_path / "t.csv").code == 130
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("output", [("-o", "-"), ("--track", "-"), ("--steps", "-"), ()])
def test_nothing_is_on_stdout_of_a_run_that_is_refused(output: tuple[str, ...]) -> None:
    words = ("--map", OFFICE_MAP, "--init", "/initialpose", "--particles", 50, "--duration", 0.001)
    result = mcl("run", SAMPLES / "office.mcap", *words, *output)
    assert (result.code, result.out) == (1, b"")
    assert "could be used" in result.err
