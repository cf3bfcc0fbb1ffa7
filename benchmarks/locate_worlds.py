"""Robots looked for in simulated buildings: ``python -m benchmarks.locate_worlds --layouts FIRST:LAST -o FILE.csv``.

A row per building, change since its map, moment and window: where the search put the robot, whether that was right (0.3
m, 5°), and the figures that ``mclcli.search.calibration`` turns into a probability. Layouts with even seeds are for
fitting, odd ones are held out.
"""

from __future__ import annotations

import argparse
import csv
import dataclasses
import math
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from mclcli.geometry import se2, se3
from mclcli.records import LaserScan
from mclcli.replay.finder import GlobalSearch, make_global_search
from mclcli.replay.setup import lidar_model
from mclcli.search.calibration import Figures
from mclcli.sensors.likelihood_field import LikelihoodField
from mclcli.sensors.observation import Observation
from mclcli.settings import profiles
from mclcli.world import distance_field, pyramid
from mclcli.world.occupancy import OccupancyGrid
from samples.sim.changes import close_doors, move_boxes
from samples.sim.layouts import corridors, hall, office_floor
from samples.sim.recording import Recording, Scenario, simulate
from samples.sim.robot import Drive
from samples.sim.sensors import Lidar, Mount

if TYPE_CHECKING:
    from collections.abc import Iterator

    from mclcli.search.locating import Location
    from samples.sim.building import Building

WINDOWS = (0.0, 2.0, 5.0, 10.0, 20.0)
KINDS = ("office", "hall", "corridors")
CHANGES = ("none", "boxes", "doors", "much", "elsewhere", "noise")
OFF_MAP = {"elsewhere", "noise"}
MOMENTS = 4
COLUMNS = (
    "kind", "layout", "change", "moment", "window", "error", "turn", "right", "among", "share", "elsewhere",
    *(field.name for field in dataclasses.fields(Figures)), "modes", "alpha", "leaves",
)  # fmt: skip


def building(kind: str, seed: int) -> Building:
    """A building of a kind."""
    if kind == "office":
        return office_floor(seed, clutter=8)
    return hall(seed) if kind == "hall" else corridors(seed, count=4 + seed % 3)


def changed(mapped: Building, kind: str, change: str, seed: int) -> Building:
    """The building as it is today; ``elsewhere`` is a building of another kind, which the map does not show.

    With ``noise`` the building is as it was, but scans have nothing to do with it.
    """
    if change == "elsewhere":  # floors of a kind have corridors in common: the robot would be right to recognise them
        return building(KINDS[(KINDS.index(kind) + 1) % len(KINDS)], seed + 1000)
    if change == "boxes":
        return move_boxes(mapped, seed, max(1, len(mapped.boxes) // 2))
    doors = tuple(i for i in range(len(mapped.doors)) if i % 3 == seed % 3)
    if change == "doors" and doors:
        return close_doors(mapped, doors[:2])
    if change == "much":
        return move_boxes(building_with_more(kind, seed), seed, 99)
    return mapped


def building_with_more(kind: str, seed: int) -> Building:
    """The same walls, with twice as many things standing about."""
    if kind == "office":
        return office_floor(seed, clutter=16)
    return hall(seed, clutter=20) if kind == "hall" else corridors(seed, count=4 + seed % 3)


def lidar(rng: np.random.Generator) -> Lidar:
    """Some lidar: wide or narrow, far or short, exact or not, mounted anyhow."""
    fov = float(rng.choice([2.0 * math.pi, 1.5 * math.pi, math.pi]))
    beams = int(rng.choice([180, 270, 360]))
    return Lidar(
        Mount(float(rng.uniform(-0.1, 0.25)), float(rng.uniform(-0.1, 0.1)), 0.2, yaw=float(rng.uniform(-0.4, 0.4))),
        beams=beams,
        angle_min=-fov / 2,
        angle_increment=fov / beams,
        range_max=float(rng.choice([5.6, 8.0, 12.0, 20.0])),
        rate=2.0,
        sigma=float(rng.uniform(0.01, 0.03)),
        dropout=float(rng.uniform(0.0, 0.05)),
    )


def record(kind: str, change: str, seed: int) -> tuple[Building, Recording]:
    """The map's building, and a drive of about a minute or more through it as it is today."""
    rng = np.random.default_rng([seed, KINDS.index(kind), CHANGES.index(change)])
    mapped = building(kind, seed)
    today = changed(mapped, kind, change, seed)
    for _ in range(20):
        names = sorted(today.places)
        tour = tuple(names[i] for i in rng.permutation(len(names))[:4])
        pairs = [tuple(names[i] for i in rng.permutation(len(names))[:2]) for _ in range(2)]
        walks = tuple((a, b) for a, b in pairs)
        scenario = Scenario(
            name=kind, mapped=mapped, today=today, tours=(tour,), lidar=lidar(rng), drive=Drive(speed=0.8), walks=walks,
            seed=seed,
        )  # fmt: skip
        try:
            return mapped, simulate(scenario)
        except ValueError:  # a door that was closed is on the way
            continue
    raise RuntimeError(f"no way through {kind} {seed} {change}")


def observations(recording: Recording) -> list[Observation]:
    """Every scan with its place by odometry."""
    device = recording.scenario.lidar
    mount = se3.from_rpy([device.mount.x, device.mount.y, device.mount.z], 0.0, 0.0, device.mount.yaw)
    odometry = recording.odom.at(recording.scan_stamps_ns)
    angles = device.angles
    return [
        Observation(
            "/scan",
            LaserScan(
                int(stamp), "laser", float(angles[0]), float(angles[1] - angles[0]), device.range_min, device.range_max,
                row.astype(np.float64),
            ),
            odom,
            mount,
        )
        for stamp, row, odom in zip(recording.scan_stamps_ns, recording.ranges, odometry, strict=True)
    ]  # fmt: skip


def drowned(seen: list[Observation], rng: np.random.Generator) -> list[Observation]:
    """Scans that say nothing: readings at random, all alike, or all of them too long for the building."""
    kind, drowned_scans = int(rng.integers(3)), []
    for one in seen:
        assert isinstance(one.reading, LaserScan)  # noqa: S101 - observations() made it
        far = one.reading.range_max
        ranges = {
            0: rng.uniform(0.1, far, one.reading.ranges.size),
            1: np.full(one.reading.ranges.size, rng.uniform(0.2, 0.9) * far),
            2: rng.uniform(0.8, 0.99, one.reading.ranges.size) * far,
        }[kind]
        drowned_scans.append(dataclasses.replace(one, reading=dataclasses.replace(one.reading, ranges=ranges)))
    return drowned_scans


def finder_of(mapped: Building) -> GlobalSearch:
    """The search over a building's map, with default settings."""
    grid = OccupancyGrid(mapped.grid, mapped.resolution, np.array(mapped.origin))
    settings = profiles.build({})
    model = lidar_model(grid, settings, distance_field.compute)
    assert isinstance(model, LikelihoodField)  # noqa: S101
    return make_global_search(grid, model, settings, pyramid.build)


def is_right(pose: np.ndarray, true: np.ndarray) -> bool:
    """Whether a pose is within 0.3 m and 5° of the truth."""
    off = se2.between(true, pose)
    return bool(math.hypot(off[0], off[1]) <= 0.3 and abs(off[2]) <= math.radians(5.0))


def rows(kind: str, change: str, seed: int) -> Iterator[list[object]]:
    """Every moment and window of one drive."""
    mapped, recording = record(kind, change, seed)
    search, seen = finder_of(mapped), observations(recording)
    if change == "noise":
        seen = drowned(seen, np.random.default_rng(seed))
    stamps = recording.scan_stamps_ns
    late = np.flatnonzero(stamps >= stamps[0] + round(max(WINDOWS) * 1e9))
    for moment in late[np.linspace(0, late.size - 1, MOMENTS).astype(int)] if late.size else []:
        true = recording.truth.at(stamps[moment : moment + 1])[0]
        for window in WINDOWS:
            first = int(np.searchsorted(stamps, stamps[moment] - round(window * 1e9)))
            location = search.find(seen[first : moment + 1], 5)
            if location is not None:
                yield [
                    kind,
                    seed,
                    change,
                    moment,
                    window,
                    *result(location, true, on_map=change not in OFF_MAP),
                ]


def result(location: Location, true: np.ndarray, *, on_map: bool) -> list[object]:
    """What a row says of one search."""
    best = location.modes[0]
    off = se2.between(true, best.pose)
    right = on_map and is_right(best.pose, true)
    among = on_map and any(is_right(mode.pose, true) for mode in location.modes)
    return [
        math.hypot(off[0], off[1]), abs(off[2]), int(right), int(among), best.share, location.elsewhere,
        *dataclasses.astuple(location.figures), len(location.modes), location.alpha, location.leaves,
    ]  # fmt: skip


def main() -> None:
    """Search and write."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--layouts", default="0:30", help="seeds of layouts, FIRST:LAST, the last not included")
    options.add_argument("-o", "--output", type=Path, help="CSV; else standard output")
    chosen = options.parse_args()
    first, last = map(int, chosen.layouts.split(":"))
    with chosen.output.open("w") if chosen.output else sys.stdout as file:
        writer = csv.writer(file)
        writer.writerow(COLUMNS)
        for seed in range(first, last):
            for kind in KINDS:
                for change in CHANGES:
                    writer.writerows(rows(kind, change, seed))
                    file.flush()


if __name__ == "__main__":
    main()
