"""Smoothed tracks against the filter's: ``python -m benchmarks.smoothing right|wrong|logs|lost|long``.

Prints the tables of docs/smooth.md. The logs are not part of this repository; those that are missing are left out.
"""

from __future__ import annotations

import argparse
import dataclasses
import time
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

import mclcli as mcl
from benchmarks import accuracy, simulated
from mclcli.filter.start import AroundPose
from mclcli.geometry import se2
from mclcli.replay.loop import replay
from mclcli.replay.smoothing import Smoothed, Smoothing
from mclcli.sensors.instruments import Lidar
from mclcli.sensors.likelihood_field import LikelihoodField
from mclcli.settings import profiles
from mclcli.smooth import best_track
from mclcli.smooth.scans import Drive, Scans
from mclcli.smooth.surface import Surface
from mclcli.world import distance_field
from mclcli.world.occupancy import OccupancyGrid
from samples.sim import memory
from samples.sim.changes import move_boxes
from samples.sim.layouts import hall
from samples.sim.recording import Recording, simulate
from samples.sim.scenarios import office, warehouse

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from mclcli.replay.intake import Setup

    At = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]

_HEAD = (
    "| drives, MAPS maps | filter, RMSE [m] | smoothed, RMSE [m] (worst) | yaw [°] | ANEES/3 | in the 95 % ellipse | "
    "τ₁ | misfit [mm] | called a reference |\n|---|---|---|---|---|---|---|---|---|"
)
_LOG_HEAD = (
    "| log | scans | filter, RMSE [m], [°] | smoothed, RMSE [m] (worst), [°] | lost | σ [mm] | offset [mm] | "
    "τ₁ | misfit [mm] | late [ms] | ahead [mm] | time [s] |\n|---|---|---|---|---|---|---|---|---|---|---|---|"
)
_INSIDE = 5.991  # 95 % quantile of χ² with two degrees of freedom
_GAP_NS = 400_000_000
_RIGHT = ("office sample", "warehouse sample", "office")
_WRONG = (("office sample", 0.05, 2.0), ("office sample", 0.1, 0.7), ("office sample", 0.1, 4.0),
          ("warehouse sample", 0.05, 2.0), ("warehouse sample", 0.1, 4.0), ("warehouse sample", 0.1, 8.0))  # fmt: skip
_CASES = {
    **accuracy.CASES,
    **{f"wean{n}": accuracy.Case(f"wean/wean{n}.mcap", f"wean/wean{n}.smooth.tum", "wean/wean.yaml") for n in (1, 3)},
}
_LOGS = ("trace0", "trace0, a wing missing", "simpath2", "olin", "intel", "wean1", "wean3",
         "office sample", "warehouse sample")  # fmt: skip


class Drives(NamedTuple):
    """A log in memory, how it is run, its map, and the truth at stamps with which of them it covers."""

    events: Iterable[tuple[str, object]]
    setup: Setup
    grid: OccupancyGrid
    at: At


class Figures(NamedTuple):
    """Errors of a track: RMSE and largest [m], RMSE of yaw [rad], ANEES/3, share within the planar 95 % ellipse."""

    rmse: float
    largest: float
    yaw: float
    anees: float
    inside: float


def smoothed(drives: Drives) -> tuple[Smoothed, np.ndarray, float]:
    """The best track, the filter's covariances (n, 3, 3), and how long smoothing kept a core busy [s]."""
    smoothing, covariances = Smoothing(drives.setup), []
    for point in replay(smoothing.passing(drives.events), drives.setup):
        smoothing.take(point)
        covariances.append(point.estimate.covariance)
    began = time.process_time()
    found = smoothing.finish(drives.grid)
    return found, np.array(covariances), time.process_time() - began


def figures(drives: Drives, found: Smoothed, poses: np.ndarray, covariances: np.ndarray) -> Figures:
    """Errors of poses (n, 3) that are as uncertain as they say."""
    truth, covered = drives.at(np.array(found.stamps_ns))
    wrong, spread = (poses - truth)[covered], covariances[covered]
    wrong[:, 2] = se2.wrap(wrong[:, 2])
    off = np.hypot(wrong[:, 0], wrong[:, 1])
    nees = np.einsum("ni,nij,nj->n", wrong, np.linalg.inv(spread), wrong)
    planar = np.einsum("ni,nij,nj->n", wrong[:, :2], np.linalg.inv(spread[:, :2, :2]), wrong[:, :2])
    yaw = float(np.sqrt(np.mean(wrong[:, 2] ** 2)))
    inside = float(np.mean(planar < _INSIDE))
    return Figures(float(np.sqrt(np.mean(off**2))), float(off.max()), yaw, float(nees.mean()) / 3.0, inside)


def fresh(kind: str, seed: int) -> Recording:
    """A simulated drive that nothing was tuned on: other noise, other moved boxes, another warehouse."""
    if kind == "office":
        return simulated.simulated(seed, (("lobby", "south2", "south3"),))
    if kind == "office sample":
        plain = office()
        moved = move_boxes(plain.mapped, seed=seed, count=2)
        return simulate(dataclasses.replace(plain, seed=seed, today=moved, camera=None, chain=("base_link",)))
    floor = hall(seed=seed, origin=(4.0, -7.5, 0.3))
    return simulate(dataclasses.replace(warehouse(), seed=seed, mapped=floor, camera=None))


def drives_of(recording: Recording, grid: OccupancyGrid, seed: int) -> Drives:
    """A simulated drive over a map, which may be wrong."""
    sweeps = recording.scenario.lidar.sweep > 0.0
    setup = memory.setup(recording, profiles.build({"hypotheses": 0}), seed=seed, alpha="auto", deskew=sweeps)
    (topic, instrument), *_ = setup.instruments.items()
    assert isinstance(instrument, Lidar)  # noqa: S101 - what memory.setup makes
    assert isinstance(instrument.model, LikelihoodField)  # noqa: S101 - likewise
    field = distance_field.compute(grid, "exact", 2.0)
    lidar = dataclasses.replace(instrument, model=dataclasses.replace(instrument.model, field=field))
    setup = dataclasses.replace(setup, instruments={topic: lidar})
    return Drives(
        memory.events(recording), setup, grid, lambda at: (recording.truth.at(at), np.ones(at.size, np.bool_))
    )


def spoiled(grid: OccupancyGrid, deviation: float, tile: float, seed: int) -> OccupancyGrid:
    """The map with what is occupied in each tile [m] shifted its own way, by ``deviation`` [m] per axis."""
    rng, n = np.random.default_rng(1000 + seed), round(tile / grid.resolution)
    occupied, cells = grid.occupied, np.where(grid.unknown, -1, 0).astype(np.int8)
    height, width = cells.shape
    for row in range(0, height, n):
        for column in range(0, width, n):
            down, right = np.rint(rng.normal(0.0, deviation / grid.resolution, 2)).astype(int).tolist()
            rows, columns = np.nonzero(occupied[row : row + n, column : column + n])
            rows, columns = rows + row + down, columns + column + right
            there = (rows >= 0) & (rows < height) & (columns >= 0) & (columns < width)
            cells[rows[there], columns[there]] = 100
    return OccupancyGrid(cells, grid.resolution, grid.origin)


def right(seeds: range) -> None:
    """Drives over right maps."""
    print(_HEAD.replace("MAPS", "right"))
    for kind in _RIGHT:
        _row(kind, [drives_of(r, memory.grid_of(r.scenario.mapped), s) for s in seeds for r in [fresh(kind, s)]])


def wrong(seeds: range) -> None:
    """Drives over maps that are wrong in pieces."""
    print(_HEAD.replace("MAPS", "wrong"))
    for kind, deviation, tile in _WRONG:
        drives = []
        for seed in seeds:
            recording = fresh(kind, seed)
            grid = spoiled(memory.grid_of(recording.scenario.mapped), deviation, tile, seed)
            drives.append(drives_of(recording, grid, seed))
        _row(f"{kind}, {100 * deviation:.0f} cm in pieces of {tile:g} m", drives)


def _row(name: str, several: list[Drives]) -> None:
    before, after, evidence, mountings = [], [], [], []
    for drives in several:
        found, covariances, _ = smoothed(drives)
        before.append(figures(drives, found, found.filtered, covariances))
        after.append(figures(drives, found, found.best.poses, found.best.covariances))
        evidence.append(found.best.learned.evidence)
        mountings.append(found.best.learned.mounting)
    f, s = np.array(before), np.array(after)
    taus, misfits = [e.tau for e in evidence], [1e3 * e.misfit for e in evidence]
    called = sum(
        not (e.doubtful or e.scarce or m.is_late or m.is_moved) for e, m in zip(evidence, mountings, strict=True)
    )
    print(
        f"| {name}: {len(several)} | {np.median(f[:, 0]):.3f} | {np.median(s[:, 0]):.4f} ({s[:, 0].max():.4f}) | "
        f"{np.degrees(np.median(s[:, 2])):.2f} | {s[:, 3].mean():.2f} ({s[:, 3].min():.2f} to {s[:, 3].max():.2f}) | "
        f"{s[:, 4].mean():.3f} ({s[:, 4].min():.3f} to {s[:, 4].max():.3f}) | {min(taus):.0f} to {max(taus):.0f} | "
        f"{min(misfits):.1f} to {max(misfits):.1f} | {called} of {len(several)} |",
        flush=True,
    )


def real(name: str, data: Path, seed: int, start: AroundPose | None = None) -> Drives:
    """A recorded log, deskewed where it tells the beams' times."""
    case, folder = (_CASES[name], data) if name in _CASES else (accuracy.SAMPLES[name], Path())
    loaded = accuracy.Loaded.of(case, folder)
    setup = loaded.setup(mcl.settings({"hypotheses": 0}), seed, start)
    if name == "warehouse sample":
        setup = dataclasses.replace(setup, deskew=True)
    at: At = lambda stamps: loaded.reference.at(stamps, _GAP_NS)  # noqa: E731
    return Drives(loaded.events(frozenset(setup.topics)), setup, mcl.load_map(folder / case.grid), at)


def logs(seeds: range, data: Path) -> None:
    """Recorded logs against their references, most of which are good to 3 cm."""
    print(_LOG_HEAD)
    for name in _LOGS:
        if name in _CASES and not (data / _CASES[name].log).exists():
            continue
        before, after, last = [], [], None
        for seed in seeds:
            drives = real(name, data, seed)
            found, covariances, seconds = smoothed(drives)
            before.append(figures(drives, found, found.filtered, covariances))
            after.append(figures(drives, found, found.best.poses, found.best.covariances))
            last = found, seconds
        assert last is not None  # noqa: S101 - there is a seed
        (found, seconds), f, s = last, np.array(before), np.array(after)
        learned, evidence = found.best.learned, found.best.learned.evidence
        lost = float(np.mean(found.best.reliability[found.best.keys] < 0.8))
        print(
            f"| {name} | {len(found.best.poses)} | {np.median(f[:, 0]):.3f}, {np.degrees(np.median(f[:, 2])):.2f} | "
            f"{np.median(s[:, 0]):.4f} ({s[:, 0].max():.4f}), {np.degrees(np.median(s[:, 2])):.2f} | "
            f"{100 * lost:.0f} % | {1e3 * learned.law.sigma:.0f} | {1e3 * learned.law.offset:+.0f} | "
            f"{evidence.tau:.0f} | {1e3 * evidence.misfit:.1f} | {_milli(learned.mounting.late)} | "
            f"{_milli(learned.mounting.ahead)} | {seconds:.1f} |",
            flush=True,
        )


def _milli(value: tuple[float, float]) -> str:
    return f"{1e3 * value[0]:+.0f} ± {1e3 * value[1]:.0f}"


def lost(seeds: range) -> None:
    """Whether a track that is lost is told, and one that is not is not: starts beside the truth."""
    print("| started off by | drives | filter ends lost | told to be doubtful |\n|---|---|---|---|")
    for off in (0.0, 1.0, 3.0, 6.0):
        went, told = 0, 0
        for seed in seeds:
            recording = fresh("office sample", seed)
            drives = drives_of(recording, memory.grid_of(recording.scenario.mapped), seed)
            turn = 2.4 * seed
            begin = recording.initial + np.array([off * np.cos(turn), off * np.sin(turn), 0.5 * off])
            start = AroundPose(begin, memory.SPREAD)
            drives = drives._replace(setup=dataclasses.replace(drives.setup, start=start))
            found, covariances, _ = smoothed(drives)
            went += figures(drives, found, found.best.poses, found.best.covariances).rmse > 0.5
            told += float(np.mean(found.best.reliability[found.best.keys] < 0.8)) > 0.02
            del covariances
        print(f"| {off:g} m, {np.degrees(0.5 * off):.0f}° | {len(seeds)} | {went} | {told} |", flush=True)


def long(times: int) -> None:
    """Time and memory of a long log: the office sample, so many times over."""
    import resource

    recording = fresh("office sample", 1)
    drives = drives_of(recording, memory.grid_of(recording.scenario.mapped), 1)
    smoothing = Smoothing(drives.setup)
    for point in replay(smoothing.passing(drives.events), drives.setup):
        smoothing.take(point)
    one, start = smoothing.drive(), smoothing.start
    n = len(start)
    ends, directions = (np.tile(a, (times, 1, 1)) for a in (one.scans.ends, one.scans.directions))
    scans = Scans(ends, directions, np.tile(one.scans.counts, times), one.scans.r_max)
    breaks = np.tile(one.breaks, times)
    odometry, twists, sweeps = (np.tile(a, (times, 1)) for a in (one.odometry, one.twists, one.sweeps))
    drive = Drive(scans, odometry, breaks, twists, sweeps)
    surface = Surface.of(distance_field.compute(drives.grid, "exact", 2.0, boundary_only=True))
    shaken = np.tile(start, (times, 1)) + np.random.default_rng(0).normal(0.0, [0.02, 0.02, 0.005], (n * times, 3))
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    began = time.process_time()
    best_track.smooth(drive, shaken, surface)
    seconds, after = time.process_time() - began, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    print(f"{n * times} scans: {seconds:.1f} s of one core, {(after - before) / 1024:.0f} MiB more")


def main() -> None:
    """Run and print."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("table", choices=("right", "wrong", "logs", "lost", "long"))
    options.add_argument("--seeds", type=int, default=8)
    options.add_argument("--first", type=int, default=500, help="first seed of simulated drives")
    options.add_argument("--data", type=Path, default=Path("../shared/data"), help="folder of the real logs")
    options.add_argument("--times", type=int, default=76, help="of the long log")
    chosen = options.parse_args()
    seeds = range(chosen.first, chosen.first + chosen.seeds)
    if chosen.table == "logs":
        logs(range(chosen.seeds), chosen.data)
    elif chosen.table == "long":
        long(chosen.times)
    else:
        {"right": right, "wrong": wrong, "lost": lost}[chosen.table](seeds)


if __name__ == "__main__":
    main()
