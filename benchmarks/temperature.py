"""Temperature against error and consistency: ``python -m benchmarks.temperature [--data FOLDER] [--seeds N] [CASE]``.

ANEES/3 is the mean over updates of eᵀ P⁻¹ e / 3 for errors e of (x, y, yaw) and the filter's covariance P: 1 where the
filter is as sure as it should be, more where it is too sure. Updates whose effective sample size is below 10 are left
out and counted: so few particles have no covariance of three dimensions. Source: Bar-Shalom, Li, Kirubarajan 2001,
section 5.4.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

import mclcli as mcl
from benchmarks.accuracy import CASES, reference_of
from mclcli.geometry import se2
from mclcli.io.tables.landmarks_file import read_landmarks
from mclcli.records import StampedPose

if TYPE_CHECKING:
    from benchmarks.accuracy import Case
    from mclcli.sensors import Temperature

_GAP_NS = 15_000_000_000
_ENOUGH = 10.0


def measure(case: Case, data: Path, temperature: Temperature, seed: int) -> tuple[float, float, float, float]:
    """RMSE [m], ANEES/3, mean temperature of the first sensor, and the share of updates left out of ANEES."""
    recording = mcl.open_recording(data / case.log)
    reference = reference_of(case, data, recording)
    poses = [StampedPose(int(t), "map", p) for t, p in zip(reference.stamps_ns, reference.poses, strict=True)]
    setup = mcl.prepare(
        recording.survey,
        recording.roles(),
        grid=mcl.load_map(data / case.grid) if case.grid else None,
        landmarks=read_landmarks(data / case.landmarks) if case.landmarks else None,
        settings=mcl.settings({}, model=case.model),
        start=mcl.AlongPoses(poses),
        seed=seed,
        temperature={"": temperature},
    )
    steps = [point.step for point in mcl.replay(recording.events(setup.topics), setup) if point.step]
    expected, covered = reference.at(np.array([step.stamp_ns for step in steps]), _GAP_NS)
    errors = np.array([step.estimate.pose for step in steps]) - expected
    errors[:, 2] = se2.wrap(errors[:, 2])
    covariances = np.array([step.estimate.covariance for step in steps])
    nees = np.einsum("ni,nij,nj->n", errors, np.linalg.inv(covariances + 1e-12 * np.eye(3)), errors)
    enough = np.array([step.ess >= _ENOUGH for step in steps])
    distances = np.hypot(errors[:, 0], errors[:, 1])[covered]
    alpha = float(np.mean([step.alphas[0] for step in steps]))
    rmse, anees = np.sqrt(np.mean(distances**2)), nees[covered & enough].mean() / 3.0
    return float(rmse), float(anees), alpha, float(1.0 - enough.mean())


def main() -> None:
    """Run and print."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("log", nargs="?", default="intel", choices=list(CASES), help="name of a case")
    options.add_argument("--data", type=Path, default=Path("../shared/data"), help="folder of the real logs")
    options.add_argument("--seeds", type=int, default=3, help="seeds 0 to N−1")
    chosen = options.parse_args()
    print("| temperature | mean α | RMSE, median [m] | ANEES/3, median | ESS below 10 |\n|---|---|---|---|---|")
    for temperature in (0.1, 0.3, 0.5, 1.0, "auto", "ess"):
        runs = [measure(CASES[chosen.log], chosen.data, temperature, seed) for seed in range(chosen.seeds)]
        rmse, anees, alpha, few = np.median(np.array(runs), axis=0)
        print(f"| {temperature} | {alpha:.2f} | {rmse:.3f} | {anees:.2f} | {100 * few:.1f} % |", flush=True)


if __name__ == "__main__":
    main()
