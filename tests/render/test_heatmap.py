from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from mclcli.render import palette
from mclcli.render.heatmap import draw_heatmap
from mclcli.world.occupancy import OccupancyGrid
from tests.render.pictures import closeness, color_at, middle_of, near, pixel, room

if TYPE_CHECKING:
    from mclcli.arrays import FloatArray

RAMP = palette.ramp("heat")


def lattice(step: float, yaw: float = 0.0) -> FloatArray:
    x, y = np.meshgrid(np.arange(1.0, 7.0, step), np.arange(1.0, 5.0, step))
    c, s = math.cos(yaw), math.sin(yaw)
    x, y = x.ravel(), y.ravel()
    return np.stack([c * x - s * y, s * x + c * y], axis=-1)


@pytest.mark.parametrize("yaw", [0.0, 0.6])
def test_squares_lie_around_their_places_in_the_color_of_their_likelihood(yaw: float) -> None:
    places = lattice(0.5, yaw)
    logs = np.linspace(-10.0, 0.0, len(places))[::-1]
    picture = draw_heatmap(
        room(origin=(0.0, 0.0, yaw)), places, logs - 300.0, step=0.5, lattice_yaw=yaw, depth=10.0, title="t"
    )
    for place, log in zip(places, logs, strict=True):
        for dx, dy in ((0.0, 0.0), (0.2, 0.2), (-0.2, 0.1)):
            c, s = math.cos(yaw), math.sin(yaw)
            x, y = place + np.array([c * dx - s * dy, s * dx + c * dy])
            assert near(color_at(picture, x, y), RAMP[round(255 * (1.0 + log / 10.0))], 8)


def test_a_square_is_centred_on_its_place_to_half_a_pixel() -> None:
    places = np.array([[2.0, 2.0], [4.1, 3.3]])
    picture = draw_heatmap(room(), places, np.array([-5.0, 0.0]), step=0.1, depth=10.0, title="t")
    color = tuple(int(c) for c in RAMP[-1])
    expected = pixel(picture, 4.1, 3.3)
    found = middle_of(closeness(picture, (color[0], color[1], color[2])), expected, 12)
    assert np.abs(found - expected).max() <= 0.5


def test_places_closer_than_pixels_are_merged_and_the_best_is_not_lost() -> None:
    grid = room(2000, 2000, 0.1)
    x, y = np.meshgrid(np.arange(20.0, 180.0, 40.0), np.arange(20.0, 180.0, 40.0))
    coarse = np.stack([x.ravel(), y.ravel()], axis=-1)
    fine = np.array([100.0, 100.0]) + np.stack(np.meshgrid(np.arange(-3, 3, 0.01), np.arange(-1, 1, 0.01)), -1).reshape(
        -1, 2
    )
    places = np.concatenate([coarse, fine])
    logs = np.full(len(places), -50.0)
    logs[-777] = 0.0
    picture = draw_heatmap(grid, places, logs, step=0.01, depth=20.0, title="t")
    x0, y0 = pixel(picture, *places[-777]).astype(int)
    worst = np.asarray(picture, dtype=int)[y0 - 1 : y0 + 2, x0 - 1 : x0 + 2].sum(axis=2).min()
    assert worst < RAMP[0].astype(int).sum() - 60
    # and the patch has no holes
    x1, y1 = pixel(picture, 100.0, 100.0).astype(int)
    patch = np.asarray(picture)[y1 - 3 : y1 + 4, x1 - 10 : x1 + 11]
    assert (np.abs(patch.astype(int) - np.array(palette.FREE)).max(axis=2) > 20).all()


def test_walls_stay_above() -> None:
    picture = draw_heatmap(room(), np.array([[0.0, 3.0], [4.0, 3.0]]), np.zeros(2), step=1.0, title="t")
    assert color_at(picture, 0.05, 3.03) == palette.WALL
    assert near(color_at(picture, 0.3, 3.03), RAMP[-1])


def test_the_best_pose_is_an_arrow_above_the_others() -> None:
    best = np.array([[4.0, 3.0, 0.5], [2.0, 2.0, 0.0]])
    picture = draw_heatmap(room(), lattice(0.5), np.zeros(len(lattice(0.5))), step=0.5, best_poses=best, title="t")
    assert near(color_at(picture, 4.0, 3.0), palette.TEAL)
    assert not near(color_at(picture, 2.0, 2.0), palette.TEAL)


def test_impossible_places_have_the_lowest_color() -> None:
    places = np.array([[2.0, 2.0], [4.0, 2.0], [6.0, 2.0]])
    picture = draw_heatmap(room(), places, np.array([-np.inf, -5.0, 0.0]), step=1.0, title="t")
    assert near(color_at(picture, 2.0, 2.0), RAMP[0])
    assert near(color_at(picture, 6.0, 2.0), RAMP[-1])


@pytest.mark.parametrize("logs", [np.zeros(0), np.full(1, -np.inf)])
def test_without_any_possible_place_there_is_still_a_map(logs: Any) -> None:
    picture = draw_heatmap(room(), np.full((len(logs), 2), 3.0), logs, step=0.1, title="t")
    assert color_at(picture, 4.03, 3.03) == palette.FREE


@pytest.mark.parametrize(
    ("logs", "step", "message"),
    [(np.zeros(3), 0.1, "log_weight"), (np.array([np.nan]), 0.1, "log_weight"), (np.zeros(1), 0.0, "step")],
)
def test_what_does_not_fit_is_refused_by_name(logs: Any, step: float, message: str) -> None:
    with pytest.raises(ValueError, match=f"{message}: expected"):
        draw_heatmap(room(), np.zeros((1, 2)), logs, step=step, title="t")


def test_off_the_map_is_no_error() -> None:
    grid = OccupancyGrid(np.zeros((10, 10), dtype=np.int8), 0.1, np.zeros(3))
    picture = draw_heatmap(grid, np.array([[1e6, 1e6]]), np.zeros(1), step=0.1, title="t")
    assert max(picture.size) < 1400
