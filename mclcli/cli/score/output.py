"""What ``mcl score`` gives back: CSV, MCAP, a heat map."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, final

import numpy as np

from mclcli.cli import console, pictures
from mclcli.cli.results import seconds
from mclcli.errors import InputError
from mclcli.filter import estimate, weights
from mclcli.io.traces.output import open_output
from mclcli.io.traces.sinks import csv_text
from mclcli.records import StepRecord, TrackPoint

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from pathlib import Path

    from mclcli.arrays import FloatArray
    from mclcli.cli.one_scan import MountedScan
    from mclcli.cli.score.poses import Candidates
    from mclcli.sensors import Measurement
    from mclcli.world.occupancy import OccupancyGrid

_BLOCK = 8192


@final
@dataclass(frozen=True, slots=True, eq=False)
class Scores:
    """Scored poses: untempered ``log_likelihoods`` (S, N), ``log_weights`` (N,) and ``weights`` (N,)."""

    candidates: Candidates
    measurements: Sequence[Measurement]
    alphas: tuple[float, ...]
    log_likelihoods: FloatArray
    log_weights: FloatArray
    weights: FloatArray


def write(scores: Scores, target: str, inputs: Sequence[Path], scan: MountedScan, grid: OccupancyGrid) -> None:
    """Write to a name ending in .mcap as MCAP, else as CSV."""
    if target.endswith(".mcap"):
        _write_mcap(scores, target, inputs, scan, grid)
        return
    with open_output(target, binary=False, inputs=inputs) as output:
        for rows in _rows(scores):
            output.write(rows)


def facts(scores: Scores, scan: MountedScan, map_name: str) -> dict[str, Any]:
    """The result for --json: every pose in input order, the best one, and how they were scored."""
    sensors = [m.sensor for m in scores.measurements]
    columns = {
        **{name: scores.candidates.poses[:, i] for i, name in enumerate(("x", "y", "yaw"))},
        **{f"log_{name}": row for name, row in zip(sensors, scores.log_likelihoods, strict=True)},
        "log_weight": scores.log_weights,
        "weight": scores.weights,
    }
    rows = zip(*(values.tolist() for values in columns.values()), strict=True)
    poses = [dict(zip(columns, row, strict=True)) for row in rows]
    used = zip(scores.measurements, scores.alphas, strict=True)
    return {
        "map": map_name,
        "stamp": seconds(scan.scan.stamp_ns),
        "sensors": {m.sensor: {"scored": m.count, "alpha": alpha} for m, alpha in used},
        "best": {"index": int(np.argmax(scores.log_weights)), **poses[int(np.argmax(scores.log_weights))]},
        "poses": poses,
    }


def _rows(scores: Scores) -> Iterator[str]:
    """The CSV in blocks of whole rows; numbers in their shortest form that reads back the same."""
    names = [f"log_{m.sensor}" for m in scores.measurements]
    header = [*map(csv_text, scores.candidates.columns), "x", "y", "yaw", *names, "log_weight", "weight"]
    yield ",".join(header) + "\n"
    values = (*scores.candidates.poses.T, *scores.log_likelihoods, scores.log_weights, scores.weights)
    texts = scores.candidates.texts if scores.candidates.columns else []
    for start in range(0, scores.weights.size, _BLOCK):
        columns = [map(repr, (column[start : start + _BLOCK] + 0.0).tolist()) for column in values]  # no -0.0
        numbers = map(",".join, zip(*columns, strict=True))
        if texts:
            others = (",".join(map(csv_text, row)) for row in texts[start : start + _BLOCK])
            numbers = map(",".join, zip(others, numbers, strict=True))
        yield "\n".join(numbers) + "\n"


def _write_mcap(scores: Scores, target: str, inputs: Sequence[Path], scan: MountedScan, grid: OccupancyGrid) -> None:
    """The poses as the particle cloud of a single step, at the scan's stamp."""
    from mclcli.io.traces.trace_mcap import TraceMcap
    from mclcli.version import __version__

    poses = scores.candidates.poses
    belief = estimate.weighted_mean(poses, scores.weights)
    record = StepRecord(
        step=0,
        stamp_ns=scan.scan.stamp_ns,
        poses=poses,
        sensors=tuple(m.sensor for m in scores.measurements),
        alphas=scores.alphas,
        log_likelihoods=scores.log_likelihoods,
        log_weights=scores.log_weights,
        weights=scores.weights,
        ess=weights.effective_sample_size(scores.weights),
        log_evidence=weights.log_sum_exp(scores.log_likelihoods.sum(axis=0)),
        resampled=False,
        degenerate=False,
        beams_used=sum(m.count for m in scores.measurements),
        estimate=belief,
        segment=0,
        converged=estimate.has_converged(poses, belief),
        reliability=0.0,
    )
    point = TrackPoint(record.stamp_ns, belief, 0, np.zeros(3), record, scan.scan)
    with open_output(target, binary=True, inputs=inputs) as output:
        trace = TraceMcap(
            output,
            grid=grid,
            metadata={"version": __version__, "command": "score"},
            parameters_yaml="",
            odom_frame="odom",
            base_frame=scan.base_frame or "base_link",
        )
        trace.write(point)
        trace.close()


def draw(scores: Scores, target: str, inputs: Sequence[Path], grid: OccupancyGrid, map_name: str) -> None:
    """Heat map of the best log-weight over yaw at every x, y.

    Raises
    ------
    InputError
        If the poses are too few to make a picture.

    """
    from mclcli.render.heatmap import draw_heatmap

    xy, inverse = np.unique(scores.candidates.poses[:, :2], axis=0, return_inverse=True)
    if len(xy) < 2:
        raise InputError("--heatmap: one position makes no picture; give --grid, or leave the poses out")
    best = np.full(len(xy), -np.inf)
    np.maximum.at(best, inverse.ravel(), scores.log_weights)
    winner = scores.candidates.poses[[int(np.argmax(scores.log_weights))]]
    x, y, yaw = winner[0]
    picture = draw_heatmap(
        grid,
        xy,
        best,
        step=scores.candidates.step or grid.resolution,
        best_poses=winner,
        title=f"Likelihood of one scan over {map_name}",
        subtitle=f"{len(scores.weights)} poses; best at x {x:.2f} m, y {y:.2f} m, yaw {np.degrees(yaw):.1f}°",
    )
    pictures.save(picture, target, inputs)
    console.remark(f"{target}: best pose {x:.3f},{y:.3f},{np.degrees(yaw):.2f}deg")
