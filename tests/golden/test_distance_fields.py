"""Distance fields of real maps: exact distances, and what nav2_amcl and Beluga make of them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from mclcli.world import distance_field
from tests.golden.lasers import grid_of, nav2_field, read

if TYPE_CHECKING:
    from tests.golden.conftest import Note

FILE = "distance_field.json"
each = pytest.mark.parametrize("name", ["olin", "tb3"])


def cells_of(name: str) -> tuple[dict[str, Any], tuple[list[int], list[int]]]:
    """The recorded cells of a map, and where they are."""
    cells = read(FILE)["fields"][name]["cells"]
    assert len(cells["col"]) == 500
    return cells, (cells["row"], cells["col"])


@each
def test_exact_distances_are_the_recorded_ones(note: Note, name: str) -> None:
    cells, at = cells_of(name)
    grid = grid_of(name)
    found = distance_field.compute(grid, "exact", 1e3).metres()[at]
    np.testing.assert_array_equal(np.rint((found / grid.resolution) ** 2), cells["edt_cells_squared"])
    worst = float(np.abs(found - cells["edt_m"]).max())
    assert note(FILE, "exact distances [m]", worst, found.size) <= 1e-9
    assert grid.cells[at].tolist() == cells["cell_value"]


@each
@pytest.mark.parametrize("max_dist", [1, 2])
def test_nav2s_own_field_is_the_recorded_one_and_never_below_the_truth(note: Note, name: str, max_dist: int) -> None:
    cells, at = cells_of(name)
    own = nav2_field(name, float(max_dist)).metres()
    np.testing.assert_array_equal(np.float32(own[at]), np.float32(cells[f"nav2_max_dist_{max_dist}"]))
    note("nav2_fields.npz", "nav2's distances, rebuilt [m]", 0.0, len(at[0]))
    exact = distance_field.compute(grid_of(name), "exact", float(max_dist)).metres()
    theirs = read(FILE)["fields"][name]["statistics"][f"{max_dist}.0"]
    assert int((np.abs(own - exact) > 1e-6).sum()) == theirs["n_cells_nav2_differs_from_min_edt_maxdist"]
    assert float((own - exact).max()) == pytest.approx(theirs["max_excess_m"], abs=1e-6)
    assert float((own - exact).min()) > -1e-6


@each
def test_belugas_distances_are_never_below_the_truth(name: str) -> None:
    cells, _ = cells_of(name)
    square = np.array(cells["edt_m"]) ** 2
    for key in (key for key in cells if key.startswith("beluga_squared") and "bound" not in key):
        recorded = np.array(cells[key])
        limit = recorded.max()
        assert (recorded >= np.minimum(square, limit) - 1e-5).all(), key
