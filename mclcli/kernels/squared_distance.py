"""Squared distances along rows, as the lower envelope of one parabola a column: linear in the row's length."""

from __future__ import annotations

import numba as nb

from mclcli.kernels import OPTIONS


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
