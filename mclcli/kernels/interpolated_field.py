"""Sum of likelihoods of scan endpoints over a distance field that is interpolated between the centres of four cells.

What bounds it: eight look-ups a particle and beam, four codes and their distances, and an exponential in vectors.
Several likelihoods are multiplied before a logarithm is taken. ``mclcli.sensors.interpolated_field`` has the same
operations in NumPy.
"""

from __future__ import annotations

import math

import numba as nb
import numpy as np

from mclcli.kernels import OPTIONS
from mclcli.kernels._bounds import _holds
from mclcli.kernels._cells import _clearance, _place
from mclcli.kernels._exponential import _exp2, _log

_BLOCK = 256  # particles whose sums stay in the first-level cache while all beams pass over them
_MOST_CELLS = 2**31 - 1  # whose numbers have 32 bits
_FLAT = nb.types.Array(nb.float64, 1, "C", readonly=True)
_POSES = nb.types.Array(nb.float64, 2, "C", readonly=True)


def _signature(code: nb.types.Type) -> object:
    codes, scratch = nb.types.Array(code, 1, "C", readonly=True), (nb.float64[:, ::1], nb.int32[:, ::1])
    size, frame = (nb.int64, nb.int64), (nb.float64,) * 7
    return nb.void(codes, *size, _FLAT, *frame, _POSES, _FLAT, _FLAT, nb.int64, nb.boolean, nb.float64[::1], *scratch)


@nb.njit(**OPTIONS)
def _between_cells(block, size, end_x, end_y, width, cells):  # type: ignore[no-untyped-def]
    """The lower left of the four nearest cells, and how far beyond its centre, where all four are on the map."""
    x, y, cos, sin, u, v = block[0], block[1], block[2], block[3], block[4], block[5]
    for i in range(size):
        column = x[i] + (cos[i] * end_x - sin[i] * end_y) - 0.5
        row = y[i] + (sin[i] * end_x + cos[i] * end_y) - 0.5
        left, below = np.int32(column), np.int32(row)
        u[i], v[i] = column - left, row - below
        cells[0, i] = np.int32(np.int32(below * width) + left)


@nb.njit(**OPTIONS)
def _between_cells_anywhere(block, size, end_x, end_y, width, height, cells):  # type: ignore[no-untyped-def]
    """All four of the nearest cells, those beside the map replaced by those at its border; +inf for ends off it."""
    x, y, cos, sin, u, v, off = block[0], block[1], block[2], block[3], block[4], block[5], block[10]
    right, top, last_column, last_row = nb.float64(width), nb.float64(height), np.int32(width - 1), np.int32(height - 1)
    for i in range(size):
        column = x[i] + (cos[i] * end_x - sin[i] * end_y)
        row = y[i] + (sin[i] * end_x + cos[i] * end_y)
        inside = (column >= 0.0) & (column < right) & (row >= 0.0) & (row < top)
        off[i] = 0.0 if inside else np.inf
        column, row = (column - 0.5 if inside else 0.0), (row - 0.5 if inside else 0.0)
        u[i], v[i] = column - np.floor(column), row - np.floor(row)
        left, below = np.int32(np.floor(column)), np.int32(np.floor(row))
        beside, above = min(np.int32(left + 1), last_column), np.int32(min(np.int32(below + 1), last_row) * width)
        left, below = max(left, np.int32(0)), np.int32(max(below, np.int32(0)) * width)
        cells[0, i], cells[1, i] = np.int32(below + left), np.int32(below + beside)
        cells[2, i], cells[3, i] = np.int32(above + left), np.int32(above + beside)


@nb.njit(**OPTIONS)
def _look_up(codes, levels, block, size, width, cells):  # type: ignore[no-untyped-def]
    """Distances of the four cells whose lower left one is known."""
    first, second, third, fourth, at = block[6], block[7], block[8], block[9], cells[0]
    last = nb.uint32(levels.size - 1)
    for i in range(size):
        cell = nb.uint32(at[i])
        first[i] = levels[min(nb.uint32(codes[cell]), last)]
        second[i] = levels[min(nb.uint32(codes[nb.uint32(cell + 1)]), last)]
        cell = nb.uint32(cell + width)
        third[i] = levels[min(nb.uint32(codes[cell]), last)]
        fourth[i] = levels[min(nb.uint32(codes[nb.uint32(cell + 1)]), last)]


@nb.njit(**OPTIONS)
def _look_up_anywhere(codes, levels, block, size, cells):  # type: ignore[no-untyped-def]
    """Distances of the four cells all of which are known."""
    last = nb.uint32(levels.size - 1)
    for k in range(4):
        to, at = block[6 + k], cells[k]
        for i in range(size):
            to[i] = levels[min(nb.uint32(codes[nb.uint32(at[i])]), last)]


@nb.njit(**OPTIONS)
def _interpolate(block, size):  # type: ignore[no-untyped-def]
    """Distances between those of four cells, in the place of the first ones."""
    u, v, first, second, third, fourth = block[4], block[5], block[6], block[7], block[8], block[9]
    for i in range(size):
        lower = first[i] + u[i] * (second[i] - first[i])
        upper = third[i] + u[i] * (fourth[i] - third[i])
        first[i] = lower + v[i] * (upper - lower)


@nb.njit(**OPTIONS)
def _distances(codes, levels, block, size, end_x, end_y, width, height, clear, cells):  # type: ignore[no-untyped-def]
    """Fill row 6 of ``block`` with the distances at a beam's endpoints; look-ups apart, so that the rest is vectors."""
    if clear:
        _between_cells(block, size, end_x, end_y, width, cells)
        _look_up(codes, levels, block, size, width, cells)
        _interpolate(block, size)
        return
    _between_cells_anywhere(block, size, end_x, end_y, width, height, cells)
    _look_up_anywhere(codes, levels, block, size, cells)
    _interpolate(block, size)
    found, off = block[6], block[10]
    for i in range(size):
        found[i] = off[i] if off[i] == np.inf else found[i]  # whatever the cell that stands in for it


@nb.njit(**OPTIONS)
def _multiply(found, size, law, result):  # type: ignore[no-untyped-def]
    """Multiply ``result`` by p of each distance, none of them unknown or off the map."""
    factor, amplitude, rest, furthest, floor = law[0], law[1], law[2], law[5], law[6]
    for i in range(size):
        d = min(found[i], furthest)
        result[i] *= max(amplitude * _exp2(factor * (d * d)) + rest, floor)


@nb.njit(**OPTIONS)
def _combine(found, size, law, cubes, result):  # type: ignore[no-untyped-def]
    """Multiply ``result`` by p of each distance, or add p³."""
    factor, amplitude, rest, off_map, unknown = law[0], law[1], law[2], law[3], law[4]
    furthest, floor = law[5], law[6]
    for i in range(size):
        d = min(found[i], furthest)
        square = unknown if math.isnan(d) else d * d
        p = amplitude * _exp2(factor * square) + rest
        p = off_map if found[i] == np.inf else p
        result[i] = result[i] + p * p * p if cubes else result[i] * max(p, floor)


@nb.njit([_signature(code) for code in (nb.uint16, nb.uint32)], **OPTIONS)
def sum_interpolated(  # type: ignore[no-untyped-def]
    codes, height, width, levels, origin_x, origin_y, cos, sin, yaw, resolution, shift, poses, ends, law, factors,
    cubes, out, block, cells,
):  # fmt: skip
    """Add to ``out`` (N,) the sum over beams of log max(p, floor), or of p³ with ``cubes``.

    p = amplitude·2^(factor·d²) + rest with d the distance at the endpoint, at most the furthest [m]. ``codes`` (H·W,)
    unsigned, less than 2³¹ of them; ``levels`` (L,) [m], NaN for unknown cells; then where the cells lie (see
    ``endpoints.Anchoring.frame``); ``poses`` (N, 3) in map; ``ends`` (2·B,) [cells]: x of all endpoints from the base,
    then y. ``law`` (7,): factor ≤ 0 [1/m²], amplitude, rest, p off the map, d² [m²] that stands for unknown, furthest
    distance, floor. ``factors`` likelihoods are multiplied before a logarithm is taken. Scratch: ``block`` (12, 256),
    ``cells`` (4, 256).
    """
    if levels.size == 0 or not _holds(min(codes.size, _MOST_CELLS), height, width):
        return  # there is no map
    wide, high = np.int32(width), np.int32(height)
    end_x, end_y = ends[: ends.size // 2], ends[ends.size // 2 :]
    marked = False
    for k in range(levels.size):
        marked |= math.isnan(levels[k])
    for start in range(0, poses.shape[0], _BLOCK):
        size, total, result = min(_BLOCK, poses.shape[0] - start), out[start : start + _BLOCK], block[11]
        _place(poses[start : start + size], origin_x, origin_y, cos, sin, yaw, resolution, shift, block)
        clearance = _clearance(block[0, :size], block[1, :size], block[2], block[3], width, height)
        for first in range(0, end_x.size, max(factors, 1)):
            result[:] = 0.0 if cubes else 1.0
            for b in range(first, min(first + max(factors, 1), end_x.size)):
                clear = math.hypot(end_x[b], end_y[b]) + 1.0 < clearance
                _distances(codes, levels, block, size, end_x[b], end_y[b], wide, high, clear, cells)
                if clear and not (marked or cubes):
                    _multiply(block[6], size, law, result)
                else:
                    _combine(block[6], size, law, cubes, result)
            for i in range(size):
                total[i] += result[i] if cubes else _log(result[i])
