"""Best distances in windows over a distance field: what bounds of the search are looked up in.

Level h holds the least distance in windows wide enough for a block of 2^h × 2^h places, at every 2^(h−3)th cell from
level 4 on; a distance takes one byte. All levels together take about 3.4 bytes a cell, whatever their number.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, final

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from mclcli.world.distance_field import DistanceField

OFF_MAP = 255  # the bin of what is off the map
_LAST_BIN = 254
TOP_LEVEL = 7
_FULL_LEVELS = 3  # up to here a window at every cell, and no group of angles


def angles_in(level: int) -> int:
    """Angles in a group at a level."""
    return 1 << max(level - _FULL_LEVELS, 0)


def stride_of(level: int) -> int:
    """Cells between the windows of a level."""
    return 1 << max(level - _FULL_LEVELS, 0)


def window_of(level: int) -> int:
    """Side of a level's windows in cells.

    A block's places, the cells by which an endpoint can move within a group of angles (steps are at most one cell
    long), and those by which a window can begin before it has to.
    """
    moved = angles_in(level) if level > _FULL_LEVELS else 0
    return (1 << level) + moved + stride_of(level) - 1


@final
@dataclass(frozen=True, slots=True, eq=False)
class Pyramid:
    """Windows of all levels: ``pool`` uint8, one level after the other, and where each lies in it.

    ``shapes`` (L + 1, 5) int64: start, height, width, shift and margin of every level; row 0 is unused. Entry (r, c) of
    a level is the least bin in the window from cell ``(r − margin) << shift``, ``(c − margin) << shift``.
    """

    pool: NDArray[np.uint8]
    shapes: NDArray[np.int64]


def bins_of(field: DistanceField) -> NDArray[np.uint8]:
    """Bin (L,) of every level of a field: its distance in 254 steps, rounded down; unknown cells share the last."""
    share = np.nan_to_num(field.levels / field.max_dist, nan=1.0)
    return np.floor(np.clip(share, 0.0, 1.0) * _LAST_BIN).astype(np.uint8)


def bound_table(field: DistanceField, log_p: NDArray[np.float64]) -> NDArray[np.float64]:
    """Greatest value (256,) of a cell in this bin or in a later one; ``log_p`` (L + 1,) ends with off the map."""
    table = np.full(OFF_MAP + 1, -np.inf)
    np.maximum.at(table, bins_of(field), log_p[:-1])
    table[OFF_MAP] = log_p[-1]
    return np.maximum.accumulate(table[::-1])[::-1].copy()


def top_level(height: int, width: int) -> int:
    """Highest level that is of use on a map of this size."""
    return max(1, min(TOP_LEVEL, (max(height, width) - 1).bit_length()))


def layout(height: int, width: int) -> NDArray[np.int64]:
    """``Pyramid.shapes`` for a field of this size."""
    shapes, start = [[0, 0, 0, 0, 0]], 0
    for level in range(1, top_level(height, width) + 1):
        stride = stride_of(level)
        margin = -(-(window_of(level) - 1) // stride)
        rows, columns = (margin + -(-side // stride) for side in (height, width))
        shapes.append([start, rows, columns, stride.bit_length() - 1, margin])
        start += rows * columns
    shape = np.array(shapes, np.int64)
    shape.flags.writeable = False
    return shape


def size_of(shapes: NDArray[np.int64]) -> int:
    """Bytes that the windows of a layout take."""
    return int((shapes[:, 1] * shapes[:, 2]).sum())


def build(field: DistanceField) -> Pyramid:
    """Pyramid of a field; it depends on nothing else."""
    bins = bins_of(field)[field.codes]
    shapes = layout(*bins.shape)
    pool = np.empty(size_of(shapes), np.uint8)
    for level, (start, rows, columns, _, margin) in enumerate(shapes.tolist()):
        if level:
            side, stride = window_of(level), stride_of(level)
            windows = _windows(_windows(bins, side, stride, margin).T, side, stride, margin).T
            pool[start : start + rows * columns] = windows.ravel()
    pool.flags.writeable = False
    return Pyramid(pool, shapes)


def _windows(bins: NDArray[np.uint8], side: int, stride: int, margin: int) -> NDArray[np.uint8]:
    """Least bin over ``side`` rows from every ``stride``th one, beginning ``margin`` strides before the first.

    Windows double in length until two of them, overlapping, make one of ``side``.
    """
    count = margin + -(-bins.shape[0] // stride)
    after = (count - 1) * stride + side - margin * stride - bins.shape[0]
    run = np.pad(bins, ((margin * stride, max(after, 0)), (0, 0)), constant_values=OFF_MAP)
    length = 1
    while 2 * length <= side:
        run = np.minimum(run[:-length], run[length:])
        length *= 2
    rest = side - length
    last = (count - 1) * stride + 1
    return np.minimum(run[:last:stride], run[rest : rest + last : stride])
