"""Errors on real logs over several seeds: ``python -m benchmarks.accuracy [--data FOLDER] [--seeds N] [CASE...]``.

Prints the table of docs/accuracy.md. The logs are not part of this repository; those that are missing are left out.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

import mclcli as mcl
from mclcli.evaluate.metrics import absolute_pose_errors
from mclcli.io.landmarks_file import read_landmarks
from mclcli.io.tum import read_tum
from mclcli.records import LandmarkSightings, Odometry, StampedPose
from mclcli.trajectory import Trajectory

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from mclcli.io.recording import Recording


@dataclass(frozen=True)
class Case:
    """A log, its map or landmarks, and its reference: a TUM file, or a topic of the log.

    ``misread`` is the share of sighted ids to be replaced by those of other landmarks, drawn with the run's seed.
    """

    log: str
    reference: str
    grid: str = ""
    landmarks: str = ""
    model: str = "likelihood_field"
    misread: float = 0.0


def _mrclam(robot: int, misread: float = 0.0) -> Case:
    log = f"mrclam/dataset6_robot{robot}"
    return Case(f"{log}.mcap", f"{log}.truth.tum", landmarks="mrclam/landmarks.yaml", misread=misread)


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
    "intel, beam": Case("intel/intel.mcap", "intel/truth.tum", "intel/intel.yaml", model="beam"),
    "mrclam robot 1": _mrclam(1),
    "mrclam robot 3": _mrclam(3),
    "mrclam robot 1, 20 % of ids misread": _mrclam(1, 0.2),
    "mrclam robot 3, 20 % of ids misread": _mrclam(3, 0.2),
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
    landmarks = read_landmarks(data / case.landmarks) if case.landmarks else None
    setup = mcl.prepare(
        recording.found,
        recording.roles(),
        grid=mcl.load_map(data / case.grid) if case.grid else None,
        landmarks=landmarks,
        settings=mcl.settings({}, model=case.model),
        start=mcl.AlongPoses([StampedPose(int(stamp), "map", pose) for stamp, pose in poses]),
        seed=seed,
    )
    events: Iterable[tuple[str, object]] = recording.events(setup.topics)
    if landmarks is not None and case.misread:
        events = misread(events, case.misread, landmarks.ids, seed)
    points = list(mcl.replay(events, setup))
    track = Trajectory(np.array([p.stamp_ns for p in points]), np.array([p.estimate.pose for p in points]))
    errors = absolute_pose_errors(track, reference)
    return errors.translation_rmse, float(errors.translation[-1])


def misread(
    events: Iterable[tuple[str, object]], share: float, ids: tuple[str, ...], seed: int
) -> Iterator[tuple[str, object]]:
    """The same log where this share of the sightings, drawn at random, bears the id of any landmark."""
    draws = np.random.default_rng(seed)
    for topic, record in events:
        if not isinstance(record, LandmarkSightings):
            yield topic, record
            continue
        wrong = draws.random(len(record.ids)) < share
        others = draws.choice(ids, len(record.ids))
        seen = tuple(str(o) if w else i for i, o, w in zip(record.ids, others, wrong, strict=True))
        yield topic, replace(record, ids=seen)


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
