"""Errors on real logs over several seeds: ``python -m benchmarks.accuracy [CASE…] [--profiles P…] [--set K=V…]``.

Prints the tables of docs/accuracy.md. The logs are not part of this repository; those that are missing are left out.
"""

from __future__ import annotations

import argparse
import functools
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

import mclcli as mcl
from mclcli.evaluate.metrics import absolute_pose_errors
from mclcli.geometry.trajectory import Trajectory
from mclcli.io.tables.landmarks_file import read_landmarks
from mclcli.io.tables.tum import read_tum
from mclcli.records import LandmarkSightings, Odometry, StampedPose
from mclcli.settings.profiles import PROFILES

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from mclcli.filter.start import Start
    from mclcli.io.recording.recording import Recording
    from mclcli.records import TrackPoint
    from mclcli.replay.intake import Setup
    from mclcli.sensors import Temperature
    from mclcli.settings.profiles import Settings

HEAD = "| log | profile | RMSE, median [m] | worst seed [m] | at the end, worst [m] | lost |"
LOST = 1.0  # [m] a run that errs so much at any scan has lost the robot for a while


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
SAMPLES = {
    "office sample": Case("samples/office.mcap", "samples/office.truth.tum", "maps/office.yaml"),
    "warehouse sample": Case("samples/warehouse.mcap", "samples/warehouse.truth.tum", "maps/warehouse.yaml"),
}


@dataclass(frozen=True, eq=False)
class Loaded:
    """A case read once, for as many runs as are wanted; ``grid`` and ``landmarks`` are None where it has none."""

    case: Case
    data: Path
    recording: Recording
    reference: Trajectory

    @staticmethod
    def of(case: Case, data: Path) -> Loaded:
        """Open the log and read the reference."""
        recording = mcl.open_recording(data / case.log)
        return Loaded(case, data, recording, reference_of(case, data, recording))

    def setup(
        self, settings: Settings, seed: int, start: Start | None = None, temperature: Temperature | None = None
    ) -> Setup:
        """Setup of one run, by default from the first reference pose (0.1 m, 5°)."""
        track = zip(self.reference.stamps_ns, self.reference.poses, strict=True)
        landmarks = self.data / self.case.landmarks if self.case.landmarks else None
        return mcl.prepare(
            self.recording.survey,
            self.recording.roles(),
            grid=mcl.load_map(self.data / self.case.grid) if self.case.grid else None,
            landmarks=None if landmarks is None else read_landmarks(landmarks),
            settings=settings,
            start=start or mcl.AlongPoses([StampedPose(int(stamp), "map", pose) for stamp, pose in track]),
            seed=seed,
            temperature={"": temperature} if temperature is not None else {},
        )

    @functools.lru_cache(maxsize=4)  # noqa: B019 - a benchmark ends
    def events(self, topics: frozenset[str]) -> list[tuple[str, object]]:
        """Decoded messages of some topics."""
        return list(self.recording.events(topics))

    def run(self, setup: Setup) -> list[TrackPoint]:
        """All track points of one run."""
        events: Iterable[tuple[str, object]] = self.events(frozenset(setup.topics))
        if self.case.misread:
            ids = read_landmarks(self.data / self.case.landmarks).ids
            events = misread(events, self.case.misread, ids, setup.localizer.seed)
        return list(mcl.replay(events, setup))

    def errors(self, points: Sequence[TrackPoint]) -> np.ndarray:
        """Translation errors [m] at every scan that the reference covers."""
        track = Trajectory(np.array([p.stamp_ns for p in points]), np.array([p.estimate.pose for p in points]))
        return absolute_pose_errors(track, self.reference).translation


def reference_of(case: Case, data: Path, recording: Recording) -> Trajectory:
    """The case's reference."""
    if case.reference.endswith(".tum"):
        track = read_tum(data / case.reference)
        return Trajectory(track.stamps_ns, track.poses)
    records = [r for r in recording.records(case.reference) if isinstance(r, Odometry | StampedPose)]
    return Trajectory(np.array([r.stamp_ns for r in records]), np.array([r.pose for r in records]))


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


def rmse(errors: np.ndarray) -> float:
    """Root mean square [m]."""
    return float(np.sqrt(np.mean(errors**2)))


def row(name: str, profile: str, errors: list[np.ndarray]) -> str:
    """A line of the table: over the seeds median, worst, worst at the end of the log, how many ever lost the robot."""
    each = np.array([rmse(e) for e in errors])
    end = max(float(e[-1]) for e in errors)
    lost = sum(bool((e > LOST).any()) for e in errors)
    return f"| {name} | {profile} | {np.median(each):.3f} | {each.max():.3f} | {end:.2f} | {lost} of {each.size} |"


def main() -> None:
    """Run and print."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("logs", nargs="*", help="names of cases; all")
    options.add_argument("--data", type=Path, default=Path("../shared/data"), help="folder of the real logs")
    options.add_argument("--seeds", type=int, default=10, help="seeds 0 to N−1")
    options.add_argument("--profiles", nargs="+", default=list(PROFILES), choices=list(PROFILES))
    options.add_argument("--model", default="", help="instead of the case's own")
    options.add_argument("--set", dest="changes", nargs="*", default=[], metavar="KEY=VALUE")
    options.add_argument("--temperature", type=lambda text: text if text in {"auto", "ess"} else float(text))
    chosen = options.parse_args()
    changes = dict(change.split("=", 1) for change in chosen.changes)
    everything = {name: (case, chosen.data) for name, case in CASES.items()}
    everything |= {name: (case, Path()) for name, case in SAMPLES.items()}
    print(f"{HEAD}\n|---|---|---|---|---|---|")
    for name in chosen.logs or everything:
        case, data = everything[name]
        if not (data / case.log).exists():
            continue
        loaded = Loaded.of(case, data)
        for profile in chosen.profiles:
            settings = mcl.settings({"hypotheses": 0, **changes}, profile=profile, model=chosen.model or case.model)
            seeds = range(chosen.seeds)
            temperature = chosen.temperature
            errors = [loaded.errors(loaded.run(loaded.setup(settings, seed, None, temperature))) for seed in seeds]
            print(row(name, profile, errors), flush=True)


if __name__ == "__main__":
    main()
