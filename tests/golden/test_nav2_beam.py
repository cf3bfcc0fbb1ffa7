"""The beam model with profile nav2's switches against what nav2_amcl's own code computed."""

from __future__ import annotations

import functools
import json
from typing import Any

import numpy as np
import pytest

from mclcli.io.map_yaml import load_map
from mclcli.sensors.beam import BeamModel, BeamParameters
from mclcli.sensors.beams import Beams
from mclcli.world.occupancy import OccupancyGrid
from mclcli.world.raycast import make_caster
from tests.data import golden

CASES = [
    "c1_olin_identity",
    "c2_olin_yaw90",
    "c3_olin_upside_down",
    "c4_tb3_identity",
    "c5_tb3_upside_down",
    "c6_tb3_yaw90_clean",
]


@functools.cache
def table(name: str) -> dict[str, Any]:
    """One golden file."""
    loaded: dict[str, Any] = json.loads(golden(name).read_text(encoding="utf-8"))
    return loaded


@functools.cache
def map_of(name: str) -> OccupancyGrid:
    """Map with the single-precision resolution that the originals used."""
    entry = table("cases.json")["maps"][name]
    cells = load_map(golden(entry["yaml"])).cells
    return OccupancyGrid(cells, entry["resolution_used"], np.array(entry["origin"]))


def beams_of(case: dict[str, Any], chosen: list[int]) -> Beams:
    """Beams of a case as nav2's node prepares them: its own angles, short readings taken for the maximum."""
    scan, mount = table("cases.json")["scans"][case["scan"]], table("cases.json")["mounts"][case["mount"]]
    ranges = np.array([np.nan if r is None else float(r) for r in scan["ranges"]])
    ranges[case["nav2_short_mapped_to_range_max"]] = case["nav2_range_max"]
    angles = case["nav2_angle_min"] + np.array(chosen) * case["nav2_angle_increment"]
    directions = np.column_stack([np.cos(angles), np.sin(angles)])
    origins = np.broadcast_to(np.array(mount["xyz"][:2]), directions.shape)
    return Beams(origins, directions, ranges[chosen], case["nav2_range_max"])


def parameters_of(name: str, form: str) -> BeamParameters:
    """A parameter set of the golden files."""
    wanted = ("z_hit", "z_short", "z_max", "z_rand", "sigma_hit", "lambda_short")
    values = {key: table("nav2_laser.json")["parameter_sets"][name][key] for key in wanted}
    return BeamParameters(**values, beam_form=form, raycast=f"bresenham_{form}")


@pytest.mark.parametrize("name", CASES)
def test_expected_ranges_are_nav2s_to_the_bit(name: str) -> None:
    case, expected = table("cases.json")["cases"][name], table("nav2_laser.json")["cases"][name]["p1"]["map_range"]
    beams = beams_of(case, expected["beam_indices"])
    poses = np.array(case["particles"])[expected["particle_indices"]]
    caster = make_caster(map_of(case["map"]), method="bresenham_nav2")
    got = caster.ranges(poses, beams.origins, beams.directions, beams.r_max)
    np.testing.assert_array_equal(got, np.array(expected["range"]))
    assert np.ptp(got) > 1.0


@pytest.mark.parametrize("parameters", ["p1", "p2"])
@pytest.mark.parametrize("name", CASES)
def test_every_particle_weighs_what_it_weighs_in_nav2(name: str, parameters: str) -> None:
    case, expected = table("cases.json")["cases"][name], table("nav2_laser.json")["cases"][name][parameters]["beam"]
    beams = beams_of(case, expected["beam_indices_visited"])
    model = BeamModel(make_caster(map_of(case["map"]), method="bresenham_nav2"), parameters_of(parameters, "nav2"))
    measurement = model.measure("lidar", beams)
    assert measurement.count == len(expected["beam_indices_contributing"])
    got = measurement.log_likelihood(np.array(case["particles"]))
    np.testing.assert_allclose(got, expected["log_factor"], rtol=1e-9, atol=0)
