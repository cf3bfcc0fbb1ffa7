"""Sum of log-likelihoods of scan endpoints over a coded distance field."""

from __future__ import annotations

import numba as nb
import numpy as np

_BLOCK = 256  # particles whose sums stay in registers and L1 while all beams pass over them


def _signature(code: nb.types.Type) -> object:
    row, beams = nb.float64[::1], nb.types.Array(nb.float64, 1, "C", readonly=True)
    codes = nb.types.Array(code, 2, "C", readonly=True)
    return nb.void(codes, beams, row, row, row, row, row, row, row)


@nb.njit([_signature(nb.uint16), _signature(nb.uint32)], cache=True, nogil=True, error_model="numpy")
def sum_log_p(codes, log_p, x, y, cos, sin, end_x, end_y, out):  # type: ignore[no-untyped-def]
    """Add to ``out`` (N,) the sum over beams of ``log_p[code of the endpoint's cell]``, beams in their order.

    ``codes`` (H, W) unsigned; ``log_p`` (L + 1,), the last entry for endpoints off the map; ``x``, ``y``,
    ``cos``, ``sin`` (N,): particles in cells; ``end_x``, ``end_y`` (B,): endpoints from the base, in cells.
    """
    height, width = codes.shape
    flat = codes.ravel()
    off_map = log_p[log_p.size - 1]
    cells = np.empty(_BLOCK, np.int32)
    for start in range(0, x.size, _BLOCK):
        size = min(_BLOCK, x.size - start)
        for b in range(end_x.size):
            bx, by = end_x[b], end_y[b]
            for i in range(size):  # no table look-up in here, so that the compiler can use vectors
                n = start + i
                column = x[n] + (cos[n] * bx - sin[n] * by)
                row = y[n] + (sin[n] * bx + cos[n] * by)
                inside = (column >= 0.0) & (column < width) & (row >= 0.0) & (row < height)
                cells[i] = np.int32(row) * np.int32(width) + np.int32(column) if inside else np.int32(-1)
            for i in range(size):
                cell = cells[i]
                out[start + i] += log_p[flat[cell]] if cell >= 0 else off_map
