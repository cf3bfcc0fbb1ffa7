from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from mclcli.render import palette
from mclcli.render.field import draw_field
from mclcli.render.scan import draw_scan
from mclcli.world.occupancy import OccupancyGrid
from tests.render.pictures import closeness, color_at, middle_of, near, pixel, room

if TYPE_CHECKING:
    from mclcli.arrays import FloatArray

DEPTH = palette.ramp("depth")


def beside_a_wall(size: int = 120, resolution: float = 0.05, yaw: float = 0.0) -> tuple[OccupancyGrid, FloatArray]:
    """A map with a wall in column 0 and its distance field, 2 m at most."""
    cells = np.zeros((size, size), dtype=np.int8)
    cells[:, 0] = 100
    distance = np.broadcast_to(np.minimum(np.arange(size) * resolution, 2.0), (size, size))
    return OccupancyGrid(cells, resolution, np.array([1.0, 2.0, yaw])), distance


@pytest.mark.parametrize(("size", "resolution"), [(120, 0.05), (2400, 0.0025), (12, 0.5)])
@pytest.mark.parametrize("yaw", [0.0, 0.8])
def test_colors_follow_the_distance(size: int, resolution: float, yaw: float) -> None:
    grid, distance = beside_a_wall(size, resolution, yaw)
    picture = draw_field(grid, distance, max_dist=2.0, title="t")
    for metres in (0.75, 1.25, 1.75, 4.0):
        x, y = grid.to_map([metres / resolution + 0.5, 0.47 * size])
        assert near(color_at(picture, float(x), float(y)), DEPTH[round(255 * min(metres / 2.0, 1.0))], 6)


@pytest.mark.parametrize("metres", [0.5, 1.0, 1.5])
def test_lines_run_at_round_distances_to_half_a_pixel(metres: float) -> None:
    grid, distance = beside_a_wall()
    picture = draw_field(grid, distance, max_dist=2.0, title="t")
    expected = pixel(picture, *grid.to_map([metres / 0.05 + 0.5, 51.0]))
    pale = np.asarray(picture, dtype=np.float64)[..., 0]  # red jumps at a white line
    x, y = np.floor(expected).astype(int)
    row = pale[y, x - 6 : x + 7] - np.linspace(pale[y, x - 6], pale[y, x + 6], 13)
    assert row.max() > 30.0
    middle = (np.clip(row, 0.0, None) * (np.arange(x - 6, x + 7) + 0.5)).sum() / np.clip(row, 0.0, None).sum()
    assert abs(middle - expected[0]) <= 0.5


def test_the_clamp_is_a_plain_and_no_line() -> None:
    grid, distance = beside_a_wall()
    picture = draw_field(grid, distance, max_dist=2.0, title="t")
    x, y = np.floor(pixel(picture, *grid.to_map([2.0 / 0.05 + 0.5, 51.0]))).astype(int)
    row = np.asarray(picture, dtype=int)[y, x - 5 : x + 300]
    assert (np.abs(row - DEPTH[-1].astype(int)).max(axis=1) < 12).all()


def test_walls_are_on_top_and_unknown_is_washed_out() -> None:
    cells = np.zeros((40, 60), dtype=np.int8)
    cells[:, 0], cells[:, 20] = 100, -1  # something known on either side, so that the unknown is shown
    grid = OccupancyGrid(cells, 0.1, np.zeros(3))
    picture = draw_field(grid, np.full(cells.shape, 1.2), max_dist=2.0, title="t")
    assert color_at(picture, 0.05, 2.03) == palette.WALL
    sea, washed = color_at(picture, 1.53, 2.03), color_at(picture, 2.05, 2.03)
    assert near(sea, DEPTH[round(255 * 0.6)])
    assert near(washed, np.rint(0.28 * np.array(sea) + 0.72 * np.array(palette.UNKNOWN)).astype(np.uint8))


def test_a_map_without_walls_is_one_plain() -> None:
    grid = OccupancyGrid(np.zeros((30, 30), dtype=np.int8), 0.1, np.zeros(3))
    picture = draw_field(grid, np.full((30, 30), 2.0), max_dist=2.0, title="t")
    assert near(color_at(picture, 1.03, 1.03), DEPTH[-1], 2)
    assert near(color_at(picture, 2.53, 0.53), DEPTH[-1], 2)


@pytest.mark.parametrize(
    ("distance", "max_dist", "message"),
    [
        (np.zeros((3, 3)), 2.0, "distance_m"),
        (np.full((60, 80), np.nan), 2.0, "distance_m"),
        (np.zeros((60, 80)), 0.0, "max_dist"),
        (np.zeros((60, 80)), np.inf, "max_dist"),
    ],
)
def test_a_field_that_does_not_fit_is_refused(distance: Any, max_dist: float, message: str) -> None:
    with pytest.raises(ValueError, match=f"{message}: expected"):
        draw_field(room(), distance, max_dist=max_dist, title="t")


SENSOR = np.array([4.0, 3.0, 0.7])
ENDS = np.array([[6.0, 4.0], [2.03, 4.51], [5.0, 1.0], [np.inf, np.nan], [3.0, 1.5]])


def test_endpoints_lie_where_the_beams_end() -> None:
    picture = draw_scan(room(), SENSOR, ENDS, title="t")
    amount = closeness(picture, palette.TEAL)
    for end in ENDS[[0, 1, 2, 4]]:
        expected = pixel(picture, *end)
        assert np.abs(middle_of(amount, expected, 6) - expected).max() <= 0.5


def test_endpoints_have_the_color_of_their_value() -> None:
    values = np.array([-4.0, 0.0, -1.0, np.nan, np.nan])
    picture = draw_scan(room(), SENSOR, ENDS, values, title="t")
    ramp = palette.ramp("time")
    assert near(color_at(picture, *ENDS[0]), ramp[0])
    assert near(color_at(picture, *ENDS[1]), ramp[-1])
    assert near(color_at(picture, *ENDS[2]), ramp[191])
    assert near(color_at(picture, *ENDS[4]), palette.QUIET)


def test_rays_are_faint_and_start_at_the_sensor() -> None:
    picture = draw_scan(room(), SENSOR, ENDS, title="t")
    x, y = np.floor(pixel(picture, 5.2, 3.6)).astype(int)
    row = np.asarray(picture, dtype=int)[y - 3 : y + 4, x].sum(axis=1)
    assert 20 < sum(palette.FREE) - row.min() < 200
    assert near(color_at(picture, 4.0, 3.0), palette.INK)


@pytest.mark.parametrize("values", [None, np.zeros(0)])
def test_a_scan_without_returns_is_a_map_with_a_sensor(values: Any) -> None:
    picture = draw_scan(room(), SENSOR, np.zeros((0, 2)), values, title="t")
    assert near(color_at(picture, 4.0, 3.0), palette.INK)


def test_the_view_closes_in_on_the_scan() -> None:
    ends = np.array([50.0, 50.0]) + np.array([[5.0, 0.0], [0.0, 5.0], [-5.0, -5.0]])
    picture = draw_scan(room(1000, 1000, 0.1), np.array([50.0, 50.0, 0.0]), ends, title="t")
    assert 1120 / picture.info["pixel_from_map"][0] < 40.0


def test_a_scan_that_does_not_fit_is_refused() -> None:
    with pytest.raises(ValueError, match="values: expected 5 numbers"):
        draw_scan(room(), SENSOR, ENDS, np.zeros(2), title="t")
    with pytest.raises(ValueError, match="pose: expected"):
        draw_scan(room(), np.array([0.0, np.nan, 0.0]), ENDS, title="t")
