"""Robots looked for in real logs: ``python -m benchmarks.locate_logs [--data FOLDER] [-o FILE.csv] [LOG...]``.

Every scan of Intel alone; of the others, 20 moments with windows of 0 and 2 s. Prints how often the best place is right
(0.3 m, 5°) and confident, and processor time of the proof (the greatest log-likelihood) and of all.
"""

from __future__ import annotations

import argparse
import csv
import time
from collections import deque
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

import mclcli as mcl
from benchmarks.locate_worlds import COLUMNS, result
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


CASES = {
    "intel": Case("intel/intel.mcap", "intel/intel.yaml", "intel/truth.tum", 0, (0.0,)),
    "olin": Case("olin/macfirst_floor_take_2", "olin/mac_1st_floor_9_23.yaml", "olin/matched.tum", 20, (0.0, 2.0)),
    "trace0": Case(
        "birmingham/trace0.bag",
        "birmingham/map_from_trace0.yaml",
        "birmingham/trace0.on_map_from_trace0.tum",
        20,
        (0.0, 2.0, 5.0, 10.0),
    ),
    "trace0, a wing missing": Case(
        "birmingham/trace0.bag",
        "birmingham/map_from_trace1.yaml",
        "birmingham/trace0.on_map_from_trace0.tum",
        20,
        (0.0, 2.0, 5.0, 10.0),
    ),
    "simpath2": Case(
        "birmingham/simpath2.bag", "birmingham/meeting_world.yaml", "/base_pose_ground_truth", 20, (0.0, 2.0, 5.0)
    ),
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


def run(name: str, data: Path, writer: csv.Writer | None) -> None:  # type: ignore[name-defined]
    """One case: rows, and a line per window."""
    case = CASES[name]
    search = global_search(profiles.build({}), mcl.load_map(data / case.grid), None)
    reference = reference_of(case, data)
    found: dict[float, list[tuple[float, ...]]] = {}
    for number, (window, seen) in enumerate(moments(case, data)):
        proof = time_of_proof(search, seen)
        began = time.process_time()
        location = search.find(seen, 5)
        spent = time.process_time() - began
        if location is None:
            continue
        row = result(location, truth_at(reference, seen[-1].reading.stamp_ns), on_map=True)
        judged = [float(str(value)) for value in row[2:5]]
        found.setdefault(window, []).append((*judged, proof, spent))
        if writer is not None:
            writer.writerow([name, 0, "real", number, window, *row])
    for window, rows in sorted(found.items()):
        right, among, share, proof_s, all_s = (np.array(column) for column in zip(*rows, strict=True))
        sure = share >= 0.8
        print(
            f"| {name} | {window:g} s | {len(rows)} | {right.mean():.1%} | {(right.astype(bool) & sure).mean():.1%} | "
            f"{among.mean():.1%} | {int((1.0 - right[sure]).sum())} of {sure.sum()} | "
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
    options.add_argument("-o", "--output", type=Path, help="CSV with a row per search")
    chosen = options.parse_args()
    columns = ("log", "window", "moments", "right", "right and confident", "truth among 5", "wrong of confident")
    print(f"| {' | '.join(columns)} | proof [ms] | all [ms] |")
    print("|---|---|---|---|---|---|---|---|---|")
    if chosen.output is None:
        for name in chosen.logs:
            run(name, chosen.data, None)
        return
    with chosen.output.open("w") as file:
        writer = csv.writer(file)
        writer.writerow(COLUMNS)
        for name in chosen.logs:
            run(name, chosen.data, writer)


if __name__ == "__main__":
    main()
