"""Robots looked for in simulated buildings: ``python -m benchmarks.locate_worlds --layouts FIRST:LAST -o FILE.jsonl``.

Families of what may be wrong: furniture moved, doors shut, twice the clutter and all of it moved; walls on the map that
are not there; a map 1 to 3 % too large or small; a mirrored map, another building, scans of noise. Within each, lidars
of all kinds, odometry from very good to useless, with jumps, and maps of 5 and 10 cm. Layouts with even seeds are for
fitting, odd ones are held out (``benchmarks.locate_calibration``).
"""

from __future__ import annotations

import argparse
import dataclasses
import itertools
import json
import math
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from mclcli.geometry import se2, se3
from mclcli.records import LaserScan
from mclcli.replay.finder import GlobalSearch, make_global_search
from mclcli.replay.setup import lidar_model
from mclcli.sensors.likelihood_field import LikelihoodField
from mclcli.sensors.observation import Observation
from mclcli.settings import profiles
from mclcli.world import distance_field, pyramid
from mclcli.world.occupancy import OccupancyGrid
from samples.sim.changes import close_doors, move_boxes
from samples.sim.layouts import corridors, hall, office_floor
from samples.sim.recording import Recording, Scenario, simulate
from samples.sim.robot import Drive, OdometryNoise
from samples.sim.sensors import Lidar, Mount

if TYPE_CHECKING:
    from collections.abc import Iterator

    from mclcli.search.locating import Location
    from samples.sim.building import Building

WINDOWS = (0.0, 5.0, 10.0, 20.0)
KINDS = ("office", "hall", "corridors")
CHANGES = ("none", "boxes", "doors", "much", "ghosts", "scaled", "mirrored", "elsewhere", "noise")
OFF_MAP = {"mirrored", "elsewhere", "noise"}
MOMENTS = 3


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
        share = np.random.default_rng(seed).uniform(0.1, 0.6)
        return move_boxes(mapped, seed, max(1, round(share * len(mapped.boxes))))
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


def odometry_noise(rng: np.random.Generator, seconds: float = 300.0) -> OdometryNoise:
    """Some odometry: errors of about 0.5 to 12 % of the way, and in every third drive a jump a minute."""
    worse = float(np.exp(rng.uniform(np.log(0.25), np.log(6.0))))
    usual = OdometryNoise()
    sign = rng.choice([-1.0, 1.0], 3) * worse
    jumps = np.arange(20.0, seconds, 60.0) + rng.uniform(0.0, 30.0)
    slips = tuple(
        (float(at), (float(rng.uniform(-0.6, 0.6)), float(rng.uniform(-0.2, 0.2)), float(rng.uniform(-0.4, 0.4))))
        for at in jumps
    )
    return OdometryNoise(
        worse * usual.trans_per_trans, worse * usual.yaw_per_trans, worse * usual.yaw_per_yaw,
        worse * usual.trans_per_yaw, sign[0] * usual.scale, sign[1] * usual.yaw_scale, sign[2] * usual.pull,
        slips if rng.random() < 1.0 / 3.0 else (),
    )  # fmt: skip


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
            noise=odometry_noise(rng), seed=seed,
        )  # fmt: skip
        try:
            return mapped, simulate(scenario)
        except ValueError:  # a door that was closed is on the way
            continue
    raise RuntimeError(f"no way through {kind} {seed} {change}")


def map_of(mapped: Building, change: str, seed: int) -> tuple[OccupancyGrid, float]:
    """The map that the robot has, and how many times too large it is."""
    rng = np.random.default_rng([seed, CHANGES.index(change), 7])
    cells, resolution, scale = np.array(mapped.grid), mapped.resolution, 1.0
    if change == "mirrored":
        cells = np.ascontiguousarray(cells[:, ::-1])
    if change == "ghosts":
        _draw_ghosts(cells, rng)
    if change == "scaled":
        scale = 1.0 + float(rng.choice([-1.0, 1.0]) * rng.uniform(0.01, 0.03))
    if rng.random() < 1.0 / 3.0:  # a map of coarser cells: a wall in any part of a cell fills it
        cells, resolution = _coarsened(cells), 2.0 * resolution
    origin = np.array(mapped.origin) * np.array([scale, scale, 1.0])
    return OccupancyGrid(cells, scale * resolution, origin), scale


def _draw_ghosts(cells: np.ndarray, rng: np.random.Generator) -> None:
    """Walls of 1 to 4 m where there are none, four on 100 m² of floor."""
    free = np.argwhere(cells == 0)
    for row, column in free[rng.integers(len(free), size=max(2, len(free) // 10_000))]:
        length = int(rng.integers(20, 80))
        wall = (
            cells[row : row + 2, column : column + length]
            if rng.random() < 0.5
            else cells[row : row + length, column : column + 2]
        )
        wall[wall == 0] = 100


def _coarsened(cells: np.ndarray) -> np.ndarray:
    height, width = (side // 2 * 2 for side in cells.shape)
    blocks = cells[:height, :width].reshape(height // 2, 2, width // 2, 2)
    return np.ascontiguousarray(
        np.where((blocks == 100).any(axis=(1, 3)), 100, blocks.min(axis=(1, 3))).astype(np.int8)
    )


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


def finder_of(grid: OccupancyGrid) -> GlobalSearch:
    """The search over a map, with default settings."""
    settings = profiles.build({})
    model = lidar_model(grid, settings, distance_field.compute)
    assert isinstance(model, LikelihoodField)  # noqa: S101
    return make_global_search(grid, model, settings, pyramid.build)


def is_right(pose: np.ndarray, true: np.ndarray) -> bool:
    """Whether a pose is within 0.5 m and 10° of the truth."""
    off = se2.between(true, pose)
    return bool(math.hypot(off[0], off[1]) <= 0.5 and abs(off[2]) <= math.radians(10.0))


def rows(kind: str, change: str, seed: int) -> Iterator[dict[str, object]]:
    """Every moment and window of one drive."""
    mapped, recording = record(kind, change, seed)
    grid, scale = map_of(mapped, change, seed)
    search, seen = finder_of(grid), observations(recording)
    if change == "noise":
        seen = drowned(seen, np.random.default_rng(seed))
    stamps = recording.scan_stamps_ns
    late = np.flatnonzero(stamps >= stamps[0] + round(max(WINDOWS) * 1e9))
    count = 1 if change == "noise" else MOMENTS  # searches for nothing take seconds each
    for moment in late[np.linspace(0, late.size - 1, count).astype(int)] if late.size else []:
        true = recording.truth.at(stamps[moment : moment + 1])[0] * np.array([scale, scale, 1.0])
        for window in WINDOWS[::2] if change == "noise" else WINDOWS:
            first = int(np.searchsorted(stamps, stamps[moment] - round(window * 1e9)))
            location = search.find(seen[first : moment + 1], 32)
            if location is not None:
                yield {
                    "family": change, "kind": kind, "layout": seed, "moment": int(moment), "window": window,
                    **result(location, true, on_map=change not in OFF_MAP),
                }  # fmt: skip


def result(location: Location, true: np.ndarray, *, on_map: bool) -> dict[str, object]:
    """What a line says of one search: which places are right, in the order of what was measured at them."""
    right = np.zeros(len(location.looked.volume), bool)
    for mode in location.modes:
        right[mode.number] = on_map and is_right(mode.pose, true)
    looked = {
        name: np.round(value, 4).tolist() if isinstance(value, np.ndarray) else value
        for name, value in ((name, getattr(location.looked, name)) for name in location.looked.__slots__)
    }
    off = se2.between(true, location.modes[0].pose)
    return {
        "on_map": on_map, "right": right.tolist(), "left_out": location.left_out, "share": location.modes[0].share,
        "off": math.hypot(off[0], off[1]), "turn": abs(float(off[2])), "looked": looked,
    }  # fmt: skip


def main() -> None:
    """Search and write."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--layouts", default="0:12", help="seeds of layouts, FIRST:LAST, the last not included")
    options.add_argument("--every", type=int, default=4, help="one in so many of the families of each building")
    options.add_argument("-o", "--output", type=Path, help="lines of JSON; else standard output")
    chosen = options.parse_args()
    first, last = map(int, chosen.layouts.split(":"))
    with chosen.output.open("w") if chosen.output else sys.stdout as file:
        for seed in range(first, last):
            for (i, kind), (j, change) in itertools.product(enumerate(KINDS), enumerate(CHANGES)):
                if (i + j + seed) % chosen.every == 0:
                    file.writelines(json.dumps(row) + "\n" for row in rows(kind, change, seed))
                    file.flush()


if __name__ == "__main__":
    main()
