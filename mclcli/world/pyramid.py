"""Best distances in windows over a distance field: what bounds of the search are looked up in.

Level h holds the least distance in windows wide enough for a block of 2^h × 2^h places: level 3 at every cell, level 5
at every fourth, and for four angles together. A distance takes one byte; both levels take 1.1 bytes a cell.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, final

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from mclcli.arrays import FloatArray, IntArray
    from mclcli.world.distance_field import DistanceField

OFF_MAP = 255  # the bin of what is off the map
_LAST_BIN = 254
FINE = 3  # with a window at every cell, and with single angles
COARSE = 5
LEVELS = (FINE, COARSE)


def angles_in(level: int) -> int:
    """Angles in a group at a level."""
    return 1 << max(level - FINE, 0)


def stride_of(level: int) -> int:
    """Cells between the windows of a level."""
    return 1 << max(level - FINE, 0)


def window_of(level: int) -> int:
    """Side of a level's windows in cells.

    A block's places, the cells by which an endpoint can move within a group of angles (steps are at most one cell
    long), and those by which a window can begin before it has to.
    """
    moved = angles_in(level) if level > FINE else 0
    return (1 << level) + moved + stride_of(level) - 1


@final
@dataclass(frozen=True, slots=True, eq=False)
class Pyramid:
    """Windows of all levels: ``pool`` uint8, one level after the other, and where each lies in it.

    ``shapes`` (6, 5) int64: start, height, width, shift and margin of every level; rows of other levels are unused.
    Entry (r, c) of a level is the least bin in the window from row ``(r − margin) << shift`` and column ``(c − margin)
    << shift`` on.
    """

    pool: NDArray[np.uint8]
    shapes: IntArray


def bins_of(field: DistanceField) -> NDArray[np.uint8]:
    """Bin (L,) of every level of a field: its distance in 254 steps, rounded down; unknown cells share the last."""
    share = np.nan_to_num(field.levels / field.max_dist, nan=1.0)
    return np.floor(np.clip(share, 0.0, 1.0) * _LAST_BIN).astype(np.uint8)


def bound_table(field: DistanceField, log_p: FloatArray) -> FloatArray:
    """Greatest value (256,) of a cell in this bin or in a later one; ``log_p`` (L + 1,) ends with off the map."""
    table = np.full(OFF_MAP + 1, -np.inf)
    np.maximum.at(table, bins_of(field), log_p[:-1])
    table[OFF_MAP] = log_p[-1]
    return np.maximum.accumulate(table[::-1])[::-1].copy()


def layout(height: int, width: int) -> IntArray:
    """``Pyramid.shapes`` for a field of this size."""
    shapes, start = np.zeros((COARSE + 1, 5), np.int64), 0
    for level in LEVELS:
        stride = stride_of(level)
        margin = -(-(window_of(level) - 1) // stride)
        rows, columns = (margin + -(-side // stride) for side in (height, width))
        shapes[level] = [start, rows, columns, stride.bit_length() - 1, margin]
        start += rows * columns
    shapes.flags.writeable = False
    return shapes


def size_of(shapes: IntArray) -> int:
    """Bytes that the windows of a layout take."""
    return int((shapes[:, 1] * shapes[:, 2]).sum())


def build(field: DistanceField) -> Pyramid:
    """Pyramid of a field; it depends on nothing else."""
    bins = bins_of(field)[field.codes]
    shapes = layout(*bins.shape)
    pool = np.empty(size_of(shapes), np.uint8)
    for level in LEVELS:
        start, rows, columns, _, margin = shapes[level].tolist()
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
