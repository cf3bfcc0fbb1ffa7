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
from tests.data import golden
from tests.golden.lasers import CASES, SETS, LaserCase, grid_of, laser_case, numbers, read, settings_of, worst

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from mclcli.profiles import Settings
    from mclcli.sensors.beams import Beams
    from mclcli.world.distance_field import DistanceField

TOLERANCE = 1e-9


@functools.cache
def exact_field(case: str, max_dist: float, *, boundary: bool = False, unknown: bool = False) -> DistanceField:
    grid = laser_case(case).grid
    return distance_field.compute(grid, "exact", max_dist, boundary_only=boundary, mark_unknown=unknown)


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


def chosen(case: LaserCase, settings: Settings) -> Beams:
    return beams.select(case.scan, case.base_from_laser, settings.beams)


def log_likelihood(case: LaserCase, settings: Settings, field: DistanceField) -> NDArray[np.float64]:
    model = LikelihoodField(field, settings.likelihood_field)
    return model.measure("lidar", chosen(case, settings)).log_likelihood(case.particles)


@pytest.mark.parametrize("model", ["likelihood_field", "likelihood_field_prob"])
@pytest.mark.parametrize("parameters", SETS)
@pytest.mark.parametrize("name", CASES)
def test_nav2_weighs_like_the_original(name: str, parameters: str, model: str) -> None:
    """On an exact field, on nav2's own field, and with the same beams."""
    case, wanted = laser_case(name), read("nav2_laser.json")["cases"][name][parameters]
    settings = settings_of("nav2_laser.json", name, parameters, "nav2", model)
    max_dist = settings.likelihood_field.laser_likelihood_max_dist
    assert chosen(case, settings).indices.tolist() == wanted[model]["beam_indices_contributing"]
    exact = wanted[f"{model}_exact_edt"]
    expected = numbers(exact["log_factor"]) if "log_factor" in exact else np.log(numbers(exact["factor"]))
    assert worst(log_likelihood(case, settings, exact_field(name, max_dist)), expected) <= TOLERANCE
    own = nav2_field(read("cases.json")["cases"][name]["map"], max_dist)
    assert worst(log_likelihood(case, settings, own), numbers(wanted[model]["log_factor"])) <= TOLERANCE


SKIPPING = ("beamskip", "beamskip_forced_all", "beamskip_strict", "beamskip_error_branch")


@pytest.mark.parametrize("variant", SKIPPING)
@pytest.mark.parametrize("parameters", SETS)
@pytest.mark.parametrize("name", CASES)
def test_nav2_skips_the_same_beams(name: str, parameters: str, variant: str) -> None:
    case = laser_case(name)
    wanted = read("nav2_laser.json")["cases"][name][parameters][f"likelihood_field_prob_{variant}"]
    settings = settings_of("nav2_laser.json", name, parameters, "nav2", "likelihood_field_prob")
    selected = chosen(case, settings)
    field = nav2_field(read("cases.json")["cases"][name]["map"], settings.likelihood_field.laser_likelihood_max_dist)
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
        return
    if not wanted["error_branch"]:
        slots = np.searchsorted(wanted["beam_indices_visited"], selected.indices)
        mask = np.zeros(len(wanted["beam_slot_mask"]), dtype=bool)
        mask[slots[kept]] = True
        assert mask.tolist() == [bool(value) for value in wanted["beam_slot_mask"]]
    model = LikelihoodField(field, settings.likelihood_field)
    found = model.measure("lidar", selected.subset(kept)).log_likelihood(poses)
    assert worst(found, log_factor) <= TOLERANCE


@pytest.mark.parametrize("parameters", SETS)
@pytest.mark.parametrize("name", CASES)
def test_beluga_weighs_like_the_original(name: str, parameters: str) -> None:
    """On an exact field. Where no cell is unknown, marking unknown cells changes nothing."""
    case, wanted = laser_case(name), read("beluga_laser.json")["cases"][name][parameters]
    for model, key, changes in (
        ("likelihood_field", "likelihood_field/exact_edt,unknown=0,boundaries=0", {"obstacles": "occupied"}),
        ("likelihood_field", "likelihood_field/exact_edt,unknown=1,boundaries=1", {"field_unknown": "uniform"}),
        ("likelihood_field_prob", "likelihood_field_prob_exact_edt", {}),
    ):
        settings = settings_of("beluga_laser.json", name, parameters, "beluga", model, **changes)
        p = settings.likelihood_field
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
        assert worst(found[normal], expected[normal]) <= TOLERANCE, key
        assert (found[~normal] < math.log(sys.float_info.min)).all()


@pytest.mark.parametrize("parameters", SETS)
@pytest.mark.parametrize("name", CASES)
def test_beluga_projects_the_same_points(name: str, parameters: str) -> None:
    """Its wrapper holds angles in single precision: hence a tolerance of 12 m times half a unit of the last place."""
    case, wanted = laser_case(name), read("beluga_laser.json")["cases"][name][parameters]
    settings = settings_of("beluga_laser.json", name, parameters, "beluga", "likelihood_field")
    np.testing.assert_allclose(chosen(case, settings).endpoints, wanted["points_base_frame"], rtol=0, atol=5e-6)
