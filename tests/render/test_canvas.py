from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from mclcli.render import canvas, palette
from mclcli.render.marks import FINE
from mclcli.render.track import draw_track
from mclcli.world.occupancy import OccupancyGrid
from tests.render.pictures import darkness, middle_of, near, pixel, room

if TYPE_CHECKING:
    from mclcli.arrays import FloatArray

NOWHERE = np.zeros((0, 3))


def with_cell(
    shape: tuple[int, int], resolution: float, origin: tuple[float, float, float], cell: tuple[int, int]
) -> OccupancyGrid:
    cells = np.zeros(shape, dtype=np.int8)
    cells[cell] = 100
    return OccupancyGrid(cells, resolution, np.array(origin))


@pytest.mark.parametrize(
    ("shape", "resolution", "origin", "cell"),
    [
        ((10, 10), 0.05, (0.0, 0.0, 0.0), (2, 7)),
        ((10, 10), 0.05, (1.0, -2.0, 0.3), (8, 1)),
        ((333, 257), 0.07, (-11.3, 4.1, 0.0), (17, 200)),
        ((333, 257), 0.07, (-11.3, 4.1, -2.0), (300, 20)),
        ((1900, 2100), 0.05, (0.0, 0.0, 0.0), (1234, 567)),
        ((1900, 2100), 0.05, (3.0, 2.0, 0.785), (456, 1999)),
        ((5001, 5000), 0.05, (500_000.0, 5_400_000.0, 0.0), (3002, 1001)),
        ((5001, 5000), 0.05, (500_000.0, 5_400_000.0, 1.2), (3002, 1001)),
        ((20, 900), 0.1, (0.0, 0.0, 1.5707963), (10, 450)),
    ],
)
def test_an_occupied_cell_lies_where_it_belongs_to_half_a_pixel(
    shape: tuple[int, int], resolution: float, origin: tuple[float, float, float], cell: tuple[int, int]
) -> None:
    grid = with_cell(shape, resolution, origin, cell)
    picture = draw_track(grid, NOWHERE, title="")
    expected = pixel(picture, *grid.to_map([cell[1] + 0.5, cell[0] + 0.5]))
    reach = 3 + int(0.8 * picture.info["pixel_from_map"][0] * resolution)
    found = middle_of(darkness(picture), expected, reach)
    assert np.abs(found - expected).max() <= 0.5


def test_the_scale_is_that_of_the_map() -> None:
    cells = np.full((100, 100), -1, dtype=np.int8)
    cells[20:80, 10:90] = 0  # 8 m × 6 m are known: with 3 % on either side 8.48 m are 1120 px
    view = canvas.choose_view(OccupancyGrid(cells, 0.1, np.array([5.0, 0.0, 0.0])), np.zeros((0, 2)))
    assert view.scale == pytest.approx(1120 / 8.48)
    assert (view.left, view.top) == pytest.approx((5.76, 8.24), abs=0.01)
    assert (view.width, view.height) == (1120, round(6.48 * 1120 / 8.48))
    assert (view.right, view.bottom) == pytest.approx((14.24, 1.76), abs=0.01)


@pytest.mark.parametrize("shape", [(1, 1), (10, 10), (2, 3000), (3000, 2), (2500, 2500)])
def test_every_map_gets_a_handy_size(shape: tuple[int, int]) -> None:
    picture = draw_track(OccupancyGrid(np.zeros(shape, dtype=np.int8), 0.05, np.zeros(3)), NOWHERE, title="a map")
    assert 1120 < max(picture.size) < 1400
    assert min(picture.size) > 420


@pytest.mark.parametrize("yaw", [0.0, 0.4])
def test_walls_one_cell_thin_stay_dark_on_large_maps(yaw: float) -> None:
    cells = np.zeros((5000, 5000), dtype=np.int8)
    cells[1501, 200:4800] = 100
    grid = OccupancyGrid(cells, 0.05, np.array([0.0, 0.0, yaw]))
    picture = draw_track(grid, NOWHERE, title="")
    amount = darkness(picture)
    for column in np.linspace(250, 4750, 60):
        x, y = np.floor(pixel(picture, *grid.to_map([column, 1501.5]))).astype(int)
        assert amount[y - 2 : y + 3, x].max() > 0.5


@pytest.mark.parametrize("yaw", [0.0, 0.7, -2.5])
def test_cells_that_are_large_are_drawn_exactly(yaw: float) -> None:
    rng = np.random.default_rng(3)
    cells = rng.choice(np.array([0, 100, -1, 40], dtype=np.int8), size=(12, 17))
    grid = OccupancyGrid(cells, 0.2, np.array([-3.0, 8.0, yaw]))
    view = canvas.choose_view(grid, np.zeros((0, 2)))
    values = canvas.fine_values(grid, view)
    for row, column in rng.integers(0, values.shape, size=(500, 2)).tolist():
        point = [
            view.left + (column + 0.5) / (view.scale * FINE),
            view.top - (row + 0.5) / (view.scale * FINE),
        ]
        at = grid.to_cells(point)
        if np.abs(at - np.rint(at)).min() < 1e-3:
            continue  # on a border either cell is right
        inside = bool(grid.contains(point))
        expected = cells[int(at[1]), int(at[0])] if inside else -2
        assert values[row, column] == expected


def test_free_unknown_and_occupied_have_their_colors() -> None:
    cells = np.zeros((20, 30), dtype=np.int8)
    cells[:, 10:20], cells[:, 20:] = -1, 100
    picture = draw_track(OccupancyGrid(cells, 0.1, np.zeros(3)), NOWHERE, title="")
    colors = [
        picture.getpixel(tuple(np.floor(pixel(picture, x, 1.234)).astype(int).tolist())) for x in (0.47, 1.53, 2.51)
    ]
    assert colors == [palette.FREE, palette.UNKNOWN, palette.WALL]


def test_a_map_of_unknown_cells_is_shown_whole() -> None:
    view = canvas.choose_view(OccupancyGrid(np.full((50, 80), -1, np.int8), 0.1, np.zeros(3)), np.zeros((0, 2)))
    assert view.left < 0.0
    assert view.right > 8.0
    assert view.top > 5.0
    assert view.bottom < 0.0


def test_the_view_closes_in_on_a_short_drive_and_keeps_its_surroundings() -> None:
    grid = room(1000, 1000, 0.1)
    view = canvas.choose_view(grid, np.array([[50.0, 50.0], [55.0, 52.0]]))
    assert 20.0 < view.right - view.left < 50.0
    assert view.left < 40.0
    assert view.right > 65.0
    whole = canvas.choose_view(grid, np.array([[10.0, 50.0], [80.0, 52.0]]))
    assert whole.left < 0.0
    assert whole.right > 100.0


def test_points_far_off_the_map_do_not_shrink_it_to_a_dot() -> None:
    view = canvas.choose_view(room(), np.array([[1e9, 0.0], [0.0, 0.0]]))
    assert 8.0 < view.right - view.left < 20.0


def test_a_view_beside_the_map_shows_no_cell() -> None:
    grid = room()
    values = canvas.fine_values(grid, canvas.View(left=100.0, top=100.0, scale=10.0, width=30, height=20))
    assert values.shape == (20 * FINE, 30 * FINE)
    assert (values == -2).all()


def test_pixels_of_far_origins_keep_their_digits() -> None:
    view = canvas.View(left=5e6, top=6e6, scale=100.0, width=10, height=10)
    assert view.to_pixel(np.array([5e6 + 0.0125, 6e6 - 0.025])) == pytest.approx([1.25, 2.5], abs=1e-6)


@pytest.mark.parametrize("bad", [np.zeros((3, 2)), np.zeros(3), np.array([[0.0, np.nan, 0.0]])])
def test_points_that_are_none_are_refused(bad: FloatArray) -> None:
    with pytest.raises(ValueError, match="poses: expected finite numbers of shape"):
        canvas.points_of(bad, 3, "poses")


def test_cell_colors_grow_darker_with_occupancy() -> None:
    colors = palette.cell_colors().astype(int)
    assert (np.diff(colors[:101].sum(axis=1)) <= 0).all()
    assert near(tuple(colors[100]), palette.WALL, 0)
    assert near(tuple(colors[255]), palette.UNKNOWN, 0)
    assert colors[99].sum() > colors[100].sum() + 60
