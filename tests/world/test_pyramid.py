"""Windows of the pyramid against the least bin of all cells in each, and the bounds that they are looked up in."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from mclcli.world import distance_field, pyramid
from tests.support import grid_of

if TYPE_CHECKING:
    from mclcli.arrays import BoolArray

WINDOWS = {3: (8, 1), 5: (32 + 4 + 3, 4)}  # level: side of a window and cells between two
rooms = st.tuples(st.integers(1, 30), st.integers(1, 30)).flatmap(
    lambda shape: arrays(np.bool_, shape, elements=st.integers(0, 40).map(lambda i: i == 0), fill=st.just(value=False))
)


@given(occupied=rooms)
def test_every_entry_is_the_least_bin_in_its_window(occupied: BoolArray) -> None:
    field = distance_field.compute(grid_of(occupied, 0.1), "exact", 1.0)
    bins, built = pyramid.bins_of(field)[field.codes], pyramid.build(field)
    for level, (side, stride) in WINDOWS.items():
        start, height, width, shift, margin = built.shapes[level].tolist()
        entries = built.pool[start : start + height * width].reshape(height, width)
        assert 1 << shift == stride
        for row in range(height):
            for column in range(width):
                y, x = (row - margin) * stride, (column - margin) * stride
                window = bins[max(y, 0) : max(y + side, 0), max(x, 0) : max(x + side, 0)]
                assert entries[row, column] == (window.min() if window.size else pyramid.OFF_MAP)


@given(height=st.integers(1, 300), width=st.integers(1, 300))
def test_levels_lie_one_after_the_other_and_hold_every_window_that_meets_the_map(height: int, width: int) -> None:
    shapes, end = pyramid.layout(height, width), 0
    for level, (side, stride) in WINDOWS.items():
        start, rows, columns, _, margin = shapes[level].tolist()
        assert start == end
        assert margin * stride >= side - 1 > (margin - 1) * stride
        for count, cells in ((rows, height), (columns, width)):
            assert (count - margin) * stride >= cells > (count - margin - 1) * stride
        end += rows * columns
    assert end == pyramid.size_of(shapes)


@given(occupied=rooms, seed=st.integers(0, 99))
def test_a_bound_is_the_greatest_value_of_its_bin_and_of_those_beyond(occupied: BoolArray, seed: int) -> None:
    field = distance_field.compute(grid_of(occupied, 0.1), "exact", 1.0)
    log_p = np.random.default_rng(seed).normal(size=field.levels.size + 1)
    bins = [*pyramid.bins_of(field).tolist(), pyramid.OFF_MAP]
    expected = [max(v for b, v in zip(bins, log_p.tolist(), strict=True) if b >= i) for i in range(256)]
    assert pyramid.bound_table(field, log_p).tolist() == expected


def test_distances_are_rounded_down_and_unknown_cells_share_the_last_bin() -> None:
    levels = np.array([0.0, 0.5, 1.0, np.nan, 2.0])
    codes = np.arange(5, dtype=np.uint16).reshape(1, 5)
    field = distance_field.DistanceField(codes, levels, 0.1, np.zeros(3))
    assert pyramid.bins_of(field).tolist() == [0, 63, 127, 254, 254]
