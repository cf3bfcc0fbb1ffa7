"""The worked example's numbers, through the library, on both code paths."""

from __future__ import annotations

from typing import TYPE_CHECKING, get_args

import numpy as np
import pytest

from mclcli.filter import weights
from mclcli.world import FieldMethod
from tests.sensors.example import SET1, SET1_TOTAL, SET1_WEIGHTS, SET2, SET2_WEIGHTS, SET3, Example, example_map
from tests.support import grid_of, use_compiled

if TYPE_CHECKING:
    from mclcli.world.occupancy import OccupancyGrid

pytestmark = pytest.mark.usefixtures("_path")


@pytest.fixture(params=["numpy", "compiled"])
def _path(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    use_compiled(monkeypatch, always=request.param == "compiled")


@pytest.mark.parametrize("method", get_args(FieldMethod))
def test_first_set_vision_and_normalisation(method: FieldMethod) -> None:
    measurements = [SET1.lidar_measurement(method), SET1.vision_measurement()]
    total = weights.temper([1.0] * len(measurements), weights.score(measurements, SET1.poses))
    np.testing.assert_allclose(total, SET1_TOTAL, rtol=0, atol=1e-9)
    np.testing.assert_allclose(weights.normalise(total), SET1_WEIGHTS, rtol=0, atol=1e-9)


@pytest.mark.parametrize("method", get_args(FieldMethod))
@pytest.mark.parametrize("example", [SET2, SET3], ids=["second", "third"])
def test_lidar(method: FieldMethod, example: Example) -> None:
    got = example.lidar_measurement(method).log_likelihood(example.poses)
    np.testing.assert_allclose(got, example.lidar[method], rtol=0, atol=1e-9)


def test_second_set_vision_with_an_id_that_no_map_knows() -> None:
    got = SET2.vision_measurement().log_likelihood(SET2.poses)
    np.testing.assert_allclose(got, SET2.vision, rtol=0, atol=1e-9)


def test_second_set_fused() -> None:
    measurements = [SET2.lidar_measurement("brushfire"), SET2.vision_measurement()]
    fused = weights.normalise(weights.temper([1.0] * len(measurements), weights.score(measurements, SET2.poses)))
    np.testing.assert_allclose(fused, SET2_WEIGHTS, rtol=1e-9, atol=0)


WRONG = {
    "empty": grid_of(np.zeros((120, 120)), 0.05, (-3.0, -3.0, 0.0)),
    "flipped": grid_of(example_map().occupied[::-1], 0.05, (-3.0, -3.0, 0.0)),
    "transposed": grid_of(example_map().occupied.T, 0.05, (-3.0, -3.0, 0.0)),
}


@pytest.mark.parametrize("method", get_args(FieldMethod))
@pytest.mark.parametrize("example", [SET2, SET3], ids=["second", "third"])
@pytest.mark.parametrize("grid", WRONG.values(), ids=WRONG.keys())
def test_a_wrong_map_misses_by_far(method: FieldMethod, example: Example, grid: OccupancyGrid) -> None:
    got = example.lidar_measurement(method, grid).log_likelihood(example.poses)
    assert np.abs(got - example.lidar[method]).max() > 0.1
