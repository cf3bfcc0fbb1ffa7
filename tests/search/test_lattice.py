"""The lattice: which angles, where beams end, which cells may hold the base."""

from __future__ import annotations

import math

import numpy as np
import pytest

from mclcli.errors import InputError
from mclcli.search import lattice

GENERATOR = np.random.default_rng(8)


@pytest.mark.parametrize("shape", [(1, 1), (1, 7), (5, 1), (33, 70), (64, 32)])
def test_places_are_counted_in_blocks(shape: tuple[int, int]) -> None:
    allowed = GENERATOR.random(shape) < 0.4
    places = lattice.count_places(allowed)
    assert places.shape == shape
    assert places.number == allowed.sum()
    for level in range(len(places.sizes)):
        size = 2**level
        counts = places.of_level(level)
        assert counts.shape == (math.ceil(shape[0] / size), math.ceil(shape[1] / size))
        for row, column in np.ndindex(counts.shape):
            block = allowed[row * size : (row + 1) * size, column * size : (column + 1) * size]
            assert counts[row, column] == block.sum()


@pytest.mark.parametrize("reach", [0.0, 3.0, 28.6, 28.7, 200.0, 1234.5])
def test_one_step_moves_no_endpoint_by_more_than_a_cell(reach: float) -> None:
    step = lattice.angle_step(reach)
    assert step * reach <= 1.0 + 1e-12
    assert step <= math.radians(2.0) + 1e-12
    assert (math.tau / step) % 1.0 == pytest.approx(0.0, abs=1e-6) or (math.tau / step) % 1.0 > 1.0 - 1e-6
    fewer = math.tau / (round(math.tau / step) - 1)
    assert fewer * reach > 1.0 or fewer > math.radians(2.0)  # one step less would be too few


def test_keys_name_angle_row_and_column() -> None:
    places = lattice.count_places(np.ones((4, 7), bool))
    made = lattice.build(GENERATOR.uniform(-9, 9, (5, 2)), places)
    assert made.size == made.angles.size * 28
    keys = np.arange(0, made.size, 3)
    expected = [(a, r, c) for a in range(made.angles.size) for r in range(4) for c in range(7)][::3]
    assert made.nodes(keys).tolist() == [list(node) for node in expected]
    poses = [(c + 0.5, r + 0.5, made.angles[a]) for a, r, c in expected]
    np.testing.assert_array_equal(made.poses(keys), poses)


@pytest.mark.parametrize("about", [(0.0, math.pi), (1.0, 0.5), (-3.0, 0.4), (3.1, 0.2)])
def test_angles_lie_around_what_is_known(about: tuple[float, float]) -> None:
    places = lattice.count_places(np.ones((2, 2), bool))
    ends = GENERATOR.uniform(-40, 40, (6, 2))
    made = lattice.build(ends, places, about)
    step = lattice.angle_step(float(np.hypot(*ends.T).max()))
    turned = [i * step for i in range(round(math.tau / step))]
    inside = [a for a in turned if abs(math.remainder(a - about[0], math.tau)) <= about[1]]
    np.testing.assert_allclose(made.angles, inside, atol=1e-12)
    assert made.step == step


def test_beams_end_where_they_do_from_the_centre_of_a_cell() -> None:
    ends = GENERATOR.uniform(-20, 20, (7, 2))
    made = lattice.build(ends, lattice.count_places(np.ones((2, 2), bool)))
    for a in range(0, made.angles.size, 5):
        c, s = math.cos(made.angles[a]), math.sin(made.angles[a])
        for (x, y), got in zip(ends.tolist(), made.ends[a].tolist(), strict=True):
            assert got == [math.floor(0.5 + s * x + c * y), math.floor(0.5 + c * x - s * y)]
    size = math.ceil(made.angles.size / made.groups.shape[0])
    for g in range(made.groups.shape[0]):
        np.testing.assert_array_equal(made.groups[g], made.ends[g * size : (g + 1) * size].min(axis=0))


def test_too_many_endpoints_are_refused_before_they_are_made() -> None:
    places = lattice.count_places(np.ones((2, 2), bool))
    with pytest.raises(InputError, match="100 beams that end up to 2e"):
        lattice.build(np.full((100, 2), 2e6 / math.sqrt(2.0)), places)
