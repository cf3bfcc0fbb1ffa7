"""Global starts and kidnappings in the filter: ``python -m benchmarks.locate_filter [--data FOLDER] [--seeds N]``.

On Intel: ``--init global`` with many seeds, and the scans until the estimate stays within 0.5 m and 10°;
logs in which the robot is carried from one place to another, and the scans until ``--recovery locate`` has found it.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

import mclcli as mcl
from mclcli.cli.searching import global_search
from mclcli.geometry import se2
from mclcli.io.tables.tum import read_tum
from mclcli.records import LaserScan, Odometry
from mclcli.replay.finder import FoundAgain, FoundOnMap
from mclcli.settings import profiles

if TYPE_CHECKING:
    from collections.abc import Iterator

    from mclcli.io.recording.recording import Recording
    from mclcli.records import TrackPoint
    from mclcli.world.occupancy import OccupancyGrid

Event = tuple[str, object]


def scans_until_right(points: list[TrackPoint], reference: mcl.Trajectory) -> int:
    """Number of the scan, from 1, from which on the estimate is near the reference; one more than all if never."""
    right = [_near(point, reference) for point in points]
    wrong = [i for i, good in enumerate(right) if not good]
    return wrong[-1] + 2 if wrong else 1


def _near(point: TrackPoint, reference: mcl.Trajectory) -> bool:
    true = reference.poses[int(np.argmin(np.abs(reference.stamps_ns - point.stamp_ns)))]
    off = se2.between(true, point.estimate.pose)
    return bool(np.hypot(off[0], off[1]) < 0.5 and abs(off[2]) < np.radians(10.0))


def spliced(events: list[Event], leave_ns: int, arrive_ns: int, length_ns: int) -> Iterator[Event]:
    """A log that breaks off and goes on elsewhere: stamps and odometry continue as if the robot had stood still."""
    gap_ns = arrive_ns - leave_ns
    before = [e for e in events if _stamp(e) <= leave_ns and _stamp(e) > leave_ns - length_ns]
    after = [e for e in events if arrive_ns < _stamp(e) <= arrive_ns + length_ns]
    last = next(record.pose for _, record in reversed(before) if isinstance(record, Odometry))
    first = next(record.pose for _, record in after if isinstance(record, Odometry))
    yield from before
    for topic, record in after:
        yield topic, _moved(record, gap_ns, last, first)


def _stamp(event: Event) -> int:
    record = event[1]
    return record.stamp_ns if isinstance(record, LaserScan | Odometry) else 0


def _moved(record: object, gap_ns: int, last: np.ndarray, first: np.ndarray) -> object:
    import dataclasses

    if isinstance(record, Odometry):
        pose = se2.compose(last, se2.between(first, record.pose))
        return dataclasses.replace(record, stamp_ns=record.stamp_ns - gap_ns, pose=pose)
    assert isinstance(record, LaserScan)  # noqa: S101 - spliced() lets nothing else through
    return dataclasses.replace(record, stamp_ns=record.stamp_ns - gap_ns)


def global_starts(recording: Recording, grid: OccupancyGrid, reference: mcl.Trajectory, seeds: int) -> None:
    """How many scans a global start takes."""
    search = global_search(profiles.build({}), grid, None)
    last_ns = recording.first_ns + 120 * 10**9
    print("| start | seeds | within 1 scan | within 3 scans | never |\n|---|---|---|---|---|")
    for name, start in (("global", FoundOnMap(search, grid)), ("uniform", mcl.Anywhere(grid))):
        took = []
        for seed in range(seeds):
            setup = mcl.prepare(
                recording.survey, recording.roles(), grid=grid, start=start, seed=seed, window_ns=(-(2**63), last_ns)
            )
            points = list(mcl.replay(recording.events(setup.topics), setup))
            took.append((scans_until_right(points, reference), len(points)))
        within = [sum(n <= most for n, _ in took) for most in (1, 3)]
        never = sum(n > count for n, count in took)
        print(f"| {name} | {seeds} | {within[0]} | {within[1]} | {never} |", flush=True)


def kidnappings(recording: Recording, grid: OccupancyGrid, reference: mcl.Trajectory, places: int, seeds: int) -> None:
    """How many scans it takes to find a robot that was carried away."""
    roles = recording.roles()
    events = list(recording.events({roles.scan[0], roles.odometry}))
    events = [event for event in events if isinstance(event[1], LaserScan | Odometry)]
    stamps = np.array([_stamp(event) for event in events if isinstance(event[1], LaserScan)])
    search = global_search(profiles.build({}), grid, None)
    print("| recovery | kidnappings | back within 5 scans | within 20 | median |\n|---|---|---|---|---|")
    for recovery in ("locate", "uniform"):
        proposal = FoundAgain(search, grid) if recovery == "locate" else None
        took = []
        for place in range(places):
            leave = int(stamps[(place + 1) * stamps.size // (places + 2)])
            arrive = int(stamps[((place + 1) * stamps.size // (places + 2) + stamps.size // 2) % (stamps.size - 60)])
            took += [
                _kidnap(events, leave, arrive, recording, grid, reference, recovery, proposal, seed)
                for seed in range(seeds)
            ]
        shares = [sum(n <= most for n in took) / len(took) for most in (5, 20)]
        print(f"| {recovery} | {len(took)} | {shares[0]:.0%} | {shares[1]:.0%} | {np.median(took):g} |", flush=True)


def _kidnap(
    events: list[Event],
    leave_ns: int,
    arrive_ns: int,
    recording: Recording,
    grid: OccupancyGrid,
    reference: mcl.Trajectory,
    recovery: str,
    proposal: FoundAgain | None,
    seed: int,
) -> int:
    """Scans after the kidnapping until the estimate stays right."""
    log = list(spliced(events, leave_ns, arrive_ns, 60 * 10**9))
    start_ns = next(record.stamp_ns for _, record in log if isinstance(record, LaserScan))
    true = reference.poses[int(np.argmin(np.abs(reference.stamps_ns - start_ns)))]
    setup = mcl.prepare(
        recording.survey,
        recording.roles(),
        grid=grid,
        settings=profiles.build({"recovery": recovery}),
        start=mcl.AroundPose.at(float(true[0]), float(true[1]), float(true[2]), 0.1, 0.05),
        seed=seed,
        proposal=proposal,
    )
    points = [point for point in mcl.replay(log, setup) if point.stamp_ns > leave_ns]
    gap_ns = arrive_ns - leave_ns
    moved = mcl.Trajectory(reference.stamps_ns - gap_ns, reference.poses)
    right = [_near(point, moved) for point in points]
    runs = [i for i in range(len(right)) if all(right[i : i + 3])]
    return runs[0] + 1 if runs else len(points) + 1


def main() -> None:
    """Run and print."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--data", type=Path, default=Path("../shared/data"), help="folder of the real logs")
    options.add_argument("--seeds", type=int, default=20, help="seeds of global starts")
    options.add_argument("--places", type=int, default=10, help="places of kidnapping")
    chosen = options.parse_args()
    recording = mcl.open_recording(chosen.data / "intel/intel.mcap")
    grid = mcl.load_map(chosen.data / "intel/intel.yaml")
    track = read_tum(chosen.data / "intel/truth.tum")
    reference = mcl.Trajectory(track.stamps_ns, track.poses)
    global_starts(recording, grid, reference, chosen.seeds)
    kidnappings(recording, grid, reference, chosen.places, 2)


if __name__ == "__main__":
    main()
