"""Expected ranges: rays against the cells of a grid.

All lengths are in cells. A ray is start + r·direction; the kernels write the least r at which it meets a blocked cell, or
``limit``. ``poses`` (N, 4) hold column, row, cosine and sine of the yaw; ``rays`` (B, 4) the start and the direction in
the base frame, which may be shorter than 1; ``out`` is (N, B), NaN where a pose is not finite.
"""

from __future__ import annotations

import math

import numba as nb

_FAR = 255  # the largest side a table of squares can hold
_STRIDE = 0.7  # along the longer axis, hence less than a cell along the ray


def _signature(cells: nb.types.Type, dimensions: int) -> object:
    rows = nb.types.Array(nb.float64, 2, "C", readonly=True)
    return nb.void(nb.types.Array(cells, dimensions, "C", readonly=True), rows, rows, nb.float64, nb.float64[:, ::1])


@nb.njit([nb.void(nb.types.Array(nb.boolean, 2, "C", readonly=True), nb.uint8[:, :, ::1])], cache=True, nogil=True)
def fill_squares(blocked, squares):  # type: ignore[no-untyped-def]
    """Fill ``squares`` (4, H + 2, W + 2) with the side of the largest open square that has each cell in its corner.

    Table q looks right (q & 1) or left, and up (q & 2) or down. Cells of ``blocked`` (H, W) and of the border around
    the map have 0. A square is one larger than the least of three neighbours': dynamic programming over the grid.
    """
    height, width = blocked.shape
    squares[:] = 0
    for q in range(4):
        right, up = 1 if q & 1 else -1, 1 if q & 2 else -1
        for m in range(1, height + 1):
            row = height + 1 - m if up > 0 else m
            for n in range(1, width + 1):
                column = width + 1 - n if right > 0 else n
                if not blocked[row - 1, column - 1]:
                    beside, above = squares[q, row, column + right], squares[q, row + up, column]
                    least = min(beside, above, squares[q, row + up, column + right])
                    squares[q, row, column] = min(least + 1, _FAR)


@nb.njit(inline="always")
def _first_on_map(x, y, inverse_x, inverse_y, width, height):  # type: ignore[no-untyped-def]
    """First r within the rectangle of the map, +inf if the ray misses it, NaN from nowhere (slab method)."""
    first, last = 0.0, math.inf
    if inverse_x != 0.0:
        a, b = (1.0 - x) * inverse_x, (width + 1.0 - x) * inverse_x
        first, last = max(first, min(a, b)), min(last, max(a, b))
    elif not 1.0 <= x < width + 1.0:
        last = -1.0
    if inverse_y != 0.0:
        a, b = (1.0 - y) * inverse_y, (height + 1.0 - y) * inverse_y
        first, last = max(first, min(a, b)), min(last, max(a, b))
    elif not 1.0 <= y < height + 1.0:
        last = -1.0
    if not (math.isfinite(x) and math.isfinite(y)):
        return math.nan
    return first if first < last else math.inf


@nb.njit([_signature(nb.uint8, 3)], cache=True, nogil=True, error_model="numpy")
def exact(squares, poses, rays, limit, out):  # type: ignore[no-untyped-def]
    """From border to border of open squares: cell by cell near obstacles, by leaps where there are none.

    Every r comes from the index of a border, not from a running sum, so leaps do not change it. Source: Amanatides and
    Woo 1987; leaps as in Cohen and Sheffer 1994.
    """
    height, width = squares.shape[1] - 2, squares.shape[2] - 2
    for n in range(poses.shape[0]):
        base_x, base_y, c, s = poses[n, 0] + 1.0, poses[n, 1] + 1.0, poses[n, 2], poses[n, 3]
        for b in range(rays.shape[0]):
            x, y = base_x + (c * rays[b, 0] - s * rays[b, 1]), base_y + (s * rays[b, 0] + c * rays[b, 1])
            dx, dy = c * rays[b, 2] - s * rays[b, 3], s * rays[b, 2] + c * rays[b, 3]
            inverse_x, inverse_y = 1.0 / dx if dx != 0.0 else 0.0, 1.0 / dy if dy != 0.0 else 0.0
            r = 0.0
            if not (1.0 <= x < width + 1.0 and 1.0 <= y < height + 1.0):
                r = _first_on_map(x, y, inverse_x, inverse_y, width, height)
                if not r < limit:
                    out[n, b] = limit if r >= limit else math.nan
                    continue
            right, up = dx > 0.0, dy > 0.0
            table = squares[(1 if right else 0) + (2 if up else 0)]
            column = min(max(nb.int64(math.floor(x + r * dx)), 1), width)
            row = min(max(nb.int64(math.floor(y + r * dy)), 1), height)
            side = nb.int64(table[row, column])
            while side > 0:
                border_x = column + side if right else column + 1 - side
                border_y = row + side if up else row + 1 - side
                r_x = (border_x - x) * inverse_x if dx != 0.0 else math.inf
                r_y = (border_y - y) * inverse_y if dy != 0.0 else math.inf
                r = min(r_x, r_y)
                if r >= limit:
                    break
                beyond_x, beyond_y = border_x if right else border_x - 1, border_y if up else border_y - 1
                if r_x < r_y:  # rounding must not carry it out of the square's other side
                    at = nb.int64(math.floor(y + r * dy))
                    row = min(max(at, row), border_y - 1) if up else max(min(at, row), border_y)
                    column = beyond_x
                elif r_y < r_x:
                    at = nb.int64(math.floor(x + r * dx))
                    column = min(max(at, column), border_x - 1) if right else max(min(at, column), border_x)
                    row = beyond_y
                else:  # through a corner: it stops between two blocked cells
                    inside_x, inside_y = border_x - 1 if right else border_x, border_y - 1 if up else border_y
                    on_map = 1 <= beyond_x <= width and 1 <= beyond_y <= height
                    if on_map and table[inside_y, beyond_x] == 0 and table[beyond_y, inside_x] == 0:
                        break
                    column, row = beyond_x, beyond_y
                side = nb.int64(table[row, column])
            left_map = side == 0 and not (1 <= column <= width and 1 <= row <= height)
            out[n, b] = limit if left_map else min(r, limit)


@nb.njit([_signature(nb.uint8, 3)], cache=True, nogil=True, error_model="numpy")
def approximate(squares, poses, rays, limit, out):  # type: ignore[no-untyped-def]
    """By the sides of open squares, and by strides shorter than a cell where there are none; cut corners are missed."""
    height, width = squares.shape[1] - 2, squares.shape[2] - 2
    for n in range(poses.shape[0]):
        base_x, base_y, c, s = poses[n, 0] + 1.0, poses[n, 1] + 1.0, poses[n, 2], poses[n, 3]
        for b in range(rays.shape[0]):
            x, y = base_x + (c * rays[b, 0] - s * rays[b, 1]), base_y + (s * rays[b, 0] + c * rays[b, 1])
            dx, dy = c * rays[b, 2] - s * rays[b, 3], s * rays[b, 2] + c * rays[b, 3]
            scale = 1.0 / max(abs(dx), abs(dy), 1e-300)
            r = 0.0
            if not (1.0 <= x < width + 1.0 and 1.0 <= y < height + 1.0):
                inverse_x, inverse_y = 1.0 / dx if dx != 0.0 else 0.0, 1.0 / dy if dy != 0.0 else 0.0
                r = _first_on_map(x, y, inverse_x, inverse_y, width, height)
                if not r < limit:
                    out[n, b] = limit if r >= limit else math.nan
                    continue
            table = squares[(1 if dx > 0.0 else 0) + (2 if dy > 0.0 else 0)]
            column = min(max(nb.int64(x + r * dx), 1), width)
            row = min(max(nb.int64(y + r * dy), 1), height)
            side = nb.int64(table[row, column])
            while side > 0 and r < limit:
                r += scale * max(side - 1.0, _STRIDE)
                was_column, was_row = column, row
                column, row = nb.int64(x + r * dx), nb.int64(y + r * dy)
                if side == 1 and column != was_column and row != was_row:
                    if table[was_row, column] == 0 and table[row, was_column] == 0:
                        break
                side = nb.int64(table[row, column])
            out[n, b] = min(r, limit)
