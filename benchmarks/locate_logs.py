"""Robots looked for in real logs: ``python -m benchmarks.locate_logs [--data FOLDER] [-o FILE.jsonl] [LOG...]``.

Every scan of Intel alone; of the others, some moments with windows of 0 to 20 s. Prints how often the best place is
right (0.5 m, 10°) and confident, and processor time of the proof (the greatest log-likelihood) and of all.
"""

from __future__ import annotations

import argparse
import json
import time
from collections import deque
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, TextIO

import numpy as np

import mclcli as mcl
from benchmarks.locate_worlds import is_right, result
from mclcli.cli.searching import global_search
from mclcli.geometry import se2
from mclcli.io.tables.tum import read_tum
from mclcli.records import LaserScan, Odometry
from mclcli.replay.intake import Intake
from mclcli.replay.loop import ReplayTally
from mclcli.search import branching, lattice
from mclcli.sensors.observation import Observation
from mclcli.settings import profiles

if TYPE_CHECKING:
    from collections.abc import Iterator

    from mclcli.replay.finder import GlobalSearch


@dataclass(frozen=True)
class Case:
    """A log, its map, its reference, and how many moments to look at (0: all)."""

    log: str
    grid: str
    reference: str
    moments: int
    windows: tuple[float, ...]


_WINDOWS = (0.0, 5.0, 10.0, 20.0)
CASES = {
    "intel": Case("intel/intel.mcap", "intel/intel.yaml", "intel/truth.tum", 0, (0.0,)),
    "olin": Case("olin/macfirst_floor_take_2", "olin/mac_1st_floor_9_23.yaml", "olin/matched.tum", 20, (0.0, 2.0)),
    "trace0": Case(
        "birmingham/trace0.bag",
        "birmingham/map_from_trace0.yaml",
        "birmingham/trace0.on_map_from_trace0.tum",
        20,
        _WINDOWS,
    ),
    "trace0, a wing missing": Case(
        "birmingham/trace0.bag",
        "birmingham/map_from_trace1.yaml",
        "birmingham/trace0.on_map_from_trace0.tum",
        20,
        _WINDOWS,
    ),
    "trace1, a map with ghosts": Case(
        "birmingham/trace1.bag", "birmingham/map_from_trace1.yaml", "birmingham/trace1.from3.4s.tum", 20, _WINDOWS
    ),
    "simpath2": Case(
        "birmingham/simpath2.bag", "birmingham/meeting_world.yaml", "/base_pose_ground_truth", 20, _WINDOWS
    ),
    "wean1": Case("wean/wean1.mcap", "wean/wean.yaml", "wean/wean1.smooth.tum", 44, _WINDOWS),
    "wean3": Case("wean/wean3.mcap", "wean/wean.yaml", "wean/wean3.smooth.tum", 44, _WINDOWS),
}


def moments(case: Case, data: Path) -> Iterator[tuple[float, list[Observation]]]:
    """Window and what was seen in it, moment by moment."""
    recording = mcl.open_recording(data / case.log)
    setup = mcl.prepare(recording.survey, recording.roles(), grid=mcl.load_map(data / case.grid))
    intake, seen = Intake(setup, ReplayTally()), deque[Observation]()
    total = sum(1 for _ in recording.records(recording.roles().scan[0]))
    wanted = set(np.linspace(0, total - 2, case.moments or total).astype(int).tolist())
    number = -1
    for topic, record in recording.events(setup.topics):
        intake.take(topic, record)
        for usable in intake.ready():
            if not isinstance(usable, Observation) or not isinstance(usable.reading, LaserScan):
                continue
            number += 1
            seen.append(usable)
            stamp_ns = usable.reading.stamp_ns
            for window in case.windows if number in wanted else ():
                first_ns = stamp_ns - round(window * 1e9)
                yield window, [o for o in seen if o.reading.stamp_ns >= first_ns]
            while seen[0].reading.stamp_ns < stamp_ns - 21 * 10**9:
                seen.popleft()


def reference_of(case: Case, data: Path) -> mcl.Trajectory:
    """The case's reference."""
    if case.reference.endswith(".tum"):
        track = read_tum(data / case.reference)
        return mcl.Trajectory(track.stamps_ns, track.poses)
    records = mcl.open_recording(data / case.log).records(case.reference)
    stated_poses = [record for record in records if isinstance(record, Odometry)]
    return mcl.Trajectory(np.array([r.stamp_ns for r in stated_poses]), np.array([r.pose for r in stated_poses]))


def truth_at(reference: mcl.Trajectory, stamp_ns: int) -> np.ndarray:
    """The reference, interpolated."""
    after = int(np.clip(np.searchsorted(reference.stamps_ns, stamp_ns), 1, len(reference.stamps_ns) - 1))
    before_ns, after_ns = reference.stamps_ns[after - 1], reference.stamps_ns[after]
    fraction = float(np.clip((stamp_ns - before_ns) / (after_ns - before_ns), 0.0, 1.0))
    return se2.interpolate(reference.poses[after - 1], reference.poses[after], fraction)


def time_of_proof(search: GlobalSearch, seen: list[Observation]) -> float:
    """Processor time [s] of the global maximum alone."""
    view = search.view(seen)
    assert view is not None  # noqa: S101 - there is a scan
    scene, field = search.scene, search.scene.model.field
    began = time.process_time()
    grid = lattice.build(view.beams.endpoints / field.resolution, scene.places)
    branching.prepare(field, scene.pyramid, grid, scene.model.table(view.beams.r_max)).maximum()
    return time.process_time() - began


def run(name: str, data: Path, file: TextIO | None) -> None:
    """One case: lines, and a row per window."""
    case = CASES[name]
    search = global_search(profiles.build({}), mcl.load_map(data / case.grid), None)
    reference = reference_of(case, data)
    found: dict[float, list[tuple[float, ...]]] = {}
    for number, (window, seen) in enumerate(moments(case, data)):
        true_ns = seen[-1].reading.stamp_ns
        if not reference.stamps_ns[0] <= true_ns <= reference.stamps_ns[-1]:
            continue
        proof = time_of_proof(search, seen)
        began = time.process_time()
        location = search.find(seen, 32)
        spent = time.process_time() - began
        if location is None:
            continue
        true = truth_at(reference, true_ns)
        row = result(location, true, on_map=True)
        right = [is_right(mode.pose, true) for mode in location.modes]
        judged = (float(right[0]), float(any(right[:5])), float(any(right)), location.modes[0].share)
        found.setdefault(window, []).append((*judged, proof, spent))
        if file is not None:
            about = {"family": name, "kind": "real", "layout": 1, "moment": number, "window": window}
            file.write(json.dumps({**about, **row}) + "\n")
    for window, rows in sorted(found.items()):
        right_, among, listed, share, proof_s, all_s = (np.array(column) for column in zip(*rows, strict=True))
        sure = share >= 0.8
        print(
            f"| {name} | {window:g} s | {len(rows)} | {right_.mean():.0%} | {among.mean():.0%} | {listed.mean():.0%} | "
            f"{sure.mean():.0%} | {int((1.0 - right_[sure]).sum())} of {sure.sum()} | "
            f"{_milliseconds(proof_s)} | {_milliseconds(all_s)} |",
            flush=True,
        )


def _milliseconds(seconds: np.ndarray) -> str:
    """Median and maximum."""
    return f"{1e3 * np.median(seconds):.0f}, {1e3 * seconds.max():.0f}"


def main() -> None:
    """Search and print."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("logs", nargs="*", default=list(CASES), help="names of cases")
    options.add_argument("--data", type=Path, default=Path("../shared/data"), help="folder of the real logs")
    options.add_argument("-o", "--output", type=Path, help="lines of JSON for benchmarks.locate_calibration")
    chosen = options.parse_args()
    columns = ("log", "window", "moments", "right", "among 5", "listed", "confident", "wrong of those")
    print(f"| {' | '.join(columns)} | proof [ms] | all [ms] |")
    print("|---|---|---|---|---|---|---|---|---|---|")
    if chosen.output is None:
        for name in chosen.logs:
            run(name, chosen.data, None)
        return
    with chosen.output.open("w") as file:
        for name in chosen.logs:
            run(name, chosen.data, file)


if __name__ == "__main__":
    main()
