from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mclcli.geometry import se2
from mclcli.world.landmarks import Landmarks
from mclcli.world.occupancy import OccupancyGrid
from tests.worlds import drawn, empty, room

ANGLES = st.floats(-math.pi, math.pi)
METRES = st.floats(-50.0, 50.0)


def test_the_top_line_of_a_drawing_has_the_highest_y() -> None:
    grid = drawn("""
        #.?
        ...
    """)
    assert grid.cells.tolist() == [[0, 0, 0], [100, 0, -1]]
    assert (grid.width, grid.height) == (3, 2)
    assert np.argwhere(grid.occupied).tolist() == [[1, 0]]
    assert np.argwhere(grid.unknown).tolist() == [[1, 2]]
    assert int(grid.free.sum()) == 4


def test_neither_free_nor_occupied_in_between() -> None:
    grid = OccupancyGrid(np.array([[0, 1, 99, 100, -1]], np.int8), 1.0, np.zeros(3))
    assert grid.free.tolist() == [[True, False, False, False, False]]
    assert grid.occupied.tolist() == [[False, False, False, True, False]]


def test_cell_corners_and_centres() -> None:
    grid = drawn("...\n...", resolution=0.5, origin=(-1.0, 2.0, 0.0))
    assert grid.to_cells([-1.0, 2.0]).tolist() == [0.0, 0.0]
    assert grid.to_cells([0.5, 3.0]).tolist() == [3.0, 2.0]
    assert grid.to_map([0.5, 0.5]).tolist() == [-0.75, 2.25]


def test_a_quarter_turn_of_the_origin() -> None:
    grid = drawn("...\n...", origin=(10.0, 20.0, math.pi / 2))
    np.testing.assert_allclose(grid.to_map([[3.0, 0.0], [0.0, 2.0]]), [[10.0, 23.0], [8.0, 20.0]], atol=1e-12)
    assert grid.contains([9.0, 22.9])
    assert not grid.contains([11.0, 22.9])


@given(x=METRES, y=METRES, yaw=ANGLES, column=st.floats(-100, 100), row=st.floats(-100, 100))
def test_to_cells_inverts_to_map(x: float, y: float, yaw: float, column: float, row: float) -> None:
    grid = OccupancyGrid(np.zeros((2, 2), np.int8), 0.05, np.array([x, y, yaw]))
    np.testing.assert_allclose(grid.to_cells(grid.to_map([column, row])), [column, row], atol=1e-10)


@given(x=METRES, y=METRES, yaw=ANGLES, px=METRES, py=METRES)
def test_to_map_is_the_origin_composed_with_the_scaled_cell(
    x: float, y: float, yaw: float, px: float, py: float
) -> None:
    grid = OccupancyGrid(np.zeros((1, 1), np.int8), 0.2, np.array([x, y, yaw]))
    expected = se2.compose([x, y, yaw], [0.2 * px, 0.2 * py, 0.0])[:2]
    np.testing.assert_allclose(grid.to_map([px, py]), expected, atol=1e-12)


def test_far_origins_lose_nothing() -> None:
    """UTM: at 5e6 m a float64 has steps of 1e-9 m; anything coarser was lost by rotating first."""
    near = OccupancyGrid(np.zeros((400, 400), np.int8), 0.05, np.array([0.0, 0.0, 0.7]))
    far = OccupancyGrid(near.cells, 0.05, np.array([500_000.0, 5_400_000.0, 0.7]))
    offsets = np.random.default_rng(3).integers(-(2**24), 2**24, (200, 2)) / 2**20  # exact at both places
    np.testing.assert_array_equal(far.to_cells(offsets + far.origin[:2]), near.to_cells(offsets))


@pytest.mark.parametrize(
    ("point", "inside"),
    [((0.0, 0.0), True), ((2.999, 1.999), True), ((3.0, 1.0), False), ((1.0, 2.0), False), ((-1e-9, 0.5), False),
     ((math.nan, 0.5), False), ((0.5, math.inf), False)],
)  # fmt: skip
def test_contains_at_the_borders(point: tuple[float, float], inside: bool) -> None:  # noqa: FBT001 - a parameter
    assert bool(empty(3, 2).contains(point)) is inside


def test_shapes_broadcast() -> None:
    grid = empty(3, 2)
    points = np.zeros((4, 5, 2))
    assert grid.to_cells(points).shape == (4, 5, 2)
    assert grid.to_map(points).shape == (4, 5, 2)
    assert grid.contains(points).shape == (4, 5)


def test_the_digest_tells_maps_apart() -> None:
    grid = room()
    changed = grid.cells.copy()
    changed[3, 3] = 100
    others = [
        OccupancyGrid(changed, grid.resolution, grid.origin),
        OccupancyGrid(grid.cells[::-1].copy(), grid.resolution, grid.origin),
        OccupancyGrid(grid.cells.reshape(30, 20), grid.resolution, grid.origin),
        OccupancyGrid(grid.cells, grid.resolution * (1 + 1e-15), grid.origin),
        OccupancyGrid(grid.cells, grid.resolution, grid.origin + np.array([0.0, 0.0, 1e-15])),
    ]
    assert len({grid.digest(), *(other.digest() for other in others)}) == 6
    assert OccupancyGrid(grid.cells.copy(order="F"), grid.resolution, grid.origin).digest() == grid.digest()


def test_a_map_does_not_change_with_the_array_it_was_made_of() -> None:
    cells, origin = np.zeros((2, 2), np.int8), np.zeros(3)
    grid = OccupancyGrid(cells, 1.0, origin)
    cells[0, 0], origin[0] = 100, 5.0
    assert grid.cells[0, 0] == 0
    assert grid.origin[0] == 0.0
    with pytest.raises(ValueError, match="read-only"):
        grid.cells[0, 0] = 1
    with pytest.raises(ValueError, match="read-only"):
        grid.origin[0] = 1.0


@pytest.mark.parametrize(
    ("cells", "resolution", "origin", "named"),
    [
        (np.zeros((2, 2), np.uint8), 1.0, np.zeros(3), "cells"),
        (np.zeros((0, 2), np.int8), 1.0, np.zeros(3), "cells"),
        (np.zeros(4, np.int8), 1.0, np.zeros(3), "cells"),
        (np.full((2, 2), 101, np.int8), 1.0, np.zeros(3), "cells"),
        (np.full((2, 2), -2, np.int8), 1.0, np.zeros(3), "cells"),
        (np.zeros((2, 2), np.int8), 0.0, np.zeros(3), "resolution"),
        (np.zeros((2, 2), np.int8), math.nan, np.zeros(3), "resolution"),
        (np.zeros((2, 2), np.int8), 1.0, np.zeros(2), "origin"),
        (np.zeros((2, 2), np.int8), 1.0, np.array([0.0, math.inf, 0.0]), "origin"),
    ],
)
def test_impossible_maps_are_refused(cells: np.ndarray, resolution: float, origin: np.ndarray, named: str) -> None:
    with pytest.raises(ValueError, match=named):
        OccupancyGrid(cells, resolution, origin)


def test_landmarks_are_found_by_id() -> None:
    landmarks = Landmarks(("a", "7", "b"), np.arange(9.0).reshape(3, 3))
    assert landmarks.lookup(["b", "x", "7", "b"]).tolist() == [2, -1, 1, 2]
    assert landmarks.lookup([]).shape == (0,)
    with pytest.raises(ValueError, match="read-only"):
        landmarks.positions[0, 0] = 1.0


@pytest.mark.parametrize(
    ("ids", "positions"),
    [(("a", "a"), np.zeros((2, 3))), (("a",), np.zeros((1, 2))), (("a",), np.array([[0.0, math.nan, 0.0]]))],
)
def test_impossible_landmarks_are_refused(ids: tuple[str, ...], positions: np.ndarray) -> None:
    with pytest.raises(ValueError, match=r"ids|positions"):
        Landmarks(ids, positions)
