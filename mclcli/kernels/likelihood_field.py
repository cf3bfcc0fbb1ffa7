"""Sum of log-likelihoods of scan endpoints over a coded distance field.

What bounds it: per particle and beam a vector lane of arithmetic for the endpoint's cell, then two loads, its code and
that code's log-likelihood. Arithmetic and look-ups are separate loops, so that the compiler uses vectors for the first;
four beams share one pass over the sums; where a block of particles stays clear of the map's border, nothing is tested.
"""

from __future__ import annotations

import numba as nb
import numpy as np

from mclcli.kernels import OPTIONS
from mclcli.kernels._bounds import _holds
from mclcli.kernels._cells import _clearance, _place, _stay_within

_BLOCK = 256  # particles whose sums stay in the first-level cache while all beams pass over them
_MOST_CELLS = 2**31 - 1  # whose numbers have 32 bits
_TABLE = nb.types.Array(nb.float64, 1, "C", readonly=True)


def _signature(code: nb.types.Type, *between: nb.types.Type) -> object:
    frame, scratch = (nb.float64,) * 7, (nb.float64[:, ::1], nb.int32[:, ::1])
    codes, poses = nb.types.Array(code, 1, "C", readonly=True), nb.types.Array(nb.float64, 2, "C", readonly=True)
    return nb.void(codes, nb.int64, nb.int64, between[0], *frame, poses, _TABLE, between[1], *scratch)


@nb.njit(**OPTIONS)
def _cell(x, y, cos, sin, end_x, end_y, width):  # type: ignore[no-untyped-def]
    """Index of the cell where a beam ends; cos·x − sin·y before the particle's own place is added, as in NumPy."""
    row, column = np.int32(y + (sin * end_x + cos * end_y)), np.int32(x + (cos * end_x - sin * end_y))
    return np.int32(np.int32(row * width) + column)


@nb.njit(**OPTIONS)
def _cells_on_map(block, size, end_x, end_y, width, cells):  # type: ignore[no-untyped-def]
    """Cells of four beams' endpoints, for particles all of whose endpoints are on the map."""
    x, y, cos, sin = block[0, :size], block[1, :size], block[2, :size], block[3, :size]
    first, second, third, fourth = cells[0], cells[1], cells[2], cells[3]
    x0, x1, x2, x3 = end_x[0], end_x[1], end_x[2], end_x[3]
    y0, y1, y2, y3 = end_y[0], end_y[1], end_y[2], end_y[3]
    for i in range(size):
        first[i] = _cell(x[i], y[i], cos[i], sin[i], x0, y0, width)
        second[i] = _cell(x[i], y[i], cos[i], sin[i], x1, y1, width)
        third[i] = _cell(x[i], y[i], cos[i], sin[i], x2, y2, width)
        fourth[i] = _cell(x[i], y[i], cos[i], sin[i], x3, y3, width)


@nb.njit(**OPTIONS)
def _cells(block, size, end_x, end_y, width, height, cells):  # type: ignore[no-untyped-def]
    """Cells of one beam's endpoints, −1 off the map; how many are on it."""
    x, y, cos, sin = block[0, :size], block[1, :size], block[2, :size], block[3, :size]
    right, top, on_map = nb.float64(width), nb.float64(height), np.int32(0)
    for i in range(size):
        column = x[i] + (cos[i] * end_x - sin[i] * end_y)
        row = y[i] + (sin[i] * end_x + cos[i] * end_y)
        inside = (column >= 0.0) & (column < right) & (row >= 0.0) & (row < top)
        cells[i] = _cell(x[i], y[i], cos[i], sin[i], end_x, end_y, width) if inside else np.int32(-1)
        on_map += np.int32(inside)
    return on_map


@nb.njit(**OPTIONS)
def _add(total, value):  # type: ignore[no-untyped-def]
    for i in range(total.size):
        total[i] += value


@nb.njit([_signature(code, _TABLE, nb.float64[::1]) for code in (nb.uint16, nb.uint32)], **OPTIONS)
def sum_log_p(  # type: ignore[no-untyped-def]
    codes, height, width, log_p, origin_x, origin_y, cos, sin, yaw, resolution, shift, poses, ends, out, block, cells
):
    """Add to ``out`` (N,) the sum over beams of ``log_p[code of the endpoint's cell]``, beams in their order.

    ``codes`` (H·W,) unsigned, less than 2³¹; ``log_p`` (L + 1,), the last entry for endpoints off the map; then where
    the cells lie (see ``endpoints.Anchoring.frame``); ``poses`` (N, 3) in map; ``ends`` (2·B,) [cells]: x of all
    endpoints from the base, then y. Scratch: ``block`` (5, 256), ``cells`` (4, 256).
    """
    if log_p.size == 0:
        return
    if not _holds(min(codes.size, _MOST_CELLS), height, width):
        for _ in range(ends.size // 2):
            _add(out[: poses.shape[0]], log_p[log_p.size - 1])
        return
    last, wide = nb.uint32(min(log_p.size, _MOST_CELLS) - 1), np.int32(width)
    end_x, end_y = ends[: ends.size // 2], ends[ends.size // 2 :]
    first, second, third, fourth = cells[0], cells[1], cells[2], cells[3]
    for start in range(0, poses.shape[0], _BLOCK):
        size, total = min(_BLOCK, poses.shape[0] - start), out[start : start + _BLOCK]
        _place(poses[start : start + size], origin_x, origin_y, cos, sin, yaw, resolution, shift, block)
        clearance = _clearance(block[0, :size], block[1, :size], block[2], block[3], width, height)
        b = 0
        while b < end_x.size:
            four_x, four_y = end_x[b : b + 4], end_y[b : b + 4]
            if four_x.size == 4 and _stay_within(four_x, four_y, clearance):
                _cells_on_map(block, size, four_x, four_y, wide, cells)
                for i in range(size):
                    value = total[i] + log_p[min(nb.uint32(codes[nb.uint32(first[i])]), last)]
                    value += log_p[min(nb.uint32(codes[nb.uint32(second[i])]), last)]
                    value += log_p[min(nb.uint32(codes[nb.uint32(third[i])]), last)]
                    total[i] = value + log_p[min(nb.uint32(codes[nb.uint32(fourth[i])]), last)]
                b += 4
            else:
                if _cells(block, size, end_x[b], end_y[b], wide, height, first) == 0:
                    _add(total, log_p[last])
                    b += 1
                    continue
                for i in range(size):
                    code = nb.uint32(codes[nb.uint32(max(first[i], 0))])  # so that there is nothing to guess
                    total[i] += log_p[min(code if first[i] >= 0 else last, last)]
                b += 1


@nb.njit([_signature(code, nb.int64, code[:, ::1]) for code in (nb.uint16, nb.uint32)], **OPTIONS)
def look_up(  # type: ignore[no-untyped-def]
    codes, height, width, off_map, origin_x, origin_y, cos, sin, yaw, resolution, shift, poses, ends, out, block, cells
):
    """Fill ``out`` (B, N) with the code of the cell where each beam ends, ``off_map`` off the map; as ``sum_log_p``."""
    if not _holds(min(codes.size, _MOST_CELLS), height, width):
        out[:, : poses.shape[0]] = off_map
        return
    wide = np.int32(width)
    end_x, end_y = ends[: ends.size // 2], ends[ends.size // 2 :]
    for start in range(0, poses.shape[0], _BLOCK):
        size = min(_BLOCK, poses.shape[0] - start)
        _place(poses[start : start + size], origin_x, origin_y, cos, sin, yaw, resolution, shift, block)
        clearance = _clearance(block[0, :size], block[1, :size], block[2], block[3], width, height)
        b = 0
        while b < end_x.size:
            four_x, four_y = end_x[b : b + 4], end_y[b : b + 4]
            if four_x.size == 4 and _stay_within(four_x, four_y, clearance):
                _cells_on_map(block, size, four_x, four_y, wide, cells)
                for k in range(4):
                    found, row = cells[k], out[b + k, start : start + size]
                    for i in range(size):
                        row[i] = codes[nb.uint32(found[i])]
                b += 4
            else:
                found, row = cells[0], out[b, start : start + size]
                if _cells(block, size, end_x[b], end_y[b], wide, height, found) == 0:
                    row[:] = off_map
                    b += 1
                    continue
                for i in range(size):
                    code = codes[nb.uint32(max(found[i], 0))]
                    row[i] = code if found[i] >= 0 else off_map
                b += 1


@nb.njit(**OPTIONS)
def _greatest(first, second, third, fourth):  # type: ignore[no-untyped-def]
    """Greatest of four rows of codes, found in vectors, so that no look-up need test."""
    most = first[0]
    for i in range(first.size):
        most = max(most, max(max(first[i], second[i]), max(third[i], fourth[i])))
    return most


@nb.njit(**OPTIONS)
def _cut_off(codes, last):  # type: ignore[no-untyped-def]
    for i in range(codes.size):
        codes[i] = min(codes[i], last)


@nb.njit([nb.void(code[:, ::1], _TABLE, nb.float64[::1]) for code in (nb.uint16, nb.uint32)], **OPTIONS)
def sum_looked_up(found, log_p, out):  # type: ignore[no-untyped-def]
    """Add to ``out`` (N,) the sum over beams of ``log_p[found[beam, particle]]``, beams in their order.

    Codes beyond the last of ``log_p`` stand for it, and may become it.
    """
    count, n = found.shape
    if log_p.size == 0:
        return
    last, block = nb.uint32(min(log_p.size, _MOST_CELLS) - 1), 2 * _BLOCK
    for start in range(0, n, block):
        total = out[start : start + block]
        b = 0
        while b + 4 <= count:
            first, second = found[b, start : start + block], found[b + 1, start : start + block]
            third, fourth = found[b + 2, start : start + block], found[b + 3, start : start + block]
            if _greatest(first, second, third, fourth) > last:
                for k in range(4):
                    _cut_off(found[b + k, start : start + block], last)
            for i in range(total.size):
                value = total[i] + log_p[first[i]]
                value += log_p[second[i]]
                value += log_p[third[i]]
                total[i] = value + log_p[fourth[i]]
            b += 4
        for rest in range(b, count):
            one = found[rest, start : start + block]
            for i in range(total.size):
                total[i] += log_p[min(nb.uint32(one[i]), last)]


@nb.njit([nb.void(code[:, ::1], nb.int64, nb.int64[::1]) for code in (nb.uint16, nb.uint32)], **OPTIONS)
def count_below(found, limit, counts):  # type: ignore[no-untyped-def]
    """Add to ``counts`` (B,) how many codes of each row of ``found`` (B, N) are below a limit."""
    for b in range(found.shape[0]):
        row, below = found[b], np.int32(0)
        for i in range(row.size):
            below += np.int32(row[i] < limit)
        counts[b] += below
