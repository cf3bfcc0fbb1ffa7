"""Pictures of places that compete."""

from __future__ import annotations

import numpy as np
import pytest

from mclcli.render import palette
from mclcli.render.modes import draw_modes
from tests.render.pictures import closeness, color_at, middle_of, near, pixel, room

POSES = np.array([[2.0, 2.0, 0.0], [6.0, 4.0, 1.0]])
SHARES = np.array([0.8, 0.15])


def test_the_best_is_red_where_it_is_and_the_scan_lies_around_it() -> None:
    picture = draw_modes(room(), POSES, SHARES, np.array([[3.0, 3.0], [np.nan, 1.0]]), title="t")
    arrow = middle_of(closeness(picture, palette.CRIMSON), pixel(picture, 2.0, 2.0), 25)
    assert np.abs(arrow - pixel(picture, 2.0, 2.0)).max() < 4.0
    assert near(color_at(picture, 3.0, 3.0), palette.TEAL)


def test_a_more_probable_place_has_a_larger_arrow() -> None:
    def inked(share: float) -> float:
        picture = draw_modes(room(), POSES, np.array([0.8, share]), np.zeros((0, 2)), title="t")
        x, y = pixel(picture, 6.0, 4.0).astype(int)
        part = np.asarray(picture, dtype=float)[y - 20 : y + 20, x - 20 : x + 20]
        return float((part[..., 0] - part[..., 2] > 30.0).sum())

    assert inked(0.2) > inked(0.01) > 0.0


def test_nothing_found_is_a_picture_of_the_map() -> None:
    picture = draw_modes(room(), np.zeros((0, 3)), np.zeros(0), np.zeros((0, 2)), title="t")
    assert near(color_at(picture, 4.3, 3.4), palette.FREE)


def test_shapes_must_fit() -> None:
    with pytest.raises(ValueError, match="shares: expected 2 numbers"):
        draw_modes(room(), POSES, np.zeros(3), np.zeros((0, 2)), title="t")
    with pytest.raises(ValueError, match="poses"):
        draw_modes(room(), np.array([[np.nan, 0.0, 0.0]]), np.zeros(1), np.zeros((0, 2)), title="t")
