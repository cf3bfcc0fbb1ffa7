from __future__ import annotations

import math

import numpy as np
import pytest

from samples.sim.raycast import cast, cast_circles
from tests.samples.naive import ray_length


def test_ranges_equal_the_slab_test_over_all_cells() -> None:
    rng = np.random.default_rng(3)
    occupied = rng.random((17, 23)) < 0.1
    origins = rng.uniform([0.0, 0.0], [2.3, 1.7], (400, 2))
    angles = rng.uniform(-np.pi, np.pi, 400)
    expected = [ray_length(occupied, 0.1, x, y, a) for (x, y), a in zip(origins, angles, strict=True)]
    assert np.isinf(expected).any()
    assert np.sum(np.isfinite(expected)) > 200
    np.testing.assert_allclose(cast(occupied, 0.1, origins, angles, 10.0), expected, atol=1e-12)


@pytest.mark.parametrize(("angle", "length"), [(0.0, 0.65), (math.pi, 0.25), (math.pi / 2, 0.35), (-math.pi / 2, 0.15)])
def test_along_the_axes(angle: float, length: float) -> None:
    occupied = np.zeros((8, 12), dtype=np.bool_)
    occupied[0] = occupied[-2] = occupied[:, 0] = occupied[:, -2] = True
    origin = np.array([[0.35, 0.25]])
    assert cast(occupied, 0.1, origin, np.array([angle]), 5.0)[0] == pytest.approx(length, abs=1e-12)


def test_nothing_beyond_the_range_and_zero_inside_a_wall() -> None:
    occupied = np.zeros((5, 30), dtype=np.bool_)
    occupied[:, 20] = True
    origins = np.array([[0.55, 0.25], [0.55, 0.25], [2.05, 0.25]])
    found = cast(occupied, 0.1, origins, np.zeros(3), np.array([1.44, 1.46, 1.0]))
    np.testing.assert_allclose(found, [np.inf, 1.45, 0.0])


def test_a_ray_from_off_the_grid_is_an_error() -> None:
    with pytest.raises(ValueError, match="off the grid"):
        cast(np.zeros((5, 5), dtype=np.bool_), 0.1, np.array([[0.6, 0.2]]), np.zeros(1), 1.0)


def test_circles_are_met_where_the_equation_says() -> None:
    rng = np.random.default_rng(4)
    origins, angles = rng.uniform(-1, 1, (500, 2)), rng.uniform(-np.pi, np.pi, 500)
    centres = rng.uniform(-3, 3, (500, 3, 2))
    found = cast_circles(origins, angles, centres, 0.4)
    hit = np.isfinite(found)
    assert 50 < hit.sum() < 450
    ends = origins[hit] + found[hit, np.newaxis] * np.stack([np.cos(angles[hit]), np.sin(angles[hit])], axis=-1)
    gaps = np.hypot(*(centres[hit] - ends[:, np.newaxis]).transpose(2, 0, 1)) - 0.4
    np.testing.assert_allclose(np.min(np.abs(gaps), axis=1), 0.0, atol=1e-9)
    steps = np.linspace(0.0, 1.0, 200)  # no point before the end lies in any circle
    for k in np.flatnonzero(hit):
        way = origins[k] + steps[:, np.newaxis] * 0.999 * found[k] * [np.cos(angles[k]), np.sin(angles[k])]
        inside = np.hypot(*(way[:, np.newaxis] - centres[k]).transpose(2, 0, 1)) < 0.4
        assert not inside[:, ~inside[0]].any()


def test_no_people_no_hits() -> None:
    assert np.isinf(cast_circles(np.zeros((3, 2)), np.zeros(3), np.empty((3, 0, 2)), 0.2)).all()
