"""Squared distances in whole numbers against all pairs of cells, by every path and at every width of number."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from mclcli.native.backend import COMPILED, NUMPY, Backend, load
from mclcli.world import squared_distance
from mclcli.world.squared_distance import squared_distances

if TYPE_CHECKING:
    from mclcli.arrays import BoolArray

LIMITS = [1, 2, 5, 100, 254**2, 255**2, 32767, 32768, 65535, 65536, 2**31 - 1]
rooms = st.tuples(st.integers(1, 40), st.integers(1, 40)).flatmap(
    lambda shape: arrays(np.bool_, shape, elements=st.integers(0, 60).map(lambda i: i == 0), fill=st.just(value=False))
)


def naive(occupied: BoolArray, limit: int) -> list[list[int]]:
    """The least of all squared distances, cell by cell."""
    seeds = [(int(row), int(column)) for row, column in np.argwhere(occupied)]
    height, width = occupied.shape
    return [
        [min([limit, *((row - r) ** 2 + (column - c) ** 2 for r, c in seeds)]) for column in range(width)]
        for row in range(height)
    ]


@pytest.fixture(params=["numpy", "compiled", "compiled, near"])
def backend(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Backend:
    load("squared_distance")  # Hypothesis watches what runs within a test, and the compiler is a lot of that
    monkeypatch.setattr(squared_distance, "_PASSES_IN_NUMPY", 0 if request.param == "compiled" else 10**9)
    return NUMPY if request.param == "numpy" else COMPILED


@given(occupied=rooms, limit=st.sampled_from(LIMITS))
def test_every_cell_has_the_least_of_all_squared_distances(occupied: BoolArray, limit: int, backend: Backend) -> None:
    found = squared_distances(occupied, limit, backend)
    assert found.dtype == (np.uint16 if limit < 2**16 else np.uint32)
    assert found.tolist() == naive(occupied, limit)


def test_both_paths_agree_on_a_large_map(monkeypatch: pytest.MonkeyPatch) -> None:
    occupied = np.random.default_rng(3).random((301, 517)) < 5e-5
    found = []
    for backend, passes in ((NUMPY, 0), (COMPILED, 0), (COMPILED, 10**9)):
        monkeypatch.setattr(squared_distance, "_PASSES_IN_NUMPY", passes)
        found.append(squared_distances(occupied, 150**2, backend))
    assert (found[0] == found[1]).all()
    assert (found[0] == found[2]).all()
    assert found[0].max() > 100**2
