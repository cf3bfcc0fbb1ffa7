"""Field models against what nav2_amcl's and Beluga's own code computed, particle by particle."""

from __future__ import annotations

import functools
import math
import sys
from typing import TYPE_CHECKING

import numpy as np
import pytest

from mclcli.sensors import beam_skipping, beams
from mclcli.sensors.beam_skipping import BeamSkipping
from mclcli.sensors.endpoints import Anchoring
from mclcli.sensors.likelihood_field import LikelihoodField
from mclcli.world import distance_field
from tests.golden.lasers import CASES, SETS, LaserCase, laser_case, nav2_field, numbers, read, settings_of, worst

if TYPE_CHECKING:
    from mclcli.arrays import FloatArray
    from mclcli.sensors.beams import Beams
    from mclcli.settings.profiles import Settings
    from mclcli.world.distance_field import DistanceField
    from tests.golden.conftest import Note

TOLERANCE = 1e-9


@functools.cache
def exact_field(case: str, max_dist: float, *, boundary: bool = False, unknown: bool = False) -> DistanceField:
    grid = laser_case(case).grid
    return distance_field.compute(grid, "exact", max_dist, boundary_only=boundary, mark_unknown=unknown)


def chosen(case: LaserCase, settings: Settings) -> Beams:
    return beams.select(case.scan, case.base_from_laser, settings.beams)


def log_likelihood(case: LaserCase, settings: Settings, field: DistanceField) -> FloatArray:
    model = LikelihoodField(field, settings.lidars["likelihood_field"])
    return model.measure("lidar", chosen(case, settings)).log_likelihood(case.particles)


@pytest.mark.parametrize("model", ["likelihood_field", "likelihood_field_prob"])
@pytest.mark.parametrize("parameters", SETS)
@pytest.mark.parametrize("name", CASES)
def test_nav2_weighs_like_the_original(note: Note, name: str, parameters: str, model: str) -> None:
    """On an exact field, on nav2's own field, and with the same beams."""
    case, wanted = laser_case(name), read("nav2_laser.json")["cases"][name][parameters]
    settings = settings_of("nav2_laser.json", name, parameters, "nav2", model)
    max_dist = settings.lidars["likelihood_field"].laser_likelihood_max_dist
    assert chosen(case, settings).indices.tolist() == wanted[model]["beam_indices_contributing"]
    exact = wanted[f"{model}_exact_edt"]
    expected = numbers(exact["log_factor"]) if "log_factor" in exact else np.log(numbers(exact["factor"]))
    found = worst(log_likelihood(case, settings, exact_field(name, max_dist)), expected)
    assert note("nav2_laser.json", f"{model}, exact field", found, expected.size) <= TOLERANCE
    own = nav2_field(read("cases.json")["cases"][name]["map"], max_dist)
    expected = numbers(wanted[model]["log_factor"])
    found = worst(log_likelihood(case, settings, own), expected)
    assert note("nav2_laser.json", f"{model}, nav2's own field", found, expected.size) <= TOLERANCE


SKIPPING = ("beamskip", "beamskip_forced_all", "beamskip_strict", "beamskip_error_branch")


@pytest.mark.parametrize("variant", SKIPPING)
@pytest.mark.parametrize("parameters", SETS)
@pytest.mark.parametrize("name", CASES)
def test_nav2_skips_the_same_beams(note: Note, name: str, parameters: str, variant: str) -> None:
    case = laser_case(name)
    wanted = read("nav2_laser.json")["cases"][name][parameters][f"likelihood_field_prob_{variant}"]
    settings = settings_of("nav2_laser.json", name, parameters, "nav2", "likelihood_field_prob")
    selected = chosen(case, settings)
    field = nav2_field(
        read("cases.json")["cases"][name]["map"], settings.lidars["likelihood_field"].laser_likelihood_max_dist
    )
    rule = BeamSkipping(
        wanted["beam_skip_distance"],
        wanted["beam_skip_threshold"],
        wanted["beam_skip_error_threshold"],
        always=wanted["converged_by"] == "forced",
    )
    poses = case.particles[: wanted["n_particles"]]
    assert rule.always or beam_skipping.has_converged(poses) == bool(wanted["converged"])
    kept = beam_skipping.kept_beams(rule, field, selected, poses, Anchoring(half_cell=True, yaw=False))
    log_factor = numbers(wanted["log_factor"])
    if kept is None:
        assert wanted["error_branch"]
        assert np.isneginf(log_factor).all()
        note("nav2_laser.json", "beam skipping, all weights 0", 0.0, log_factor.size)
        return
    if not wanted["error_branch"]:
        slots = np.searchsorted(wanted["beam_indices_visited"], selected.indices)
        mask = np.zeros(len(wanted["beam_slot_mask"]), dtype=bool)
        mask[slots[kept]] = True
        assert mask.tolist() == [bool(value) for value in wanted["beam_slot_mask"]]
    model = LikelihoodField(field, settings.lidars["likelihood_field"])
    found = worst(model.measure("lidar", selected.subset(kept)).log_likelihood(poses), log_factor)
    assert note("nav2_laser.json", "beam skipping, masks identical", found, log_factor.size) <= TOLERANCE


@pytest.mark.parametrize("parameters", SETS)
@pytest.mark.parametrize("name", CASES)
def test_beluga_weighs_like_the_original(note: Note, name: str, parameters: str) -> None:
    """On an exact field. Where no cell is unknown, marking unknown cells changes nothing."""
    case, wanted = laser_case(name), read("beluga_laser.json")["cases"][name][parameters]
    for what, model, key, changes in (
        (
            "likelihood_field",
            "likelihood_field",
            "likelihood_field/exact_edt,unknown=0,boundaries=0",
            {"obstacles": "occupied"},
        ),
        (
            "likelihood_field, unknown space, boundaries",
            "likelihood_field",
            "likelihood_field/exact_edt,unknown=1,boundaries=1",
            {"field_unknown": "uniform"},
        ),
        ("likelihood_field_prob", "likelihood_field_prob", "likelihood_field_prob_exact_edt", {}),
    ):
        settings = settings_of("beluga_laser.json", name, parameters, "beluga", model, **changes)
        p = settings.lidars["likelihood_field"]
        selected = chosen(case, settings)
        assert selected.indices.tolist() == wanted["beam_indices_contributing"]
        field = exact_field(
            name,
            p.laser_likelihood_max_dist,
            boundary=p.obstacles == "boundary",
            unknown=p.field_unknown == "uniform",
        )
        found = log_likelihood(case, settings, field)
        exact = wanted[key]
        expected = numbers(exact["log_factor"]) if "log_factor" in exact else np.log(numbers(exact["factor"]))
        normal = expected > math.log(sys.float_info.min)  # below, the original's product underflows
        difference = worst(found[normal], expected[normal])
        assert note("beluga_laser.json", f"{what}, exact field", difference, int(normal.sum())) <= TOLERANCE
        assert (found[~normal] < math.log(sys.float_info.min)).all()


@pytest.mark.parametrize("parameters", SETS)
@pytest.mark.parametrize("name", CASES)
def test_beluga_projects_the_same_points(note: Note, name: str, parameters: str) -> None:
    """Its wrapper holds angles in single precision: hence a tolerance of 12 m times half a unit of the last place."""
    case, wanted = laser_case(name), read("beluga_laser.json")["cases"][name][parameters]
    settings = settings_of("beluga_laser.json", name, parameters, "beluga", "likelihood_field")
    points = np.array(wanted["points_base_frame"])
    found = float(np.abs(chosen(case, settings).endpoints - points).max())
    assert note("beluga_laser.json", "endpoints [m]", found, points.size) <= 5e-6
