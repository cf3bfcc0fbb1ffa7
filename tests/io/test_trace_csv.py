from __future__ import annotations

import csv
import io
import json
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from mclcli.io.traces.trace_csv import StepsCsv, TraceCsv
from mclcli.io.traces.track_csv import TrackCsv
from mclcli.records import Estimate, Hypothesis
from tests.io.traces import point, record

if TYPE_CHECKING:
    from mclcli.records import StepRecord


def _naive_rows(made: StepRecord) -> list[str]:
    seconds = f"{made.stamp_ns // 10**9}.{made.stamp_ns % 10**9:09d}"
    rows = []
    for i, ((x, y, yaw), log_weight, weight) in enumerate(zip(made.poses, made.log_weights, made.weights, strict=True)):
        logs = ",".join(f"{float(row[i]):.9f}" for row in made.log_likelihoods)
        rows.append(f"{made.step},{seconds},{i},{x:.9f},{y:.9f},{yaw:.9f},{logs},{log_weight:.9f},{weight:.9g}")
    return rows


def _trace(*records: StepRecord, sensors: tuple[str, ...] | None = None) -> list[str]:
    stream = io.StringIO()
    writer = TraceCsv(stream, {"version": "1"}, sensors=sensors)
    for made in records:
        writer.write(made)
    writer.close()
    return stream.getvalue().splitlines()


def test_every_row_is_what_plain_formatting_gives() -> None:
    many = record(1, n=9000)  # more than are formatted at once
    lines = _trace(record(0), many)
    assert lines[0] == '# {"version":"1"}'
    assert lines[1] == "step,stamp,particle,x,y,yaw,log_lidar,log_vision,log_weight,weight"
    assert lines[2:] == _naive_rows(record(0)) + _naive_rows(many)


def test_weights_come_back_with_nine_digits() -> None:
    made = record(n=50)
    rows = list(csv.DictReader(_trace(made)[1:]))
    weights = np.array([float(row["weight"]) for row in rows])
    np.testing.assert_allclose(weights, made.weights, rtol=5e-9, atol=0)
    assert [int(row["particle"]) for row in rows] == list(range(50))


def test_a_log_of_minus_infinity_stays_and_unusable_ones_are_empty() -> None:
    made = record(n=3)
    logs = np.array([[-1.0, -np.inf, np.nan], [np.inf, -2.0, -3.0]])
    rows = list(csv.DictReader(_trace(replace(made, log_likelihoods=logs))[1:]))
    assert [row["log_lidar"] for row in rows] == ["-1.000000000", "-inf", ""]
    assert [row["log_vision"] for row in rows] == ["", "-2.000000000", "-3.000000000"]


def test_a_sensor_without_measurements_has_empty_fields() -> None:
    rows = list(csv.DictReader(_trace(record(0), record(1, sensors=("vision",)))[1:]))
    assert {row["log_lidar"] for row in rows if row["step"] == "1"} == {""}
    assert float(rows[-1]["log_vision"]) == pytest.approx(record(1, sensors=("vision",)).log_likelihoods[0, -1])
    with pytest.raises(ValueError, match="no column for sensor 'lidar'"):
        _trace(record(), sensors=("vision",))


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_no_pose_or_weight_is_ever_not_a_number(bad: float) -> None:
    poses, weights = np.array(record().poses), np.array(record().weights)
    poses[1, 2] = weights[1] = bad
    with pytest.raises(ValueError, match="pose to be written is not finite"):
        _trace(replace(record(), poses=poses))
    with pytest.raises(ValueError, match="weight to be written is not finite"):
        _trace(replace(record(), weights=weights))


def test_metadata_is_one_line_of_json_whatever_it_holds() -> None:
    stream = io.StringIO()
    hostile = {"z": "a\nb\r\u2028\x1b[31m\x7f\udcff", "a": [1, {"inf": float("inf")}], "None": None}
    TraceCsv(stream, hostile).close()
    first, header = stream.getvalue().splitlines()
    assert first.isascii()
    assert first.isprintable()
    loaded = json.loads(first.removeprefix("# "))
    assert list(loaded) == ["z", "a", "None"]
    assert loaded == {**hostile, "a": [1, {"inf": "inf"}]}
    assert header == "step,stamp,particle,x,y,yaw,log_weight,weight"


def test_steps_have_every_column() -> None:
    stream = io.StringIO()
    writer = StepsCsv(stream)
    made = record(3, log_evidence=-np.inf, degenerate=True, lost=True)
    writer.write(made)
    writer.write(record(4, sensors=("lidar",)))
    writer.close()
    assert stream.getvalue().startswith(
        "step,stamp,n,ess,log_evidence,alpha_lidar,alpha_vision,resampled,degenerate,beams_used,x,y,yaw,"
        "cov_xx,cov_xy,cov_xyaw,cov_yy,cov_yyaw,cov_yawyaw,segment,converged,reliability,injected,lost,modes,"
        "weight_1,x_1,y_1,yaw_1,weight_2,x_2,y_2,yaw_2,beams_lidar,beams_vision\n"
    )
    first, second = csv.DictReader(stream.getvalue().splitlines())
    assert first["stamp"] == "1318384871.750000001"
    assert (first["n"], first["log_evidence"], first["alpha_vision"]) == ("5", "-inf", "0.3")
    assert (first["resampled"], first["degenerate"], first["converged"]) == ("0", "1", "1")
    assert float(first["cov_xyaw"]) == pytest.approx(made.estimate.covariance[0, 2], rel=1e-8)
    assert float(first["cov_yyaw"]) == pytest.approx(made.estimate.covariance[1, 2], rel=1e-8)
    assert (first["lost"], second["lost"]) == ("1", "0")
    assert (first["injected"], first["weight_1"], first["yaw_2"]) == ("0", "", "")
    assert (first["beams_lidar"], first["beams_vision"]) == ("30", "30")
    assert (second["alpha_lidar"], second["alpha_vision"]) == ("0.3", "")
    assert (second["beams_lidar"], second["beams_vision"]) == ("60", "")


def test_steps_state_the_two_heaviest_clusters() -> None:
    stream = io.StringIO()
    places = [Hypothesis(w, Estimate(np.array([w, -w, 2 * w]), np.eye(3))) for w in (0.5, 0.375, 0.125)]
    writer = StepsCsv(stream)
    writer.write(record(hypotheses=lambda: tuple(places), injected=7))
    writer.write(record(hypotheses=lambda: tuple(places[:1])))
    first, second = csv.DictReader(stream.getvalue().splitlines())
    assert first["injected"] == "7"
    assert [first[f"{name}_2"] for name in ("weight", "x", "y", "yaw")] == [
        "0.375",
        "0.375000000",
        "-0.375000000",
        "0.750000000",
    ]
    assert (second["weight_1"], second["weight_2"], second["yaw_2"]) == ("0.5", "", "")


def test_tracks_say_what_was_updated() -> None:
    stream = io.StringIO()
    writer = TrackCsv(stream)
    writer.write(point(0))
    writer.write(point(1, updated=False))
    writer.close()
    assert stream.getvalue().startswith(
        "stamp,x,y,yaw,cov_xx,cov_xy,cov_xyaw,cov_yy,cov_yyaw,cov_yawyaw,updated,segment\n"
    )
    first, second = csv.DictReader(stream.getvalue().splitlines())
    assert (first["updated"], second["updated"]) == ("1", "0")
    assert first["yaw"] == f"{point(0).estimate.pose[2]:.9f}"
    with pytest.raises(ValueError, match="covariance to be written is not finite"):
        writer.write(replace(point(2), estimate=Estimate(np.zeros(3), np.full((3, 3), np.nan))))


def test_a_run_without_updates_still_has_a_header() -> None:
    assert _trace(sensors=("lidar",))[1] == "step,stamp,particle,x,y,yaw,log_lidar,log_weight,weight"
    stream = io.StringIO()
    StepsCsv(stream, sensors=("lidar",)).close()
    assert stream.getvalue().startswith("step,stamp,n,ess,log_evidence,alpha_lidar,resampled,")
