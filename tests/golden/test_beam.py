"""The beam model in profiles nav2 and beluga against what their own code computed."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import numpy as np
import pytest

from mclcli.sensors import beams
from mclcli.sensors.beam import make_beam_model
from mclcli.world.raycast import make_caster
from tests.golden.lasers import CASES, SETS, grid_of, laser_case, numbers, read, settings_of, worst

if TYPE_CHECKING:
    from mclcli.sensors.beams import Beams
    from tests.golden.conftest import Note

TOLERANCE = 1e-9
# Beluga forms ranges from endpoints, where a reading of exactly range_max may come out a rounding below it: of those
# scored in the golden cases, this beam of c4 did, as cosine and sine of its single-precision angle say.
ROUNDED_BELOW = 222


@pytest.mark.parametrize("name", CASES)
def test_expected_ranges_are_nav2s_to_the_bit(note: Note, name: str) -> None:
    case, wanted = laser_case(name), read("nav2_laser.json")["cases"][name]["p1"]["map_range"]
    settings = settings_of("nav2_laser.json", name, "p1", "nav2", "beam", max_beams=0)
    every = dataclasses.replace(case.scan, ranges=np.ones(case.scan.ranges.size))  # directions of unread beams as well
    selected = beams.select(every, case.base_from_laser, settings.beams)
    rays, poses = wanted["beam_indices"], case.particles[wanted["particle_indices"]]
    caster = make_caster(grid_of(read("cases.json")["cases"][name]["map"]), method="bresenham_nav2")
    found = caster.ranges(poses, selected.origins[rays], selected.directions[rays], selected.r_max)
    expected = np.array(wanted["range"])
    np.testing.assert_array_equal(found, expected)
    note("nav2_laser.json", "expected ranges of the beam model [m]", 0.0, expected.size)
    assert np.ptp(found) > 1.0


@pytest.mark.parametrize("parameters", SETS)
@pytest.mark.parametrize("name", CASES)
def test_nav2_weighs_like_the_original(note: Note, name: str, parameters: str) -> None:
    case, wanted = laser_case(name), read("nav2_laser.json")["cases"][name][parameters]["beam"]
    settings = settings_of("nav2_laser.json", name, parameters, "nav2", "beam")
    selected = beams.select(case.scan, case.base_from_laser, settings.beams)
    assert selected.indices.tolist() == wanted["beam_indices_contributing"]
    found = (
        make_beam_model(case.grid, settings.lidars["beam"]).measure("lidar", selected).log_likelihood(case.particles)
    )
    expected = numbers(wanted["log_factor"])
    assert note("nav2_laser.json", "beam", worst(found, expected), expected.size) <= TOLERANCE


@pytest.mark.parametrize("parameters", SETS)
@pytest.mark.parametrize("name", CASES)
def test_beluga_weighs_like_the_original(note: Note, name: str, parameters: str) -> None:
    case, wanted = laser_case(name), read("beluga_laser.json")["cases"][name][parameters]
    settings = settings_of("beluga_laser.json", name, parameters, "beluga", "beam")
    selected = with_its_endpoints(
        beams.select(case.scan, case.base_from_laser, settings.beams), wanted["points_base_frame"]
    )
    assert selected.indices.tolist() == wanted["beam_indices_contributing"]
    found = (
        make_beam_model(case.grid, settings.lidars["beam"]).measure("lidar", selected).log_likelihood(case.particles)
    )
    expected = numbers(wanted["beam"]["log_factor"])
    assert note("beluga_laser.json", "beam", worst(found, expected), expected.size) <= TOLERANCE


def with_its_endpoints(selected: Beams, points: list[list[float]]) -> Beams:
    """Beams from the base to Beluga's own endpoints, whose angles are of single precision."""
    ends = np.array(points)
    np.testing.assert_allclose(selected.endpoints, ends, rtol=0, atol=5e-6)
    ranges = np.hypot(ends[:, 0], ends[:, 1])
    directions = ends / ranges[:, np.newaxis]
    full = np.abs(ranges - selected.r_max) < 1e-9  # the golden points have 15 digits, too few to say
    below = np.nextafter(selected.r_max, 0.0)
    ranges[full] = np.where(selected.indices[full] == ROUNDED_BELOW, below, selected.r_max)
    return dataclasses.replace(selected, directions=directions, ranges=ranges)
