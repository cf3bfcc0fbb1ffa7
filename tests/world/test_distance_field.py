"""Distance fields against brute force and Dijkstra, cell by cell."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, get_args

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from mclcli.errors import UsageError
from mclcli.world import FieldMethod, distance_field
from mclcli.world.occupancy import OccupancyGrid
from tests.reference.sensors import brushfire_distances, exact_distances
from tests.support import BACKENDS, each_backend, grid_of
from tests.worlds import drawn

if TYPE_CHECKING:
    from mclcli.arrays import BoolArray
    from mclcli.native.backend import Backend

REFERENCES = {"exact": exact_distances, "brushfire": brushfire_distances}
shapes = st.tuples(st.integers(1, 9), st.integers(1, 9))
rooms = shapes.flatmap(lambda shape: arrays(np.bool_, shape, elements=st.integers(0, 5).map(lambda i: i == 0)))
resolutions = st.sampled_from([1.0, 0.05, 0.3])


@pytest.mark.parametrize("method", get_args(FieldMethod))
@each_backend
@given(occupied=rooms, resolution=resolutions, reach=st.sampled_from([0.5, 1.0, 3.7, 50.0]))
def test_every_cell_agrees_with_the_reference(
    method: FieldMethod, occupied: BoolArray, resolution: float, reach: float, backend: Backend
) -> None:
    max_dist = reach * resolution
    field = distance_field.compute(grid_of(occupied, resolution), method, max_dist, backend=backend)
    expected = REFERENCES[method](occupied.tolist(), resolution, max_dist)
    np.testing.assert_allclose(field.metres(), expected, rtol=0, atol=1e-9 * resolution)


@pytest.mark.parametrize("method", get_args(FieldMethod))
@given(occupied=rooms, resolution=resolutions)
def test_the_levels_ascend_to_the_clamp_and_every_code_has_one(
    method: FieldMethod, occupied: BoolArray, resolution: float
) -> None:
    field = distance_field.compute(grid_of(occupied, resolution), method, 2.0)
    assert field.codes.shape == occupied.shape
    assert field.codes.max() < field.levels.size
    assert (np.diff(field.levels) > 0).all()
    assert field.levels[-1] == field.max_dist == 2.0
    assert (field.metres()[occupied] == 0.0).all()
    assert not field.codes.flags.writeable
    assert not field.levels.flags.writeable


@given(occupied=rooms)
def test_a_path_is_never_shorter_than_the_straight_line(occupied: BoolArray) -> None:
    exact, paths = (
        distance_field.compute(grid_of(occupied), method, 100.0).metres() for method in get_args(FieldMethod)
    )
    assert (paths >= exact - 1e-6).all()
    assert (paths <= 1.0824 * exact + 1e-6).all()


def test_both_paths_give_the_same_brushfire_to_the_bit() -> None:
    grid = grid_of(np.random.default_rng(5).random((60, 83)) < 0.01, 0.05)
    by_numpy, compiled = (distance_field.compute(grid, "brushfire", 1.0, backend=backend) for backend in BACKENDS)
    np.testing.assert_array_equal(by_numpy.codes, compiled.codes)
    np.testing.assert_allclose(by_numpy.levels, compiled.levels, rtol=0, atol=1e-12)


def test_only_occupied_cells_count() -> None:
    field = distance_field.compute(drawn("?.#.?\n?????", 0.5), "exact", 10.0)
    np.testing.assert_allclose(field.metres()[1], [1.0, 0.5, 0.0, 0.5, 1.0])
    np.testing.assert_allclose(field.metres()[0, 2], 0.5)


def test_a_knights_move_is_where_the_methods_differ() -> None:
    grid = drawn("#...\n....\n....")
    assert distance_field.compute(grid, "exact", 9.0).metres()[1, 2] == pytest.approx(math.sqrt(5.0))
    assert distance_field.compute(grid, "brushfire", 9.0).metres()[1, 2] == pytest.approx(1.0 + math.sqrt(2.0))


@pytest.mark.parametrize("method", get_args(FieldMethod))
def test_a_map_without_an_obstacle_is_at_the_clamp_everywhere(method: FieldMethod) -> None:
    field = distance_field.compute(drawn("...\n.?."), method, 2.0)
    assert field.metres().tolist() == [[2.0] * 3] * 2


@pytest.mark.parametrize("method", get_args(FieldMethod))
def test_a_field_turns_with_its_map(method: FieldMethod) -> None:
    occupied = np.random.default_rng(2).random((7, 11)) < 0.1
    upright = distance_field.compute(grid_of(occupied), method, 4.0).metres()
    for turned in (np.rot90, np.flipud, np.transpose):
        got = distance_field.compute(grid_of(turned(occupied)), method, 4.0).metres()
        np.testing.assert_allclose(got, turned(upright), atol=1e-12)


def test_a_reach_of_more_than_sixteen_bits_of_levels_is_still_exact() -> None:
    occupied = np.zeros((2, 400), dtype=bool)
    occupied[0, 0] = True
    field = distance_field.compute(grid_of(occupied, 0.01), "exact", 3.5)
    expected = np.minimum(0.01 * np.hypot(*np.mgrid[:2, :400]), 3.5)
    np.testing.assert_allclose(field.metres(), expected, rtol=0, atol=1e-12)


def test_more_levels_than_sixteen_bits_hold() -> None:
    metres = np.arange(70_000, dtype=np.float64).reshape(7, 10_000) * 1e-3
    field = distance_field.from_metres(grid_of(np.zeros((7, 10_000))), metres, 69.5)
    assert field.codes.dtype == np.uint32
    np.testing.assert_allclose(field.metres(), np.minimum(metres, 69.5), rtol=0, atol=1e-9)


@pytest.mark.parametrize("max_dist", [0.0, -1.0, math.inf, math.nan])
def test_the_clamp_must_be_a_length(max_dist: float) -> None:
    with pytest.raises(UsageError, match="laser_likelihood_max_dist"):
        distance_field.compute(drawn("#."), "exact", max_dist)


@given(occupied=rooms, seed=st.integers(0, 99))
def test_only_obstacles_beside_free_cells_count_if_boundaries_alone_do(occupied: BoolArray, seed: int) -> None:
    cells = np.where(occupied, 100, 0).astype(np.int8)
    cells[np.random.default_rng(seed).random(cells.shape) < 0.3] = -1
    grid = OccupancyGrid(cells, 0.1, np.zeros(3))
    height, width = cells.shape
    beside = [
        [
            any(
                0 <= r + i < height and 0 <= c + j < width and grid.free[r + i, c + j]
                for i, j in ((-1, 0), (1, 0), (0, -1), (0, 1))
            )
            for c in range(width)
        ]
        for r in range(height)
    ]
    found = distance_field.compute(grid, "exact", 0.5, boundary_only=True)
    expected = distance_field.compute(grid_of(grid.occupied & np.array(beside), 0.1), "exact", 0.5)
    np.testing.assert_array_equal(found.metres(), expected.metres())
