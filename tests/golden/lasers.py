"""Golden laser cases as our own records: map, scan, mount, particles, parameters."""

from __future__ import annotations

import functools
import json
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from mclcli.geometry import se3
from mclcli.io.maps.map_yaml import load_map
from mclcli.records import LaserScan
from mclcli.settings import profiles
from mclcli.world import distance_field
from mclcli.world.occupancy import OccupancyGrid
from tests.data import golden

if TYPE_CHECKING:
    from mclcli.arrays import FloatArray
    from mclcli.settings import Profile
    from mclcli.world.distance_field import DistanceField

CASES = (
    "c1_olin_identity",
    "c2_olin_yaw90",
    "c3_olin_upside_down",
    "c4_tb3_identity",
    "c5_tb3_upside_down",
    "c6_tb3_yaw90_clean",
)
SETS = ("p1", "p2")


@functools.cache
def read(name: str) -> dict[str, Any]:
    """One golden JSON file."""
    result: dict[str, Any] = json.loads(golden(name).read_text())
    return result


def numbers(values: list[Any]) -> FloatArray:
    """Numbers with null for NaN and "inf", "-inf"."""
    return np.array([np.nan if value is None else float(value) for value in values])


@dataclass(frozen=True)
class LaserCase:
    """One case: what both implementations were given."""

    grid: OccupancyGrid
    scan: LaserScan
    base_from_laser: FloatArray
    particles: FloatArray


@functools.cache
def grid_of(name: str) -> OccupancyGrid:
    """A golden map, with the single-precision resolution that both computed with."""
    about = read("cases.json")["maps"][name]
    grid = load_map(golden(about["yaml"]))
    return OccupancyGrid(grid.cells, about["resolution_used"], grid.origin)


@functools.cache
def laser_case(name: str) -> LaserCase:
    """A case of cases.json."""
    cases = read("cases.json")
    case = cases["cases"][name]
    about, mount = cases["scans"][case["scan"]], cases["mounts"][case["mount"]]
    scan = LaserScan(
        0,
        "laser",
        about["angle_min"],
        about["angle_increment"],
        about["range_min"],
        about["range_max"],
        numbers(about["ranges"]),
    )
    transform = se3.from_quaternion(mount["xyz"], mount["quaternion_xyzw"])
    return LaserCase(grid_of(case["map"]), scan, transform, np.array(case["particles"], dtype=np.float64))


@functools.cache
def nav2_field(name: str, max_dist: float) -> DistanceField:
    """The field that nav2_amcl itself had made, wrong cells included (README of the golden files)."""
    grid = grid_of(name)
    code = np.load(golden("nav2_fields.npz"))[f"{name}_{max_dist:.0f}"]
    exact = distance_field.compute(grid, "exact", 1e3)
    squares = np.rint((exact.metres() / grid.resolution) ** 2).astype(np.int64)
    reach = int(max_dist / grid.resolution)
    squares = np.where(code == 0, squares, squares + code)
    saturated = (code == 32767) | ((code == 0) & (squares > reach * reach))
    metres = np.float32(np.sqrt(squares) * grid.resolution).astype(np.float64)
    return distance_field.from_metres(grid, np.where(saturated, max_dist, metres), max_dist)


def settings_of(
    file: str, case: str, parameters: str, profile: Profile, model: str, **changes: object
) -> profiles.Settings:
    """Settings of a golden parameter set in a profile."""
    sets = dict(read(file)["parameter_sets"][parameters])
    sets["laser_likelihood_max_dist"] = sets.pop("max_dist")
    known = {name for _, name, _, _ in profiles.table()}
    values = {name: value for name, value in sets.items() if name in known}
    if profile == "beluga":
        values["laser_max_range"] = laser_case(case).scan.range_max
    return profiles.build({**values, **changes}, profile=profile, model=model)


def worst(found: FloatArray, expected: FloatArray) -> float:
    """Largest difference relative to the expected value; infinities must be the same."""
    assert (np.isinf(found) == np.isinf(expected)).all()
    finite = np.isfinite(expected)
    return float(np.max(np.abs(found - expected)[finite] / np.maximum(np.abs(expected[finite]), 1e-300), initial=0.0))
