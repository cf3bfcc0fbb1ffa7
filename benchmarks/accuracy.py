"""Errors on real logs over several seeds: ``python -m benchmarks.accuracy [--data FOLDER] [--seeds N] [LOG...]``.

Prints the table of docs/accuracy.md. The logs are not part of this repository; those that are missing are left out.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

import mclcli as mcl
from mclcli.evaluate.metrics import absolute_pose_errors
from mclcli.io.landmarks_file import read_landmarks
from mclcli.io.tum import read_tum
from mclcli.records import Odometry, StampedPose
from mclcli.trajectory import Trajectory

if TYPE_CHECKING:
    from mclcli.io.recording import Recording


@dataclass(frozen=True)
class Case:
    """A log, its map or landmarks, and its reference: a TUM file, or a topic of the log."""

    log: str
    reference: str
    grid: str = ""
    landmarks: str = ""


CASES = {
    "intel": Case("intel/intel.mcap", "intel/truth.tum", "intel/intel.yaml"),
    "olin": Case("olin/macfirst_floor_take_2", "olin/matched.tum", "olin/mac_1st_floor_9_23.yaml"),
    "trace0": Case(
        "birmingham/trace0.bag", "birmingham/trace0.on_map_from_trace0.tum", "birmingham/map_from_trace0.yaml"
    ),
    "trace0, a wing missing": Case(
        "birmingham/trace0.bag", "birmingham/trace0.on_map_from_trace0.tum", "birmingham/map_from_trace1.yaml"
    ),
    "simpath2": Case("birmingham/simpath2.bag", "/base_pose_ground_truth", "birmingham/meeting_world.yaml"),
    "mrclam robot 1": Case(
        "mrclam/dataset6_robot1.mcap", "mrclam/dataset6_robot1.truth.tum", landmarks="mrclam/landmarks.yaml"
    ),
    "mrclam robot 3": Case(
        "mrclam/dataset6_robot3.mcap", "mrclam/dataset6_robot3.truth.tum", landmarks="mrclam/landmarks.yaml"
    ),
}


def reference_of(case: Case, data: Path, recording: Recording) -> Trajectory:
    """The case's reference."""
    if case.reference.endswith(".tum"):
        stated = read_tum(data / case.reference)
        return Trajectory(stated.stamps_ns, stated.poses)
    records = [r for r in recording.records(case.reference) if isinstance(r, Odometry | StampedPose)]
    return Trajectory(np.array([r.stamp_ns for r in records]), np.array([r.pose for r in records]))


def rmse(case: Case, data: Path, seed: int) -> tuple[float, float]:
    """RMSE over the whole log, and the error at its end [m], with default settings from the first reference pose."""
    recording = mcl.open_recording(data / case.log)
    reference = reference_of(case, data, recording)
    poses = zip(reference.stamps_ns, reference.poses, strict=True)
    setup = mcl.prepare(
        recording.found,
        recording.roles(),
        grid=mcl.load_map(data / case.grid) if case.grid else None,
        landmarks=read_landmarks(data / case.landmarks) if case.landmarks else None,
        start=mcl.AlongPoses([StampedPose(int(stamp), "map", pose) for stamp, pose in poses]),
        seed=seed,
    )
    points = list(mcl.replay(recording.events(setup.topics), setup))
    track = Trajectory(np.array([p.stamp_ns for p in points]), np.array([p.estimate.pose for p in points]))
    errors = absolute_pose_errors(track, reference)
    return errors.translation_rmse, float(errors.translation[-1])


def main() -> None:
    """Run and print."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("logs", nargs="*", default=list(CASES), help="names of cases")
    options.add_argument("--data", type=Path, default=Path("../shared/data"), help="folder of the real logs")
    options.add_argument("--seeds", type=int, default=10, help="seeds 0 to N−1")
    chosen = options.parse_args()
    print("| log | RMSE, median [m] | worst seed [m] | at the end of the log, worst [m] |\n|---|---|---|---|")
    for name in chosen.logs:
        if not (chosen.data / CASES[name].log).exists():
            continue
        results = np.array([rmse(CASES[name], chosen.data, seed) for seed in range(chosen.seeds)])
        median, (worst, end) = np.median(results[:, 0]), results.max(axis=0)
        print(f"| {name} | {median:.3f} | {worst:.3f} | {end:.2f} |", flush=True)


if __name__ == "__main__":
    main()
