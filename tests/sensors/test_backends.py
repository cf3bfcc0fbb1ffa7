"""Every model, switch and odd input by NumPy and by compiled code: the same bits."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from mclcli.native.backend import COMPILED
from mclcli.parameters import described
from mclcli.sensors.beam_forms import BeamParameters
from mclcli.sensors.beams import Beams
from mclcli.sensors.bearing import BearingModel, BearingParameters, Bearings
from mclcli.sensors.likelihood_field import LikelihoodField, LikelihoodFieldParameters
from mclcli.sensors.models import lidar_entry
from mclcli.world import distance_field
from mclcli.world.occupancy import FREE, OCCUPIED, UNKNOWN, OccupancyGrid
from tests.kernels.guarded import guarded_arrays
from tests.support import BACKENDS

if TYPE_CHECKING:
    from mclcli.arrays import FloatArray
    from mclcli.sensors.instruments import LidarModel
    from mclcli.sensors.likelihood_field import FieldLookup, FieldUnknown

GENERATOR = np.random.default_rng(12)
CELL = 0.25
CELLS = GENERATOR.choice([FREE, OCCUPIED, UNKNOWN], (24, 31), p=[0.85, 0.1, 0.05]).astype(np.int8)
CELLS[0, 0] = UNKNOWN  # what stands in for a cell off the map


def switches(parameters: type[Any]) -> list[tuple[str, Any]]:
    """Every choice of every parameter that has some, but for the defaults; and both values of flags."""
    found: list[tuple[str, Any]] = [("", None)]
    for name, default, description in described(parameters):
        values = description.choices or ((False, True) if isinstance(default, bool) else ())
        found += [(name, value) for value in values if value != default]
    return found


def grid(yaw: float = 0.3) -> OccupancyGrid:
    return OccupancyGrid(CELLS, CELL, np.array([-3.0, -2.0, yaw]))


def borders(yaw: float) -> FloatArray:
    """Poses on corners, centres and borders of cells, up to two cells beyond every border of the map, heading along."""
    height, width = CELLS.shape
    columns = np.concatenate([np.arange(-2.0, 2.5, 0.5), [15.25], width + np.arange(-2.0, 2.5, 0.5)])
    rows = np.concatenate([np.arange(-2.0, 2.5, 0.5), [11.75], height + np.arange(-2.0, 2.5, 0.5)])
    cells = np.array(np.meshgrid(columns, rows)).reshape(2, -1)
    c, s = math.cos(yaw), math.sin(yaw)
    x, y = -3.0 + CELL * (c * cells[0] - s * cells[1]), -2.0 + CELL * (s * cells[0] + c * cells[1])
    return np.column_stack([x, y, np.full(x.size, yaw)])


FAR = [[1e200, 0.0, 0.0], [-1e9, 3.0, 1e6], [math.nan, 0.0, 0.0], [0.0, 0.0, math.nan], [math.inf, -math.inf, 1.0]]
POSES = np.concatenate(
    [
        GENERATOR.uniform([-4, -3, -7], [6, 6, 7], (600, 3)),
        GENERATOR.uniform([0.5, 1.0, -7], [1.5, 2.0, 7], (300, 3)),  # clear of the border
        borders(0.3),
        borders(0.0),
        np.array(FAR),
    ]
)


def beams(count: int = 37, r_max: float = 8.0) -> Beams:
    """Beams in all directions; some are short, or end where they begin, or exactly a cell further."""
    angles = GENERATOR.uniform(-math.pi, math.pi, count)
    ranges = np.concatenate([GENERATOR.uniform(0.0, 6.0, count - 4), [0.0, CELL, 0.5 * CELL, r_max]])
    directions = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    directions[-4:] = [1.0, 0.0]
    return Beams(np.zeros((count, 2)), directions, ranges, r_max, np.arange(count), count)


def assert_same_bits(models: list[LidarModel], seen: Beams, poses: FloatArray = POSES) -> None:
    with np.errstate(invalid="ignore", over="ignore"):  # poses that are none
        one, other = (model.measure("lidar", seen).log_likelihood(poses) for model in models)
    assert one.tobytes() == other.tobytes()
    assert len(np.unique(one)) > 50


def fields(parameters: LikelihoodFieldParameters, yaw: float = 0.3) -> list[LidarModel]:
    entry = lidar_entry("likelihood_field")
    return [entry.make(grid(yaw), parameters, distance_field.compute, backend, 1) for backend in BACKENDS]


@pytest.mark.parametrize("lookup", ["nearest", "bilinear"])
@pytest.mark.parametrize("switch", switches(LikelihoodFieldParameters), ids=lambda s: f"{s[0]}={s[1]}")
@pytest.mark.parametrize("yaw", [0.0, 0.3])
def test_likelihood_fields(switch: tuple[str, Any], lookup: FieldLookup, yaw: float) -> None:
    name, value = switch
    changes = {"field_lookup": lookup} | ({name: value} if name else {})
    assert_same_bits(fields(LikelihoodFieldParameters(**changes), yaw), beams())


@pytest.mark.parametrize("lookup", ["nearest", "bilinear"])
@pytest.mark.parametrize("unknown", ["free", "uniform"])
@pytest.mark.parametrize("count", [4, 5, 16, 17, 64])
def test_any_number_of_beams(count: int, unknown: FieldUnknown, lookup: FieldLookup) -> None:
    parameters = LikelihoodFieldParameters(
        field_lookup=lookup, field_unknown=unknown, off_map="uniform", combination="one_plus_cubes"
    )
    assert_same_bits(fields(parameters), beams(count))


@pytest.mark.parametrize("size", [1, 2, 7, 255, 256, 257])
@pytest.mark.parametrize("lookup", ["nearest", "bilinear"])
def test_any_number_of_poses(size: int, lookup: FieldLookup) -> None:
    one, other = fields(LikelihoodFieldParameters(field_lookup=lookup))
    seen = beams()
    a, b = (model.measure("lidar", seen).log_likelihood(POSES[600 - size // 2 :][:size]) for model in (one, other))
    assert a.tobytes() == b.tobytes()


def test_a_converged_set_that_skips_beams() -> None:
    poses = np.array([0.5, 1.0, 0.2]) + GENERATOR.normal(0.0, 0.05, (500, 3))
    for lookup in ("nearest", "bilinear"):
        changes: dict[str, Any] = {"do_beamskip": True, "beam_skip_distance": 0.3, "field_lookup": lookup}
        assert_same_bits(fields(LikelihoodFieldParameters(**changes)), beams(), poses)


@pytest.mark.parametrize("shape", [(1, 1), (1, 9), (9, 1), (2, 2)])
@pytest.mark.parametrize("lookup", ["nearest", "bilinear"])
def test_maps_of_a_cell_or_a_row(shape: tuple[int, int], lookup: FieldLookup) -> None:
    cells = np.full(shape, OCCUPIED, np.int8)
    cells[0, -1] = FREE if cells.size > 1 else OCCUPIED
    small = distance_field.compute(OccupancyGrid(cells, CELL, np.zeros(3)), "exact", 2.0)
    poses = np.column_stack([GENERATOR.uniform(-0.6, 3.0, (400, 2)), GENERATOR.choice([0.0, 0.7], 400)])
    parameters = LikelihoodFieldParameters(field_lookup=lookup)
    seen = dataclasses.replace(beams(), ranges=np.resize([0.0, CELL, 0.1], 37))
    scores = [LikelihoodField(small, parameters, b).measure("lidar", seen).log_likelihood(poses) for b in BACKENDS]
    assert scores[0].tobytes() == scores[1].tobytes()


@pytest.mark.parametrize("switch", switches(BeamParameters), ids=lambda s: f"{s[0]}={s[1]}")
def test_the_beam_mixture_has_one_way_only(switch: tuple[str, Any]) -> None:
    name, value = switch
    parameters, entry = BeamParameters(**({name: value} if name else {})), lidar_entry("beam")
    assert entry.compiled
    models = [entry.make(grid(), parameters, distance_field.compute, backend, 1) for backend in BACKENDS]
    poses = POSES[np.isfinite(POSES).all(axis=1) & (np.abs(POSES) < 1e3).all(axis=1)]
    assert_same_bits(models, beams(), poses)


@pytest.mark.parametrize("sigma", [1e-170, 1e-100, 1e-9, 0.01, 0.5])
@pytest.mark.parametrize("eps", [0.0, 1e-300, 0.1, 1.0])
@pytest.mark.parametrize("count", [1, 16, 35])
def test_bearings(sigma: float, eps: float, count: int) -> None:
    angles = np.concatenate([GENERATOR.uniform(-math.pi, math.pi, count - 1), [0.0]])
    places = np.concatenate([GENERATOR.uniform(-5, 5, (count - 1, 2)), [[-3.0, -2.0]]])  # on it stands a pose
    seen = Bearings(np.array([0.1, -0.2]) if count > 1 else np.zeros(2), angles, places, 2)
    with np.errstate(over="ignore"):  # what such a deviation makes of the floor
        one, other = (
            BearingModel(BearingParameters(sigma, eps), backend).measure("vision", seen).log_likelihood(POSES)
            for backend in BACKENDS
        )
    assert (np.isnan(one) == np.isnan(other)).all()
    there = ~np.isnan(one)
    assert there.sum() == len(POSES) - 3
    assert one[there].tobytes() == other[there].tobytes()


@pytest.mark.parametrize("model", ["likelihood_field", "beam"])
@pytest.mark.parametrize("lookup", ["nearest", "bilinear"])
def test_kernels_have_all_the_room_that_they_use(
    model: str, lookup: FieldLookup, monkeypatch: pytest.MonkeyPatch
) -> None:
    entry = lidar_entry(model)
    parameters = LikelihoodFieldParameters(field_lookup=lookup) if model == "likelihood_field" else BeamParameters()
    made = entry.make(grid(), parameters, distance_field.compute, COMPILED, 1)
    seen, poses = beams(), POSES[:1100]
    sighted = Bearings(np.zeros(2), np.linspace(-1.0, 1.0, 19), GENERATOR.uniform(-5, 5, (19, 2)), 2)
    measured = made.measure("lidar", seen), BearingModel(BearingParameters(), COMPILED).measure("vision", sighted)
    expected = [one.log_likelihood(poses) for one in measured]
    with guarded_arrays(monkeypatch) as given:
        found = [one.log_likelihood(poses) for one in measured]
    assert [one.tobytes() for one in found] == [one.tobytes() for one in expected]
    assert len(given) > 3
    assert all(one.is_intact() for one in given)


@pytest.mark.parametrize("model", ["likelihood_field", "beam"])
@pytest.mark.parametrize("count", [1, 512, 513])
def test_as_many_beams_as_a_scan_may_have(model: str, count: int) -> None:
    """Many beams are not taken several poses at a time; a score is the sum of its beams' all the same."""
    entry = lidar_entry(model)
    parameters = LikelihoodFieldParameters() if model == "likelihood_field" else BeamParameters()
    angles = np.linspace(-3.0, 3.0, count)
    directions = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    seen = Beams(np.zeros((count, 2)), directions, GENERATOR.uniform(0.1, 6.0, count), 8.0, np.arange(count), count)
    for backend in BACKENDS:
        measured = entry.make(grid(), parameters, distance_field.compute, backend, 1).measure("lidar", seen)
        assert measured.each is not None
        for pose in POSES[600:603]:
            total = measured.log_likelihood(pose[np.newaxis])[0]
            assert total == pytest.approx(measured.each(pose[np.newaxis]).sum(), rel=1e-9)
