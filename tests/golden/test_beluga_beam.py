"""The beam model with profile beluga's switches against what Beluga's own headers computed."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from mclcli.sensors.beam import BeamModel
from mclcli.sensors.beams import Beams
from mclcli.world.raycast import make_caster
from tests.golden.test_nav2_beam import CASES, map_of, parameters_of, table

# Beluga forms ranges from endpoints, where a reading of exactly range_max may come out a rounding below it: of those
# scored in the golden cases, this beam of c4 did, as cosine and sine of its single-precision angle say.
ROUNDED_BELOW = 222


def virtual_beams(points: list[list[float]], numbers: list[int], r_max: float) -> Beams:
    """Beams from the base to where the real ones ended, as Beluga has them; ``numbers`` are theirs in the scan."""
    ends = np.array(points)
    ranges = np.hypot(ends[:, 0], ends[:, 1])
    directions = ends / ranges[:, np.newaxis]
    full = np.abs(ranges - r_max) < 1e-9  # the golden points have 15 digits, too few to say
    ranges[full] = np.where(np.array(numbers)[full] == ROUNDED_BELOW, np.nextafter(r_max, 0.0), r_max)
    return Beams(np.zeros_like(ends), directions, ranges, r_max)


@pytest.mark.parametrize("parameters", ["p1", "p2"])
@pytest.mark.parametrize("name", CASES)
def test_every_particle_weighs_what_it_weighs_in_beluga(name: str, parameters: str) -> None:
    case: dict[str, Any] = table("cases.json")["cases"][name]
    expected = table("beluga_laser.json")["cases"][name]
    points, numbers = expected[parameters]["points_base_frame"], expected[parameters]["beam_indices_contributing"]
    beams = virtual_beams(points, numbers, expected["laser_max_range"])
    model = BeamModel(make_caster(map_of(case["map"]), method="bresenham_beluga"), parameters_of(parameters, "beluga"))
    got = model.measure("lidar", beams).log_likelihood(np.array(case["particles"]))
    np.testing.assert_allclose(got, expected[parameters]["beam"]["log_factor"], rtol=1e-9, atol=0)
