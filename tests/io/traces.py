"""Made-up track points and step records for the tests of writers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from mclcli.records import Estimate, LaserScan, StepRecord, TrackPoint

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from mclcli.arrays import FloatArray

START_NS = 1_318_384_871_000_000_001
PERIOD_NS = 250_000_000


@dataclass(frozen=True, slots=True, eq=False)
class Grid:
    cells: NDArray[np.int8]
    resolution: float
    origin: FloatArray


def grid() -> Grid:
    cells = np.zeros((3, 4), dtype=np.int8)
    cells[0, 1], cells[2, 3] = 100, -1
    return Grid(cells, 0.05, np.array([-3.0, 2.0, 0.5]))


def record(step: int = 0, n: int = 5, sensors: tuple[str, ...] = ("lidar", "vision"), **changes: Any) -> StepRecord:
    rng = np.random.default_rng([7, step])
    poses = np.array([12.3 + 0.1 * step, -8.1, 3.1]) + rng.normal(size=(n, 3)) * [0.06, 0.06, 0.02]
    logs = rng.normal(-80.0, 4.0, size=(len(sensors), n))
    log_weights = 0.3 * logs.sum(axis=0) - np.log(n)
    weights = np.exp(log_weights - log_weights.max())
    weights /= weights.sum()
    fields: dict[str, Any] = {
        "step": step,
        "stamp_ns": START_NS + step * PERIOD_NS,
        "poses": poses,
        "sensors": sensors,
        "alphas": (0.3,) * len(sensors),
        "log_likelihoods": logs,
        "log_weights": log_weights,
        "weights": weights,
        "ess": 1.0 / float(weights @ weights),
        "log_evidence": -80.125,
        "resampled": step % 2 == 0,
        "degenerate": False,
        "beams_used": 60,
        "estimate": Estimate(weights @ poses, np.cov(poses.T, aweights=weights)),
        "segment": 0,
        "converged": True,
        "reliability": 0.9,
        "counts": (60 // max(len(sensors), 1),) * len(sensors),
    }
    return StepRecord(**(fields | changes))


def scan(stamp_ns: int) -> LaserScan:
    ranges = np.array([1.5, np.inf, np.nan, 0.25])
    return LaserScan(stamp_ns, "laser", -1.5, 0.5, 0.125, 30.0, ranges, angle_max=0.0, scan_time=0.25)


def point(step: int = 0, *, updated: bool = True, scanned: bool = True, n: int = 5) -> TrackPoint:
    made = record(step, n=n)
    return TrackPoint(
        made.stamp_ns,
        made.estimate,
        segment=made.segment,
        odom_from_base=np.array([1.0, 0.1 * step, -0.5]),
        step=made if updated else None,
        scan=scan(made.stamp_ns) if scanned else None,
    )
