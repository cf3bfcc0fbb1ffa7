"""Squared distances along rows: in narrow integers where the clamp is near, by a lower envelope of parabolas where not.

The first is bounded by loads, two for every cell and step; the second by branches.
"""

from __future__ import annotations

import numba as nb
import numpy as np

from mclcli.kernels import OPTIONS

_BLOCK = 512  # cells of a row whose squares and results stay in the first-level cache


def _signature(columns: nb.types.Type, out: nb.types.Type) -> object:
    return nb.void(columns[:, ::1], nb.int64, out[:, ::1], nb.int64[:, ::1])


_SIGNATURES = [
    _signature(nb.uint16, nb.uint16),
    _signature(nb.uint16, nb.uint32),
    _signature(nb.uint32, nb.uint32),
]


@nb.njit(_SIGNATURES, **OPTIONS)
def lower_envelopes(along_columns, limit, out, scratch):  # type: ignore[no-untyped-def]
    """Fill ``out`` (H, W) with min over u of ``along_columns[row, u]``² + (column − u)², at most ``limit``.

    ``scratch`` (2, W): columns whose parabolas make up the envelope, and the column where each begins to be lowest.
    Source: Meijster, Roerdink and Hesselink 2000, phase 2; Felzenszwalb and Huttenlocher 2012.
    """
    height, width = out.shape
    apex, begin = scratch[0], scratch[1]
    for row in range(height):
        last = -1
        for u in range(width):
            g = nb.int64(along_columns[row, u])
            if g * g >= limit:
                continue
            first = nb.int64(0)
            while last >= 0:
                at = begin[last]
                i = apex[last]
                h = nb.int64(along_columns[row, i])
                if (at - i) * (at - i) + h * h <= (at - u) * (at - u) + g * g:
                    first = 1 + (u * u - i * i + g * g - h * h) // (2 * (u - i))
                    break
                last -= 1
            if first < width:
                last += 1
                apex[last], begin[last] = u, first
        k = 0
        for column in range(width):
            if last < 0:
                out[row, column] = limit
                continue
            while k < last and begin[k + 1] <= column:
                k += 1
            g, away = nb.int64(along_columns[row, apex[k]]), column - apex[k]
            out[row, column] = min(g * g + away * away, limit)


@nb.njit(**OPTIONS)
def _four_steps(line, middle, size, k, best):  # type: ignore[no-untyped-def]
    """Take four more steps to both sides; returns the next one, far away if none can help."""
    l0, r0 = line[middle - k : middle - k + size], line[middle + k : middle + k + size]
    l1, r1 = line[middle - k - 1 : middle - k - 1 + size], line[middle + k + 1 : middle + k + 1 + size]
    l2, r2 = line[middle - k - 2 : middle - k - 2 + size], line[middle + k + 2 : middle + k + 2 + size]
    l3, r3 = line[middle - k - 3 : middle - k - 3 + size], line[middle + k + 3 : middle + k + 3 + size]
    q0, q1 = np.uint16(k * k), np.uint16((k + 1) * (k + 1))
    q2, q3 = np.uint16((k + 2) * (k + 2)), np.uint16((k + 3) * (k + 3))
    most = np.uint16(0)
    for i in range(size):
        one = min(np.uint16(min(l0[i], r0[i]) + q0), np.uint16(min(l1[i], r1[i]) + q1))
        two = min(np.uint16(min(l2[i], r2[i]) + q2), np.uint16(min(l3[i], r3[i]) + q3))
        value = min(best[i], min(one, two))
        best[i] = value
        most = max(most, value)
    return k + 4 if most > q3 else nb.int64(1 << 40)


@nb.njit([nb.void(nb.uint8[:, ::1], nb.int64, nb.uint16[:, ::1], nb.uint16[::1])], **OPTIONS)
def near(along_columns, limit, out, line):  # type: ignore[no-untyped-def]
    """As ``lower_envelopes`` for ``limit`` < 2¹⁵, step by step away from each column until nothing can get less.

    ``line`` (W + 2·reach + 6,): scratch, with reach the least whole number whose square is at least ``limit``.
    """
    height, width = out.shape
    reach = (line.size - width - 6) // 2
    if reach < 0:
        return
    line[:] = limit
    for row in range(height):
        inner = line[reach + 3 : reach + 3 + width]
        for column in range(width):
            g = np.int32(along_columns[row, column])
            inner[column] = min(g * g, np.int32(limit))
        for start in range(0, width, _BLOCK):
            best, size = out[row, start : start + _BLOCK], min(_BLOCK, width - start)
            middle = reach + 3 + start
            least = np.int32(limit)
            for i in range(size + 2 * reach):
                least = min(least, np.int32(line[start + 3 + i]))
            for i in range(size):
                best[i] = line[middle + i]
            k = 1 if least < limit else reach + 1
            while k <= reach:
                k = _four_steps(line, middle, size, k, best)
